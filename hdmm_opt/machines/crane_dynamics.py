"""Dynamics of the crane: the chain by recursive Newton-Euler, its actuators' bodies by virtual work, and the EMLAs.

The chain lift, tilt, telescope is read from `crane.urdf`, with the end mass on the telescope and a payload at the tool.
Cylinder and rod of an actuator move with the triangle that it closes: their places are functions of the joints, p(w)
and turn'(w), so by d'Alembert they add

    J_pᵀ m (p'' - g) + J_turnᵀ I turn''

to the torques of the joints. The force of an actuator is its joint's torque over the lever arm.

Source: public data of the HIAB XS 031, frames included. Assumed: everything of an EMLA that `pmsm_emla` marks so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ..plants.parameter import Parameter
from ..plants.plant import Plant
from ..plants.pmsm_emla import defaults, pmsm_emla, shaft_torque, transmission
from .crane_geometry import BASE, ELBOW, LIFT, TILT, ActuatorLoop
from .rigid_body import GRAVITY, Payload, inverse_dynamics, pose
from .urdf import Body, bodies

JOINTS = ("lift", "tilt", "telescope")
#: Viscous friction of every joint, N m s/rad or N s/m; public.
DAMPING = 0.1
#: Rated force of an EMLA, N; table.
RATED_FORCE = 75e3


@cache
def bodies_of_crane() -> dict[str, Body]:
    """The bodies of `crane.urdf` by the names of their joints."""
    text = (Path(__file__).parent / "crane.urdf").read_text(encoding="utf-8")
    return {body.joint: body for body in bodies(text)}


def chain() -> tuple[Body, ...]:
    """Lift, tilt and telescope, the telescope carrying the end mass."""
    found = bodies_of_crane()
    return tuple(found[name] for name in JOINTS)


def joint_torques(w: Any, v: Any, a: Any, payload: Any = 0.0) -> Any:
    """Torques and force that the actuators must exert at the joints.

    Args:
        w: Joint coordinates, rad, rad, m. Shape (3,).
        v: Rates.
        a: Accelerations.
        payload: Point mass at the tool, kg, beside the end mass.

    Returns:
        SX column, N m, N m, N. Shape (3,).
    """
    import casadi as ca

    w, v, a = ca.SX(w), ca.SX(v), ca.SX(a)
    load = Payload(body=2, mass=payload, position=(0.0, 0.0, 0.0))
    torques = inverse_dynamics(chain(), w, v, a, payloads=(load,)) + DAMPING * v
    return torques + _actuator_bodies(w, v, a)


def _actuator_bodies(w: Any, v: Any, a: Any) -> Any:
    """What the cylinders and rods of lift and tilt ask of the joints."""
    import casadi as ca

    q, rate = ca.SX.sym("w", 3), ca.SX.sym("v", 3)
    torques, gain = ca.SX.zeros(3), ca.SX.sym("a", 3)
    gravity = ca.DM([GRAVITY[0], GRAVITY[2]])
    for loop, parent, joint in ((LIFT, -1, BASE), (TILT, 0, ELBOW)):
        for name, place, turned in _members(loop, parent, joint, q):
            body = bodies_of_crane()[name]
            moved = ca.jacobian(place, q)
            centre = float(body.moment[0]) / body.mass
            acceleration = moved @ gain + ca.jtimes(moved @ rate, q, rate)
            spin = turned @ gain + ca.jtimes(turned @ rate, q, rate)
            about = float(body.inertia[1, 1]) - body.mass * centre**2
            torques += moved.T @ (body.mass * (acceleration - gravity)) + turned.T * (about * spin)
    return ca.substitute([torques], [q, rate, gain], [w, v, a])[0]


def _members(loop: ActuatorLoop, parent: int, joint: tuple[float, float], q: Any) -> list[tuple[str, Any, Any]]:
    """Name, centre of mass in the plane, and Jacobian of the turning rate by the joint rates, of cylinder and rod."""
    import casadi as ca

    own = q[parent + 1]
    anchor = bodies_of_crane()[f"{loop.name}_cylinder"].position
    fixed = ca.DM([anchor[0] - joint[0], anchor[2] - joint[1]])
    end = own + (math.atan2(float(fixed[1]), float(fixed[0])) + loop.offset + math.pi)
    along = loop.b * ca.vertcat(ca.cos(end), ca.sin(end)) - fixed
    length = loop.extension(own) + loop.dead
    direction = along / length
    turn = ca.jacobian(along, own)
    own_rate = (along[0] * turn[1] - along[1] * turn[0]) / length**2
    before = [1.0 if k <= parent else 0.0 for k in range(3)]
    row = ca.horzcat(*(own_rate if k == parent + 1 else before[k] for k in range(3)))
    rotation, origin = pose(chain(), q, parent)
    found = []
    for name, shift in ((f"{loop.name}_cylinder", 0.0), (f"{loop.name}_rod", loop.extension(own))):
        body = bodies_of_crane()[name]
        local = ca.DM(list(joint)) + fixed + (float(body.moment[0]) / body.mass + shift) * direction
        ground = origin + rotation @ ca.vertcat(local[0], 0, local[1])
        found.append((name, ca.vertcat(ground[0], ground[2]), row))
    return found


def strokes(w: Any) -> Any:
    """Strokes of the three actuators, m. Shape (3,)."""
    import casadi as ca

    return ca.vertcat(LIFT.extension(w[0]), TILT.extension(w[1]), w[2])


def levers(w: Any) -> Any:
    """Rates of the strokes over those of the joints, m/rad, m/rad, 1. Shape (3,)."""
    import casadi as ca

    return ca.vertcat(LIFT.lever(w[0]), TILT.lever(w[1]), 1)


def joints_of(x: Any) -> Any:
    """Joint coordinates at strokes of the actuators, rad, rad, m. Shape (3,)."""
    import casadi as ca

    return ca.vertcat(LIFT.coordinate(x[0]), TILT.coordinate(x[1]), x[2])


def rod_forces(x: Any, v: Any, a: Any, payload: Any = 0.0) -> Any:
    """Forces that the actuators must exert on their rods, N, in coordinates of the rods.

    Args:
        x: Strokes, m; symbols or numbers. Shape (3,).
        v: Their rates, m/s.
        a: Their accelerations, m/s².
        payload: Point mass at the tool, kg, beside the end mass.

    Returns:
        SX column. Shape (3,). An actuator's own rotor, screw and friction are not in it.
    """
    import casadi as ca

    x, v, a = ca.SX(x), ca.SX(v), ca.SX(a)
    w, rate = ca.SX.sym("w", 3), ca.SX.sym("rate", 3)
    lever = levers(w)
    gain = (a - ca.jtimes(lever, w, rate) * rate) / lever
    forces = joint_torques(w, rate, gain, payload) / lever
    joints = joints_of(x)
    return ca.substitute([forces], [w, rate], [joints, v / levers(joints)])[0]


@dataclass(frozen=True, kw_only=True)
class Drives:
    """What the EMLAs of the crane do in a motion.

    Attributes:
        force: Forces on the rods, N. Each shape (3,).
        speed: Motor speeds, rad/s.
        torque: Motor torques, N m.
        current: Motor currents, A, amplitude.
        voltage: Phase voltages, V, amplitude.
        power: Electrical power drawn, W, without what the inductances store and give back; negative where a motor
            feeds back.
        loss: Power drawn that is not passed to the rod, W: copper, viscous friction, gear, screw and rod friction, and
            what speeds the rotors up, which a motion from rest to rest gives back.
    """

    force: Any
    speed: Any
    torque: Any
    current: Any
    voltage: Any
    power: Any
    loss: Any


def drives(
    w: Any, v: Any, a: Any, j: Any, payload: Any = 0.0, parameters: Mapping[str, Parameter] | None = None
) -> Drives:
    """What a motion asks of the three EMLAs at nominal parameters.

    Args:
        w: Joint coordinates, rad, rad, m; SX symbols. Shape (3,).
        v: Rates.
        a: Accelerations.
        j: Jerks: the voltage depends on the rate of the current.
        payload: Mass at the tool, kg.
        parameters: Replacements for those of `pmsm_emla`; the same for the three.

    Not guaranteed: backlash, compliance and thermal effects are not modelled; the mass of the rods is in the chain.
    """
    import casadi as ca

    known = {name: p.value for name, p in {**defaults("voltage"), **(parameters or {})}.items()}
    lever = levers(w)
    force = joint_torques(w, v, a, payload) / lever
    speed = lever * v
    gain = lever * a + ca.jtimes(lever, w, v) * v
    torque = ca.vertcat(*(shaft_torque(force[i], speed[i], gain[i], known) for i in range(3)))
    constant, r = known["torque_constant"], transmission(known)
    current = torque / constant
    slope = sum((ca.jtimes(current, x, dx) for x, dx in ((w, v), (v, a), (a, j))), ca.SX.zeros(3))
    turning = speed / r
    electrical = known["pole_pairs"] * turning
    across = known["resistance"] * current + known["inductance"] * slope + constant * turning / 1.5
    along = -known["inductance"] * electrical * current
    copper = 1.5 * known["resistance"] * current**2
    power = torque * turning + copper
    return Drives(
        force=force,
        speed=turning,
        torque=torque,
        current=current,
        voltage=ca.sqrt(across**2 + along**2 + 1e-12),
        power=power,
        loss=power - force * speed,
    )


def drive_limits(plant: Plant | None = None) -> tuple[tuple[str, str, float], ...]:
    """Largest force, motor speed, torque, current and voltage of an EMLA at voltage level: name, unit, value.

    Args:
        plant: The EMLA; the bundled one where None.
    """
    own = pmsm_emla("voltage") if plant is None else plant
    limits = {limit.name: limit.value for limit in own.limits}
    return (
        ("force", "N", RATED_FORCE),
        ("motor speed", "rad/s", limits["speed"] / transmission(own.values())),
        ("motor torque", "N m", own.ratings["peak_torque"].value),
        ("current", "A", limits["current"]),
        ("voltage", "V", limits["voltage"]),
    )
