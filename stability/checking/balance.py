"""What a mode carries in the motion that is asked for, as the only other row that reads it says.

Theorem: in M x' = g b + Σ c s + c_0 + what is left, with g, c and c_0 constant and signals s of bounded rate,
b* = (M r' - Σ c s - c_0) / g is one of them, and around it what is left acts alone. Must fail: an effect without a
sign, a row that two modes balance, what may change counted as constant.
"""

from __future__ import annotations

from collections.abc import Collection
from fractions import Fraction

from .arithmetic import ONE, ZERO, Interval, add, down, inverse, mul, neg, up
from .forms import Form, Table, over, plus, times
from .limits import NotProvedError

#: The range of b* is widened by this share of its size; it settles in so many steps.
WIDER, SETTLE = Fraction(1, 10**6), 12


class Balance:
    """A row in balance: b* in signals and a constant, and what the row feels besides, without deviations."""

    def __init__(
        self, raw: Form, own: str, mass: Interval, moving: Form, signals: Collection[str], table: Table
    ) -> None:
        self.met: Form = {}
        self.left: Form = {}
        self.steady = {own, *signals}
        for symbol, c in raw.items():
            if symbol in self.steady or not symbol:
                self._count(symbol, c)
            elif symbol[0] not in "Qe":
                self._split(table.expand({symbol: ONE}), c)
        self._split(moving, neg(mass))
        effect = self.met.pop(own, ZERO)
        if effect[0] <= 0 <= effect[1]:
            raise NotProvedError("what a mode carries has no effect of a known sign")
        self.value = times(self.met, neg(inverse(effect)))

    def _count(self, symbol: str, part: Interval) -> None:
        self.met[symbol] = add(self.met.get(symbol, ZERO), part)

    def _split(self, form: Form, factor: Interval) -> None:
        """Of what may change, the middle counts as constant, and the rest is left."""
        rest: Form = {}
        for symbol, c in form.items():
            if symbol in self.steady or not symbol:
                middle = down((c[0] + c[1]) / 2)
                self._count(symbol, mul(factor, (middle, middle)))
                rest[symbol] = mul(factor, add(c, (-middle, -middle)))
            elif symbol[0] not in "Qe":
                rest[symbol] = mul(factor, c)
        self.left = plus(self.left, rest)

    def range(self, ranges: dict[str, Interval]) -> Interval:
        """Where b* is for ranges of the signals."""
        return over(self.value, ranges)

    def rate(self, rates: dict[str, Interval]) -> Interval:
        """How fast b* moves for rates of the signals."""
        return over({s: c for s, c in self.value.items() if s}, rates)


def widened(span: Interval) -> Interval:
    """A range with a little room."""
    room = up(WIDER * max(abs(span[0]), abs(span[1])))
    return span[0] - room, span[1] + room


def inside(inner: Interval, outer: Interval) -> bool:
    """Whether one range is in another."""
    return outer[0] <= inner[0] and inner[1] <= outer[1]
