"""Pareto sets: candidates that no other one beats in every objective."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..comparison import Outcome
from ..population import Evaluate, Population
from .jaya import move

Array = NDArray[np.float64]


def dominates(one: Sequence[float], other: Sequence[float]) -> bool:
    """Nowhere worse, somewhere better."""
    return all(a <= b for a, b in zip(one, other, strict=True)) and tuple(one) != tuple(other)


def front(outcomes: Sequence[Outcome]) -> list[int]:
    """Indices of the feasible outcomes that none dominates, in the order of the first objective."""
    feasible = [i for i, outcome in enumerate(outcomes) if outcome.feasible and np.isfinite(outcome.cost)]
    best = [i for i in feasible if not any(dominates(outcomes[j].objectives, outcomes[i].objectives) for j in feasible)]
    return sorted(best, key=lambda i: outcomes[i].objectives)


def pareto_jaya(evaluate: Evaluate, state: Population) -> Population:
    """One iteration of multi-objective JAYA: the best and the worst of the moves are taken by front and crowding.

    Candidates and their rivals are sorted together, feasible before infeasible, by front, then by crowding distance;
    the better half goes on.

    References:
        R. V. Rao, D. P. Rai and J. Balic (2017), Engineering Applications of Artificial Intelligence 60, 60-75;
        crowding distance: K. Deb et al. (2002), IEEE Transactions on Evolutionary Computation 6, 182-197.
    """
    random, x = state.generator(), state.points
    order = crowded_order(state.outcomes)
    best, worst = x[order[0]], x[order[-1]]
    trial = np.clip(move(random, x, best, worst), 0.0, 1.0)
    rivals = evaluate(list(trial))
    points, outcomes = np.vstack([x, trial]), (*state.outcomes, *rivals)
    kept = crowded_order(outcomes)[: len(x)]
    return replace(
        state, iteration=state.iteration + 1, points=points[kept], outcomes=tuple(outcomes[i] for i in kept),
        random=dict(random.bit_generator.state), evaluations=state.evaluations + len(trial),
        runs=state.runs + sum(o.runs for o in rivals),
    )  # fmt: skip


def crowded_order(outcomes: Sequence[Outcome]) -> list[int]:
    """Indices from the best to the worst: front by front, the loneliest of a front first, then the infeasible."""
    left = [i for i, outcome in enumerate(outcomes) if outcome.feasible and np.isfinite(outcome.cost)]
    rest = [i for i in range(len(outcomes)) if i not in left]
    order: list[int] = []
    while left:
        chosen = [left[i] for i in front([outcomes[j] for j in left])]
        lonely = _crowding(np.array([outcomes[i].objectives for i in chosen]))
        order += [chosen[i] for i in np.argsort(-lonely, kind="stable")]
        left = [i for i in left if i not in chosen]
    return order + sorted(rest, key=lambda i: outcomes[i].rank())


def _crowding(values: Array) -> Array:
    """Sum over the objectives of the distance between a point's neighbours, infinite at the ends. Shape (p,)."""
    distance = np.zeros(len(values))
    for column in values.T:
        order = np.argsort(column, kind="stable")
        distance[order[[0, -1]]] = np.inf
        span = column[order[-1]] - column[order[0]]
        if span > 0:
            distance[order[1:-1]] += (column[order[2:]] - column[order[:-2]]) / span
    return distance
