"""What each part of the law contributes to a design: the same gains without it, certified and simulated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stability import Failure
from stability.certificates.budget import Budget, budget_of
from stability.certificates.impulse import begun

from ..files.text import upward
from ..problem import GainSet, Problem
from ..problem.margins import certified_error
from ..problem.problem import Contracts
from ..simulation import Loop, Run, scenarios, within_assumptions
from .certify import contracts_of
from .demand import with_terms

#: A part that changes neither figure by this share contributes nothing.
NOTHING = 1e-6
#: Sources below this share of a bound are left out.
SMALL = 0.005
#: Gains by which a part of the law is switched off.
SWITCHES = {"theta": ("epsilon",), "phi": ("gamma",), "lead": ("lead", "smooth")}


@dataclass(frozen=True, kw_only=True)
class Contribution:
    """The figures of a design without a part of its law.

    Attributes:
        part: "theta", "phi", "lead", or the name of a modelling term; empty for the whole law.
        certified: Certified error of the output, m; None where nothing is proved.
        simulated: Largest error after the transient in the study's scenarios, m; infinite where a run is lost.
    """

    part: str
    certified: float | None
    simulated: float


def contributions(problem: Problem, gains: GainSet) -> list[Contribution]:
    """The whole law, then without each part that it has; certificates are coarse ones, so that they compare."""
    return [_judged(part, own, values) for part, own, values in _variants(problem, gains)]


def _variants(problem: Problem, gains: GainSet) -> Iterator[tuple[str, Problem, GainSet]]:
    yield "", problem, gains
    for part, kinds in SWITCHES.items():
        off = {
            m.name: tuple(
                0.0 if item.name.startswith(kinds) else value
                for item, value in zip(m.ranges, gains[m.name], strict=True)
            )
            for m in problem.members
        }
        if off != dict(gains):
            yield part, problem, off
    terms = problem.study.controller.modelling
    for term in terms:
        yield term, with_terms(problem, tuple(t for t in terms if t != term)), gains


def _judged(part: str, problem: Problem, gains: GainSet) -> Contribution:
    found = contracts_of(problem, gains)
    inside = [s for s in scenarios(problem) if within_assumptions(problem, s)]
    shown = Loop(problem).figures([Run(gains=gains, scenario=scenario) for scenario in inside])
    return Contribution(
        part=part, certified=None if isinstance(found, Failure) else certified_error(problem, found),
        simulated=max(figures.maximum_error_m for figures in shown),
    )  # fmt: skip


def contribution_lines(problem: Problem, found: list[Contribution]) -> list[str]:
    """A line for each part of the law."""
    unit, whole = f"m{problem.machine.output_unit}", found[0]
    lines = []
    for without in found[1:]:
        told = "nothing proved" if without.certified is None else f"certified {upward(1e3 * without.certified)} {unit}"
        changed = without.certified is None or whole.certified is None or max(
            abs(without.certified / whole.certified - 1), abs(without.simulated / whole.simulated - 1)
        ) > NOTHING  # fmt: skip
        after = "" if changed else ": it contributes nothing"
        lines.append(f"without {without.part}: {told}, simulated {1e3 * without.simulated:.4g} {unit}{after}")
    return lines


def together(problem: Problem, lines: Sequence[str]) -> list[str]:
    """Lines about members, with those that say the same of several in one."""
    found: dict[str, list[str]] = {}
    for line in lines:
        member, colon, rest = line.partition(": ")
        named = colon and member in problem.machine.members
        found.setdefault(rest if named else line, []).append(member if named else "")
    return [f"{', '.join(own)}: {text}" if own[0] else text for text, own in found.items()]


def budget_lines(problem: Problem, gains: GainSet, contracts: Contracts) -> list[str]:
    """A line for each member: what its certified error is made of."""
    lines = []
    for member in problem.members:
        bounds, found = contracts[member.name].bounds, contracts[member.name].certificate
        own, where = member.gains(gains[member.name]), problem.prefix(member)
        for fine in (False, True):
            search = begun(member.model, bounds, own, member.box, fine=fine)
            if not isinstance(search, Failure) and search.partition == found.partition:
                lines.append(where + _told(budget_of(search, bounds, found)))
                break
    return lines


def _told(parts: Budget) -> str:
    shares = sorted(((size / parts.whole, name) for name, size in parts.sources.items()), reverse=True)
    named = ", ".join(f"{100 * share:.3g} % {name}" for share, name in shares if share > SMALL)
    added = 100 * (1 - parts.nominal / parts.whole)
    return f"the certified error is made of {named}; {added:.3g} % of it are there because the loop is uncertain"
