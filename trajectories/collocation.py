"""Optimal motions by direct collocation on B-splines, verified for all t, repaired where they are not inside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .diagnosis import Relaxation, refusal, reject_places, relaxed
from .guess import Guess, guesses, straight
from .limits import violations
from .nodes import POINTS, TIGHTENING, gauss
from .program import Program, build
from .quantity import Peaks, Quantities, peaks
from .solver import AGAIN, ELSEWHERE, FLOOR, HURRY, NEAR, assembled, bounds, solver_of
from .spline import Spline, clamped_knots
from .task import Cost, Task

Array = NDArray[np.float64]

#: Programs solved at the most until every quantity is inside its limits between the collocation points.
ROUNDS = 8
#: How much further than the excess a limit is tightened where the motion left it.
FORWARD = 1.2
#: A limit is tightened by no more than this share in a round.
LARGEST = 0.1
#: No limit of a quantity is tightened past the middle of its band, less this share.
NARROWEST = 1e-6
#: How often a search that ends at the shortest admitted duration goes on below it.
FLOORS = 5
#: Factors on the widening of limits that are tried, to find one of which it is true that it would do.
GROWTHS = (1.0, 1.5, 3.0, 8.0)
#: A motion longer than this, s, is not searched for.
LONGEST = 1e4
#: Where a search ends at this share of the longest admitted duration, the quickest motion is looked for first; where
#: that takes so many times the admitted duration, no other start is tried.
AT_THE_END, FAR_LONGER = 0.9, 1.2
#: CPU time for finding out why there is no motion, s.
PATIENCE = 6.0
#: No other start is tried once the solver has taken so many iterations.
ITERATIONS = 250


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A solved task.

    Attributes:
        spline: The motion; it respects every limit for all t.
        arrivals: Times at the waypoints after the first, s.
        cost: Value of the weighted cost.
        parts: Integrals that the cost weighs: "time", "jerk", and the task's running costs.
        quantities: What else was limited; None for nothing.
        peaks: Bounds of the quantities for all t; None where there are none.
        rounds: Programs solved until the limits held between the collocation points.
        iterations: Iterations of the solver, all rounds together.
    """

    spline: Spline
    arrivals: tuple[float, ...]
    cost: float
    parts: dict[str, float]
    quantities: Quantities | None
    peaks: Peaks | None
    rounds: int
    iterations: int


def solve(task: Task, begin: float = 0.0, guess: Guess | None = None) -> Motion:
    """Solve a task and verify the motion for all t; tighten limits that it leaves between the points, and solve again.

    Args:
        task: The task.
        begin: Time of the first knot, s.
        guess: Where the search starts; by default straight lines between the waypoints, and bent ones if that fails.

    Returns:
        The motion.

    Raises:
        LimitViolatedError: no motion inside the limits was found. The message says which limit, where, by how much,
            and what would do.

    References:
        C. R. Hargraves and S. W. Paris (1987), Journal of Guidance 10, 338-342 (direct collocation); C. de Boor
        (1978), A Practical Guide to Splines, ch. X and XI.

    Not guaranteed: global optimality. A bound by control points is conservative by the distance between polygon and
    curve, which falls with the square of the number of spans.
    """
    reject_places(task)
    starts = guesses(task) if guess is None else iter([guess])
    first = _Attempt(task, next(starts))
    motion = first.run()
    if motion is not None:
        return _from(motion, begin)
    clock = _Clock(PATIENCE)
    shortest = _shortest(task, clock) if first.share > AT_THE_END else None
    hopeless = shortest is not None and shortest > FAR_LONGER * task.longest
    late = hopeless and clock.left < 0
    relaxation = None if late else relaxed(task, first.start, HURRY if hopeless else ())
    if not hopeless:
        known = [] if relaxation is None or relaxation.widened else [relaxation.guess]
        motion = _elsewhere(task, (*known, *starts), first.iterations)
        if motion is not None:
            return _from(motion, begin)
        clock = _Clock(PATIENCE)
    crowded = relaxation is not None and relaxation.crowded
    raise refusal(task, _reasons(task, relaxation, clock), first.failure, shortest, crowded=crowded)


