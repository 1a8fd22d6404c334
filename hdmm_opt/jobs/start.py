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

from ..problem import GainSet, Member, Problem
from ..problem.margins import UNPROVED, certified_error, violation
from ..problem.member import Values
from ..problem.problem import Contracts
from .certify import contracts_of
from .options import Progress

#: Bandwidths of the outermost row, rad/s, and ratios of successive ones, from which the search begins.
OUTER, RATIOS = (5.0, 10.0, 18.0), (8.0, 14.0)
#: Shares of the gains of load networks, of ω β.
NETWORK = (0.1, 0.3)
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
    """

    gains: GainSet
    contracts: Contracts | Failure
    evaluations: int
    runs: int = 0


def cascade(problem: Problem, outer: float, ratios: Sequence[float], network: float | None = None) -> GainSet:
    """Gains with bandwidths ω_1 and ω_{i+1} = ratio_i ω_i in every member, inside the ranges of the study.

    Args:
        problem: The problem.
        outer: ω_1, rad/s.
        ratios: Ratios of the bandwidths of successive rows; the last one is repeated.
        network: Share of the gains of load networks; see `with_bandwidths`.
    """
    return {member.name: _rungs(member, outer, ratios, network) for member in problem.members}


def _rungs(member: Member, outer: float, ratios: Sequence[float], network: float | None) -> Values:
    searched = member.searched
    quiet = member.values(np.array([1.0 if member.ranges[i].name.startswith("sigma") else 0.0 for i in searched]))
    widths: list[float] = []
    for i in member.law.controlled:
        # a row that tracks nothing is as fast as the row before it
        follows = isinstance(member.plant.targets[i], int)
        ratio = ratios[min(len(widths), len(ratios)) - 1] if widths and follows and ratios else 1.0
        widths.append(widths[-1] * ratio if widths else outer)
    return with_bandwidths(member, quiet, widths, network)


def bandwidths(member: Member, values: Values) -> list[float]:
    """ω_i = g_i β_i / (2 M_i) of the controlled rows at the largest inertia, 1/s."""
    return [per * g.beta for per, g in zip(_per_gain(member, values), member.gains(values), strict=True)]


def with_bandwidths(member: Member, values: Values, widths: Sequence[float], network: float | None = None) -> Values:
    """The gains with other β, inside their ranges and in four digits.

    Args:
        member: The member.
        values: Its gains.
        widths: Bandwidths of its controlled rows, rad/s.
        network: Where it is given, every γ that is searched is this share of ω β: a quarter, and the row with its load
            network has a double pole.
    """
    made, place = list(values), {item.name: i for i, item in enumerate(member.ranges)}
    for k, (per, width) in enumerate(zip(_per_gain(member, values), widths, strict=True), 1):
        wanted = {f"beta_{k}": width / per}
        if network is not None and not member.ranges[place[f"gamma_{k}"]].fixed:
            wanted[f"gamma_{k}"] = network * width**2 / per
        for name, value in wanted.items():
            item = member.ranges[place[name]]
            made[place[name]] = min(max(float(f"{value:.4g}"), item.low), item.high)
    return tuple(made)


def _per_gain(member: Member, values: Values) -> list[float]:
    gains = member.gains(values)
    rows = error_rows(member.model, member.bounds, gains, 1e-9 * member.box, np.zeros(len(member.model.inputs)))
    # no effect at all: an actuator that may be stuck
    effects = {i: rows.control_gain[i] if rows.control_gain[i] > NOTHING else 1.0 for i in member.law.controlled}
    return [float(effect / (2 * rows.mass_high[member.model.driven[i]])) for i, effect in effects.items()]


def starting_point(problem: Problem, progress: Progress) -> Tuned:
    """The cascade with the smallest certified bound on the output, or the least bad that was met."""
    if not problem.searched:
        gains = problem.at(np.zeros(0))
        return Tuned(gains=gains, contracts=contracts_of(problem, gains), evaluations=1)
    return _Cascades(problem, progress).best()


class _Cascades:
    """A grid, then a pattern search; every cascade is looked at once."""

    def __init__(self, problem: Problem, progress: Progress) -> None:
        self.problem, self.progress = problem, progress
        stages = max(len(member.law.controlled) for member in problem.members)
        self.count = min(stages, 3)  # ω_1 and up to two ratios
        searched = [m.ranges[i].name for m in problem.members for i in m.searched]
        self.shares = NETWORK if any(name.startswith("gamma") for name in searched) else ()
        self.seen: dict[tuple[float, ...], tuple[tuple[float, float], Tuned]] = {}

    def at(self, point: tuple[float, ...]) -> tuple[float, float]:
        """Violation and certified bound of a cascade."""
        key = _short(point)
        if key not in self.seen:
            ratios, network = key[1 : self.count], key[self.count] if self.shares else None
            gains = cascade(self.problem, key[0], ratios, network)
            contracts = contracts_of(self.problem, gains)
            lacking = violation(self.problem, contracts, gains)
            bound = math.inf if isinstance(contracts, Failure) else certified_error(self.problem, contracts)
            tuned = Tuned(gains=gains, contracts=contracts, evaluations=0)
            self.seen[key] = ((lacking, bound), tuned)
            self.progress.update(0.0, f"{len(self.seen)} cascades")
        return self.seen[key][0]

    def best(self) -> Tuned:
        """The best that was met."""
        grid = [
            (outer, *[ratio] * (self.count - 1), *share)
            for outer in OUTER for ratio in RATIOS for share in ([(s,) for s in self.shares] or [()])
        ]  # fmt: skip
        best = min(grid, key=self.at)
        if self.at(best)[0] < UNPROVED:
            for step in STEPS:
                better = True
                while better:
                    around = [
                        (*best[:k], best[k] * factor, *best[k + 1 :])
                        for k in range(len(best)) for factor in (step, 1 / step)
                    ]  # fmt: skip
                    found = min(around, key=self.at)
                    better = self.at(found) < self.at(best)
                    best = found if better else best
        return replace(self.seen[_short(best)][1], evaluations=len(self.seen))


def _short(point: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(float(f"{v:.4g}") for v in point)
