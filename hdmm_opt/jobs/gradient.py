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

from stability import Failure
from tuning import Budget, Derivatives, descend

from ..problem import GainSet, Problem
from ..problem.margins import HEADROOM, margins, of_machine
from ..problem.problem import Contracts
from ..simulation import Loop, Run
from .certify import contracts_of
from .evaluation import certified_cost, cost_scales, cost_scenarios, simulated_cost

Array = NDArray[np.float64]

#: Step of the differences, as a share of a gain's range.
STEP = 1e-3
#: Digits of the gains while they descend.
EXACT = 15


def descent(
    loop: Loop, starts: Sequence[Array], budget: Budget,
    progress: Callable[[int, float], None] = lambda used, cost: None,
) -> tuple[list[Array], int]:  # fmt: skip
    """Minimise the cost of `evaluation.py` from some points of the unit cube.

    Args:
        loop: The problem's loop.
        starts: Points to begin from, one after the other. Each shape (d,).
        budget: A point costs one evaluation, its derivatives one more for each gain that is searched: as many
            certificates, and as many runs of the differentiated loop as the gains have directions.
        progress: Called with the evaluations used and the best cost.

    Returns:
        The proved points that were tried, the best first, and the evaluations used.
    """
    count = _count(loop.problem)
    return descend(lambda point, want: derivatives(loop, point, want), starts, count, budget, progress)


def derivatives(loop: Loop, point: Array, wanted: bool) -> Derivatives:
    """Cost and constraints at a point, with their derivatives where wanted."""
    problem, size, count = loop.problem, loop.problem.searched, _count(loop.problem)
    nothing = Derivatives(
        cost=math.nan, gradient=np.full(size, math.nan), slacks=np.full(count, math.nan),
        jacobian=np.full((count, size), math.nan), evaluations=1,
    )  # fmt: skip
    gains = problem.at(point, digits=EXACT)
    found = contracts_of(problem, gains)
    if isinstance(found, Failure):
        return nothing
    runs = [Run(gains=gains, scenario=s) for s in cost_scenarios(problem)]
    shown = loop.figures(runs)
    if any(m.diverged for m in shown):
        return nothing
    certified, room = certified_cost(problem, found), _room(problem, found, gains)
    cost = certified + simulated_cost(problem, shown)
    if not wanted:
        return Derivatives(cost=cost, gradient=nothing.gradient, slacks=room, jacobian=nothing.jacobian, evaluations=1)
    # neither an encoder's rounding nor a fault has a useful derivative, and a body's loads are not differentiated: the
    # slope is that of the loop without them
    smooth = [replace(run, scenario=replace(run.scenario, quantisation=0.0, faults={}, ground=None)) for run in runs]
    _, rms, itae = loop.sensitivities(smooth, _directions(problem, gains))
    scales = cost_scales(problem)
    gradient = (scales[0] * rms + scales[1] * itae).sum(axis=0) / max(len(runs), 1)
    jacobian = np.zeros((count, size))
    for i in range(size):
        step = STEP if point[i] + STEP <= 1 else -STEP
        moved_gains = problem.at(point + step * np.eye(size)[i], digits=EXACT)
        moved = contracts_of(problem, moved_gains)
        if not isinstance(moved, Failure):
            gradient[i] += (certified_cost(problem, moved) - certified) / step
            jacobian[:, i] = (_room(problem, moved, moved_gains) - room) / step
    return Derivatives(cost=cost, gradient=gradient, slacks=room, jacobian=jacobian, evaluations=1 + size)


def _directions(problem: Problem, gains: GainSet) -> Array:
    """What each coordinate of the unit cube does to all gains, member by member. Shape (d, gains)."""
    made = np.zeros((problem.searched, sum(len(values) for values in gains.values())))
    sizes = [len(values) for values in gains.values()]
    begins = dict(zip(gains, np.cumsum([0, *sizes[:-1]]), strict=True))
    row = 0
    for group in problem.groups:
        for index in group[0].searched:
            for member in group:
                item = member.ranges[index]
                made[row, begins[member.name] + index] = gains[member.name][index] * math.log(item.high / item.low)
            row += 1
    return made


def _room(problem: Problem, found: Contracts, gains: GainSet) -> Array:
    """Shares of every limit that the certified set leaves, and what sampled adaptation leaves. Shape (c,)."""
    shares = [1 - m.share * (1 + HEADROOM) for m in margins(problem, found)]
    late = [
        1 - member.bounds.period * g.delta * g.sigma
        for member in problem.members for g in member.gains(gains[member.name])
    ]  # fmt: skip
    return np.array([*shares, *late])


def _count(problem: Problem) -> int:
    of_members = sum(len(m.plant.limits) + 2 + len(m.law.controlled) for m in problem.members)
    return of_members + of_machine(problem)
