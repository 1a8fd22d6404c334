"""References of all members of a machine: moves through the waypoints with a dwell before, between and after."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trajectories import MotionLimits, Reference, Spline, constant, quintic, violations

from ..errors import InvalidInputError
from ..machines.machine import Machine
from ..study import Study
from ..study.reference import MotionLimitSection
from .arm_mover import arm_mover
from .crane_moves import crane_moves
from .least_time import least_time
from .mover import Bounded
from .single_axis import axis_moves

#: From a study and its machine to the moves, each a spline of every member that starts at time 0.
Planner = Callable[[Study, Machine], list[list[Spline]]]


def joint_moves(study: Study, machine: Machine) -> list[list[Spline]]:
    """Moves of all joints from waypoint to waypoint: quintic in the given times, or of least time by the program.

    Raises:
        InvalidInputError: a move that is outside the study's limits, or that cannot be reached inside them.
    """
    section, limits = study.reference, study.reference.limits or MotionLimitSection()
    bounds = Bounded(speed=limits.speed, acceleration=limits.acceleration, jerk=limits.jerk)
    if section.kind == "bspline":
        motions = least_time(study, arm_mover(machine), section.waypoints, bounds)
        return [[motion.spline.coordinate(k) for k in range(len(machine.members))] for motion in motions]
    moves = [
        [quintic(a, b, 0.0, duration) for a, b in zip(start, goal, strict=True)]
        for start, goal, duration in zip(section.waypoints, section.waypoints[1:], section.durations_s, strict=False)
    ]
    units = tuple(plant.state_units[0] for plant in machine.plants)
    free = MotionLimits(position=(-np.inf, np.inf), names=machine.members, units=units)
    for k, move in enumerate(moves, 1):
        together = Spline(knots=move[0].knots, coefficients=np.stack([s.coefficients for s in move], axis=1))
        broken = violations(together, bounds.of(free))
        if broken:
            raise InvalidInputError(f"reference: move {k}: {broken[0]}; allow more time, or widen the limit")
    return moves


#: Planners by the name that a machine gives.
PLANNERS: dict[str, Planner] = {"axis": axis_moves, "joints": joint_moves, "crane": crane_moves}


def references(study: Study, machine: Machine) -> tuple[Reference, ...]:
    """The references, in coordinates of the members; all have the same knots.

    Raises:
        InvalidInputError: a move that cannot be reached, or a transient that outlasts the reference.
    """
    section = study.reference
    segments: list[list[Spline]] = [[] for _ in machine.members]
    clock, moves = 0.0, PLANNERS[machine.planner](study, machine)
    for number, move in enumerate(moves):
        if section.dwell_s > 0:
            for own, spline in zip(segments, move, strict=True):
                own.append(constant(float(spline.coefficients[0]), clock, clock + section.dwell_s))
            clock += section.dwell_s
        for own, spline in zip(segments, move, strict=True):
            own.append(_from(spline, clock, section.pace))
        clock = segments[0][-1].end
        if number + 1 == len(moves) and section.dwell_s > 0:
            for own in segments:
                own.append(constant(float(own[-1].coefficients[-1]), clock, clock + section.dwell_s))
    made = tuple(Reference(segments=tuple(own)) for own in segments)
    if not study.validation.transient_s < made[0].duration:
        raise InvalidInputError(
            f"validation.transient_s ends before the reference does: got {study.validation.transient_s:g} s of "
            f"{made[0].duration:g} s; shorten the transient"
        )
    return made


def _from(spline: Spline, clock: float, pace: float) -> Spline:
    """The spline at another pace, with its first knots exactly at a time."""
    knots = clock + (spline.knots - spline.start) / pace
    knots[: spline.degree + 1] = clock
    knots[-spline.degree - 1 :] = knots[-1]
    return Spline(knots=knots, coefficients=spline.coefficients)
