"""From a study's `[reference]` to a reference that respects its limits for all t."""

from __future__ import annotations

import math

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
    constant,
    peaks,
    quintic,
    shortest_duration,
    solve,
    violations,
)

from .enclosure import enclosure
from .errors import InvalidInputError
from .plants import EFFORTS, Plant, effort
from .study import Study

#: The effort limit of the study that bounds each entry of `EFFORTS`.
_LIMIT_OF = ("torque_nm", "torque_nm", "current_a", "current_a", "voltage_v")


def build_reference(study: Study, plant: Plant) -> Reference:
    """Moves through the waypoints, with a dwell before, between and after.

    Args:
        study: The study.
        plant: Its plant.

    Returns:
        The reference. Speed, acceleration, jerk and stroke hold for all t by control points, torque, current and
        voltage (at nominal parameters and the largest load) by interval enclosure of every span.

    Raises:
        InvalidInputError: a move breaks a limit; the message names it and what would do.
    """
    section = study.reference
    room = min(min(section.waypoints_m) - plant.stroke[0], plant.stroke[1] - max(section.waypoints_m))
    if not room > 0:
        raise InvalidInputError(
            f"reference: waypoints lie inside the stroke, {plant.stroke[0]:g} to {plant.stroke[1]:g} m, with room for "
            f"the tracking error: got {min(section.waypoints_m):g} to {max(section.waypoints_m):g} m; move them inwards"
        )
    segments: list[Spline] = []
    clock = 0.0
    for k, (start, goal) in enumerate(zip(section.waypoints_m, section.waypoints_m[1:], strict=False)):
        if section.dwell_s > 0:
            segments.append(constant(start, clock, clock + section.dwell_s))
            clock = segments[-1].end
        try:
            segments.append(_move(study, plant, k, start, goal, clock))
        except LimitViolatedError as error:
            raise InvalidInputError(f"reference: move {k + 1} cannot be reached: {error}") from None
        clock = segments[-1].end
    if section.dwell_s > 0:
        segments.append(constant(section.waypoints_m[-1], clock, clock + section.dwell_s))
    return Reference(segments=tuple(segments))


def _move(study: Study, plant: Plant, k: int, start: float, goal: float, clock: float) -> Spline:
    section = study.reference
    task = _task(study, plant, k, start, goal)
    if section.kind == "bspline":
        return solve(task, clock).spline.coordinate(0)
    spline = quintic(start, goal, clock, section.durations_s[k])
    broken = violations(spline, task.limits)
    if broken:
        limits = section.limits
        least = shortest_duration(goal - start, limits.speed_m_s, limits.acceleration_m_s2, limits.jerk_m_s3)
        remedy = "move the waypoint" if broken[0].startswith("position") else f"{1.02 * least:.3g} s would do"
        raise LimitViolatedError(f"{broken[0]} in {section.durations_s[k]:g} s; {remedy}")
    assert task.quantities is not None
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


def _task(study: Study, plant: Plant, k: int, start: float, goal: float) -> Task:
    section, limits = study.reference, study.reference.limits
    load = max(study.uncertainty.load_force_n, key=abs)
    column, running = effort(plant, load)
    bounded = [getattr(limits, name) for name in _LIMIT_OF]
    energy = section.objective == "energy" and section.kind == "bspline"
    given = section.durations_s[k] if section.durations_s else section.longest_s
    return Task(
        waypoints=(Waypoint(value=np.array([start])), Waypoint(value=np.array([goal]))),
        limits=MotionLimits(
            speed=limits.speed_m_s,
            acceleration=limits.acceleration_m_s2,
            jerk=limits.jerk_m_s3,
            position=plant.stroke,
        ),
        quantities=Quantities(
            function=column,
            names=tuple(name for name, _ in EFFORTS),
            units=tuple(unit for _, unit in EFFORTS),
            lower=np.full(len(EFFORTS), -np.inf),
            upper=np.array([np.inf if value is None else value for value in bounded]),
            enclose=enclosure(column),
        ),
        cost=Cost(time=0.0, running=running, names=("energy",), weights=(1.0,)) if energy else Cost(),
        duration=given if energy else None,
        longest=given,
        spans=section.spans,
    )


def effort_table(study: Study, plant: Plant, reference: Reference) -> list[dict[str, float | str | None]]:
    """Peak of every limited quantity over the reference, beside its limit."""
    limits = study.reference.limits
    rows: list[dict[str, float | str | None]] = []
    bounds = reference.bounds()
    for order, (name, unit, limit) in enumerate(
        (("speed", "m/s", limits.speed_m_s), ("acceleration", "m/s^2", limits.acceleration_m_s2),
         ("jerk", "m/s^3", limits.jerk_m_s3)), 1,
    ):  # fmt: skip
        rows.append({"quantity": name, "unit": unit, "peak": max(map(abs, bounds[order])), "limit": limit})
    load = max(study.uncertainty.load_force_n, key=abs)
    t = np.linspace(0.0, reference.duration, 4001)
    values = np.array(effort(plant, load)[0].map(t.size)(*(row[None, :] for row in reference(t))))
    sampled = [np.abs(values[0]).max(), np.abs(values[2]).max(), values[4].max()]
    for peak, (name, unit) in zip(sampled, (("torque", "N m"), ("current", "A"), ("voltage", "V")), strict=True):
        limit = getattr(limits, {"torque": "torque_nm", "current": "current_a", "voltage": "voltage_v"}[name])
        rows.append({"quantity": name, "unit": unit, "peak": float(peak), "limit": limit})
    assert all(math.isfinite(float(row["peak"] or 0.0)) for row in rows)
    return rows
