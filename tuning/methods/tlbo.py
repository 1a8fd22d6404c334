"""Teaching-learning-based optimisation (TLBO) as published: no algorithm parameters, greedy acceptance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..population import Evaluate, Population, greedy


def tlbo(evaluate: Evaluate, state: Population) -> Population:
    """One iteration: the teacher's phase, then the learners' phase; two evaluations a candidate.

    Teacher: ``x + r (best - T mean)`` with T = 1 or 2 at random. Learner i meets another j: ``x_i + r (x_i - x_j)``
    where i is better, else ``x_i + r (x_j - x_i)``. All learners meet the population as the teacher left it, so that
    they can be evaluated together; the publication goes through them one after the other.

    References:
        R. V. Rao, V. J. Savsani and D. P. Vakharia (2011), Computer-Aided Design 43, 303-315, section 3.
    """
    random, x = state.generator(), state.points
    count = len(x)
    factor = random.integers(1, 3)
    difference = random.uniform(size=x.shape[1]) * (x[state.best] - factor * x.mean(axis=0))
    state = greedy(evaluate, state, x + difference, random)
    x = state.points
    other = (np.arange(count) + random.integers(1, count, count)) % count
    ranks = [outcome.rank() for outcome in state.outcomes]
    ahead = np.array([1.0 if ranks[i] < ranks[j] else -1.0 for i, j in enumerate(other)])
    trial = x + random.uniform(size=x.shape) * ahead[:, None] * (x - x[other])
    return replace(greedy(evaluate, state, trial, random), iteration=state.iteration + 1)
