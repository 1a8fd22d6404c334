"""One verdict, and the verdicts on a file; bounds and margins in few digits that hold."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction


@dataclass(frozen=True)
class Obligation:
    """One verdict."""

    name: str
    statement: str
    margin: float
    unit: str
    verdict: str
    remedy: str = ""
    member: str = ""


@dataclass(frozen=True)
class Use:
    """What is certified of a limit: share is the certified size over the limit."""

    member: str
    name: str
    share: float


@dataclass(frozen=True)
class Report:
    """The verdict on one file: status 0 proved, 1 not proved, 2 unreadable.

    `uses` are the shares of the limits, `bundled` what the study left to the bundled machine `model`, `assumed` what
    has no source, `records` what of a draft's records contradicts the study or the proof; `required` are the study's
    requirements, with what is proved of each, or None where it is simulated only.
    """

    file: str
    status: int
    message: str
    obligations: list[Obligation] = field(default_factory=list)
    uses: list[Use] = field(default_factory=list)
    bundled: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    model: str = ""
    records: str = ""
    required: dict[str, tuple[float, float | None]] = field(default_factory=dict)


def decided(name: str, statement: str, margin: Fraction, unit: str, remedy: str, *, member: str = "",
            strict: bool = True) -> Obligation:  # fmt: skip
    """An obligation, proved where its margin is positive, or zero where that is enough."""
    good = margin > 0 or (margin == 0 and not strict)
    size = Fraction(10) ** 300
    shown = below(max(-size, min(size, margin)))
    return Obligation(name, statement, shown, unit, "proved" if good else "undecided", "" if good else remedy, member)


def below(x: Fraction) -> float:
    """A float that is not above x."""
    found = float(x)
    return math.nextafter(found, -math.inf) if Fraction(found) > x else found


def above(x: Fraction) -> float:
    """A float that is not below x, nor is its shortest decimal."""
    found = float(x)
    while min(Fraction(found), Fraction(repr(found))) < x:
        found = math.nextafter(found, math.inf)
    return found


def downward(x: Fraction | float, digits: int = 4) -> str:
    """A margin in few digits, not above it."""
    return _rounded(Fraction(x), digits, ROUND_FLOOR)


def upward(x: Fraction | float, digits: int = 4) -> str:
    """A bound in few digits, not below it."""
    return _rounded(Fraction(x), digits, ROUND_CEILING)


def _rounded(x: Fraction, digits: int, rounding: str) -> str:
    context = Context(prec=digits, rounding=rounding)
    return f"{float(context.divide(Decimal(x.numerator), Decimal(x.denominator))):.{digits}g}"


def milli(bound: Fraction, unit: str) -> str:
    """A bound in thousandths of its unit, four digits, rounded up."""
    return f"{upward(1000 * bound)} m{unit}"


def percent(share: Fraction | float, *, up: bool) -> str:
    """A share in percent, three digits, rounded up or down."""
    return f"{upward(100 * Fraction(share), 3) if up else downward(100 * Fraction(share), 3)} %"
