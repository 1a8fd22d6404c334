"""Matrices of fractions, and the exponential of one in fixed point with a bound on its error."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from .limits import FIXED, MAX_NORM, TERMS, NotProvedError

Matrix = list[list[Fraction]]


def dot(row: Iterable[Fraction], column: Iterable[Fraction]) -> Fraction:
    """Sum of products; most matrices here are sparse."""
    return sum((a * b for a, b in zip(row, column, strict=True) if a and b), Fraction(0))


def product_of(*factors: Matrix) -> Matrix:
    """Matrix product."""
    result = factors[0]
    for factor in factors[1:]:
        columns = list(zip(*factor, strict=True))
        result = [[dot(row, column) for column in columns] for row in result]
    return result


def identity(count: int) -> Matrix:
    """Unit matrix."""
    return [[Fraction(int(i == j)) for j in range(count)] for i in range(count)]


def negative(matrix: Matrix) -> Matrix:
    """Entries with the other sign."""
    return [[-value for value in row] for row in matrix]


def sum_of(*matrices: Matrix) -> Matrix:
    """Matrix sum."""
    pairs = zip(*matrices, strict=True)
    return [[sum(values, Fraction(0)) for values in zip(*rows, strict=True)] for rows in pairs]


def absolute(matrix: Matrix) -> Matrix:
    """Entries without sign."""
    return [[abs(value) for value in row] for row in matrix]


def inverse_of(matrix: Matrix) -> Matrix:
    """Exact inverse by Gauss-Jordan elimination."""
    n = len(matrix)
    work = [[*row, *unit] for row, unit in zip(matrix, identity(n), strict=True)]
    for i in range(n):
        pivot = next((k for k in range(i, n) if work[k][i] != 0), None)
        if pivot is None:
            raise NotProvedError("the transform of the certificate is singular")
        work[i], work[pivot] = work[pivot], work[i]
        work[i] = [value / work[i][i] for value in work[i]]
        for k in range(n):
            if k != i and work[k][i] != 0:
                work[k] = [a - work[k][i] * b for a, b in zip(work[k], work[i], strict=True)]
    return [row[n:] for row in work]


def exponential_times(matrix: Matrix, columns: Matrix) -> Matrix:
    """exp(matrix) · columns in fixed point; every entry within FIXED_ERROR where the columns have entries below 2^8.

    The remainder of the series is below 20^121/121! < 2^-140; rounding, by truncation at 2^-192 in each of 120 terms of
    at most 300 products, grows by no more than exp(20) < 2^29.
    """
    if max(sum(map(abs, row), Fraction(0)) for row in matrix) > MAX_NORM or len(matrix) > 300:
        raise NotProvedError("the plant is too fast for the control period of this certificate")
    sparse = [[(j, (v.numerator << FIXED) // v.denominator) for j, v in enumerate(row) if v] for row in matrix]
    term = [[(v.numerator << FIXED) // v.denominator for v in row] for row in columns]
    if max(abs(v) for row in term for v in row) >> (FIXED + 8):
        raise NotProvedError("the units of this certificate are too far apart")
    total = [list(row) for row in term]
    width = range(len(columns[0]))
    for k in range(1, TERMS + 1):
        term = [[(sum(a * term[j][c] for j, a in row) >> FIXED) // k for c in width] for row in sparse]
        total = [[a + b for a, b in zip(old, new, strict=True)] for old, new in zip(total, term, strict=True)]
        if k > MAX_NORM and not any(abs(v) > 1 for row in term for v in row):
            break
    return [[Fraction(v, 1 << FIXED) for v in row] for row in total]
