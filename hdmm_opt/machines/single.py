"""A plant by itself: a machine of one member, which meets the plant's own disturbances."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import casadi as ca

from ..errors import RefusedKeyError
from ..names import nearest
from ..plants import EFFECTIVENESS
from ..plants.registry import PlantModel
from .machine import Disturbance, Machine
from .model import SINGLE, Model, Numbers, check_numbers, check_parameters, given, no_place, numbers_of

#: Name of the only member.
MEMBER = "actuator"
_ELSEWHERE = ("urdf", "tip_m", "damping", "locked", "least_lever_m_rad")


def single(name: str, plant: PlantModel) -> Model:
    """The model of one plant by itself.

    Args:
        name: Name of the plant.
        plant: How it is made.
    """

    def check(section: Any) -> Iterator[RefusedKeyError]:
        yield from no_place(section, (*_ELSEWHERE, *(() if plant.sensors else ("sensor",))), name)
        if section.level not in plant.levels:
            yield RefusedKeyError("level", f"is one of {', '.join(plant.levels)}: got {section.level!r}", "choose one")
            return
        if plant.sensors and section.sensor not in plant.sensors:
            rule = f"is one of {', '.join(plant.sensors)}: got {section.sensor!r}"
            yield RefusedKeyError("sensor", rule, "say where the sensor is")
            return
        for member in section.joints:
            if member != MEMBER:
                yield RefusedKeyError(f"joints.{member}", "is not a member of this machine", nearest(member, [MEMBER]))
        known, own = plant.defaults(section.level), section.joints.get(MEMBER)
        blank = plant.made(section, {}, {})
        yield from check_parameters("parameters", section.parameters, known, name, blank)
        yield from check_numbers("", section, blank)
        if own is not None:
            yield from check_parameters(f"joints.{MEMBER}.parameters", own.parameters, known, name, blank)
            yield from check_numbers(f"joints.{MEMBER}.", own, blank)
            if own.least_effectiveness is not None and EFFECTIVENESS not in known:
                rule = f'has no place with level = "{section.level}"'
                yield RefusedKeyError(f"joints.{MEMBER}.least_effectiveness", rule, "remove it")

    def build(section: Any) -> Machine:
        numbers = Numbers.of(section, MEMBER)
        parameters = given(numbers.parameters, plant.defaults(section.level))
        made = plant.made(section, parameters, given(numbers.ratings, plant.ratings(section.level)))
        made = numbers_of(made, numbers)
        x = ca.SX.sym("x", 1)
        disturbances = tuple(Disturbance(name=w, unit=made.load_unit, course="any") for w in made.disturbances)
        return Machine(
            name=name, members=(MEMBER,), plants=(made,), disturbances=disturbances, forces=None,
            place=ca.Function("place", [x], [x]), planner="axis", bundled={MEMBER: numbers.left(made, coupled=False)},
        )  # fmt: skip

    return Model(
        members=lambda section: (MEMBER,), check=check, build=build, kinds=("quintic", "bspline"),
        limited=(*SINGLE, "torque_nm", "current_a", "voltage_v"),
    )  # fmt: skip
