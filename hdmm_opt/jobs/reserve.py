"""What a loop bears beyond its assumptions, each alone, and which limit a faster loop would meet first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from stability import Bounds, Failure, Interval

from ..problem import GainSet, Problem
from ..problem.margins import margins
from ..problem.problem import Contracts
from .certify import contracts_of, refinable

#: Steps of a bisection; delays of so many periods more and errors so many times as large are looked at, no larger ones.
STEPS, PERIODS, TIMES = 5, 2.0, 8.0
#: Share of the stiffness of a spring that is taken away at most.
SOFTEST = 0.9


def reserve_lines(problem: Problem, gains: GainSet, contracts: Contracts) -> list[str]:
    """How much more delay and error, and how much less stiffness, is still proved bounded; and the tightest limit.

    Not guaranteed: that more is not proved; between what is and what is not, bisection takes one crossing.
    """
    period = problem.period
    late = _largest(problem, gains, PERIODS, lambda bounds, more: replace(bounds, delay=bounds.delay + more * period))
    told = [f"{_least(late, PERIODS)}{late * period * 1e3:.3g} ms more of delay"]
    if any(v > 0 for member in problem.members for v in member.bounds.noise):
        noisy = _largest(problem, gains, TIMES - 1, _noisier)
        told.append(f"measurement errors {_least(noisy, TIMES - 1)}{1 + noisy:.3g} times as large")
    springs = {name.partition("/")[2] for member in problem.members for name in member.model.quotients}
    for name in sorted(springs):
        less = _largest(problem, gains, SOFTEST, partial(_softer, name))
        told.append(f"a {name} down to {100 * (1 - less):.3g} % of what is assumed")
    tightest = max((m for m in margins(problem, contracts) if m.kind != "error"), key=lambda m: m.share)
    return [
        f"beyond its assumptions, and where limits allow it, the loop is proved bounded with {' or '.join(told)}",
        f"a faster loop meets first: {tightest.label}, of which {100 * tightest.share:.3g} % are used",
    ]


def _least(found: float, most: float) -> str:
    return "at least " if found == most else ""


def _noisier(bounds: Bounds, more: float) -> Bounds:
    return replace(bounds, noise=tuple((1 + more) * v for v in bounds.noise))


def _softer(name: str, bounds: Bounds, less: float) -> Bounds:
    known = bounds.parameters
    return replace(bounds, parameters={**known, name: known[name] * Interval(1 - less)} if name in known else known)


def _largest(problem: Problem, gains: GainSet, most: float, changed: Callable[[Bounds, float], Bounds]) -> float:
    """The largest change up to `most` under which the loop is certified, by bisection; 0 where none is."""

    def good(more: float) -> bool:
        members = tuple(member.under(changed(member.bounds, more)) for member in problem.members)
        found = contracts_of(replace(problem, members=members), gains, refine=refinable(problem))
        return not isinstance(found, Failure)

    if good(most):
        return most
    low, high = 0.0, most
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return low
