"""Two levels of a motion: a leader moves the actuators to efficient operating points, a follower moves the machine.

    leader:    minimise the energy lost in motors, gears and screws over the whole job,
               over the duration of each move and the telescope's share in reaching each place of the tool
    follower:  for what the leader says, the smoothest motion, ∫ Σ jerk² dt, inside every limit

The energy-optimal motion of one level bounds from below what the leader can reach, up to local optima; the leader
starts from it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajectories import LimitViolatedError, Motion, Waypoint, solve

from .crane_task import COSTS, crane_cost, crane_task, joint_limits, running_costs, tool_function
from .errors import InvalidInputError
from .plants.crane import reach

Array = NDArray[np.float64]

#: Size of the leader's first steps, as a share of its ranges.
STEP = 0.08


@dataclass(frozen=True, kw_only=True)
class Job:
    """Moves from rest to rest between places of the tool.

    Attributes:
        start: Joint coordinates at the start, rad, rad, m. Shape (3,).
        places: Places of the tool after each move, m. Shape (moves, 2).
        payloads: Mass at the tool in each move, kg. Shape (moves,).
        longest: Longest admissible duration of a move, s.
        least_lever: Shortest admissible lever arm of the actuators of lift and tilt, m/rad.
    """

    start: tuple[float, float, float]
    places: tuple[tuple[float, float], ...]
    payloads: tuple[float, ...]
    longest: float
    least_lever: float

    def __post_init__(self) -> None:
        if not 1 <= len(self.places) == len(self.payloads):
            raise InvalidInputError(
                f"a job needs a payload for each place: got {len(self.payloads)} and {len(self.places)}; list as many"
            )


@dataclass(frozen=True, kw_only=True)
class Motions:
    """The motions of a job.

    Attributes:
        name: How they were chosen.
        motions: One for each move.
        payloads: Mass at the tool in each, kg.
    """

    name: str
    motions: tuple[Motion, ...]
    payloads: tuple[float, ...]

    @property
    def duration(self) -> float:
        """Time of all moves, s."""
        return sum(motion.parts["time"] for motion in self.motions)

    @cached_property
    def totals(self) -> dict[str, float]:
        """Integrals of electrical power, J, of what is lost of it, J, and of effort, s, over all moves."""
        return {name: sum(motion.parts[name] for motion in self.motions) for name in COSTS}

    @cached_property
    def efficiency(self) -> float:
        """Work that leaves the rods where they drive, over the energy that the motors draw then."""
        useful = drawn = 0.0
        for motion, payload in zip(self.motions, self.payloads, strict=True):
            t = np.linspace(motion.spline.start, motion.spline.end, 2001)
            curves = [motion.spline(t, order).T for order in range(4)]
            power, lost, _ = np.array(running_costs(payload).map(len(t))(*curves))
            useful += float(np.trapezoid(np.maximum(power - lost, 0.0), t))
            drawn += float(np.trapezoid(np.maximum(power, 0.0), t))
        return useful / drawn


@dataclass(frozen=True, kw_only=True)
class Bilevel:
    """The four references of a job, and how the leader's search went.

    Attributes:
        references: "time-optimal", "effort-optimal", "energy-optimal", each on one level, and "leader and follower".
        evaluations: Follower problems that the leader had solved.
        history: Lost energy, J, of the best decision after each evaluation.
    """

    references: tuple[Motions, ...]
    evaluations: int
    history: tuple[float, ...]


def bilevel(job: Job, evaluations: int = 40, tick: Callable[[int, int, float], None] | None = None) -> Bilevel:
    """Solve a job on two levels, and by three single-level programs to compare with.

    Args:
        job: The job.
        evaluations: Decisions of the leader to try, at the most.
        tick: Called with the number of decisions tried, their budget, and the best lost energy, J.

    Returns:
        The references.

    Raises:
        LimitViolatedError: a move that no motion inside the limits makes.

    References:
        Heydari Shahna (2025), publication P-14, for the division into leader and follower; J. A. Nelder and R. Mead
        (1965), The Computer Journal 7, 308-313, for the leader's search; S. Dempe (2002), Foundations of Bilevel
        Programming, ch. 1.

    Not guaranteed: global optimality, on either level. Every motion of the result is inside its limits for all t.
    """
    quickest = _free(job, crane_cost_of(time=1.0), "time-optimal")
    easiest = _free(job, crane_cost_of(time=0.0, effort=1.0), "effort-optimal")
    frugal = _free(job, crane_cost_of(time=0.0, loss=1e-3), "energy-optimal")
    led, tried, history = _lead(job, frugal, evaluations, tick)
    return Bilevel(references=(quickest, easiest, frugal, led), evaluations=tried, history=tuple(history))


def crane_cost_of(**weights: float) -> Callable[[float], Any]:
    """The cost for a payload."""
    return lambda payload: crane_cost(payload=payload, **weights)


def _free(job: Job, cost: Callable[[float], Any], name: str) -> Motions:
    """Each move on one level: the tool goes to its place with the joints that cost least."""
    motions: list[Motion] = []
    at = np.array(job.start)
    for place, payload in zip(job.places, job.payloads, strict=True):
        goal = Waypoint(value=np.array(place), through=tool_function(), near=_near(job, place, at))
        motions.append(solve(_task(job, [at, goal], payload, cost=cost(payload), longest=job.longest)))
        at = motions[-1].spline.coefficients[-1]
    return Motions(name=name, motions=tuple(motions), payloads=job.payloads)


def _follower(job: Job, durations: Sequence[float] | Array, ends: Sequence[Array]) -> Motions:
    """The smoothest motions to given joint coordinates in given times."""
    motions = []
    at = np.array(job.start)
    for end, duration, payload in zip(ends, durations, job.payloads, strict=True):
        cost = crane_cost(time=0.0, jerk=1.0, payload=payload)
        motions.append(solve(_task(job, [at, end], payload, cost=cost, duration=float(duration))))
        at = np.asarray(end)
    return Motions(name="leader and follower", motions=tuple(motions), payloads=job.payloads)


def _lead(
    job: Job, start: Motions, evaluations: int, tick: Callable[[int, int, float], None] | None
) -> tuple[Motions, int, list[float]]:
    """The leader's search over durations and extensions, each a share of its range."""
    from scipy.optimize import minimize

    high = joint_limits(job.least_lever).room[1]
    moves = len(job.places)
    best: list[Any] = [np.inf, None]
    history: list[float] = []

    def lost(decision: Array) -> float:
        durations, extensions = job.longest * decision[:moves], high[2] * decision[moves:]
        try:
            ends = [
                _configuration(job, place, w3, motion.spline.coefficients[-1])
                for place, w3, motion in zip(job.places, extensions, start.motions, strict=True)
            ]
            found = _follower(job, durations, ends)
            value = found.totals["loss"]
        except LimitViolatedError:
            found, value = None, np.inf
        if value < best[0]:
            best[:] = [value, found]
        history.append(float(best[0]))
        if tick is not None:
            tick(len(history), evaluations, float(best[0]))
        return min(value, 1e12)

    first = np.array(
        [m.parts["time"] / job.longest for m in start.motions]
        + [m.spline.coefficients[-1][2] / high[2] for m in start.motions]
    )
    first = np.clip(first, 0.02, 1.0)
    simplex = np.stack([first, *(first + STEP * unit * np.where(first > 0.5, -1, 1) for unit in np.eye(len(first)))])
    minimize(
        lost, first, method="Nelder-Mead", bounds=[(0.02, 1.0)] * moves + [(0.0, 1.0)] * moves,
        options={"initial_simplex": simplex, "maxfev": evaluations, "xatol": 1e-3, "fatol": 1e-3},
    )  # fmt: skip
    if best[1] is None:
        raise LimitViolatedError("the leader found no decision that the follower can carry out; allow longer moves")
    return best[1], len(history), history


