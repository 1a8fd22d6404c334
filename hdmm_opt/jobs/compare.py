"""The law against its rivals: equal budget, the same scenarios, the same cost, the same knowledge of the plant."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Failure
from tuning import Budget, Outcome
from tuning import search as run_search

from ..control import GainSpec
from ..control.rivals.cascade import Cascade
from ..control.rivals.registry import rivals
from ..errors import InvalidInputError
from ..files.sections import named_gains
from ..files.state import State
from ..files.text import upward
from ..problem import Problem
from ..problem.margins import certified_error
from ..simulation import Figures, Loop, Run, Scenario, scenarios
from .certify import strongest
from .evaluation import cost_scenarios, simulated_cost
from .options import Options, Progress
from .search import search
from .start import Tuned, starting_point

Array = NDArray[np.float64]

SCHEMA = "hdmm-opt/comparison/2"
#: Methods that tune the law; the rivals are tuned by the first.
METHODS = ("jaya", "tlbo")


@dataclass(frozen=True, kw_only=True)
class Contender:
    """A tuned controller and what it did.

    Attributes:
        name: Law and method.
        gains: Its gains by name.
        cost: Closed-loop cost of the tuning, without any certified part.
        evaluations: Candidates that were simulated or refused for it.
        certified: Certified bound on the output, m; None for a law without one.
        figures: Figures by scenario.
    """

    name: str
    gains: Mapping[str, float]
    cost: float
    evaluations: int
    certified: float | None
    figures: Mapping[str, Figures]


def compare(
    problem: Problem, budget: tuple[int, int], seed: int, options: Options, progress: Progress
) -> list[Contender]:
    """Tune the law and its rivals on the study's scenarios, and run them on all.

    Args:
        problem: The problem.
        budget: Population, and evaluations of each candidate of the population, the same for all.
        seed: Seed of every search.
        options: Workers of the law's search.
        progress: Where to report.

    Returns:
        The law tuned by each method, then the rivals.

    Raises:
        InvalidInputError: all gains are fixed, or a plant that the rivals are not made for.

    Not guaranteed: that any search found the best gains; all had the same number of candidates. The law's candidates
    must be proved besides; the rivals have no such constraint, and no certificate. A rival's gains are shared by all
    members, the law has its own for each.
    """
    if not problem.searched:
        raise InvalidInputError("a comparison needs gains to search: all are fixed; give one min and max")
    progress.stage("proof of a start")
    first = starting_point(problem, progress)
    found, loop = [], Loop(problem)
    for method in METHODS:
        progress.stage(f"{problem.study.controller.law}: {method}")
        tuned = search(problem, first, method, budget, seed, options, State(None, {}, resume=False), progress)
        found.append(_law(loop, tuned, method))
    for name, kind in rivals().items():
        progress.stage(f"{name}: {METHODS[0]}")
        try:
            laws = [kind(plant=m.plant, modelling=problem.study.controller.modelling) for m in problem.members]
        except ValueError as error:
            raise InvalidInputError(f"{error}; compare another machine") from None
        found.append(_Rival(problem, name, laws).tuned(budget, seed, progress))
    return found


def _law(loop: Loop, tuned: Tuned, method: str) -> Contender:
    problem, chosen, given = loop.problem, cost_scenarios(loop.problem), scenarios(loop.problem)
    shown = loop.figures([Run(gains=tuned.gains, scenario=s) for s in (*chosen, *given)])
    best = strongest(problem, tuned.gains).contracts
    bound = None if isinstance(best, Failure) else certified_error(problem, best)
    return Contender(
        name=f"{problem.study.controller.law}, {method}", gains=named_gains(problem, tuned.gains),
        cost=simulated_cost(problem, shown[: len(chosen)]), evaluations=tuned.evaluations, certified=bound,
        figures={s.name: m for s, m in zip(given, shown[len(chosen) :], strict=True)},
    )  # fmt: skip


class _Rival:
    """A rival on a problem, with gains that all members share."""

    def __init__(self, problem: Problem, name: str, laws: Sequence[Cascade]) -> None:
        self.problem, self.name = problem, name
        self.loop = Loop(problem, laws=laws)
        self.schema: tuple[GainSpec, ...] = laws[0].schema
        if any([spec.name for spec in law.schema] != [spec.name for spec in self.schema] for law in laws):
            raise InvalidInputError(f"{name} needs members of one kind, which share its gains: compare another machine")

    def values(self, point: Array) -> tuple[float, ...]:
        """Gains at a point of the unit cube."""
        found = []
        for spec, share in zip(self.schema, point, strict=True):
            assert spec.low is not None and spec.high is not None
            found.append(float(spec.low * (spec.high / spec.low) ** share))
        return tuple(found)

    def runs(self, point: Array, chosen: Sequence[Scenario]) -> list[Run]:
        """Runs with one point's gains in every member."""
        gains = dict.fromkeys(self.problem.machine.members, self.values(point))
        return [Run(gains=gains, scenario=scenario) for scenario in chosen]

    def tuned(self, budget: tuple[int, int], seed: int, progress: Progress) -> Contender:
        """The rival after a search from the middle of its ranges."""
        problem, chosen, given = self.problem, cost_scenarios(self.problem), scenarios(self.problem)
        population, rounds = budget
        allowed = Budget(evaluations=population * (rounds + 1), seconds=problem.study.tuning.seconds or math.inf)

        def evaluate(points: Sequence[Array]) -> list[Outcome]:
            shown = self.loop.figures([run for point in points for run in self.runs(point, chosen)])
            return [_outcome(problem, shown[k : k + len(chosen)]) for k in range(0, len(shown), len(chosen))]

        def after(now: Any) -> None:
            cost = now.outcomes[now.best].cost
            progress.update(
                now.evaluations / allowed.evaluations, f"best {cost:.4g}" if math.isfinite(cost) else "lost"
            )

        middle = np.full(len(self.schema), 0.5)
        found = run_search(METHODS[0], evaluate, middle, population, seed, allowed, after=after)
        point = found.points[found.best]
        shown = self.loop.figures(self.runs(point, given))
        return Contender(
            name=f"{self.name}, {METHODS[0]}", cost=found.outcomes[found.best].cost,
            gains={spec.name: v for spec, v in zip(self.schema, self.values(point), strict=True)},
            evaluations=found.evaluations, certified=None,
            figures={s.name: m for s, m in zip(given, shown, strict=True)},
        )  # fmt: skip


