"""JAYA as published: no algorithm parameters, greedy acceptance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..population import Evaluate, Population, greedy

Array = NDArray[np.float64]


def jaya(evaluate: Evaluate, state: Population) -> Population:
    """One iteration: ``x + r1 (best - |x|) - r2 (worst - |x|)``, clipped to the cube, kept only where it is better.

    References:
        R. Venkata Rao (2016), International Journal of Industrial Engineering Computations 7, 19-34, eq. 1.
    """
    random, order, x = state.generator(), state.order, state.points
    best, worst = x[order[0]], x[order[-1]]
    return replace(greedy(evaluate, state, move(random, x, best, worst), random), iteration=state.iteration + 1)


def move(random: np.random.Generator, x: Array, best: Array, worst: Array) -> Array:
    """Towards the best and away from the worst, each coordinate by draws of its own. Shape (p, d)."""
    r1, r2 = random.uniform(size=x.shape), random.uniform(size=x.shape)
    return x + r1 * (best - np.abs(x)) - r2 * (worst - np.abs(x))
