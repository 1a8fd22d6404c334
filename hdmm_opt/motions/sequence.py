"""A job of the crane: moves from rest to rest, each with its payload, and the motions that carry it out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajectories import LimitViolatedError, Motion, MotionLimits, Obstacle, Task, Waypoint, solve

from ..errors import InvalidInputError
from ..machines.crane_geometry import apart, reach
from ..machines.crane_limits import COSTS, LEAST_LEVER, joint_limits
from .crane_task import Bounded, crane_task, running_costs, tool_function

Array = NDArray[np.float64]

#: A tool nearer to its goal than this, m, is there.
NOWHERE = 1e-6
#: Extensions of the telescope that a posture is looked for with.
EXTENSIONS = 13


@dataclass(frozen=True, kw_only=True)
class Move:
    """A move to a place, given for the tool or for the joints.

    Attributes:
        tool: Place of the tool, m, shape (2,); the joints are free to share the way. None where `joints` is given.
        joints: Joint coordinates, rad, rad, m, shape (3,).
        via: What it passes without a stop: places of the tool, m, shape (2,), or joint coordinates, shape (3,).
        payload: Mass at the tool, kg, beside the end mass.
    """

    tool: tuple[float, float] | None = None
    joints: tuple[float, float, float] | None = None
    via: tuple[tuple[float, ...], ...] = ()
    payload: float = 0.0

    def __post_init__(self) -> None:
        if (self.tool is None) == (self.joints is None):
            raise InvalidInputError("a move goes to a place of the tool or to joint coordinates: give one of the two")


@dataclass(frozen=True, kw_only=True)
class Job:
    """Moves from rest to rest.

    Attributes:
        start: Joint coordinates at the start, rad, rad, m. Shape (3,).
        moves: The moves, one after the other.
        obstacles: What the tool keeps clear of.
        longest: Longest admissible duration of a move, s.
        least_lever: Shortest admissible lever arm of the actuators of lift and tilt, m/rad.
        bounds: Limits that the job has in place of the crane's, and those of the tool.
    """

    start: tuple[float, float, float]
    moves: tuple[Move, ...]
    obstacles: tuple[Obstacle, ...] = ()
    longest: float = 60.0
    least_lever: float = LEAST_LEVER
    bounds: Bounded = field(default_factory=Bounded)

    def task(self, waypoints: Sequence[Any], payload: float, **options: Any) -> Task:
        """A move of the job as a task."""
        return crane_task(
            waypoints, payload=payload, obstacles=self.obstacles, limits=self.limits, bounds=self.bounds, **options
        )

    @cached_property
    def limits(self) -> MotionLimits:
        """Limits of the joints."""
        own = {name: np.array(v) for name, v in self.bounds.joints.items()}
        return replace(joint_limits(self.least_lever), **own)

    def near(self, place: Sequence[float], at: Array) -> Array:
        """Joint coordinates at a place of the tool, the nearest to given ones of a few extensions.

        Raises:
            LimitViolatedError: no posture was found. Not guaranteed: that there is none.
        """
        low, high = self.limits.room
        middle, span = (low + high) / 2, high - low
        starts = [at, middle, *(middle + 0.3 * span * np.array(turn) for turn in ((1, 1, 0), (1, -1, 0), (-1, 1, 0)))]
        extensions = [float(at[2]), *np.linspace(low[2], high[2], EXTENSIONS)]
        for start in starts:
            tried = [reach(place, float(extension), start) for extension in extensions]
            found = [w for w in tried if w is not None and self.limits.holds(w)]
            if found:
                break
        else:
            raise LimitViolatedError(
                f"no posture with the tool at ({place[0]:g}, {place[1]:g}) m was found; move the place, or give joints"
            )
        return min(found, key=lambda w: float(np.abs(w - at).max()))


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
        """Integrals of electrical power, J, of what is lost of it, J, and of effort, s, over all moves."""
        return dict(zip(COSTS, self._integrals[: len(COSTS)].tolist(), strict=True))

    @cached_property
    def efficiency(self) -> float | None:
        """Work that the rods do while the motors draw power, over the energy drawn then; None where none is drawn."""
        useful, drawn = self._integrals[len(COSTS) :]
        return float(useful / drawn) if drawn > 0 else None

    @cached_property
    def _integrals(self) -> Array:
        """Over all moves: the running costs, the power at the rods and that drawn, both where it is drawn."""
        from scipy.integrate import trapezoid

        parts = []
        for motion, move in zip(self.motions, self.job.moves, strict=True):
            t = np.linspace(motion.spline.start, motion.spline.end, 4001)
            curves = (motion.spline(t, order).T for order in range(4))
            power, lost, effort = np.array(running_costs(move.payload).map(len(t))(*curves))
            useful = np.where(power > 0, np.maximum(power - lost, 0.0), 0.0)
            parts.append(trapezoid([power, lost, effort, useful, np.maximum(power, 0.0)], t))
        return np.sum(parts, axis=0)


def _going_somewhere(job: Job, move: Move, at: Array) -> None:
    """Refuse a move that ends or passes where the tool is already, or inside an obstacle.

    Raises:
        ValueError: it does.
    """
    if move.joints is not None and not move.via and float(np.abs(np.array(move.joints) - at).max()) < NOWHERE:
        raise ValueError(f"the joints go from one place to another: they are at {list(move.joints)} already")
    places = [*move.via, *([] if move.tool is None else [move.tool])]
    before: Sequence[float] | None = None
    for place in places:
        there = apart(at, place) < NOWHERE if before is None and len(place) == 2 else before == place
        if before is None and len(place) == 3:
            there = float(np.abs(np.array(place) - at).max()) < NOWHERE
        if there:
            what = "tool goes" if len(place) == 2 else "joints go"
            raise ValueError(f"the {what} from one place to another: it is at {list(place)} already")
        before = place
    for place in [place for place in places if len(place) == 2]:
        for obstacle in job.obstacles:
            clear = float(obstacle.clearance(place))
            if clear < 0:
                raise ValueError(
                    f"the tool keeps clear of {obstacle.name}: ({place[0]:g}, {place[1]:g}) m is {-clear:.3g} m inside"
                )


def carried_out(job: Job, cost: Callable[[float], Any], name: str, **options: Any) -> Motions:
    """Each move by itself on one level: where the tool has a place, the joints share the way as costs least.

    Args:
        job: The job.
        cost: The cost for a payload.
        name: Name of the result.
        options: Further entries of `trajectories.Task`.

    Raises:
        InvalidInputError: a move that is none, such as one to the place where the crane is.
        LimitViolatedError: a move that no motion inside the limits makes; the message says which.

    Not guaranteed: that moves chosen one by one are best together.
    """
    motions: list[Motion] = []
    at = np.array(job.start)
    for number, move in enumerate(job.moves, 1):
        try:
            _going_somewhere(job, move, at)
            waypoints: list[Any] = [at]
            last = at
            for place in move.via:
                if len(place) == 3:
                    last = np.array(place)
                    waypoints.append(Waypoint(value=last))
                    continue
                last = job.near(place, last)
                waypoints.append(Waypoint(value=np.array(place), through=tool_function(), near=last))
            if move.tool is not None:
                near = job.near(move.tool, at)
                waypoints.append(Waypoint(value=np.array(move.tool), through=tool_function(), near=near))
            else:
                waypoints.append(np.array(move.joints))
            task = job.task(waypoints, move.payload, cost=cost(move.payload), longest=job.longest, **options)
            motions.append(solve(task))
        except LimitViolatedError as error:
            raise LimitViolatedError(f"move {number}: {error}") from None
        except ValueError as error:
            raise InvalidInputError(f"move {number}: {error}; change the move") from None
        at = motions[-1].spline.coefficients[-1]
    return Motions(name=name, job=job, motions=tuple(motions))
