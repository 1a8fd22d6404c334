"""Closed intervals of floats, every operation rounded outwards."""

from __future__ import annotations

import math
from collections.abc import Iterable
from math import isnan, nextafter

_LOW, _HIGH = -math.inf, math.inf
_FAR = 1e5


def _down(value: float) -> float:
    return nextafter(value, _LOW)


def _up(value: float) -> float:
    return nextafter(value, _HIGH)


def _libm(low: float, high: float) -> tuple[float, float]:
    """Results of the C library widened by four units in the last place: it is not correctly rounded."""
    for _ in range(4):
        low, high = _down(low), _up(high)
    return low, high


class Interval:
    """A closed interval [low, high] that contains the exact result of every operation on its members.

    Each elementary operation is rounded outwards by one unit in the last place, which covers IEEE 754
    round-to-nearest (Moore, Kearfott and Cloud 2009, ch. 2).

    Raises:
        ValueError: low > high, or an end that is NaN.

    Not guaranteed: tightness. A variable that occurs twice is treated as two variables.
    """

    __slots__ = ("high", "low")

    def __init__(self, low: float, high: float | None = None) -> None:
        self.low = low = float(low)
        self.high = high = low if high is None else float(high)
        if not low <= high:
            raise ValueError(f"an interval needs lower <= upper: got [{low}, {high}]; swap or correct the ends")

    @staticmethod
    def symmetric(radius: float) -> Interval:
        """The interval [-radius, radius]."""
        return Interval(-abs(radius), abs(radius))

    @property
    def magnitude(self) -> float:
        """The largest absolute value in the interval."""
        return max(abs(self.low), abs(self.high))

    @property
    def is_point(self) -> bool:
        """True for a single number."""
        return self.low == self.high

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __add__(self, other: Interval) -> Interval:
        return Interval(nextafter(self.low + other.low, _LOW), nextafter(self.high + other.high, _HIGH))

    def __sub__(self, other: Interval) -> Interval:
        return Interval(nextafter(self.low - other.high, _LOW), nextafter(self.high - other.low, _HIGH))

    def __mul__(self, other: Interval) -> Interval:
        a, b, c, d = self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high
        if isnan(a + b + c + d):  # 0 times infinity: the member 0 makes it 0
            a, b, c, d = (0.0 if isnan(end) else end for end in (a, b, c, d))
        return Interval(nextafter(min(a, b, c, d), _LOW), nextafter(max(a, b, c, d), _HIGH))

    def __truediv__(self, other: Interval) -> Interval:
        if other.low <= 0.0 <= other.high:
            raise ZeroDivisionError(f"division by an interval that holds 0: {other}; narrow the box")
        return self * Interval(_down(1.0 / other.high), _up(1.0 / other.low))

    def __and__(self, other: Interval) -> Interval:
        return Interval(max(self.low, other.low), min(self.high, other.high))

    def square(self) -> Interval:
        """The exact range of x² (not x·x)."""
        small = 0.0 if self.low <= 0.0 <= self.high else min(abs(self.low), abs(self.high))
        return Interval(max(0.0, _down(small * small)), _up(self.magnitude**2))

    def sqrt(self) -> Interval:
        """The range of the square root.

        Raises:
            ValueError: the interval holds negative numbers.
        """
        if self.low < 0.0:
            raise ValueError(f"square root of an interval below 0: {self}; narrow the box")
        return Interval(max(0.0, _down(math.sqrt(self.low))), _up(math.sqrt(self.high)))

    def tanh(self) -> Interval:
        """The range of tanh."""
        low, high = _libm(math.tanh(self.low), math.tanh(self.high))
        return Interval(max(-1.0, low), min(1.0, high))

    def exp(self) -> Interval:
        """The range of the exponential; infinite where it overflows."""
        ends = [math.exp(v) if v < 709.0 else math.inf for v in (self.low, self.high)]
        low, high = _libm(min(ends[0], 8e307), ends[1])
        return Interval(max(0.0, low), high)

    def sin(self) -> Interval:
        """The range of the sine; [-1, 1] far from zero, where a float does not know its phase."""
        if self.magnitude > _FAR or self.high - self.low >= 2 * math.pi:
            return Interval(-1.0, 1.0)
        ends = math.sin(self.low), math.sin(self.high)
        low, high = _libm(min(ends), max(ends))
        if self._passes(-math.pi / 2):
            low = -1.0
        if self._passes(math.pi / 2):
            high = 1.0
        return Interval(max(-1.0, low), min(1.0, high))

    def cos(self) -> Interval:
        """The range of the cosine."""
        return (self + Interval(_down(math.pi / 2), _up(math.pi / 2))).sin()

    def log(self) -> Interval:
        """The range of the natural logarithm.

        Raises:
            ValueError: the interval holds numbers that are not positive.
        """
        if not self.low > 0.0:
            raise ValueError(f"logarithm of an interval that is not above 0: {self}; narrow the box")
        return Interval(*_libm(math.log(self.low), math.log(self.high)))

    def asin(self) -> Interval:
        """The range of the arc sine.

        Raises:
            ValueError: the interval leaves [-1, 1].
        """
        self._inside("sine")
        return Interval(*_libm(math.asin(self.low), math.asin(self.high)))

    def acos(self) -> Interval:
        """The range of the arc cosine.

        Raises:
            ValueError: the interval leaves [-1, 1].
        """
        self._inside("cosine")
        low, high = _libm(math.acos(self.high), math.acos(self.low))
        return Interval(max(0.0, low), high)

    def _inside(self, name: str) -> None:
        if not -1.0 <= self.low <= self.high <= 1.0:
            raise ValueError(f"arc {name} of an interval that leaves [-1, 1]: {self}; narrow the box")

    def atan(self) -> Interval:
        """The range of the arc tangent."""
        return Interval(*_libm(math.atan(self.low), math.atan(self.high)))

    def atan2(self, other: Interval) -> Interval:
        """The range of the angle of the points (x, y), y in this interval and x in the other.

        The whole circle where the box holds the origin or a point of the cut y = 0, x < 0.
        """
        if other.low <= 0.0 and self.low <= 0.0 <= self.high:
            return Interval(*_libm(-math.pi, math.pi))
        angles = [math.atan2(y, x) for y in (self.low, self.high) for x in (other.low, other.high)]
        return Interval(*_libm(min(angles), max(angles)))

    def abs(self) -> Interval:
        """The range of the absolute value."""
        small = 0.0 if self.low <= 0.0 <= self.high else min(abs(self.low), abs(self.high))
        return Interval(small, self.magnitude)

    def minimum(self, other: Interval) -> Interval:
        """The range of the smaller of two."""
        return Interval(min(self.low, other.low), min(self.high, other.high))

    def maximum(self, other: Interval) -> Interval:
        """The range of the larger of two."""
        return Interval(max(self.low, other.low), max(self.high, other.high))

    def _passes(self, phase: float) -> bool:
        """Whether phase + 2πk may lie inside, with room for rounding."""
        room = 1e-9
        first = math.ceil((self.low - phase - room) / (2 * math.pi))
        return first <= math.floor((self.high - phase + room) / (2 * math.pi))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Interval) and (self.low, self.high) == (other.low, other.high)

    def __hash__(self) -> int:
        return hash((self.low, self.high))

    def __repr__(self) -> str:
        return f"[{self.low:g}, {self.high:g}]"


def total(parts: Iterable[Interval]) -> Interval:
    """Sum of intervals; zero for none."""
    result = Interval(0.0)
    for part in parts:
        result = result + part
    return result
