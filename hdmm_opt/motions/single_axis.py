"""Moves of actuators that nothing joins, each inside its limits for all t."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from trajectories import (
    Cost,
    LimitViolatedError,
    MotionLimits,
    Quantities,
    Reference,
    Spline,
    Task,
    Waypoint,
    peaks,
    quintic,
    shortest_duration,
    solve,
    violations,
)

from ..errors import InvalidInputError
from ..machines.machine import Machine
from ..plants import Plant
from ..study import Study
from ..study.reference import MotionLimitSection
from .enclosure import enclosure


def axis_moves(study: Study, machine: Machine) -> list[list[Spline]]:
    """Moves of each actuator by itself inside its limits.

    Args:
        study: The study.
        machine: Its machine, of members that nothing joins.

    Returns:
        The moves. Speed, acceleration, jerk and stroke hold for all t by control points, torque, current and voltage
        (at nominal parameters and the largest load) by interval enclosure of every span.

    Raises:
        InvalidInputError: a move breaks a limit; the message names it and what would do.
    """
    section = study.reference
    if section.limits is None:
        raise InvalidInputError('"reference.limits" is required and missing; add it')
    if len(machine.members) > 1 and not section.durations_s:
        raise InvalidInputError(
            "reference.durations_s is required where several members move together: their least times differ; list them"
        )
    own = []
    for k, (name, plant) in enumerate(zip(machine.members, machine.plants, strict=True)):
        places = [place[k] for place in section.waypoints]
        own.append(_moves(study, section.limits, plant, places, f"{name}: " if len(machine.members) > 1 else ""))
    return [list(together) for together in zip(*own, strict=True)]


def _moves(
    study: Study, limits: MotionLimitSection, plant: Plant, places: Sequence[float], where: str
) -> list[Spline]:  # fmt: skip
    unit = plant.state_units[0]
    room = min(min(places) - plant.stroke[0], plant.stroke[1] - max(places))
    if not room > 0:
        raise InvalidInputError(
            f"reference: {where}waypoints lie inside the stroke, {plant.stroke[0]:g} to {plant.stroke[1]:g} {unit}, "
            f"with room for the tracking error: got {min(places):g} to {max(places):g} {unit}; move them inwards"
        )
    moves = []
    for k, (start, goal) in enumerate(pairwise(places)):
        try:
            moves.append(_move(study, limits, plant, k, start, goal))
        except LimitViolatedError as error:
            raise InvalidInputError(f"reference: {where}move {k + 1} cannot be reached: {error}") from None
    return moves


def _move(study: Study, limits: MotionLimitSection, plant: Plant, k: int, start: float, goal: float) -> Spline:
    section = study.reference
    if start == goal:  # it rests while others move
        return quintic(start, goal, 0.0, section.durations_s[k])
    task = _task(study, limits, plant, k, start, goal)
    if section.kind == "bspline":
        return solve(task, 0.0).spline.coordinate(0)
    spline = quintic(start, goal, 0.0, section.durations_s[k])
    broken = violations(spline, task.limits)
    if broken:
        least = shortest_duration(goal - start, *(float(task.limits.of(order)[0]) for order in (1, 2, 3)))
        remedy = "move the waypoint" if broken[0].startswith("position") else f"{1.02 * least:.3g} s would do"
        raise LimitViolatedError(f"{broken[0]} in {section.durations_s[k]:g} s; {remedy}")
    if task.quantities is None:
        return spline
    found = peaks(spline, task.quantities)
    for name, unit, peak, limit in zip(
        task.quantities.names, task.quantities.units, found.upper, task.quantities.upper, strict=True
    ):
        if not peak <= limit:
            raise LimitViolatedError(
                f"{name} needs up to {peak:.4g} {unit}, the limit is {limit:g} {unit}; "
                "allow more time or raise the limit"
            )
    return spline


def largest_loads(study: Study) -> list[float]:
    """The end of each disturbance's range that asks most of the actuator."""
    return [max(disturbance.range, key=abs) for disturbance in study.uncertainty.disturbances.values()]


def _task(study: Study, limits: MotionLimitSection, plant: Plant, k: int, start: float, goal: float) -> Task:
    section = study.reference
    quantities, running = _efforts(study, limits, plant)
    energy = section.objective == "energy" and section.kind == "bspline"
    given = section.durations_s[k] if section.durations_s else section.longest_s
    return Task(
        waypoints=(Waypoint(value=np.array([start])), Waypoint(value=np.array([goal]))),
        limits=_limits(limits, plant),
        quantities=quantities,
        cost=Cost(time=0.0, running=running, names=("energy",), weights=(1.0,)) if energy else Cost(),
        duration=given if energy else None,
        longest=given,
        spans=section.spans,
    )


def _limits(limits: MotionLimitSection, plant: Plant) -> MotionLimits:
    """The study's limits as those of the first state and its derivatives."""
    low, high = plant.stroke
    units = (plant.state_units[0],)
    speed, acceleration, jerk = limits.single
    if plant.first == "position":
        return MotionLimits(position=(low, high), speed=speed, acceleration=acceleration, jerk=jerk, units=units)
    inside = max(low, -speed), min(high, speed)
    return MotionLimits(position=inside, speed=acceleration, acceleration=jerk, units=units)


def _efforts(study: Study, limits: MotionLimitSection, plant: Plant) -> tuple[Quantities | None, Any]:
    """What the motion asks of the actuator with its limits, and the power that an energy-optimal motion spends."""
    efforts = plant.efforts
    if efforts is None:
        if study.reference.objective == "energy":
            raise InvalidInputError(
                f'"reference.objective" is "energy", and {plant.name} does not say what a motion spends; use "time"'
            )
        return None, None
    column, running = efforts.of(plant, largest_loads(study))
    bounded = [getattr(limits, name) for name in efforts.limits]
    count = len(efforts.names)
    quantities = Quantities(
        function=column,
        names=efforts.names,
        units=efforts.units,
        lower=np.full(count, -np.inf),
        upper=np.array([np.inf if value is None else value for value in bounded]),
        enclose=enclosure(column),
    )
    return quantities, running


def effort_table(study: Study, plant: Plant, reference: Reference) -> list[dict[str, float | str | None]]:
    """Peak of every limited quantity over the reference, beside its limit."""
    limits = study.reference.limits
    assert limits is not None
    rows: list[dict[str, float | str | None]] = []
    bounds, units = reference.bounds(), plant.reference_units
    known = dict(zip(("speed", "acceleration", "jerk"), limits.single, strict=True))
    for order, (name, limit) in enumerate(known.items(), 1 if plant.first == "position" else 0):
        rows.append({"quantity": name, "unit": units[order], "peak": max(map(abs, bounds[order])), "limit": limit})
    if plant.efforts is None:
        return rows
    t = np.linspace(0.0, reference.duration, 4001)
    column, _ = plant.efforts.of(plant, largest_loads(study))
    values = np.array(column.map(t.size)(*(row[None, :] for row in reference(t)))).max(axis=1)
    for key in dict.fromkeys(plant.efforts.limits):
        own = [k for k, name in enumerate(plant.efforts.limits) if name == key]
        peak, first = float(max(values[k] for k in own)), own[0]
        assert math.isfinite(peak)
        name, unit = plant.efforts.names[first], plant.efforts.units[first]
        given = getattr(limits, key)
        drive = next((limit.value for limit in plant.limits if limit.name == name and limit.unit == unit), None)
        rows.append({"quantity": name, "unit": unit, "peak": peak, "limit": drive if given is None else given})
    return rows