def _outcome(problem: Problem, shown: Sequence[Figures]) -> Outcome:
    """Lost runs last, the earlier the worse; otherwise the cost."""
    lost = [m.diverged_s for m in shown if m.diverged]
    if lost:
        return Outcome(violation=1.0 + 1.0 / (1.0 + min(lost)), cost=math.inf)
    return Outcome(violation=0.0, cost=simulated_cost(problem, shown), runs=len(shown))


def table(found: Sequence[Contender], proved: Sequence[str], unit: str, writes: Callable[[str], None]) -> None:
    """Write the comparison as text: a line for each scenario and controller, the best figure marked.

    Args:
        found: The controllers.
        proved: Scenarios inside the assumptions of the certificates.
        unit: Unit of the output.
        writes: Called with each line.
    """
    heads = (f"max [m{unit}]", f"RMS [m{unit}]", "limit use", "certified")
    widths = (11, 12, 11, 11)
    writes(f"{'scenario':18}{'controller':16}" + "".join(f"{h:>{w}}" for h, w in zip(heads, widths, strict=True)))
    for scenario in found[0].figures:
        best = min(c.figures[scenario].rms_error_m for c in found)
        for c in found:
            m = c.figures[scenario]
            mark = "*" if not m.diverged and m.rms_error_m == best else " "
            size = (
                f"{f'lost at {m.diverged_s:.3g} s':>23}"
                if m.diverged
                else f"{1e3 * m.maximum_error_m:11.3g}{1e3 * m.rms_error_m:11.3g}{mark}"
            )
            bound = "" if c.certified is None or scenario not in proved else upward(1e3 * c.certified)
            writes(f"{scenario:18}{c.name:16}{size}{m.limit_use:11.3g}{bound:>11}")