def _task(job: Job, waypoints: Sequence[Any], payload: float, **options: Any) -> Any:
    return crane_task(waypoints, payload=payload, limits=joint_limits(job.least_lever), **options)


def _near(job: Job, place: Sequence[float], at: Array) -> Array:
    """Joint coordinates at a place of the tool, near given ones."""
    low, high = joint_limits(job.least_lever).room
    best: tuple[float, Array] | None = None
    for w3 in np.linspace(0.1, 0.9, 9) * high[2]:
        found = reach(place, float(w3), at)
        if found is not None and (found >= low).all() and (found <= high).all():
            far = float(np.abs(found - at).max())
            best = (far, found) if best is None or far < best[0] else best
    if best is None:
        raise LimitViolatedError(f"the tool cannot reach ({place[0]:g}, {place[1]:g}) m; move the place")
    return best[1]


def _configuration(job: Job, place: Sequence[float], w3: float, near: Array) -> Array:
    """Joint coordinates at a place of the tool with a given extension."""
    found = reach(place, w3, near)
    low, high = joint_limits(job.least_lever).room
    if found is None or (found < low).any() or (found > high).any():
        raise LimitViolatedError(
            f"the tool cannot reach ({place[0]:g}, {place[1]:g}) m with an extension of {w3:.4g} m; choose another"
        )
    return found
