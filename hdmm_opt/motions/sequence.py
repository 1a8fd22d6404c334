"""The motions that carry out a job of a machine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajectories import LimitViolatedError, Motion, Waypoint, solve

from ..errors import InvalidInputError
from .job import Job, Move, Place, State, spans_of
from .retimed import jerk_limited_motion, retimed_motion
from .tool_path import along_joints, path_task

Array = NDArray[np.float64]

#: A tool nearer to its goal than this, m, is there; joints nearer than this, rad or m, too.
NOWHERE = 1e-4
#: Places that follow each other closer than this share of the longest way between two of them make no program.
CLOSE = 0.05


@dataclass(frozen=True, kw_only=True)
class Motions:
    """The motions of a job.

    Attributes:
        name: How they were chosen.
        job: The job.
        motions: One for each move.
    """

    name: str
    job: Job
    motions: tuple[Motion, ...]

    @property
    def duration(self) -> float:
        """Time of all moves, s."""
        return sum(motion.parts["time"] for motion in self.motions)

    @cached_property
    def totals(self) -> dict[str, float]:
        """Integrals of the running costs of the machine over all moves: "energy", J, "loss", J, "effort", s."""
        return dict(zip(self.job.mover.cost_names, self._integrals[:-2].tolist(), strict=True))

    @cached_property
    def efficiency(self) -> float | None:
        """Work that the rods do while the motors draw power, over the energy drawn then; None where none is drawn."""
        useful, drawn = self._integrals[-2:]
        return float(useful / drawn) if drawn > 0 else None

    @cached_property
    def _integrals(self) -> Array:
        """Over all moves: the running costs, the power at the rods and that drawn, both where it is drawn."""
        from scipy.integrate import trapezoid

        parts = []
        for motion, move in zip(self.motions, self.job.moves, strict=True):
            t = np.linspace(motion.spline.start, motion.spline.end, 4001)
            costs = np.array(self.job.mover.costs(move.payload).map(len(t))(*(c.T for c in motion.spline.curves(t))))
            named = dict(zip(self.job.mover.cost_names, costs, strict=True))
            power, lost = named.get("energy", np.zeros(len(t))), named.get("loss", np.zeros(len(t)))
            useful = np.where(power > 0, np.maximum(power - lost, 0.0), 0.0)
            parts.append(trapezoid([*costs, useful, np.maximum(power, 0.0)], t))
        return np.sum(parts, axis=0)


def _going_somewhere(job: Job, move: Move, at: State) -> None:
    """Refuse a move that ends or passes where it is already, or inside an obstacle.

    Raises:
        ValueError: it does.
    """
    places = [*move.via, *([] if move.path else [move])]
    ways = _ways(job, places, at)
    for number, (place, way) in enumerate(zip(places, ways, strict=True)):
        key = "" if number == len(move.via) else f"via.{number}: "
        moving = at.speed is not None and number == 0
        if way < NOWHERE and not moving and place.angle is None:
            what = "tool goes from one place to another: it is" if place.joints is None else (
                "joints go from one place to another: they are"
            )  # fmt: skip
            raise ValueError(f"{key}the {what} at {list(place.joints or place.tool or ())} already")
        if way < CLOSE * max(ways) and not moving and place.angle is None:
            raise ValueError(
                f"{key}it is {way:.3g} from the place before, less than {CLOSE:.0%} of the longest way between two "
                f"places, {max(ways):.3g}: leave one of them out"
            )
        for obstacle in job.obstacles:
            if place.tool is None:
                continue
            clear = float(obstacle.clearance(place.tool))
            if clear < 0:
                said = job.mover.said(place.tool)
                raise ValueError(f"the tool keeps clear of {obstacle.name}: {said} is {-clear:.3g} m inside")


def _ways(job: Job, places: Sequence[Place], at: State) -> list[float]:
    """How far each place is from the one before: between joint coordinates where both have them, else of the tool."""
    joints, tool = at.place, job.mover.place(at.place)[: len(job.mover.coordinates)]
    found = []
    for place in places:
        if place.joints is not None:
            there = np.array(place.joints)
            spot = job.mover.place(there)[: len(tool)]
        else:
            there, spot = None, np.array(place.tool)
        apart = spot - tool if joints is None or there is None else there - joints
        found.append(float(np.abs(apart).max()))
        joints, tool = there, spot
    return found


def carried_out(
    job: Job, cost: Callable[[float], Any], name: str, *, kind: str = "bspline", spans: int | None = None,
    tick: Callable[[int], None] | None = None,
) -> Motions:  # fmt: skip
    """Each move by itself on one level: where the tool has a place, the joints share the way as costs least.

    Args:
        job: The job.
        cost: The cost for a payload.
        name: Name of the result.
        kind: "bspline", "toppra" or "ruckig"; the last two go straight between joint coordinates.
        spans: Spans of each phase; by default `spans_of`.
        tick: Called with the number of each move that is done.

    Raises:
        InvalidInputError: a move that is none, such as one to the place where the machine is.
        LimitViolatedError: a move that no motion inside the limits makes; the message says which.

    Not guaranteed: that moves chosen one by one are best together.
    """
    motions: list[Motion] = []
    at = job.at
    for number, move in enumerate(job.moves, 1):
        try:
            _going_somewhere(job, move, at)
            if kind == "bspline":
                motions.append(_programmed(job, move, at, cost(move.payload), spans))
            else:
                goal = job.waypoint(move, at.place).guess
                make = retimed_motion if kind == "toppra" else jerk_limited_motion
                motions.append(make(job, at, goal, move, cost(move.payload)))
        except LimitViolatedError as error:
            raise LimitViolatedError(f"move {number}: {error}") from None
        except ValueError as error:
            raise InvalidInputError(f"move {number}: {error}; change the move") from None
        if tick is not None:
            tick(number)
        at = State(motions[-1].spline.coefficients[-1], None if move.speed is None else np.array(move.speed))
    return Motions(name=name, job=job, motions=tuple(motions))


def _programmed(job: Job, move: Move, at: State, cost: Any, spans: int | None) -> Motion:
    """One move by the spline program."""
    if move.path:
        task, guess = path_task(job, move, at, cost, spans or spans_of(1))
        return along_joints(solve(task, guess=guess), len(job.start))
    waypoints, last = [at.waypoint], at.place
    for place in (*move.via, move):
        waypoints.append(job.waypoint(place, last))
        last = waypoints[-1].guess
    if move.speed is not None:
        waypoints[-1] = Waypoint(value=waypoints[-1].value, speed=np.array(move.speed))
    return solve(job.task(tuple(waypoints), move.payload, cost=cost, spans=spans or spans_of(len(waypoints) - 1)))
