"""Dynamics of a tree of rigid bodies as CasADi expressions, by the recursive Newton-Euler algorithm.

References:
    J. Y. S. Luh, M. W. Walker and R. P. C. Paul (1980), Journal of Dynamic Systems, Measurement, and Control 102,
    69-76; R. Featherstone (2008), Rigid Body Dynamics Algorithms, ch. 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .urdf import Body

#: Gravity in the frame of the ground, m/s²; z points up.
GRAVITY = (0.0, 0.0, -9.80665)


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A point mass on a body.

    Attributes:
        body: Index of the body.
        mass: Mass, kg; a number or a symbol.
        position: Where it sits in the body's frame, m. Shape (3,); numbers or symbols.
    """

    body: int
    mass: Any
    position: Any


def inverse_dynamics(
    tree: Sequence[Body], q: Any, v: Any, a: Any, *, gravity: Sequence[float] = GRAVITY,
    payloads: Sequence[Payload] = (),
) -> Any:  # fmt: skip
    """The joint torques and forces of a motion.

    Args:
        tree: The bodies, each after its parent. n of them.
        q: Joint positions, rad or m; symbols or numbers. Shape (n,).
        v: Joint rates. Shape (n,).
        a: Joint accelerations. Shape (n,).
        gravity: Gravity in the frame of the ground, m/s². Shape (3,).
        payloads: Point masses carried along.

    Returns:
        SX column, N m or N. Shape (n,). Friction, actuators and the inertia of motors are not in it.
    """
    import casadi as ca

    q, v, a = ca.SX(q), ca.SX(v), ca.SX(a)
    ground = (ca.SX.zeros(3), ca.SX.zeros(3), -ca.SX(ca.DM(list(gravity))))
    motions, places = [], []
    for i, body in enumerate(tree):
        spin, gain, push = ground if body.parent < 0 else motions[body.parent]
        rotation, position = placement(body, q[i])
        axis = ca.DM(body.axis)
        carried, grown = rotation.T @ spin, rotation.T @ gain
        moved = rotation.T @ (push + ca.cross(gain, position) + ca.cross(spin, ca.cross(spin, position)))
        if body.kind == "revolute":
            motions.append((carried + axis * v[i], grown + ca.cross(carried, axis * v[i]) + axis * a[i], moved))
        else:
            motions.append((carried, grown, moved + 2 * ca.cross(carried, axis * v[i]) + axis * a[i]))
        places.append((rotation, position))
    forces = [ca.SX.zeros(3) for _ in tree]
    turns = [ca.SX.zeros(3) for _ in tree]
    torques = [ca.SX(0) for _ in tree]
    for i in reversed(range(len(tree))):
        body, (spin, gain, push) = tree[i], motions[i]
        mass, moment, inertia = _inertia(body, i, payloads)
        forces[i] += mass * push + ca.cross(gain, moment) + ca.cross(spin, ca.cross(spin, moment))
        turns[i] += inertia @ gain + ca.cross(spin, inertia @ spin) + ca.cross(moment, push)
        torques[i] = ca.dot(ca.DM(body.axis), turns[i] if body.kind == "revolute" else forces[i])
        if body.parent >= 0:
            rotation, position = places[i]
            force = rotation @ forces[i]
            forces[body.parent] += force
            turns[body.parent] += rotation @ turns[i] + ca.cross(position, force)
    return ca.vertcat(*torques)


def mass_matrix(tree: Sequence[Body], q: Any, *, payloads: Sequence[Payload] = ()) -> Any:
    """M(q) of ``M a + c(q, v) = torque``, symmetric and positive definite. Shape (n, n)."""
    import casadi as ca

    a = ca.SX.sym("a", len(tree))
    still = inverse_dynamics(tree, q, ca.SX.zeros(len(tree)), a, gravity=(0, 0, 0), payloads=payloads)
    return ca.jacobian(still, a)


def placement(body: Body, position: Any) -> tuple[Any, Any]:
    """Rotation, shape (3, 3), and origin, shape (3,), of a body's frame in its parent's at a joint position."""
    import casadi as ca

    fixed, axis = ca.DM(body.rotation), ca.DM(body.axis)
    if body.kind == "prismatic":
        return ca.SX(fixed), ca.DM(body.position) + fixed @ axis * position
    cross = ca.skew(axis)
    turn = ca.DM.eye(3) + ca.sin(position) * cross + (1 - ca.cos(position)) * (cross @ cross)
    return fixed @ turn, ca.SX(ca.DM(body.position))


def pose(tree: Sequence[Body], q: Any, body: int) -> tuple[Any, Any]:
    """Rotation and origin of a body's frame in the frame of the ground."""
    import casadi as ca

    q = ca.SX(q)
    rotation, origin = ca.SX.eye(3), ca.SX.zeros(3)
    while body >= 0:
        turned, moved = placement(tree[body], q[body])
        rotation, origin = turned @ rotation, moved + turned @ origin
        body = tree[body].parent
    return rotation, origin


def _inertia(body: Body, index: int, payloads: Sequence[Payload]) -> tuple[Any, Any, Any]:
    """Mass, first moment and inertia about the origin of the body's frame, payloads included."""
    import casadi as ca

    mass, moment, inertia = ca.SX(body.mass), ca.SX(ca.DM(body.moment)), ca.SX(ca.DM(body.inertia))
    for payload in payloads:
        if payload.body == index:
            place = ca.SX(payload.position)
            mass, moment = mass + payload.mass, moment + payload.mass * place
            inertia = inertia - payload.mass * (ca.skew(place) @ ca.skew(place))
    return mass, moment, inertia
