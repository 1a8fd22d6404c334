"""From gains to certificates.

Verdicts here steer the search and explain refusals. A gain file is written only after `stability/checker.py` has proved
the finished document.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from stability import Certificate, Composition, Failure, certify, certify_sampled, deviation_rows
from stability.certificates import quadratic
from stability.networks.contracts import Contract, refined, solve_contracts
from stability.networks.observer import SampledObserver

from ..problem import GainSet, Member, Problem
from ..problem.margins import HEADROOM, member_margins, violation
from ..problem.member import Values
from ..problem.problem import Contracts

#: How many times the study's control period a certificate is looked for.
LONGEST = 64
#: Steps of a bisection for the longest period, of one member and of members that are linked.
STEPS, LINKED_STEPS = 12, 4


def contracts_of(problem: Problem, gains: GainSet, *, composed: bool = False) -> Contracts | Failure:
    """Proofs of all members at their control periods, or why there are none.

    Args:
        problem: The problem.
        gains: Gains of all members.
        composed: Whether to look for a composition where a member that nothing links has no sampled certificate, or
            where it breaks a limit; that takes long.
    """
    if problem.linked:
        return solve_contracts(problem.subsystems(gains), problem.assume)
    found: Contracts = {}
    for member in problem.members:
        values = gains[member.name]
        one = certificate(member, values) if composed else sampled(member, values)
        if isinstance(one, Failure):
            return one
        found[member.name] = Contract(guarantee=None, reached=None, bounds=member.bounds, certificate=one)
    return found


def sampled(member: Member, values: Values, *, refine: bool = False) -> Certificate | Failure:
    """The sampled certificate of a member alone."""
    return certify_sampled(member.model, member.bounds, member.gains(values), member.box, refine=refine)


def certificate(member: Member, values: Values, *, period: float | None = None) -> Certificate | Failure:
    """A certificate of a member alone at its control period, or at another one (0: a continuous law).

    The sampled certificate comes first; the composition is looked for where there is none, and for a continuous law.
    """
    if period is not None:
        member = member.under(replace(member.bounds, period=period))
    if member.bounds.period == 0:
        return composition(member, values)
    found = sampled(member, values)
    if isinstance(found, Certificate):
        return found
    return min((found, composition(member, values)), key=lambda c: _rank(member, c, values))


def composition(member: Member, values: Values) -> Composition | Failure:
    """The better composition certificate of those without and with θ̂ in V."""
    gains = member.gains(values)
    plain = certify(member.model, member.bounds, gains, member.box)
    if not any(g.epsilon > 0 for g in gains):
        return plain
    adaptive = certify(member.model, member.bounds, gains, member.box, adaptive=True)
    return min((plain, adaptive), key=lambda c: _rank(member, c, values))


def member_violation(member: Member, found: Certificate | Failure, values: Values) -> float:
    """How far the gains of a member alone are from being proved inside its limits; 0 where they are."""
    late = sum(max(0.0, member.bounds.period * g.delta * g.sigma - 1.0) for g in member.gains(values))
    if isinstance(found, Failure):
        return 10.0 + late
    excess = (m.share * (1 + HEADROOM) - 1.0 for m in member_margins(member, found, shown=False))
    return late + sum(max(0.0, value) for value in excess)


def _rank(member: Member, found: Certificate | Failure, values: Values) -> tuple[float, float]:
    size = math.inf if isinstance(found, Failure) else float(found.ultimate[0])
    return member_violation(member, found, values), size


@dataclass(frozen=True, kw_only=True)
class Strongest:
    """The best proofs of some gains, and what the other kinds give.

    Attributes:
        contracts: The best of each member, or why there are none.
        notes: A line for each member: which kind was taken, and what the others give.
    """

    contracts: Contracts | Failure
    notes: tuple[str, ...]


def strongest(problem: Problem, gains: GainSet) -> Strongest:
    """Search all kinds of certificates that a gain file can carry, refined ones too.

    A member that nothing links takes the kind with the smaller bound among those that meet its limits; a linked member
    keeps the sampled kind, which gives a guarantee.
    """
    if problem.linked:
        found = contracts_of(problem, gains)
        if isinstance(found, Failure):
            return Strongest(contracts=found, notes=())
        better = {
            name: refined(name, own, found[name]) for name, own in problem.subsystems(gains).items()
        }  # fmt: skip
        notes = tuple(_refinement(problem.member(name), found[name], better[name]) for name in better)
        if violation(problem, better, gains) > 0 and violation(problem, found, gains) == 0:
            better = found
        return Strongest(contracts=better, notes=notes)
    contracts: Contracts = {}
    notes = []
    for member in problem.members:
        values = gains[member.name]
        plain = sampled(member, values)
        if isinstance(plain, Certificate):
            plain = min((plain, sampled(member, values, refine=True)), key=lambda c: _rank(member, c, values))
        composed = composition(member, values)
        best = min((plain, composed), key=lambda c: _rank(member, c, values))
        if isinstance(best, Failure):
            return Strongest(contracts=best, notes=())
        notes.append(_compared(member, values, plain, composed, best))
        contracts[member.name] = Contract(guarantee=None, reached=None, bounds=member.bounds, certificate=best)
    return Strongest(contracts=contracts, notes=tuple(notes))


def _refinement(member: Member, plain: Contract, better: Contract) -> str:
    unit = member.plant.state_units[0]
    sizes = [1e3 * float(c.certificate.ultimate[0]) for c in (plain, better)]
    return f"{member.name}: sampled certificate, {sizes[1]:.4g} m{unit} (not refined: {sizes[0]:.4g} m{unit})"


def _compared(
    member: Member, values: Values, plain: Certificate | Failure, composed: Composition | Failure, taken: Certificate
) -> str:
    if isinstance(taken, Composition):
        return f"composition certificate, {_told(member, taken)} (sampled: {_told(member, plain)})"
    others = (
        f"composition: {_told(member, composed)}, quadratic, at the samples: {quadratic_bound(member, values, taken)}"
    )
    return f"sampled certificate, {_told(member, taken)} ({others})"


def _told(member: Member, found: Certificate | Failure) -> str:
    unit = member.plant.state_units[0]
    return found.reason if isinstance(found, Failure) else f"{1e3 * float(found.ultimate[0]):.4g} m{unit}"


def quadratic_bound(member: Member, values: Values, found: Certificate) -> str:
    """The ultimate bound at the samples by one ellipsoid for the exact map, over the box of a sampled certificate."""
    rows = deviation_rows(member.model, member.bounds, member.gains(values), found.half_widths, found.input_bound)
    inclusion = quadratic.from_period(rows, member.bounds.period, found.half_widths)
    ellipsoid = quadratic.search(inclusion, np.eye(len(found.half_widths))[0], found.half_widths)
    squared = None if ellipsoid is None else quadratic.prove(inclusion, ellipsoid)
    unit = member.plant.state_units[0]
    return "none" if squared is None else f"{1e3 * math.sqrt(squared):.4g} m{unit}"


def longest_period(problem: Problem, gains: GainSet, *, proved: bool = False) -> float:
    """The largest control period of all members at which everything is certified, s, by bisection; 0 where none is.

    Certified at the period returned, not certified at one a little longer; beyond, nothing is said. Where the own
    period is `proved` already, shorter ones are not looked at.
    """

    def good(period: float) -> bool:
        slower = at_period(problem, period)
        return slower is not None and violation(slower, contracts_of(slower, gains, composed=True), gains) == 0.0

    steps = LINKED_STEPS if problem.linked else STEPS
    low = high = problem.period
    if good(high):
        while good(2 * high) and high < LONGEST * problem.period:
            high *= 2
        low, high = high, 2 * high
    elif proved:
        return high
    else:
        low = high / 2.0**steps
        if not good(low):
            return 0.0
    for _ in range(steps):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def at_period(problem: Problem, period: float) -> Problem | None:
    """The problem at another control period, observers of the same bandwidth; None where one does not contract."""
    from stability.networks.observer import sampled_bounds

    section, observers = problem.study.controller.observer, {}
    for name in problem.observers:
        assert section is not None
        observer = SampledObserver.of_bandwidth(section.bandwidth_rad_s, section.largest, period)
        if sampled_bounds(observer, noise=0.0, acceleration=1.0, initial=0.0) is None:
            return None
        observers[name] = observer
    members = tuple(m.under(replace(m.bounds, period=period)) for m in problem.members)
    return replace(problem, members=members, observers=observers)


def ultimates(contracts: Mapping[str, Contract]) -> np.ndarray:
    """Certified bounds on the members' errors after the transient. Shape (n,)."""
    return np.array([float(contract.certificate.ultimate[0]) for contract in contracts.values()])
