"""Intervals of fractions, rounded outwards to a number of bits.

Theorem: the fundamental theorem of interval arithmetic (Moore 1966); every operation holds the range of what it
encloses.
"""

from __future__ import annotations

import math
from fractions import Fraction

from .limits import BITS, MAX_SHIFT, NotProvedError

Interval = tuple[Fraction, Fraction]
ZERO: Interval = (Fraction(0), Fraction(0))
ONE: Interval = (Fraction(1), Fraction(1))


def down(x: Fraction) -> Fraction:
    """The largest number of BITS bits that is not above x."""
    numerator, denominator = x.numerator, x.denominator
    shift = BITS - (abs(numerator).bit_length() - denominator.bit_length())
    if abs(shift) > MAX_SHIFT:
        raise NotProvedError("a bound leaves the range of numbers that the checker handles")
    if denominator.bit_length() <= BITS and abs(numerator).bit_length() <= BITS:
        return x
    if shift >= 0:
        return Fraction((numerator << shift) // denominator, 1 << shift)
    return Fraction((numerator // (denominator << -shift)) << -shift)


def up(x: Fraction) -> Fraction:
    """The smallest number of BITS bits that is not below x."""
    return -down(-x)


def symmetric(radius: Fraction) -> Interval:
    """[-radius, radius]."""
    return -abs(radius), abs(radius)


def add(a: Interval, b: Interval) -> Interval:
    """Sum."""
    return down(a[0] + b[0]), up(a[1] + b[1])


def neg(a: Interval) -> Interval:
    """Negative."""
    return -a[1], -a[0]


class Work:
    """Counts interval products, so that no file can keep the checker busy for long."""

    def __init__(self) -> None:
        self.left = 0

    def begin(self, allowed: int) -> None:
        """Allow so many products from here on."""
        self.left = allowed

    def one(self, cost: int = 1) -> None:
        """Count a product, or what costs as much as so many."""
        self.left -= cost
        if self.left < 0:
            raise NotProvedError("the model is larger than this checker takes on")


WORK = Work()


def mul(a: Interval, b: Interval) -> Interval:
    """Product."""
    WORK.one()
    if a[0] == a[1] == 0 or b[0] == b[1] == 0:
        return ZERO
    ends = (a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])
    return down(min(ends)), up(max(ends))


def inverse(a: Interval) -> Interval:
    """Reciprocal."""
    if a[0] <= 0 <= a[1]:
        raise NotProvedError("a divisor can vanish in the assumed box")
    return down(1 / a[1]), up(1 / a[0])


def square(a: Interval) -> Interval:
    """Range of x²."""
    low, high = sorted((abs(a[0]), abs(a[1])))
    return (Fraction(0) if a[0] <= 0 <= a[1] else down(low * low)), up(high * high)


def root(x: Fraction, upwards: bool) -> Fraction:
    """A rational bound on the square root."""
    WORK.one(4)
    if x < 0:
        raise NotProvedError("a square root of a negative number in the assumed box")
    shift = 2 * max(0, BITS - (x.numerator.bit_length() - x.denominator.bit_length()) // 2)
    scaled = (x.numerator << shift) // x.denominator
    return Fraction(math.isqrt(scaled) + (1 if upwards else 0), 1 << (shift // 2)) + (
        Fraction(1, 1 << (shift // 2)) if upwards else 0
    )


def exponential(x: Fraction) -> Interval:
    """Enclosure of exp(x) by a Taylor sum on |x| <= 1/2 and repeated squaring."""
    halvings = 0
    while abs(x) > Fraction(1, 2):
        x, halvings = x / 2, halvings + 1
    term, total = Fraction(1), Fraction(1)
    for k in range(1, 24):
        term = down(term * x / k)
        total = down(total + term)
    error = 2 * abs(term) + Fraction(1, 2 ** (BITS - 8))
    value = (down(total - error), up(total + error))
    for _ in range(halvings):
        value = (down(value[0] * value[0]), up(value[1] * value[1]))
    return value


def tanh_point(x: Fraction) -> Interval:
    """Enclosure of tanh at one number."""
    if abs(x) > 40:
        edge = 1 - Fraction(1, 2**100)
        return (edge, Fraction(1)) if x > 0 else (Fraction(-1), -edge)
    if abs(x) < Fraction(1, 2**40):  # x - x³ <= tanh x <= x for x >= 0, and odd
        return (down(x - x**3), up(x)) if x >= 0 else (down(x), up(x - x**3))
    low, high = exponential(down(2 * x))[0], exponential(up(2 * x))[1]
    return down(1 - 2 / (low + 1)), up(1 - 2 / (high + 1))


#: What a tanh costs, in products.
TANH_WORK = 100


def tanh(a: Interval) -> Interval:
    """Range of tanh."""
    WORK.one(TANH_WORK)
    return tanh_point(a[0])[0], tanh_point(a[1])[1]


def magnitude(a: Interval) -> Fraction:
    """Largest absolute value."""
    return max(abs(a[0]), abs(a[1]))


def intersect(a: Interval, b: Interval) -> Interval:
    """Intersection of two enclosures of the same quantity."""
    return max(a[0], b[0]), min(a[1], b[1])