def _elsewhere(task: Task, starts: tuple[Guess, ...], iterations: int) -> Motion | None:
    """The first motion found from other starts."""
    for start in starts:
        if iterations > ITERATIONS:
            return None
        attempt = _Attempt(task, start, options=ELSEWHERE)
        motion = attempt.run()
        if motion is not None:
            return motion
        iterations += attempt.iterations
    return None


class _Clock:
    """CPU time that is left, s."""

    def __init__(self, seconds: float) -> None:
        self.end = process_time() + seconds

    @property
    def left(self) -> float:
        return self.end - process_time()


def _from(motion: Motion, begin: float) -> Motion:
    """The motion, found from time 0, at its time: the knots alone move."""
    spline = Spline(knots=begin + motion.spline.knots, coefficients=motion.spline.coefficients)
    return replace(motion, spline=spline, arrivals=tuple(begin + t for t in motion.arrivals))


def _reasons(task: Task, relaxation: Relaxation | None, clock: _Clock) -> str:
    """What has to give way, and wider limits with which a motion was found and verified."""
    if relaxation is None or not relaxation.widened:
        return ""
    for growth in () if relaxation.crowded else GROWTHS:
        if clock.left > 0 and _Attempt(relaxation.task(task, growth), relaxation.guess, clock).run() is not None:
            return relaxation.text(growth)
    return relaxation.text(None)


def _shortest(task: Task, clock: _Clock) -> float | None:
    """Duration of the quickest motion inside the limits, s; None where none was found in the time that is left."""
    longer = replace(task, cost=Cost(), duration=None, longest=LONGEST)
    motion = _Attempt(longer, straight(longer), clock).run()
    return None if motion is None else motion.parts["time"]


class _Attempt:
    """One search from one guess, with a clock in the CPU time that is left."""

    def __init__(
        self, task: Task, start: Guess, clock: _Clock | None = None, options: tuple[tuple[str, Any], ...] = ()
    ) -> None:
        self.task, self.start, self.clock = task, start, clock
        self.options = options if clock is None else HURRY
        self.iterations = 0
        self.failure = ""
        self.share = 0.0  # of the longest admitted duration, where the last search ended

    def run(self) -> Motion | None:
        """The motion from time 0; None where none was found, and `failure` says why."""
        task, start = self.task, self.start
        for _ in range(FLOORS):
            motion, floored = self._rounds(start)
            if not floored:
                return motion
            # the search ended at the shortest duration that it admits: go on below it
            start = Guess(points=start.points, durations=start.durations * FLOOR)
        self.failure = f"nothing that is limited keeps the motion from taking no time, of {task.longest:g} s"
        return None

    def _rounds(self, start: Guess) -> tuple[Motion | None, bool]:
        """Solve, verify and tighten; and whether a duration ended at its lower bound."""
        task = self.task
        size = _first_cost(task, start)
        program, scale = build(task), 1.0 / size if size > 0 else 1.0
        solver = solver_of(program, (*self.options, *(NEAR if start.near else ())))
        x = program.shape.packed(list(start.points), start.durations)
        lower, upper = program.rows(task)
        known: dict[str, Any] = {}
        for rounds in range(1, ROUNDS + 1):
            if self.clock is not None and self.clock.left < 0:
                return None, False
            answer = solver(x0=x, p=scale, lbg=lower, ubg=upper, **bounds(task, program, start), **known)
            self.iterations += solver.stats()["iter_count"]
            x = np.array(answer["x"]).ravel()
            durations = program.shape.unpacked(x)[1]
            self.share = durations.sum() / task.longest if task.duration is None else 1.0
            if not solver.stats()["success"]:
                self.failure = str(solver.stats()["return_status"])
                return None, False
            if task.duration is None and (durations < 1.5 * FLOOR * start.durations).any():
                return None, True
            spline, arrivals = assembled(task, program.shape, x)
            found = peaks(spline, task.quantities) if task.quantities is not None else None
            broken = violations(spline, task.limits)
            if not broken and (found is None or found.inside):
                return self._motion(spline, arrivals, found, rounds), False
            self.failure = "; ".join(broken) or "a quantity outside its limits between the collocation points"
            if found is None or found.inside:
                return None, False
            _tighten(task, program, found, lower, upper)
            solver = solver_of(program, (*self.options, *AGAIN))
            known = {"lam_x0": answer["lam_x"], "lam_g0": answer["lam_g"]}
        return None, False

    def _motion(self, spline: Spline, arrivals: tuple[float, ...], found: Peaks | None, rounds: int) -> Motion:
        return motion_of(self.task, spline, arrivals, found, rounds=rounds, iterations=self.iterations)


