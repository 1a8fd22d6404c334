"""Cells of the inertias' ranges, and the smallest reach of a comparison system."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..loops.deviation import DeviationRows

Array = NDArray[np.float64]

#: Share of the contraction that R gives away, so that the exact check, which rounds outwards, is strict.
SPARE = 1e-3
#: Digits of W, which the file carries as short rationals.
DIGITS = 9


@dataclass(frozen=True, kw_only=True)
class Cell:
    """The certificate for a part of the inertias' ranges.

    Attributes:
        transform: W. Shape (n, n).
        reach: R, ultimate bounds on |y|. Shape (n,).
        start: P, bounds on |y| at every sample. Shape (n,).
        shape: s, what of P lies outside R and shrinks with the decay. Shape (n,).
    """

    transform: Array
    reach: Array
    start: Array
    shape: Array


def cells_of(rows: DeviationRows, split: tuple[int, ...]) -> list[DeviationRows]:
    """The enclosures with each inertia's range cut into equal parts, every combination."""
    low, width = rows.mass_low, (rows.mass_high - rows.mass_low) / np.array(split)
    parts = []
    for index in product(*(range(count) for count in split)):
        begin = low + np.array(index) * width
        parts.append(replace(rows, mass_low=begin, mass_high=begin + width))
    return parts


def rounded(matrix: Array) -> Array:
    """The matrix with short decimals, as a file carries it."""
    return np.array([[float(f"{v:.{DIGITS - 1}e}") for v in row] for row in matrix])


def least_reach(vertices: list[tuple[Array, Array]]) -> Array | None:
    """The smallest R with A_v R + b_v <= R at every vertex, a little enlarged; None where there is none.

    Policy iteration: in each row the vertex that asks for most.
    """
    n = len(vertices[0][1])
    stack, push = np.array([a for a, _ in vertices]), np.array([b for _, b in vertices])
    reach, extra = np.zeros(n), np.zeros(n)
    for _ in range(50):
        choice = (stack @ reach + push).argmax(axis=0)
        a, b = stack[choice, np.arange(n)], push[choice, np.arange(n)]
        radius = float(np.max(np.abs(np.linalg.eigvals(a))))
        if not radius < 1:
            return None
        found = np.asarray(np.linalg.solve(np.eye(n) - a, b + extra), dtype=np.float64)
        if (np.abs(found - reach) <= 1e-9 * np.abs(found)).all():
            if extra.any():
                return found if (found > 0).all() else None
            extra = SPARE * (1 - radius) * np.maximum(found, 1e-12 * found.max())
        reach = found
    return None
