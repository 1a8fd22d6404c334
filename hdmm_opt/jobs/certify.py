"""From gains to certificates.

Verdicts here steer the search and explain refusals. A gain file is written only after `stability/checker.py` has proved
the finished document.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from stability import Certificate, Composition, Failure, Impulse, certify, certify_impulse
from stability.networks.contracts import Contract, solve_contracts

from ..problem import GainSet, Member, Problem
from ..problem.build import observer_at
from ..problem.margins import HEADROOM, member_margins, violation
from ..problem.member import Values
from ..problem.problem import Contracts

#: How many times the study's control period a certificate is looked for.
LONGEST = 64
#: States of linked members at most for their inertias to be cut into cells: the checker has 10 s for a file.
FEW = 3
#: Steps of a bisection for the longest period, of one member and of members that are linked.
STEPS, LINKED_STEPS = 12, 4


def contracts_of(problem: Problem, gains: GainSet, *, refine: bool = False) -> Contracts | Failure:
    """Proofs of all members at their control periods, or why there are none; refined ones where they can be."""
    if problem.linked:
        return solve_contracts(problem.subsystems(gains), problem.assume, fine=refine and refinable(problem))
    found: Contracts = {}
    for name, one in _each(problem, gains, refine=refine).items():
        if isinstance(one, Failure):
            return one
        bounds = problem.member(name).bounds
        found[name] = Contract(guarantee=None, reached=None, bounds=bounds, certificate=one)
    return found


def _each(problem: Problem, gains: GainSet, *, refine: bool) -> dict[str, Impulse | Failure]:
    """The certificate of every member by itself; members that are alike are proved once."""
    found: dict[str, Impulse | Failure] = {}
    for k, member in enumerate(problem.members):
        values, before = gains[member.name], problem.members[:k]
        twin = next((m for m in before if gains[m.name] == values and _alike(m, member)), None)
        found[member.name] = found[twin.name] if twin else certificate(member, values, refine=refine)
    return found


def _alike(one: Member, other: Member) -> bool:
    """Whether a proof of one member is a proof of the other, with the same gains."""
    same = one.bounds == other.bounds and one.plant.parameters == other.plant.parameters
    return same and one.model.to_data() == other.model.to_data() and np.array_equal(one.box, other.box)


def refinable(problem: Problem) -> bool:
    """Whether the checker has the time for cells of all members."""
    return not problem.linked or max(len(member.model.rows) for member in problem.members) <= FEW


def certificate(member: Member, values: Values, *, refine: bool = False) -> Impulse | Failure:
    """The certificate of a member alone."""
    return certify_impulse(member.model, member.bounds, member.gains(values), member.box, refine=refine)


def composition(member: Member, values: Values) -> Composition | Failure:
    """The gain condition of a member's continuous law without load networks, with or without θ̂ in V."""
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
    """The best proofs of some gains.

    Attributes:
        contracts: The best of each member, or why there are none.
        notes: A line for each member: what refining the certificate brought.
    """

    contracts: Contracts | Failure
    notes: tuple[str, ...]


def strongest(problem: Problem, gains: GainSet) -> Strongest:
    """Proofs with refined certificates, where those are tighter and keep what the members guarantee."""
    found = contracts_of(problem, gains)
    if isinstance(found, Failure):
        return Strongest(contracts=contracts_of(problem, gains, refine=True), notes=())
    if problem.linked:
        finer = contracts_of(problem, gains, refine=True) if refinable(problem) else found
        return Strongest(contracts=found if isinstance(finer, Failure) else finer, notes=())
    better: Contracts = {}
    for name, finer in _each(problem, gains, refine=True).items():
        member = problem.member(name)
        taken = min((found[name].certificate, finer), key=lambda c: _rank(member, c, gains[name]))
        assert isinstance(taken, Impulse)
        better[name] = replace(found[name], certificate=taken)
    notes = tuple(_refinement(problem.member(name), found[name], better[name]) for name in better)
    if violation(problem, better, gains) > 0 and violation(problem, found, gains) == 0:
        better = found
    return Strongest(contracts=better, notes=notes)


def _refinement(member: Member, plain: Contract, better: Contract) -> str:
    unit = member.plant.state_units[0]
    sizes = [1e3 * float(c.certificate.ultimate[0]) for c in (plain, better)]
    counts = [len(c.certificate.cells) for c in (plain, better)]
    return (
        f"{member.name}: {sizes[1]:.4g} m{unit} with what is constant in {counts[1]} cells, {sizes[0]:.4g} m{unit} "
        f"in {counts[0]}"
    )


def longest_period(problem: Problem, gains: GainSet, *, proved: bool = False, refine: bool = False) -> float:
    """The largest control period of all members at which everything is certified, s, by bisection; 0 where none is.

    Certified at the period returned, not certified at one a little longer; beyond, nothing is said. Where the own
    period is `proved` already, shorter ones are not looked at.
    """

    def good(period: float) -> bool:
        slower = at_period(problem, period)
        found = contracts_of(slower, gains, refine=refine)
        return violation(slower, found, gains) == 0.0

    steps = LINKED_STEPS if problem.linked else STEPS
    low = problem.period
    if good(low):
        while good(2 * low) and low < LONGEST * problem.period:
            low *= 2
    elif proved:
        return low
    else:
        low = next((p for p in (low / 2.0**k for k in range(1, steps + 1)) if good(p)), 0.0)
    high = 2 * low
    for _ in range(steps if low else 0):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def at_period(problem: Problem, period: float) -> Problem:
    """The problem at another control period, observers of the same bandwidth."""
    observer = observer_at(problem.study, period)
    members = tuple(m.under(replace(m.bounds, period=period, observer=observer)) for m in problem.members)
    return replace(problem, members=members)


def ultimates(contracts: Mapping[str, Contract]) -> np.ndarray:
    """Certified bounds on the members' errors after the transient. Shape (n,)."""
    return np.array([float(contract.certificate.ultimate[0]) for contract in contracts.values()])
