"""Integrals over a sub-step, and sums of bounds, in whole numbers rounded up.

Theorem: ∫|f| = |∫f| where f keeps its sign. Where f(z) = 0, |f(r)| is at most the integral of |f'| from z to r, and

    ∫|f| <= ∫_z^h |f'(s)| (h - s) ds + ∫_0^z |f'(s)| s ds,

with the derivative |f'(z)| (2z - h) by z: it is largest at an end. Must fail: a slope left out.
"""

from __future__ import annotations

import math
from fractions import Fraction

from .limits import FIXED
from .matrices import Ball, Matrix, Whole, ball, exponential_of, times_up
from .turn import Turn

WHOLE = 1 << FIXED


def integrals_of(flow: Matrix, length: Fraction) -> tuple[Ball, Ball, Ball]:
    """exp(flow h), and the integrals of exp(flow r) and of (h - r) exp(flow r) over 0 <= r <= h."""
    n = len(flow)
    block = [[*(v * length for v in row), *(length * int(i == j) for j in range(n)), *[Fraction(0)] * n]
             for i, row in enumerate(flow)]  # fmt: skip
    block += [[*[Fraction(0)] * 2 * n, *(length * int(i == j) for j in range(n))] for i in range(n)]
    whole = exponential_of([*block, *([Fraction(0)] * 3 * n for _ in range(n))]).part(slice(0, n), slice(None))
    first, second, third = (whole.part(slice(None), slice(k * n, (k + 1) * n)) for k in range(3))
    return first, second, third


class Piece:
    """f = rows times exp(flow r) times the sources over a sub-step: exact areas, and bounds on ∫|f| where f has a zero.

    Entrywise |exp(flow r)| <= exp(least r), and f' = rows flow exp(flow r) sources.
    """

    def __init__(self, turn: Turn, length: Fraction) -> None:
        flow, sources = turn.flow, ball(turn.sources)
        self.forward, area, _ = integrals_of(flow, length)
        self.area = area @ sources
        least = [[v if i == j else abs(v) for j, v in enumerate(row)] for i, row in enumerate(flow)]
        _, once, late = integrals_of(least, length)
        whole = Ball([[v * length.numerator // length.denominator for v in row] for row in once.rows], once.error + 1)
        self.size, after, before = (times_up(part.sizes(), sources.sizes()) for part in (once, late, whole - late))
        self.slope = times_up(ball([[abs(v) for v in row] for row in flow]).sizes(), larger(after, before))
        grown = [[max(v, Fraction(0)) * length if i == j else v * length for j, v in enumerate(row)]
                 for i, row in enumerate(least)]  # fmt: skip
        self.ceiling = exponential_of(grown).sizes()

    def integral(self, rows: Ball) -> Whole:
        """Bounds on ∫|rows exp(flow r) sources| dr."""
        return larger((rows @ self.area).sizes(), times_up(rows.sizes(), self.slope))


def through(rows: Ball, blocks: list[Ball], ends: list[int]) -> Ball:
    """Rows times a block-diagonal matrix."""
    parts = [rows.part(slice(None), slice(a, b)) @ block for a, b, block in zip(ends, ends[1:], blocks, strict=False)]
    made = parts[0]
    for part in parts[1:]:
        made = made.beside(part)
    return made


def length_of(values: list[int]) -> int:
    """Euclidean norm, rounded up."""
    return abs(values[0]) if len(values) == 1 else math.isqrt(sum(v * v for v in values)) + 1


def norm_of(block: Whole) -> int:
    """Spectral norm of a block of one or two rows, rounded up; of a larger one the bound by its rows and columns."""
    if len(block) == 1:
        return abs(block[0][0])
    if len(block) > 2:
        sums = [max(sum(map(abs, line)) for line in way) for way in (block, zip(*block, strict=True))]
        return math.isqrt(sums[0] * sums[1]) + 1
    (a, b), (c, d) = block
    total, product = a * a + b * b + c * c + d * d, abs(a * d - b * c)
    # the largest σ² is half of t + sqrt(t² - 4 det²)
    return math.isqrt((total + math.isqrt(max(total * total - 4 * product * product, 0)) + 1) // 2 + 1) + 1


def larger(first: Whole, second: Whole) -> Whole:
    """The larger of each pair of entries."""
    return [[max(a, b) for a, b in zip(x, y, strict=True)] for x, y in zip(first, second, strict=True)]


def added(*parts: Whole) -> Whole:
    """Sum of matrices."""
    return [[sum(values) for values in zip(*rows, strict=True)] for rows in zip(*parts, strict=True)]


def times_ratio(part: Whole, numerator: int, denominator: int = 1) -> Whole:
    """A matrix times a ratio, rounded up."""
    return [[-(-v * numerator // denominator) for v in row] for row in part]


def scaled_up(value: int, factor: Fraction) -> int:
    """A number times a ratio, rounded up."""
    return -(-value * factor.numerator // factor.denominator)


class Weighted:
    """Sums or largest values over groups, plain and with weights."""

    def __init__(self, rows: int, columns: int) -> None:
        self.sums = [[[0] * columns for _ in range(rows)] for _ in range(2)]

    def add(self, found: Whole, weight: int) -> None:
        """Add a group."""
        self.sums = [added(self.sums[0], found), added(self.sums[1], times_ratio(found, weight, WHOLE))]

    def keep(self, found: Whole, weight: int) -> None:
        """Keep what a group has that is larger."""
        self.sums = [larger(self.sums[0], found), larger(self.sums[1], times_ratio(found, weight, WHOLE))]