def motion_of(
    task: Task, spline: Spline, arrivals: tuple[float, ...], found: Peaks | None, *, rounds: int = 0,
    iterations: int = 0,
) -> Motion:  # fmt: skip
    """A motion of a task, with what it costs."""
    parts = integrals(task, spline)
    return Motion(
        spline=spline, arrivals=arrivals, cost=task.cost.value(parts), parts=parts, quantities=task.quantities,
        peaks=found, rounds=rounds, iterations=iterations,
    )  # fmt: skip


def integrals(task: Task, spline: Spline) -> dict[str, float]:
    """Duration, integral of the squared jerk, and integrals of the running costs, by Gauss points in every span."""
    edges = np.unique(spline.knots)
    local, weights = gauss(1)
    times = (edges[:-1, None] + np.diff(edges)[:, None] * local).ravel()
    shares = (np.diff(edges)[:, None] * weights).ravel()
    curves = spline.curves(times)
    found = {"time": spline.end - spline.start, "jerk": float(shares @ (curves[3] ** 2).sum(axis=1))}
    if task.cost.running is not None:
        values = np.array(task.cost.running.map(len(times))(*(curve.T for curve in curves)))
        found |= {name: float(shares @ row) for name, row in zip(task.cost.names, values, strict=True)}
    return found


def _first_cost(task: Task, start: Guess) -> float:
    """Size of the cost at the guess."""
    knots = [clamped_knots(0.0, float(t), task.spans, task.degree) for t in start.durations]
    total = 0.0
    for own, coefficients in zip(knots, start.points, strict=True):
        parts = integrals(task, Spline(knots=own, coefficients=coefficients))
        total += task.cost.value({name: abs(value) for name, value in parts.items()})
    return total


def _tighten(task: Task, program: Program, found: Peaks, lower: Array, upper: Array) -> None:
    """Move the limits of a quantity inwards at the points of the spans where it is outside."""
    given = task.quantities
    assert given is not None
    kept = np.flatnonzero(np.isfinite(given.lower) | np.isfinite(given.upper))
    count = program.nodes * len(kept)
    low, high = (
        _per_node(task, outside / given.scale[:, None])[kept].T.ravel() for outside in (found.under, found.over)
    )
    if count:
        middle = (lower[-count:] + upper[-count:]) / 2  # infinite where one side is free
        lower[-count:] = np.minimum(lower[-count:] + low, np.where(np.isfinite(middle), middle - NARROWEST, np.inf))
        upper[-count:] = np.maximum(upper[-count:] - high, np.where(np.isfinite(middle), middle + NARROWEST, -np.inf))


def _per_node(task: Task, outside: Array) -> Array:
    """How far to tighten at each point: a little more than a span's excess, half of it in its neighbours."""
    change = FORWARD * np.minimum(outside, LARGEST) + np.where(outside > 0, TIGHTENING, 0.0)
    beside = np.pad(change, ((0, 0), (1, 1)))
    change = np.maximum(change, np.maximum(beside[:, :-2], beside[:, 2:]) / 2)
    # the ends of a phase stay: at rest they were checked before
    parts = [np.pad(np.repeat(own, POINTS, axis=1), ((0, 0), (1, 1))) for own in np.split(change, task.phases, axis=1)]
    return np.concatenate(parts, axis=1)
