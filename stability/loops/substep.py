"""A sub-step of a control period: what sources make of rows in it, and bounds where that changes its sign."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def ceiling(matrix: Array, time: float) -> Array:
    """Entrywise at least |exp(matrix r)| for 0 <= r <= time."""
    from scipy.linalg import expm

    size = np.abs(matrix)
    np.fill_diagonal(size, np.maximum(np.diag(matrix), 0.0))
    return np.asarray(expm(size * time), dtype=np.float64)


def integrals_of(flow: Array, length: float) -> tuple[Array, Array, Array]:
    """exp(flow h), and the integrals of exp(flow r) and of (h - r) exp(flow r) over 0 <= r <= h."""
    from scipy.linalg import expm

    n = len(flow)
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n], block[:n, n : 2 * n], block[n : 2 * n, 2 * n :] = flow, np.eye(n), np.eye(n)
    whole = np.asarray(expm(block * length), dtype=np.float64)
    return whole[:n, :n], whole[:n, n : 2 * n], whole[:n, 2 * n :]


class SubStep:
    """Integrals of f = rows · exp(flow r) · sources over a sub-step, and bounds on those of |f| where f has a zero."""

    def __init__(self, flow: Array, sources: Array, length: float) -> None:
        self.forward, area, _ = integrals_of(flow, length)
        self.area, self.ceiling = area @ sources, ceiling(flow, length)
        # entrywise |exp(flow r)| <= exp(least r), and f' = rows flow exp(flow r) sources
        least = np.abs(flow)
        np.fill_diagonal(least, np.diag(flow))
        _, once, twice = integrals_of(least, length)
        self.size, late = once @ np.abs(sources), twice @ np.abs(sources)
        self.slope = np.abs(flow) @ np.maximum(late, length * self.size - late)

    def integral(self, rows: Array) -> Array:
        """A bound on ∫|rows exp(flow r) sources| dr. Shape (..., sources)."""
        return np.maximum(np.abs(rows @ self.area), np.abs(rows) @ self.slope)
