"""Descent inside the proved set along the gradient of the closed-loop cost.

The simulated part of the cost is differentiated exactly, by the differentiated loop. The certified part and the limits,
which come out of a search for a certificate, are differenced.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from stability import Certificate, Failure, Gains
from tuning import Budget, Derivatives, descend

from .axis import KINDS
from .evaluation import certified_cost, cost_scales, cost_scenarios, find, simulated_cost
from .problem import Problem
from .proof import HEADROOM, slacks
from .simulation import Run

Array = NDArray[np.float64]

#: Step of the differences, as a share of a gain's range.
STEP = 1e-3
#: Digits of the gains while they descend.
EXACT = 15


def descent(
    problem: Problem, starts: Sequence[Array], budget: Budget,
    progress: Callable[[int, float], None] = lambda used, cost: None,
) -> tuple[list[Array], int]:  # fmt: skip
    """Minimise the cost of `evaluation.py` from some points of the unit cube.

    Args:
        problem: The study's problem.
        starts: Points to begin from, one after the other. Each shape (d,).
        budget: A point costs one evaluation, its derivatives one more for each gain that is searched: as many
            certificates, and as many runs of the differentiated loop as the gains have directions.
        progress: Called with the evaluations used and the best cost.

    Returns:
        The proved points that were tried, the best first, and the evaluations used.
    """
    return descend(lambda point, want: derivatives(problem, point, want), starts, _count(problem), budget, progress)


def derivatives(problem: Problem, point: Array, wanted: bool) -> Derivatives:
    """Cost and constraints at a point, with their derivatives where wanted."""
    size, count = len(problem.searched), _count(problem)
    nothing = Derivatives(
        cost=math.nan, gradient=np.full(size, math.nan), slacks=np.full(count, math.nan),
        jacobian=np.full((count, size), math.nan), evaluations=1,
    )  # fmt: skip
    gains = problem.gains(point, digits=EXACT)
    found = find(problem, gains)
    if isinstance(found, Failure):
        return nothing
    runs = [Run(gains=gains, scenario=s) for s in cost_scenarios(problem)]
    shown = problem.loop.figures(runs, problem.reference)
    if any(m.diverged for m in shown):
        return nothing
    certified, room = certified_cost(problem, found), _room(problem, found, gains)
    cost = certified + simulated_cost(problem, shown)
    if not wanted:
        return Derivatives(cost=cost, gradient=nothing.gradient, slacks=room, jacobian=nothing.jacobian, evaluations=1)
    # an encoder's rounding has no useful derivative: the slope is that of the loop without it
    smooth = [replace(run, scenario=replace(run.scenario, quantisation=0.0)) for run in runs]
    _, rms, itae = problem.loop.sensitivities(smooth, _directions(problem, gains), problem.reference)
    scales = cost_scales(problem)
    gradient = (scales[0] * rms + scales[1] * itae).sum(axis=0) / max(len(runs), 1)
    jacobian = np.zeros((count, size))
    for i in range(size):
        step = STEP if point[i] + STEP <= 1 else -STEP
        moved_gains = problem.gains(point + step * np.eye(size)[i], digits=EXACT)
        moved = find(problem, moved_gains)
        if isinstance(moved, Certificate):
            gradient[i] += (certified_cost(problem, moved) - certified) / step
            jacobian[:, i] = (_room(problem, moved, moved_gains) - room) / step
    return Derivatives(
        cost=cost, gradient=gradient, slacks=room, jacobian=jacobian,
        evaluations=1 + size,
    )  # fmt: skip


def _directions(problem: Problem, gains: tuple[Gains, ...]) -> Array:
    """What each coordinate of the unit cube does to all gains, in the order of `gain_columns`. Shape (d, 4 k)."""
    rows = len(gains)
    made = np.zeros((len(problem.searched), 4 * rows))
    for direction, index in zip(made, problem.searched, strict=True):
        row, kind = divmod(index, len(KINDS))
        item = problem.ranges[index]
        direction[kind * rows + row] = getattr(gains[row], KINDS[kind]) * math.log(item.high / item.low)
    return made


def _room(problem: Problem, found: Certificate, gains: tuple[Gains, ...]) -> Array:
    """Shares of every limit that the certified set leaves, and what sampled adaptation leaves. Shape (c,)."""
    shares = [1 - size * (1 + HEADROOM) / limit for _, size, limit, _ in slacks(problem, found)]
    return np.array([*shares, *(1 - problem.bounds.period * g.delta * g.sigma for g in gains)])


def _count(problem: Problem) -> int:
    return len(problem.plant.limits) + 2 + len(problem.law.governed)
