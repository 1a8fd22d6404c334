"""A member of a machine: read, decided, and compared with what the file records."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .claim import Claim
from .course import follows
from .golden import golden_agree
from .impulse import Impulse
from .limits import REQUIRED, need
from .loop import Loop
from .obligation import Obligation, Use, downward
from .obligations import obligations, uses
from .parsing import number
from .reading import read
from .statement import consistent
from .structure import different, well_formed


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
    verdict: Impulse
    used: list[Use]
    failed: str


def check_member(data: dict[str, Any], which: int, coupled: bool) -> Member:
    """Re-prove one member under its own assumptions."""
    entry = data["members"][which]
    claim = read(data, entry, coupled)
    need(not (coupled and 0 in claim.networks), "a first row with a load network is of a member that nothing links")
    need(not (coupled and claim.parts), "only a member that nothing links has constants that are cut")
    consistent(data, entry, claim)
    follows(data, entry, claim, which)
    well_formed(claim)
    different(entry["golden"], claim)
    made, loop, verdict = obligations(claim)
    agree = golden_agree(entry["golden"], claim)
    seen = number(data["validation"]["members"][claim.name]["largest_error"], "largest_error")
    need(seen >= 0, "largest_error must not be negative")
    rate = number(entry["certificate"]["envelope"]["rate"], "rate")
    required = REQUIRED[data["study"]["controller"]["law"]][entry["certificate"]["kind"]]
    need(sorted(o.name for o in made) == sorted(required), "the checker has not decided what the law needs")
    failed = ""
    wrong = [o for o in made if o.verdict != "proved"]
    if wrong:
        failed = f"{wrong[0].name} (margin {downward(wrong[0].margin)} {wrong[0].unit})"
    elif not rate <= verdict.rate():
        failed = "the envelope states a faster rate"
    elif not agree:
        failed = "the golden vectors do not follow from the gains and the law"
    elif seen > claim.half_widths[0]:
        failed = "the recorded simulation leaves the certified envelope"
    tube = tube_of(claim, verdict) if len(claim.rows) > accelerating(claim) else None
    return Member(claim.name, claim, loop, made, tube, verdict, uses(claim, loop, verdict), failed)


def tube_of(claim: Claim, verdict: Impulse) -> tuple[Fraction, Fraction, Fraction]:
    """Bounds on the deviations of position, speed and acceleration for all t; no position where a speed comes first."""
    row = accelerating(claim)
    position = claim.half_widths[0] if row else Fraction(0)
    return position, claim.half_widths[row], verdict.speed(row)


def accelerating(claim: Claim) -> int:
    """The row whose state's rate is an acceleration."""
    return 1 if claim.first == "position" else 0
