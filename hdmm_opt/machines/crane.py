"""The HIAB-class crane with an EMLA at voltage level on every joint, in coordinates of the rods."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import casadi as ca

from ..errors import RefusedKeyError
from ..names import nearest
from ..plants import Parameter, defaults, pmsm_emla
from ..plants.pmsm_emla import ratings
from .crane_dynamics import JOINTS, joints_of, rod_forces, strokes
from .crane_geometry import LIFT, TELESCOPE, TILT, figure, tool
from .machine import Disturbance, Machine
from .model import Model, Numbers, check_numbers, check_parameters, given, no_place, numbers_of

#: Longest strokes, m.
STROKES = {"lift": LIFT.stroke, "tilt": TILT.stroke, "telescope": TELESCOPE}


def crane(
    parameters: Mapping[str, Mapping[str, Parameter]], locked: Mapping[str, float] | None = None,
    rated: Mapping[str, Mapping[str, Parameter]] | None = None,
) -> Machine:  # fmt: skip
    """The machine; its states are those of the EMLAs, 4 a joint.

    Args:
        parameters: Replacements for those of `pmsm_emla`, by joint.
        locked: Joints that have no actuator, and the stroke at which they stand still, m.
        rated: Replacements for the ratings of `pmsm_emla`, by joint.
    """
    fixed = dict(locked or {})
    kept = [k for k, name in enumerate(JOINTS) if name not in fixed]
    known = defaults("voltage")
    massless = {"load_mass": replace(known["load_mass"], value=0.0, tolerance=0.0, source="derived",
                                     meaning="part of the crane's inertia in the axis' own model")}  # fmt: skip
    plants = [
        pmsm_emla("voltage", {**parameters.get(name, {}), **massless}, (rated or {}).get(name)).with_values(
            stroke=(0.0, STROKES[name])
        )
        for name in (JOINTS[k] for k in kept)
    ]
    n = len(kept)
    x, v, a, d = ca.SX.sym("x", n), ca.SX.sym("v", n), ca.SX.sym("a", n), ca.SX.sym("d", 1)

    def whole(part: Any, still: bool) -> Any:
        rest = {name: 0.0 if still else value for name, value in fixed.items()}
        return ca.vertcat(*(part[kept.index(k)] if k in kept else rest[name] for k, name in enumerate(JOINTS)))

    forces = rod_forces(whole(x, still=False), whole(v, still=True), whole(a, still=True), d[0])
    place = ca.vertcat(*tool(joints_of(whole(x, still=False))))
    turned = strokes(whole(x, still=True))
    return Machine(
        name="crane", members=tuple(JOINTS[k] for k in kept), plants=tuple(plants),
        disturbances=(Disturbance(name="payload", unit="kg", course="constant"),),
        forces=ca.Function("forces", [x, v, a, d], [ca.vertcat(*(forces[k] for k in kept))]),
        place=ca.Function("place", [x], [place]), planner="crane", coordinates=("x", "z"),
        sticks=ca.Function("sticks", [x], [figure(joints_of(whole(x, still=False)))]),
        of_joints=ca.Function("strokes", [x], [ca.vertcat(*(turned[k] for k in kept))]),
    )  # fmt: skip


def _members(section: Any) -> tuple[str, ...]:
    return tuple(name for name in JOINTS if name not in section.locked)


def _check(section: Any) -> Iterator[RefusedKeyError]:
    yield from no_place(section, ("urdf", "tip_m", "damping", "body", "shared"), "crane")
    if section.level not in (None, "voltage"):
        yield RefusedKeyError("level", f'of the crane is "voltage": got {section.level!r}', "leave it out")
    known = {name: p for name, p in defaults("voltage").items() if name != "load_mass"}
    for where, names in (("joints", section.joints), ("locked", section.locked)):
        for name in names:
            if name not in JOINTS:
                yield RefusedKeyError(f"{where}.{name}", "is not a joint of the crane", nearest(name, JOINTS))
    if any(name not in JOINTS for name in (*section.joints, *section.locked)):
        return
    if len(section.locked) == len(JOINTS):
        yield RefusedKeyError("locked", "must leave a joint that moves: got all of them", "unlock one")
    for name, stroke in section.locked.items():
        if not 0 <= stroke <= STROKES[name]:
            rule = f"is a stroke from 0 to {STROKES[name]:g} m: got {stroke:g}"
            yield RefusedKeyError(f"locked.{name}", rule, "correct it")
    blank = pmsm_emla("voltage")
    yield from check_parameters("parameters", section.parameters, known, "an EMLA of the crane", blank)
    yield from check_numbers("", section, blank, stroke=False)
    for name, drive in section.joints.items():
        yield from check_parameters(f"joints.{name}.parameters", drive.parameters, known, "an EMLA of the crane", blank)
        yield from check_numbers(f"joints.{name}.", drive, blank)
        if drive.least_effectiveness is not None:
            yield RefusedKeyError(f"joints.{name}.least_effectiveness", "has no place at voltage level", "remove it")


def _build(section: Any) -> Machine:
    numbers = {name: Numbers.of(section, name) for name in JOINTS}
    parameters = {name: given(own.parameters, defaults("voltage")) for name, own in numbers.items()}
    rated = {name: given(own.ratings, ratings("voltage")) for name, own in numbers.items()}
    made = crane(parameters, section.locked, rated)
    plants = {
        name: numbers_of(plant, numbers[name]) for name, plant in zip(made.members, made.plants, strict=True)
    }  # fmt: skip
    bundled = {name: numbers[name].left(plant, coupled=True) for name, plant in plants.items()}
    return replace(made, plants=tuple(plants.values()), bundled=bundled)


MODEL = Model(members=_members, check=_check, build=_build, kinds=("bspline",))
