"""Stage one of the gain selection: bandwidth cascades to a proved start.

A cascade gives every controlled row of a member a bandwidth ω_i = g_i β_i / (2 M_i), each a ratio above that of the
row before it, the same in all members. A grid of such cascades and a pattern search find the one with the smallest
certified bound on the output.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stability import Failure, error_rows
from stability.certificates.composition import Composition

from ..problem import GainSet, Member, Problem
from ..problem.margins import UNPROVED, certified_error, violation
from ..problem.member import Values
from ..problem.problem import Contracts
from .certify import contracts_of
from .options import Progress

#: Bandwidths of the outermost row, rad/s, and ratios of successive ones, from which the search begins.
OUTER, RATIOS = (5.0, 10.0, 18.0), (8.0, 14.0)
#: Step factors of the pattern search that improves the best of them.
STEPS = (1.5, 1.2)
#: An effect of a control below this is none.
NOTHING = 1e-300


@dataclass(frozen=True, kw_only=True)
class Tuned:
    """Gains with their proof, or why there is none.

    Attributes:
        gains: Gains of all members.
        contracts: Their proofs, or why there are none.
        evaluations: Candidates that were looked at.
        runs: Closed-loop runs that were spent.
        composed: Whether a composition is among the proofs: candidates are then judged by compositions too.
    """

    gains: GainSet
    contracts: Contracts | Failure
    evaluations: int
    runs: int = 0
    composed: bool = False


def cascade(problem: Problem, outer: float, ratios: Sequence[float]) -> GainSet:
    """Gains with bandwidths ω_1 and ω_{i+1} = ratio_i ω_i in every member, inside the ranges of the study.

    Args:
        problem: The problem.
        outer: ω_1, rad/s.
        ratios: Ratios of the bandwidths of successive rows; the last one is repeated.
    """
    return {member.name: _rungs(member, outer, ratios) for member in problem.members}


def _rungs(member: Member, outer: float, ratios: Sequence[float]) -> Values:
    searched = member.searched
    quiet = member.values(np.array([1.0 if member.ranges[i].name.startswith("sigma") else 0.0 for i in searched]))
    widths: list[float] = []
    for i in member.law.controlled:
        # a row that tracks nothing is as fast as the row before it
        follows = isinstance(member.plant.targets[i], int)
        ratio = ratios[min(len(widths), len(ratios)) - 1] if widths and follows and ratios else 1.0
        widths.append(widths[-1] * ratio if widths else outer)
    return with_bandwidths(member, quiet, widths)


def bandwidths(member: Member, values: Values) -> list[float]:
    """ω_i = g_i β_i / (2 M_i) of the controlled rows at the largest inertia, 1/s."""
    return [per * g.beta for per, g in zip(_per_gain(member, values), member.gains(values), strict=True)]


def with_bandwidths(member: Member, values: Values, widths: Sequence[float]) -> Values:
    """The gains with other β, inside their ranges and in four digits."""
    made = list(values)
    for k, (per, width) in enumerate(zip(_per_gain(member, values), widths, strict=True)):
        index = next(i for i, item in enumerate(member.ranges) if item.name == f"beta_{k + 1}")
        item = member.ranges[index]
        made[index] = min(max(float(f"{width / per:.4g}"), item.low), item.high)
    return tuple(made)


def _per_gain(member: Member, values: Values) -> list[float]:
    gains = member.gains(values)
    rows = error_rows(member.model, member.bounds, gains, 1e-9 * member.box, np.zeros(len(member.model.inputs)))
    # no effect at all: an actuator that may be stuck
    effects = {i: rows.control_gain[i] if rows.control_gain[i] > NOTHING else 1.0 for i in member.law.controlled}
    return [float(effect / (2 * rows.mass_high[i])) for i, effect in effects.items()]


def starting_point(problem: Problem, progress: Progress) -> Tuned:
    """The cascade with the smallest certified bound on the output, or the least bad that was met."""
    if not problem.searched:
        gains = problem.at(np.zeros(0))
        contracts = contracts_of(problem, gains, composed=True)
        return Tuned(gains=gains, contracts=contracts, evaluations=1, composed=_composed(contracts))
    found = _Cascades(problem, progress, composed=False).best()
    if not isinstance(found.contracts, Failure) or problem.linked:
        return found
    return _Cascades(problem, progress, composed=True).best()


def _composed(contracts: Contracts | Failure) -> bool:
    if isinstance(contracts, Failure):
        return False
    return any(isinstance(contract.certificate, Composition) for contract in contracts.values())


class _Cascades:
    """A grid, then a pattern search; every cascade is looked at once."""

    def __init__(self, problem: Problem, progress: Progress, *, composed: bool) -> None:
        self.problem, self.progress, self.composed = problem, progress, composed
        stages = max(len(member.law.controlled) for member in problem.members)
        self.count = min(stages, 3)  # ω_1 and up to two ratios
        self.seen: dict[tuple[float, ...], tuple[tuple[float, float], Tuned]] = {}

    def at(self, point: tuple[float, ...]) -> tuple[float, float]:
        """Violation and certified bound of a cascade."""
        key = _short(point)
        if key not in self.seen:
            gains = cascade(self.problem, key[0], key[1:])
            contracts = contracts_of(self.problem, gains, composed=self.composed)
            lacking = violation(self.problem, contracts, gains)
            bound = math.inf if isinstance(contracts, Failure) else certified_error(self.problem, contracts)
            tuned = Tuned(gains=gains, contracts=contracts, evaluations=0, composed=_composed(contracts))
            self.seen[key] = ((lacking, bound), tuned)
            self.progress.update(0.0, f"{len(self.seen)} cascades")
        return self.seen[key][0]

    def best(self) -> Tuned:
        """The best that was met."""
        grid = [(outer, *[ratio] * (self.count - 1)) for outer in OUTER for ratio in RATIOS]
        best = min(grid, key=self.at)
        if self.at(best)[0] < UNPROVED:
            for step in STEPS:
                better = True
                while better:
                    around = [
                        (*best[:k], best[k] * factor, *best[k + 1 :])
                        for k in range(self.count) for factor in (step, 1 / step)
                    ]  # fmt: skip
                    found = min(around, key=self.at)
                    better = self.at(found) < self.at(best)
                    best = found if better else best
        return replace(self.seen[_short(best)][1], evaluations=len(self.seen))


def _short(point: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(float(f"{v:.4g}") for v in point)
