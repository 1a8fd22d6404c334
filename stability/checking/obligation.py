"""One verdict, and the verdicts on a file."""

from __future__ import annotations

from dataclasses import dataclass, field
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
class Report:
    """The verdict on one file."""

    file: str
    status: int
    message: str
    obligations: list[Obligation] = field(default_factory=list)


def decided(name: str, statement: str, margin: Fraction, unit: str, remedy: str, *, member: str = "",
            strict: bool = True) -> Obligation:  # fmt: skip
    """An obligation, proved where its margin is positive, or zero where that is enough."""
    good = margin > 0 or (margin == 0 and not strict)
    size = Fraction(10) ** 300
    shown = float(max(-size, min(size, margin)))
    return Obligation(name, statement, shown, unit, "proved" if good else "undecided", "" if good else remedy, member)
