"""Minimum-time and minimum-energy motions of one axis by direct collocation on a B-spline."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .limits import Enclosure, LimitViolatedError, MotionLimits, effort_peaks
from .quintic import quintic, shortest_duration
from .spline import DEGREE, Spline, clamped_knots

Array = NDArray[np.float64]

OBJECTIVES = ("time", "energy")
#: Collocation points in each span at which the effort limits are imposed.
POINTS = 3
#: A motion longer than this, s, is not searched for.
LONGEST = 1e4
#: Every limit is kept smaller by this share in the program, so that what the solver's tolerance leaves is inside.
TIGHTENING = 1e-4


@dataclass(frozen=True, kw_only=True)
class Task:
    """A rest-to-rest move of one axis.

    Attributes:
        start: First position, m.
        goal: Last position, m.
        limits: Limits of the motion; they hold for all t.
        effort: CasADi function (x, x', x'', x''') -> column of effort quantities, and the running cost as its second
            output (W or (N m)²; for the energy objective).
        effort_names: Name and unit of each effort quantity.
        effort_limits: Largest value of each effort quantity.
        enclose: Upper bounds of the effort quantities over ranges, to verify them between collocation points.
        objective: "time" or "energy".
        longest: Longest admissible duration, s; the fixed duration of the energy objective.
        spans: Number of spline spans.
    """

    start: float
    goal: float
    limits: MotionLimits
    effort: Any
    effort_names: tuple[str, ...]
    effort_limits: tuple[float, ...]
    enclose: Enclosure
    objective: str = "time"
    longest: float = 60.0
    spans: int = 24


@dataclass(frozen=True, kw_only=True)
class Motion:
    """A solved move.

    Attributes:
        spline: The motion; respects every limit for all t.
        cost: Value of the objective, s or the integral of the running cost.
        effort_peaks: Proved upper bounds on the effort quantities.
        rounds: Programs solved until the effort limits held between the collocation points.
    """

    spline: Spline
    cost: float
    effort_peaks: tuple[float, ...]
    rounds: int


def solve(task: Task, begin: float = 0.0) -> Motion:
    """Solve a move and verify it for all t; tighten the effort limits and solve again where it is not inside.

    Args:
        task: The move.
        begin: Time of the first knot, s.

    Returns:
        The motion.

    Raises:
        LimitViolatedError: no motion inside the limits was found.

    Not guaranteed: global optimality.
    """
    low, high = task.limits.position
    for point in (task.start, task.goal):
        if not low <= point <= high:
            raise LimitViolatedError(f"position {point:g} m leaves the stroke {low:g}…{high:g} m; move the waypoint")
    share = 1.0
    peaks: list[float] = []
    for rounds in range(1, 6):
        unit, duration, cost = _program(task, share)
        spline = Spline(knots=begin + duration * clamped_knots(0.0, 1.0, task.spans), coefficients=unit)
        peaks = effort_peaks(spline, task.enclose, task.effort_limits)
        if all(peak <= limit for peak, limit in zip(peaks, task.effort_limits, strict=True)):
            return Motion(spline=spline, cost=cost, effort_peaks=tuple(peaks), rounds=rounds)
        share *= 0.999 / max(peak / limit for peak, limit in zip(peaks, task.effort_limits, strict=True))
    worst = int(np.argmax(np.array(peaks) / np.array(task.effort_limits)))
    raise LimitViolatedError(
        f"{task.effort_names[worst]} cannot be kept under {task.effort_limits[worst]:g} between the knots: "
        f"{peaks[worst]:.4g} remained; raise the limit or use more spans"
    )


def derivative_matrices(spans: int) -> list[Array]:
    """Maps from control points to the control points of derivatives 0…3, on unit time."""
    knots = clamped_knots(0.0, 1.0, spans)
    maps = [np.eye(len(knots) - DEGREE - 1)]
    for degree in range(DEGREE, DEGREE - 3, -1):
        step = np.diff(np.eye(len(maps[-1])), axis=0)
        maps.append((degree / (knots[degree + 1 : -1] - knots[1 : -degree - 1]))[:, None] * step @ maps[-1])
        knots = knots[1:-1]
    return maps


def _basis(spans: int, points: Array) -> list[Array]:
    """Values of the basis and its derivatives at unit times. Four arrays of shape (points, k)."""
    knots = clamped_knots(0.0, 1.0, spans)
    identity = np.eye(len(knots) - DEGREE - 1)
    columns = [Spline(knots=knots, coefficients=row) for row in identity]
    return [np.stack([column(points, order) for column in columns], axis=1) for order in range(4)]


def _program(task: Task, share: float) -> tuple[Array, float, float]:
    import casadi as ca

    limits, count = task.limits, task.spans + DEGREE
    free = ca.MX.sym("c", count - 6)
    duration = ca.MX.sym("T")
    points = ca.vertcat(*[task.start] * 3, free, *[task.goal] * 3)
    maps = derivative_matrices(task.spans)
    constraints, upper = [], []
    for order, limit in ((1, limits.speed), (2, limits.acceleration), (3, limits.jerk)):
        rows = ca.DM(maps[order]) @ points / (limit * (1 - TIGHTENING) * duration**order)
        constraints.append(rows)
        upper += [1.0] * rows.numel()
    nodes, weights = _gauss(task.spans)
    basis = [ca.DM(b) for b in _basis(task.spans, nodes)]
    curves = [(b @ points) / duration**order for order, b in enumerate(basis)]
    mapped = task.effort.map(len(nodes))
    effort, running = mapped(*(curve.T for curve in curves))
    scale = np.array(task.effort_limits) * share * (1 - TIGHTENING)
    constraints.append(ca.vec(effort / ca.repmat(ca.DM(scale), 1, len(nodes))))
    energy = duration * ca.dot(ca.DM(weights), running.T)
    fixed = task.objective == "energy"
    quickest = shortest_duration(task.goal - task.start, limits.speed, limits.acceleration, limits.jerk)
    guess = task.longest if fixed else min(task.longest, 1.5 * quickest)
    lowest, highest = task.limits.position
    starts = _initial(task, count)
    lower_constraints = [-1.0] * len(upper) + [-np.inf] * (len(nodes) * len(scale))
    upper += [1.0] * (len(nodes) * len(scale))
    objective = energy / max(_energy_scale(task, guess, starts, basis, weights), 1e-9) if fixed else duration
    solver = ca.nlpsol(
        "motion", "ipopt",
        {"x": ca.vertcat(free, duration), "f": objective, "g": ca.vertcat(*constraints)},
        {"expand": True, "print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 500}},
    )  # fmt: skip
    answer = solver(
        x0=np.append(starts[3:-3], guess),
        lbx=[lowest] * (count - 6) + [task.longest if fixed else min(0.05 * quickest, 0.5 * task.longest)],
        ubx=[highest] * (count - 6) + [task.longest],
        lbg=lower_constraints,
        ubg=upper,
    )
    values = np.array(answer["x"]).ravel()
    names = ["speed", "acceleration", "jerk", *task.effort_names]
    _refuse(solver, np.array(answer["g"]).ravel(), np.array(upper), names, [len(m) for m in maps[1:]], len(scale), task)
    coefficients = np.concatenate([[task.start] * 3, np.clip(values[:-1], lowest, highest), [task.goal] * 3])
    cost = (
        float(values[-1])
        if not fixed
        else float(answer["f"]) * max(_energy_scale(task, guess, starts, basis, weights), 1e-9)
    )
    return coefficients, float(values[-1]), cost


def _refuse(
    solver: Any, values: Array, upper: Array, names: list[str], counts: list[int], efforts: int, task: Task
) -> None:
    """Raise with the most violated limit unless every constraint of the program holds."""
    excess, motion = values - upper, sum(counts)
    excess[:motion] = np.abs(values[:motion]) - 1.0
    if solver.stats()["success"] and excess.max() <= TIGHTENING:
        return
    if task.longest < LONGEST:
        shortest = _shortest(task)
        if shortest is not None and shortest > task.longest:
            raise LimitViolatedError(
                f"no motion from {task.start:g} to {task.goal:g} m within {task.longest:g} s respects the limits; "
                f"{1.001 * shortest:.4g} s would do"
            )
    worst = int(excess.argmax())
    which = (
        int(np.searchsorted(np.cumsum(counts), worst, side="right"))
        if worst < motion
        else 3 + (worst - motion) % efforts
    )
    raise LimitViolatedError(
        f"no motion from {task.start:g} to {task.goal:g} m within {task.longest:g} s respects the limits: "
        f"{names[which]} would be {100 * max(excess[worst], 0.0):.3g} % over its limit; "
        f"allow more time or raise the {names[which]} limit"
    )


def _shortest(task: Task) -> float | None:
    """Duration of the quickest motion inside the limits, s; None where there is none."""
    try:
        return solve(replace(task, objective="time", longest=LONGEST)).spline.end
    except LimitViolatedError:
        return None


def _initial(task: Task, count: int) -> Array:
    """Control points of a quintic move as the first guess."""
    from scipy.interpolate import make_lsq_spline

    move = quintic(task.start, task.goal, 0.0, 1.0)
    times = np.linspace(0.0, 1.0, 8 * count)
    fitted = make_lsq_spline(times, move(times), clamped_knots(0.0, 1.0, task.spans), DEGREE)
    return np.asarray(fitted.c)


def _gauss(spans: int) -> tuple[Array, Array]:
    """Gauss-Legendre points and weights in each span, on unit time."""
    local, weight = np.polynomial.legendre.leggauss(POINTS)
    starts = np.arange(spans)[:, None]
    return ((starts + (local + 1) / 2) / spans).ravel(), np.tile(weight / (2 * spans), spans)


def _energy_scale(task: Task, duration: float, points: Array, basis: list[Any], weights: Array) -> float:
    curves = [np.asarray(b) @ points / duration**order for order, b in enumerate(basis)]
    running = np.array(task.effort.map(len(weights))(*(curve[None, :] for curve in curves))[1]).ravel()
    return float(duration * abs(weights @ running))
