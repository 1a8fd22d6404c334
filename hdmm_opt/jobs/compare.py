"""The law against its rivals: equal budget and seeds, the same scenarios, sensors, cost and knowledge of the plant."""

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
from ..simulation import Figures, Loop, Run, Scenario
from .certify import strongest
from .challenges import challenges
from .evaluation import cost_scenarios, simulated_cost
from .options import Options, Progress
from .search import search
from .start import Tuned, starting_point

Array = NDArray[np.float64]

SCHEMA = "hdmm-opt/comparison/3"
#: Method that tunes all, and searches with seeds of their own.
METHOD, SEEDS = "jaya", 5


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A controller as one search tuned it, and what it did.

    Attributes:
        gains: Its gains by name.
        cost: Closed-loop cost of the tuning, without any certified part.
        evaluations: Candidates that were simulated or refused for it.
        certified: Certified bound on the output, m; None for a law without one.
        figures: Figures by scenario.
    """

    gains: Mapping[str, float]
    cost: float
    evaluations: int
    certified: float | None
    figures: Mapping[str, Figures]


@dataclass(frozen=True, kw_only=True)
class Contender:
    """A controller, tuned anew with every seed.

    Attributes:
        name: Law.
        trials: One for each seed.
    """

    name: str
    trials: tuple[Trial, ...]

    def errors(self, scenario: str) -> list[float]:
        """Largest errors of the output after the transient in a scenario, m, sorted; infinite for lost runs."""
        return sorted(trial.figures[scenario].maximum_error_m for trial in self.trials)

    def middle(self, scenario: str) -> Figures:
        """Figures of the trial with the middle error."""
        ranked = sorted(self.trials, key=lambda trial: trial.figures[scenario].maximum_error_m)
        return ranked[len(ranked) // 2].figures[scenario]

    @property
    def certified(self) -> float | None:
        """The middle of the certified bounds, m; None where a trial has none."""
        bounds = sorted(t.certified if t.certified is not None else math.inf for t in self.trials)
        middle = bounds[len(bounds) // 2]
        return middle if math.isfinite(middle) else None


def compare(
    problem: Problem, budget: tuple[int, int], seed: int, options: Options, progress: Progress, *, seeds: int = SEEDS
) -> list[Contender]:
    """Tune the law and its rivals on some of the study's scenarios, and score them on all and on others.

    Args:
        problem: The problem.
        budget: Population, and evaluations of each candidate of the population, the same for all.
        seed: First seed of the searches.
        options: Workers of the law's search.
        progress: Where to report.
        seeds: Searches of each controller.

    Returns:
        The law, then the rivals. All see the same sensors, observer, delay and limits, tuned on `cost_scenarios` and
        scored on `challenges`.

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
    loop, law, numbers = Loop(problem), problem.study.controller.law, range(seed, seed + seeds)
    trials = []
    for number in numbers:
        progress.stage(f"{law}, seed {number}")
        state = State(None, {}, resume=False)
        trials.append(_law(loop, search(problem, first, METHOD, budget, number, options, state, progress), seed))
    found = [Contender(name=law, trials=tuple(trials))]
    for name, kind in rivals().items():
        try:
            laws = [kind(plant=m.plant, modelling=problem.study.controller.modelling) for m in problem.members]
        except ValueError as error:
            raise InvalidInputError(f"{error}; compare another machine") from None
        rival, trials = _Rival(problem, name, laws), []
        for number in numbers:
            progress.stage(f"{name}, seed {number}")
            trials.append(rival.tuned(budget, number, seed, progress))
        found.append(Contender(name=name, trials=tuple(trials)))
    return found


def _law(loop: Loop, tuned: Tuned, seed: int) -> Trial:
    problem, chosen, given = loop.problem, cost_scenarios(loop.problem), challenges(loop.problem, seed)
    shown = loop.figures([Run(gains=tuned.gains, scenario=s) for s in (*chosen, *given)])
    best = strongest(problem, tuned.gains).contracts
    bound = None if isinstance(best, Failure) else certified_error(problem, best)
    return Trial(
        gains=named_gains(problem, tuned.gains), cost=simulated_cost(problem, shown[: len(chosen)]),
        evaluations=tuned.evaluations, certified=bound,
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

    def tuned(self, budget: tuple[int, int], seed: int, noise: int, progress: Progress) -> Trial:
        """The rival after a search from the middle of its ranges."""
        problem, chosen, given = self.problem, cost_scenarios(self.problem), challenges(self.problem, noise)
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
        found = run_search(METHOD, evaluate, middle, population, seed, allowed, after=after)
        point = found.points[found.best]
        shown = self.loop.figures(self.runs(point, given))
        return Trial(
            cost=found.outcomes[found.best].cost,
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
    """Write the comparison as text: a line for each scenario and controller, the least error marked.

    Args:
        found: The controllers.
        proved: Scenarios inside the assumptions of the certificates.
        unit: Unit of the output.
        writes: Called with each line.
    """
    heads = (f"max [m{unit}]", "least", "most", f"RMS [m{unit}]", "settled [s]", "limits", "travel", "certified")
    widths = (11, 10, 10, 11, 12, 8, 10, 11)
    writes(f"{'scenario':18}{'controller':15}" + "".join(f"{h:>{w}}" for h, w in zip(heads, widths, strict=True)))
    for scenario in found[0].trials[0].figures:
        best = min(c.middle(scenario).maximum_error_m for c in found)
        for c in found:
            errors, m = c.errors(scenario), c.middle(scenario)
            bound = "" if c.certified is None or scenario not in proved else upward(1e3 * c.certified)
            sizes = [_size(error) for error in (m.maximum_error_m, errors[0], errors[-1])]
            sizes[0] += "*" if math.isfinite(best) and m.maximum_error_m == best else ""
            travel = sum(own.travel for own in m.members.values())
            rest = (_size(m.rms_error_m), f"{m.settling_time_s:.3g}", f"{m.limit_use:.3g}", f"{travel:.4g}", bound)
            cells = zip((*sizes, *rest), widths, strict=True)
            writes(f"{scenario:18}{c.name:15}" + "".join(f"{text:>{width}}" for text, width in cells))


def _size(error: float) -> str:
    return f"{1e3 * error:.3g}" if math.isfinite(error) else "lost"
