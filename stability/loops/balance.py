"""What a mode carries in the motion that is asked for, as the only other row that reads it says.

    M_k x_k' = g b + Σ c_s s + c_0 + what is left,      b* = (M_k r' - Σ c_s s - c_0) / g

with the signals s of bounded rate and g, c_s and c_0 constant, though not known exactly: b* is a signal of bounded rate
like them, and what it carries is no disturbance. Of what may change, the middle counts as constant, the rest is left.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from ..enclosures.form import ZERO, Form, Symbols
from ..enclosures.interval import Interval
from .box import over

#: The range of b* is widened by this share of its size before what reads it is bounded.
WIDER = 1e-6
#: Steps in which that range settles.
STEPS = 12


@dataclass(frozen=True)
class Balance:
    """A row in balance.

    Attributes:
        value: b* in signals and a constant.
        left: What the row feels besides, without deviations.
    """

    value: Form
    left: Form

    def range(self, ranges: Mapping[str, Interval]) -> Interval:
        """Where b* is for ranges of the signals."""
        return over(self.value, ranges)

    def rate(self, rates: Mapping[str, Interval]) -> Interval:
        """How fast b* moves for rates of the signals."""
        return over(Form(self.value.coefficients), rates)


def balance(
    raw: Form, own: str, mass: Interval, moving: Form, signals: Collection[str], symbols: Symbols
) -> Balance:  # fmt: skip
    """Split a row.

    Args:
        raw: What it feels, before nonlinear operations are replaced by what bounds them.
        own: The symbol of b*.
        mass: M_k.
        moving: The rate of its target.
        signals: Symbols of bounded rate, without b*.
        symbols: The table of all symbols.

    Raises:
        ValueError: b* has no effect of a known sign.
    """
    met: dict[str, Interval] = {}
    constant, left = raw.constant, Form()

    def count(symbol: str, part: Interval) -> None:
        met[symbol] = met.get(symbol, ZERO) + part

    def split(form: Form, factor: Interval) -> None:
        nonlocal constant, left
        rest: dict[str, Interval] = {}
        for symbol, c in form.coefficients.items():
            if symbol == own or symbol in signals:
                count(symbol, factor * _middle(c))
                rest[symbol] = factor * (c - _middle(c))
            elif symbol[0] not in "Qe":
                rest[symbol] = factor * c
        constant = constant + factor * _middle(form.constant)
        left = left + Form(rest, factor * (form.constant - _middle(form.constant)))

    for symbol, c in raw.coefficients.items():
        if symbol == own or symbol in signals:
            count(symbol, c)
        elif symbol[0] not in "Qe":
            split(symbols.expand(Form.of(symbol)), c)
    split(moving, -mass)
    effect = met.pop(own, ZERO)
    if effect.low <= 0 <= effect.high:
        raise ValueError("what a mode carries has no effect of a known sign")
    by = Interval(-1.0) / effect
    return Balance(Form({s: c * by for s, c in met.items()}, constant * by), left)


def _middle(span: Interval) -> Interval:
    return Interval((span.low + span.high) / 2)
