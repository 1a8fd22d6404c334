"""One obligation, decided: what a refusal says, and what the checker said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from stability import checker


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """One obligation, decided.

    Attributes:
        name: Name of the obligation.
        statement: What had to be shown.
        margin: Distance from failing, [unit]; negative where it fails.
        unit: Unit of the margin.
        verdict: "proved", "refuted" or "undecided".
        remedy: What would make it pass, or help; empty where it passes.
        sure: True where the remedy was tried and makes it pass.
        witness: For a refuted obligation, the scenario and control rate that replay it.
        member: The member that it is about; empty for the machine.
    """

    name: str
    statement: str
    margin: float
    unit: str
    verdict: str
    remedy: str = ""
    sure: bool = False
    witness: dict[str, Any] | None = None
    member: str = ""


def from_checker(report: checker.Report) -> list[Verdict]:
    """What the checker did not prove, as verdicts."""
    if report.status == 0:
        return []
    failed = [
        Verdict(
            name=o.name, statement=o.statement, margin=o.margin, unit=o.unit, verdict=o.verdict,
            remedy=o.remedy, sure=True, member=o.member,
        )
        for o in report.obligations
        if o.verdict != "proved"
    ]  # fmt: skip
    return failed or [
        Verdict(name="exact check", statement=report.message, margin=-1.0, unit="1", verdict="undecided", remedy="")
    ]
