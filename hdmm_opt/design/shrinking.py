"""How much of its uncertainty a design can prove."""

from __future__ import annotations

from dataclasses import replace

from stability import Bounds, Interval

from ..problem import GainSet, Problem
from ..problem.margins import violation
from ..problem.verdict import Verdict
from .certify import contracts_of

#: Halvings of the share.
STEPS = 10


def provable_share(problem: Problem, gains: GainSet) -> float:
    """The largest share of every uncertainty at which the gains are proved, by bisection; 0 where none was found.

    Parameters and disturbances keep the middle of their ranges; noise and initial errors shrink to zero.
    """

    def good(share: float) -> bool:
        smaller = shrunk(problem, share)
        return violation(smaller, contracts_of(smaller, gains, composed=True), gains) == 0.0

    if not good(0.0):
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def shrunk(problem: Problem, share: float) -> Problem:
    """The problem with every uncertainty at a share of its size."""
    members = tuple(m.under(_bounds(m.bounds, share, problem.loads is None)) for m in problem.members)
    loads = problem.loads
    if loads is not None:
        spans = {name: _smaller(value, share) for name, value in loads.disturbances.items()}
        loads = replace(loads, disturbances=spans)
    return replace(problem, members=members, loads=loads)


def _smaller(interval: Interval, share: float) -> Interval:
    middle = (interval.low + interval.high) / 2
    return Interval(middle) + Interval.symmetric(share * (interval.high - interval.low) / 2)


def _bounds(bounds: Bounds, share: float, own: bool) -> Bounds:
    """The assumptions of a member; its disturbances are uncertain where they are its own."""
    spans = {name: _smaller(value, share) if own else value for name, value in bounds.disturbances.items()}
    return replace(
        bounds,
        parameters={name: _smaller(value, share) for name, value in bounds.parameters.items()},
        disturbances=spans,
        noise=tuple(share * value for value in bounds.noise),
        initial=tuple(share * value for value in bounds.initial),
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
    return Verdict(
        name="uncertainty", statement=statement, margin=share - 1.0, unit="share", verdict="undecided",
        remedy=remedy, sure=share > 0.0,
    )  # fmt: skip
