"""An arm from URDF with a torque at every joint (P-3)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import casadi as ca

from ..errors import InvalidInputError, RefusedKeyError
from ..names import nearest
from ..plants import EFFECTIVENESS, Limit, Plant, effectiveness
from ..plants.rigid_joint import UNITS, joint_parameters, rigid_joint
from .machine import Disturbance, Machine
from .model import EACH, STROKE, Model, no_place, stroke_of
from .rigid_body import Payload, inverse_dynamics, pose
from .urdf import Body, bodies

#: Viscous friction of every joint where a study gives none, N m s/rad or N s/m.
DAMPING = 0.1
DAMPING_TOLERANCE = 0.5
#: A joint turns at most once either way, and slides at most so far, m, where the URDF has no limits.
FARTHEST = 10.0


def arm(text: str, joints: Any, damping: float, tip: tuple[float, float, float]) -> Machine:
    """The machine of a URDF.

    Args:
        text: The URDF. The joints that `joints` names are a chain from the ground on; all others stand still at 0, and
            what they carry goes with the link that they sit on.
        joints: Sections of the study by joint: parameters.armature, limits.torque, limits.speed, least_effectiveness.
        damping: Viscous friction of every joint, N m s/rad or N s/m.
        tip: Place of the tool, and of the payload, in the frame of the last body, m.

    Raises:
        InvalidInputError: joints that the file does not have, or that are no chain.
    """
    names = tuple(joints)
    tree, places = _tree(text, names)
    plants = [_driven(tree[place], name, joints[name], damping) for name, place in zip(names, places, strict=True)]
    n = len(names)
    x, v, a, d = ca.SX.sym("x", n), ca.SX.sym("v", n), ca.SX.sym("a", n), ca.SX.sym("d", 1)

    def whole(part: Any) -> Any:
        return ca.vertcat(*(part[places.index(k)] if k in places else 0 for k in range(len(tree))))

    load = Payload(body=places[-1], mass=d[0], position=tip)
    forces = inverse_dynamics(tree, whole(x), whole(v), whole(a), payloads=(load,))
    rotation, origin = pose(tree, whole(x), places[-1])
    end = origin + rotation @ ca.DM(tip)
    joints = [pose(tree, whole(x), k)[1] for k in places]
    return Machine(
        name="arm", members=names, plants=tuple(plants),
        disturbances=(Disturbance(name="payload", unit="kg", course="constant"),),
        forces=ca.Function("forces", [x, v, a, d], [ca.vertcat(*(forces[k] for k in places))]),
        place=ca.Function("place", [x], [end]), planner="joints",
        sticks=ca.Function("sticks", [x], [ca.horzcat(ca.SX.zeros(3), *joints, end)]),
        coordinates=("x", "y", "z"),
    )  # fmt: skip


@cache
def _tree(text: str, names: tuple[str, ...]) -> tuple[tuple[Body, ...], tuple[int, ...]]:
    """All bodies of a file, and the indices of those that named joints move."""
    tree = tuple(bodies(text))
    found = {body.joint: k for k, body in enumerate(tree)}
    missing = [name for name in names if name not in found]
    if missing:
        raise InvalidInputError(f'the URDF has no joint "{missing[0]}"; known: {", ".join(found)}')
    places = tuple(found[name] for name in names)
    for k, place in enumerate(places):
        if tree[place].parent != (places[k - 1] if k else -1):
            raise InvalidInputError(
                f'the joints of an arm follow each other: "{names[k]}" does not move with the one before; '
                "name all joints of the chain, from the ground on"
            )
    return tree, places


def _driven(body: Body, name: str, section: Any, damping: float) -> Plant:
    position, effort, inertia, _ = UNITS[body.kind]
    armature, torque, speed = section.parameters["armature"], section.limits["torque"], section.limits["speed"]
    for key, entry, wanted in (
        ("parameters.armature", armature, inertia), ("limits.torque", torque, effort),
        ("limits.speed", speed, f"{position}/s"),
    ):  # fmt: skip
        if entry.unit != wanted:
            raise InvalidInputError(
                f'plant.joints.{name}.{key}.unit must be "{wanted}": got "{entry.unit}"; convert the value'
            )
    parameters = joint_parameters(
        body.kind, armature=(armature.value, armature.tolerance or 0.0, armature.source),
        load_inertia=(0.0, 0.0, "derived"), damping=_damping(section, damping),
    )  # fmt: skip
    limit = Limit(name="torque", signals=("torque_command",), value=torque.value, unit=effort, source=torque.source)
    widest = 2 * math.pi if body.kind == "revolute" else FARTHEST
    travel = (max(body.limits[0], -widest), min(body.limits[1], widest))
    plant = rigid_joint(body.kind, parameters, torque=limit, speed=speed.value, travel=travel)
    return plant.with_values(
        parameters={} if section.least_effectiveness is None
        else {EFFECTIVENESS: effectiveness(section.least_effectiveness)},
        stroke=stroke_of(section),
    )  # fmt: skip


def _damping(section: Any, shared: float) -> tuple[float, float, str]:
    own = section.parameters.get("damping")
    if own is None:
        return shared, DAMPING_TOLERANCE, "assumed"
    return own.value, DAMPING_TOLERANCE if own.tolerance is None else own.tolerance, own.source


def _urdf(name: str) -> str:
    bundled = resources.files("hdmm_opt") / "machines" / f"{name}.urdf"
    if name.isidentifier() and bundled.is_file():
        return bundled.read_text(encoding="utf-8")
    try:
        return Path(name).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise InvalidInputError(f"plant.urdf: cannot read {name}: {reason}; check the path") from None


def _check(section: Any) -> Iterator[RefusedKeyError]:
    elsewhere = ("parameters", "ratings", "limits", *STROKE.values())
    yield from no_place(section, ("level", "locked", "least_lever_m_rad", "body", "shared", *elsewhere), "arm")
    if section.urdf is None:
        yield RefusedKeyError("urdf", 'is required with model = "arm"', 'give a bundled name ("crane") or a path')
    if not section.joints:
        yield RefusedKeyError("joints", "needs the joints of the arm, from the ground on", "give each a section")
    for name, drive in section.joints.items():
        yield from _of_joint(name, drive)


def _of_joint(name: str, drive: Any) -> Iterator[RefusedKeyError]:
    complete = True
    for part, keys in (("parameters", ("armature",)), ("limits", ("torque", "speed"))):
        for key in keys:
            if key not in getattr(drive, part):
                complete = False
                yield RefusedKeyError(f"joints.{name}.{part}.{key}", "is required for a joint of an arm", "add it")
        for key in getattr(drive, part):
            if key not in keys and not (part == "parameters" and key == "damping"):
                rule = "has no place in a joint of an arm"
                yield RefusedKeyError(f"joints.{name}.{part}.{key}", rule, nearest(key, keys))
    if complete:
        armature, torque = drive.parameters["armature"], drive.limits["torque"]
        if not (armature.value >= 0 and torque.value > 0 and drive.limits["speed"].value > 0):
            rule = "needs a torque and a speed above 0 and an armature of 0 or more"
            yield RefusedKeyError(f"joints.{name}", rule, "correct the values")


def _build(section: Any) -> Machine:
    damping = DAMPING if section.damping is None else section.damping
    return arm(_urdf(section.urdf), section.joints, damping, section.tip_m or (0.0, 0.0, 0.0))


MODEL = Model(
    members=lambda section: tuple(section.joints), check=_check, build=_build, kinds=("quintic", "bspline"),
    limited=EACH,
)  # fmt: skip
