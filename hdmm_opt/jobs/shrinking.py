"""How much of its uncertainty a design can prove."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from stability import Bounds, Interval

from ..problem import GainSet, Problem
from ..problem.margins import violation
from ..problem.verdict import Verdict
from .certify import contracts_of

#: Halvings of the share of all uncertainties, and of one kind.
STEPS, COARSE = 10, 5
#: Kinds of uncertainty, as a refusal names them.
KINDS = {
    "tolerances": "every tolerance", "disturbances": "every disturbance range", "noise": "every noise bound",
    "initial": "every initial error",
}  # fmt: skip


def provable_share(problem: Problem, gains: GainSet, kinds: Iterable[str] = tuple(KINDS), steps: int = STEPS) -> float:
    """The largest share of some kinds of uncertainty at which the gains are proved; 0 where none is found.

    Parameters and disturbances keep the middle of their ranges; noise and initial errors shrink to zero.
    """
    kinds = tuple(kinds)

    def good(share: float) -> bool:
        smaller = shrunk(problem, share, kinds)
        contracts = contracts_of(smaller, gains)
        return violation(smaller, contracts, gains) == 0.0

    if not good(0.0):
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(steps):
        middle = (low + high) / 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def shrunk(problem: Problem, share: float, kinds: Iterable[str] = tuple(KINDS)) -> Problem:
    """The problem with some kinds of uncertainty at a share of their size."""
    own = {kind: share if kind in kinds else 1.0 for kind in KINDS}
    members = tuple(m.under(_bounds(m.bounds, own, problem.loads is None)) for m in problem.members)
    loads, share = problem.loads, own["disturbances"]
    if loads is not None:
        spans = {name: _smaller(value, share) for name, value in loads.disturbances.items()}
        loads = replace(loads, disturbances=spans)
    return replace(problem, members=members, loads=loads)


def _smaller(interval: Interval, share: float) -> Interval:
    middle = (interval.low + interval.high) / 2
    return Interval(middle) + Interval.symmetric(share * (interval.high - interval.low) / 2)


def _bounds(bounds: Bounds, share: Mapping[str, float], own: bool) -> Bounds:
    """The assumptions of a member; its disturbances are uncertain where they are its own."""
    spans = {
        name: _smaller(value, share["disturbances"]) if own else value for name, value in bounds.disturbances.items()
    }
    return replace(
        bounds,
        parameters={name: _smaller(value, share["tolerances"]) for name, value in bounds.parameters.items()},
        disturbances=spans,
        noise=tuple(share["noise"] * value for value in bounds.noise),
        initial=tuple(share["initial"] * value for value in bounds.initial),
    )


def uncertainty(problem: Problem, gains: GainSet) -> Verdict:
    """The share as a verdict: what would pass."""
    share = provable_share(problem, gains)
    what = "every tolerance, disturbance range, noise bound and initial error"
    if share == 0.0:
        statement, remedy = "not proved for the nominal machine either", "other gains, or another modelling term"
    else:
        statement = f"proved with {what} at {100 * share:.3g} % of the study's"
        remedy = f"{what} at {100 * share:.3g} %"
        alone = {} if problem.linked else {kind: provable_share(problem, gains, (kind,), COARSE) for kind in KINDS}
        found = [f"{KINDS[kind]} at {100 * part:.3g} %" for kind, part in alone.items() if part > 0]
        remedy += f"; or with these gains alone {', or '.join(found)}" if found else ""
    return Verdict(
        name="uncertainty", statement=statement, margin=share - 1.0, unit="share", verdict="undecided",
        remedy=remedy, sure=share > 0.0,
    )  # fmt: skip
