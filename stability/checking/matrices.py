"""Matrices in fixed point with one bound on all their errors, and exact inverses.

Theorem: |a b - a' b'| <= |a| |b - b'| + |a - a'| |b| + |a - a'| |b - b'|; the remainder of an exponential's series.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from .limits import FIXED, MAX_NORM, TERMS, NotProvedError

Matrix = list[list[Fraction]]
#: Whole numbers in units of 2^-FIXED.
Whole = list[list[int]]


def dot(row: Iterable[Fraction], column: Iterable[Fraction]) -> Fraction:
    """Sum of products; most matrices here are sparse."""
    return sum((a * b for a, b in zip(row, column, strict=True) if a and b), Fraction(0))


def identity(count: int) -> Matrix:
    """Unit matrix."""
    return [[Fraction(int(i == j)) for j in range(count)] for i in range(count)]


def inverse_of(matrix: Matrix) -> Matrix:
    """Exact inverse by Gauss-Jordan elimination."""
    n = len(matrix)
    work = [[*row, *unit] for row, unit in zip(matrix, identity(n), strict=True)]
    for i in range(n):
        pivot = next((k for k in range(i, n) if work[k][i] != 0), None)
        if pivot is None:
            raise NotProvedError("the coordinates of the certificate are singular")
        work[i], work[pivot] = work[pivot], work[i]
        work[i] = [value / work[i][i] for value in work[i]]
        for k in range(n):
            if k != i and work[k][i] != 0:
                factor = work[k][i]
                work[k] = [a - factor * b for a, b in zip(work[k], work[i], strict=True)]
    return [row[n:] for row in work]


@dataclass(frozen=True)
class Ball:
    """A matrix in units of 2^-FIXED, every entry within `error` of what it stands for."""

    rows: Whole
    error: int

    def __matmul__(self, other: Ball) -> Ball:
        columns = list(zip(*other.rows, strict=True))
        rows = [[sum(map(operator.mul, row, column)) >> FIXED for column in columns] for row in self.rows]
        size = max((sum(map(abs, row)) for row in self.rows), default=0)
        other_size = max((sum(map(abs, column)) for column in columns), default=0)
        error = size * other.error + other_size * self.error + len(other.rows) * self.error * other.error
        return Ball(rows, (error >> FIXED) + 2)

    def __add__(self, other: Ball) -> Ball:
        pairs = zip(self.rows, other.rows, strict=True)
        return Ball([[a + b for a, b in zip(p, q, strict=True)] for p, q in pairs], self.error + other.error)

    def __sub__(self, other: Ball) -> Ball:
        pairs = zip(self.rows, other.rows, strict=True)
        return Ball([[a - b for a, b in zip(p, q, strict=True)] for p, q in pairs], self.error + other.error)

    def beside(self, other: Ball) -> Ball:
        """Columns of both."""
        pairs = zip(self.rows, other.rows, strict=True)
        return Ball([[*p, *q] for p, q in pairs], max(self.error, other.error))

    def over(self, other: Ball) -> Ball:
        """Rows of both."""
        return Ball([*self.rows, *other.rows], max(self.error, other.error))

    def part(self, rows: slice, columns: slice) -> Ball:
        """Some rows and columns."""
        return Ball([row[columns] for row in self.rows[rows]], self.error)

    def sizes(self) -> Whole:
        """Bounds on the entries without sign."""
        return [[abs(v) + self.error for v in row] for row in self.rows]


def ball(matrix: Sequence[Sequence[Fraction]]) -> Ball:
    """A matrix of fractions."""
    return Ball([[(v.numerator << FIXED) // v.denominator for v in row] for row in matrix], 1)


def nothing(rows: int, columns: int) -> Ball:
    """Zeros."""
    return Ball([[0] * columns for _ in range(rows)], 0)


def eye(count: int) -> Ball:
    """Unit matrix."""
    return Ball([[int(i == j) << FIXED for j in range(count)] for i in range(count)], 0)


def times_up(first: Whole, second: Whole) -> Whole:
    """Product of matrices that are not negative, rounded up."""
    columns = list(zip(*second, strict=True))
    return [[(sum(map(operator.mul, row, column)) >> FIXED) + 1 for column in columns] for row in first]


def exponential_of(matrix: Matrix) -> Ball:
    """exp(matrix).

    The remainder of the series is below 20^121/121! < 2^-140. Entries are cut to 2^-160, and terms to the same in each
    of 120 products of at most 300 entries; both grow by no more than exp(20) < 2^29: below 2^-114 together.
    """
    if max(sum(map(abs, row), Fraction(0)) for row in matrix) > MAX_NORM or len(matrix) > 300:
        raise NotProvedError("the plant is too fast for the control period of this certificate")
    sparse = [[(j, (v.numerator << FIXED) // v.denominator) for j, v in enumerate(row) if v] for row in matrix]
    term = eye(len(matrix)).rows
    total = [list(row) for row in term]
    width = range(len(matrix))
    for k in range(1, TERMS + 1):
        term = [[(sum(a * term[j][c] for j, a in row) >> FIXED) // k for c in width] for row in sparse]
        total = [[a + b for a, b in zip(old, new, strict=True)] for old, new in zip(total, term, strict=True)]
        if k > MAX_NORM and not any(abs(v) > 1 for row in term for v in row):
            break
    return Ball(total, 1 << (FIXED - 113))
