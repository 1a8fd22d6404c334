"""Optimal motions by direct collocation on B-splines, verified for all t, repaired where they are not inside."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .diagnosis import at_rest, refusal, relaxed
from .guess import Guess, guesses, straight
from .limits import LimitViolatedError, violations
from .nodes import POINTS, TIGHTENING, gauss
from .program import Program, build
from .quantity import Peaks, peaks
from .solver import AGAIN, assembled, bounds, solver_of
from .spline import Spline, clamped_knots
from .task import Cost, Task

Array = NDArray[np.float64]

#: Programs solved at the most until every quantity is inside its limits between the collocation points.
ROUNDS = 8
#: How much further than the excess a limit is tightened where the motion left it.
FORWARD = 1.2
#: A motion longer than this, s, is not searched for.
LONGEST = 1e4


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A solved task.

    Attributes:
        spline: The motion; it respects every limit for all t.
        arrivals: Times at the waypoints after the first, s.
        cost: Value of the weighted cost.
        parts: Integrals that the cost weighs: "time", "jerk", and the task's running costs.
        peaks: Bounds of the quantities for all t; None where there are none.
        rounds: Programs solved until the limits held between the collocation points.
        iterations: Iterations of the solver, all rounds together.
    """

    spline: Spline
    arrivals: tuple[float, ...]
    cost: float
    parts: dict[str, float]
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
    _reject_places(task)
    given = [guess] if guess is not None else list(guesses(task))
    first = _Attempt(task, given[0])
    motion = first.run(begin)
    if motion is not None:
        return motion
    relaxation = relaxed(task, given[0])
    starts = given[1:] if relaxation is None or relaxation.widened else [relaxation.guess, *given[1:]]
    for start in starts:
        motion = _Attempt(task, start).run(begin)
        if motion is not None:
            return motion
    raise refusal(task, relaxation, first.failure, _shortest(task))


def _shortest(task: Task) -> float | None:
    """Duration of the quickest motion inside the limits, s; None where none was found."""
    longer = replace(task, cost=Cost(), duration=None, longest=LONGEST)
    motion = _Attempt(longer, straight(longer)).run(0.0)
    return None if motion is None else motion.parts["time"]


def _reject_places(task: Task) -> None:
    low, high = task.limits.room
    for waypoint in task.waypoints:
        for k, value in enumerate(waypoint.known):
            if not np.isnan(value) and not low[k] <= value <= high[k]:
                name, unit = f"{task.limits.names[k]} position".strip(), task.limits.units[k]
                raise LimitViolatedError(
                    f"{name} {value:g} {unit} leaves the stroke {low[k]:g}…{high[k]:g} {unit}; move the waypoint"
                )
    for which, waypoint in (("start", task.waypoints[0]), ("goal", task.waypoints[-1])):
        if not np.isnan(waypoint.known).any():
            over = at_rest(task, waypoint.known)
            if over:
                raise LimitViolatedError(f"no motion: at rest at the {which}, {over}")


class _Attempt:
    """One search from one guess."""

    def __init__(self, task: Task, start: Guess) -> None:
        self.task, self.start = task, start
        self.iterations = 0
        self.failure = ""

    def run(self, begin: float) -> Motion | None:
        task = self.task
        program = build(task, 1.0 / max(_first_cost(task, self.start), 1e-12))
        solver = solver_of(program)
        x = program.shape.packed(list(self.start.points), self.start.durations)
        upper, lower = program.upper.copy(), program.lower.copy()
        known: dict[str, Any] = {}
        again = None
        for rounds in range(1, ROUNDS + 1):
            answer = solver(x0=x, lbg=lower, ubg=upper, **bounds(task, program, self.start), **known)
            self.iterations += solver.stats()["iter_count"]
            x = np.array(answer["x"]).ravel()
            if not solver.stats()["success"]:
                self.failure = str(solver.stats()["return_status"])
                return None
            spline, arrivals = assembled(task, program.shape, x, begin)
            found = peaks(spline, task.quantities) if task.quantities is not None else None
            if not violations(spline, task.limits) and (found is None or found.inside):
                return self._motion(spline, arrivals, found, rounds)
            self.failure = "limits between the collocation points"
            if found is not None:
                _tighten(task, program, found, lower, upper)
            solver = again = again or solver_of(program, **AGAIN)
            known = {"lam_x0": answer["lam_x"], "lam_g0": answer["lam_g"]}
        return None

    def _motion(self, spline: Spline, arrivals: tuple[float, ...], found: Peaks | None, rounds: int) -> Motion:
        parts = integrals(self.task, spline)
        weights = {"time": self.task.cost.time, "jerk": self.task.cost.jerk}
        weights |= dict(zip(self.task.cost.names, self.task.cost.weights, strict=True))
        return Motion(
            spline=spline, arrivals=arrivals, cost=sum(weights[name] * value for name, value in parts.items()),
            parts=parts, peaks=found, rounds=rounds, iterations=self.iterations,
        )  # fmt: skip


def integrals(task: Task, spline: Spline) -> dict[str, float]:
    """Duration, integral of the squared jerk, and integrals of the running costs, by Gauss points in every span."""
    edges = np.unique(spline.knots)
    local, weights = gauss(1)
    times = (edges[:-1, None] + np.diff(edges)[:, None] * local).ravel()
    shares = (np.diff(edges)[:, None] * weights).ravel()
    jerk = spline(times, 3).reshape(len(times), -1) if spline.degree >= 3 else np.zeros((len(times), 1))
    found = {"time": spline.end - spline.start, "jerk": float(shares @ (jerk**2).sum(axis=1))}
    if task.cost.running is not None:
        curves = [spline(times, order).reshape(len(times), -1).T for order in range(4)]
        values = np.array(task.cost.running.map(len(times))(*curves))
        found |= {name: float(shares @ row) for name, row in zip(task.cost.names, values, strict=True)}
    return found


def _first_cost(task: Task, start: Guess) -> float:
    """Size of the cost at the guess."""
    knots = [clamped_knots(0.0, float(t), task.spans, task.degree) for t in start.durations]
    total = 0.0
    for own, coefficients in zip(knots, start.points, strict=True):
        parts = integrals(task, Spline(knots=own, coefficients=coefficients))
        weights = {"time": task.cost.time, "jerk": task.cost.jerk}
        weights |= dict(zip(task.cost.names, task.cost.weights, strict=True))
        total += sum(weights[name] * abs(value) for name, value in parts.items())
    return total


def _tighten(task: Task, program: Program, found: Peaks, lower: Array, upper: Array) -> None:
    """Move the limits of a quantity inwards at the points of the spans where it is outside."""
    given = task.quantities
    assert given is not None
    kept = np.flatnonzero(np.isfinite(given.lower) | np.isfinite(given.upper))
    excess = FORWARD * found.excess / given.scale[:, None] + np.where(found.excess > 0, TIGHTENING, 0.0)
    beside = np.pad(excess, ((0, 0), (1, 1)))
    excess = np.maximum(excess, np.maximum(beside[:, :-2], beside[:, 2:]) / 2)[kept]
    phases = np.split(excess, task.phases, axis=1)
    # each phase: its first point, those of its spans, its last point; rest at an end leaves nothing to move
    per_node = [np.pad(np.repeat(own, POINTS, axis=1), ((0, 0), (1, 1))) for own in phases]
    change = np.concatenate(per_node, axis=1).T.ravel()
    upper[-change.size :] -= change
    lower[-change.size :] += change
