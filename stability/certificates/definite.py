"""Whether a matrix of fractions is positive definite, decided exactly."""

from __future__ import annotations

import math
from fractions import Fraction


def positive_definite(matrix: list[list[Fraction]]) -> bool:
    """Strict definiteness of a symmetric rational matrix: its leading principal minors, by Bareiss's elimination.

    References:
        Bareiss (1968), Mathematics of Computation 22, 565-578; Sylvester's criterion.
    """
    scale = math.lcm(*(value.denominator for row in matrix for value in row))
    rest = [[int(value * scale) for value in row] for row in matrix]
    before = 1
    for k in range(len(rest)):
        pivot = rest[k][k]
        if pivot <= 0:
            return False
        for i in range(k + 1, len(rest)):
            for j in range(k + 1, len(rest)):
                rest[i][j] = (rest[i][j] * pivot - rest[i][k] * rest[k][j]) // before
        before = pivot
    return True
