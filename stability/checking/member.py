"""A member of a machine: read, decided, and compared with what the file records."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .arithmetic import up
from .claim import Claim
from .golden import golden_agree
from .limits import REQUIRED, need
from .loop import Loop
from .obligation import Obligation
from .obligations import obligations
from .parsing import number
from .reading import read
from .sampled import Held


@dataclass(frozen=True)
class Member:
    """A member of a machine with its verdicts, and the tube of position, speed, acceleration that it gives for all t.

    The tube is None where the certificate gives none.
    """

    name: str
    claim: Claim
    loop: Loop
    made: list[Obligation]
    reached: tuple[Fraction, Fraction, Fraction] | None
    ultimate: Fraction
    failed: str


def check_member(data: dict[str, Any], entry: dict[str, Any], coupled: bool) -> Member:
    """Re-prove one member under its own assumptions."""
    claim = read(data, entry, coupled)
    made, loop, verdict = obligations(claim)
    agree = golden_agree(entry["golden"], claim)
    seen = number(data["validation"]["members"][claim.name]["largest_error"], "largest_error")
    need(seen >= 0, "largest_error must not be negative")
    rate = number(entry["certificate"]["envelope"]["rate"], "rate")
    failed = missing(data, REQUIRED[data["study"]["controller"]["law"]][claim.kind], claim.name)
    wrong = [o for o in made if o.verdict != "proved"]
    if not failed and wrong:
        failed = f"{wrong[0].name} (margin {wrong[0].margin:.4g} {wrong[0].unit})"
    elif not failed and not rate <= claim.decay / (2 if claim.kind == "composition" else 1):
        failed = "the envelope states a faster rate"
    elif not failed and not agree:
        failed = "the golden vectors do not follow from the gains and the law"
    elif not failed and seen > claim.half_widths[0]:
        failed = "the recorded simulation leaves the certified envelope"
    tube = tube_of(claim, verdict) if isinstance(verdict, Held) and len(claim.rows) > accelerating(claim) else None
    return Member(claim.name, claim, loop, made, tube, verdict.ultimate(0), failed)


def missing(data: dict[str, Any], required: Iterable[str], member: str) -> str:
    """What to say of an obligation that the file does not record as proved, exactly once; empty where all are."""
    recorded = [o["name"] for o in data["obligations"] if o["verdict"] == "proved" and o.get("member", "") == member]
    for name in required:
        if recorded.count(name) != 1:
            return f"the file leaves out the obligation {name}"
    return ""


def tube_of(claim: Claim, verdict: Held) -> tuple[Fraction, Fraction, Fraction]:
    """Bounds on the deviations of position, speed and acceleration for all t; no position where a speed comes first."""
    row = accelerating(claim)
    rate = max(period.speeds(period.cell.start)[row] for period in verdict.periods)
    position = claim.half_widths[0] if row else Fraction(0)
    return position, claim.half_widths[row], up(rate * claim.half_widths[row] / claim.period)


def accelerating(claim: Claim) -> int:
    """The row whose state's rate is an acceleration."""
    return 1 if claim.first == "position" else 0
