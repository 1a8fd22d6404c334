"""Members that nothing joins, plants of one kind: one plant by itself, or several with a body that they move.

Each member is proved by itself against what it meets; a body makes in simulation what the proof takes as given.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import casadi as ca

from ..errors import RefusedKeyError
from ..names import nearest
from ..plants import EFFECTIVENESS, Limit
from ..plants.registry import PlantModel
from .body import BodyModel
from .machine import Disturbance, Machine
from .model import SINGLE, Model, Numbers, check_numbers, check_parameters, given, no_place, numbers_of

#: Name of the only member.
MEMBER = "actuator"
_ELSEWHERE = ("urdf", "tip_m", "damping", "locked", "least_lever_m_rad")


def free(
    name: str, plant: PlantModel, members: Sequence[str] = (MEMBER,), body: BodyModel | None = None,
    shared: Mapping[str, Limit] = MappingProxyType({}),
) -> Model:  # fmt: skip
    """The model of members that nothing joins.

    Args:
        name: Name of the machine.
        plant: How each member is made.
        members: Their names.
        body: What they move, where it is part of the machine.
        shared: What they draw on together, by output.
    """
    names, elsewhere = tuple(members), (*_ELSEWHERE, *(() if plant.sensors else ("sensor",)))

    def check(section: Any) -> Iterator[RefusedKeyError]:
        yield from no_place(
            section, (*elsewhere, *(("body",) if body is None else ()), *(() if shared else ("shared",))), name
        )
        if section.level not in plant.levels:
            yield RefusedKeyError("level", f"is one of {', '.join(plant.levels)}: got {section.level!r}", "choose one")
            return
        if plant.sensors and section.sensor not in plant.sensors:
            rule = f"is one of {', '.join(plant.sensors)}: got {section.sensor!r}"
            yield RefusedKeyError("sensor", rule, "say where the sensor is")
            return
        known, blank = plant.defaults(section.level), plant.made(section, {}, {})
        for member in section.joints:
            if member not in names:
                yield RefusedKeyError(f"joints.{member}", "is not a member of this machine", nearest(member, names))
        yield from check_parameters("parameters", section.parameters, known, name, blank)
        yield from check_numbers("", section, blank)
        for member in names:
            own = section.joints.get(member)
            if own is None:
                continue
            yield from check_parameters(f"joints.{member}.parameters", own.parameters, known, name, blank)
            yield from check_numbers(f"joints.{member}.", own, blank)
            if own.least_effectiveness is not None and EFFECTIVENESS not in known:
                rule = f'has no place with level = "{section.level}"'
                yield RefusedKeyError(f"joints.{member}.least_effectiveness", rule, "remove it")
        for output, limit in section.shared.items():
            if output not in shared:
                yield RefusedKeyError(f"shared.{output}", "is not drawn on together", nearest(output, shared))
            elif limit.unit != shared[output].unit:
                rule = f'must be "{shared[output].unit}": got "{limit.unit}"'
                yield RefusedKeyError(f"shared.{output}.unit", rule, "convert the value")
        if body is not None:
            yield from check_parameters("body", section.body, body.defaults, f"the body of {name}", None)

    def build(section: Any) -> Machine:
        made, bundled = [], {}
        for member in names:
            numbers = Numbers.of(section, member)
            parameters = given(numbers.parameters, plant.defaults(section.level))
            own = plant.made(section, parameters, given(numbers.ratings, plant.ratings(section.level)))
            made.append(numbers_of(own, numbers))
            bundled[member] = numbers.left(made[-1], coupled=False)
        x = ca.SX.sym("x", len(names))
        several = len(names) > 1
        disturbances = tuple(
            Disturbance(name=f"{member}.{w}" if several else w, unit=own.load_unit, course="any")
            for member, own in zip(names, made, strict=True) for w in own.disturbances
        )  # fmt: skip
        return Machine(
            name=name, members=names, plants=tuple(made), disturbances=disturbances, forces=None,
            place=ca.Function("place", [x], [x]), planner="axis", bundled=bundled,
            shared={
                output: limit if output not in section.shared
                else replace(limit, value=section.shared[output].value, source=section.shared[output].source)
                for output, limit in shared.items()
            },
            body=None if body is None else body.build({**body.defaults, **given(section.body, body.defaults)}),
        )  # fmt: skip

    return Model(
        members=lambda section: names, check=check, build=build,
        kinds=("quintic", "bspline") if len(names) == 1 else ("quintic",),
        limited=(*SINGLE, "torque_nm", "current_a", "voltage_v"),
    )  # fmt: skip
