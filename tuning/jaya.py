"""JAYA as published: no algorithm parameters, greedy acceptance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .population import Evaluate, Population, greedy


def jaya(evaluate: Evaluate, state: Population) -> Population:
    """One iteration: ``x + r1 (best - |x|) - r2 (worst - |x|)``, clipped to the cube, kept only where it is better.

    References:
        R. Venkata Rao (2016), International Journal of Industrial Engineering Computations 7, 19-34, eq. 1.
    """
    random, order, x = state.generator(), state.order, state.points
    best, worst = x[order[0]], x[order[-1]]
    r1, r2 = random.uniform(size=x.shape), random.uniform(size=x.shape)
    trial = x + r1 * (best - np.abs(x)) - r2 * (worst - np.abs(x))
    return replace(greedy(evaluate, state, trial, random), iteration=state.iteration + 1)
