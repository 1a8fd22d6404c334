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

from ..control import GainSpec, Law
from ..control.fitted import fitted
from ..control.rivals.registry import rivals
from ..control.rivals.rival import Rival
from ..errors import InvalidInputError
from ..files.comparison import error_text, peaks_text
from ..files.sections import named_gains
from ..files.state import State
from ..files.text import upward
from ..problem import GainSet, Problem
from ..problem.margins import certified_error, violation
from ..simulation import Figures, Loop, Run
from .certify import refinable, strongest
from .challenges import Ground, grounds
from .evaluation import cost_scenarios, simulated_cost
from .options import Options, Progress
from .search import search
from .start import Tuned, starting_point

Array = NDArray[np.float64]

SCHEMA = "hdmm-opt/comparison/3"
#: What is added to the name of the law where it is tuned as its rivals are, without a proof.
UNPROVED = ", free"
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
        options: Workers of the law's search, and threads of the runs of all others.
        progress: Where to report.
        seeds: Searches of each controller.

    Returns:
        The law, the law tuned without a proof, then the rivals. All see the same sensors, observer, delay and limits,
        tuned on `cost_scenarios` and scored on `grounds`.

    Raises:
        InvalidInputError: all gains are fixed, or a plant that the rivals are not made for.

    Not guaranteed: that any search found the best gains; all had the same number of candidates. The law's candidates
    must be proved besides; the rivals have no such constraint, and no certificate. A rival's gains are shared by all
    members, the law has its own for each.
    """
    if not problem.searched:
        raise InvalidInputError("a comparison needs gains to search: all are fixed; give one min and max")
    against = {name: _laws(problem, kind) for name, kind in rivals().items() if _suits(problem, kind)}
    if not against:
        rules = dict.fromkeys(f"{kind.NAME} {kind.NEEDS}" for kind in rivals().values())
        raise InvalidInputError(f"no rival is made for this machine: {'; '.join(rules)}; compare another machine")
    progress.stage("proof of a start")
    first, fine = starting_point(problem, progress), refinable(problem)
    law, numbers, trials = problem.study.controller.law, range(seed, seed + seeds), []
    own, ways = [member.law for member in problem.members], grounds(problem, seed)
    loop, score = Loop(problem), _Score(ways, own)
    for number in numbers:
        progress.stage(f"{law}, seed {number}")
        state = State(None, {}, resume=False)
        tuned = search(problem, first, METHOD, budget, number, options, state, progress, refine=fine)
        trials.append(_law(loop, tuned, score))
    found = [Contender(name=law, trials=tuple(trials))]

    def contend(name: str, simulated: _Simulated) -> None:
        made = []
        for number in numbers:
            progress.stage(f"{name}, seed {number}")
            made.append(simulated.tuned(budget, number, options.jobs, progress))
        found.append(Contender(name=name, trials=tuple(made)))

    contend(f"{law}{UNPROVED}", _Simulated(problem, ways, own))
    for name, laws in against.items():
        contend(name, _Rival(problem, ways, name, laws))
    return found


def _suits(problem: Problem, kind: type[Rival]) -> bool:
    return all(kind.suits(member.plant) for member in problem.members)


def _laws(problem: Problem, kind: type[Rival]) -> list[Rival]:
    """A rival for each member."""
    return [kind(plant=m.plant, modelling=problem.study.controller.modelling) for m in problem.members]


class _Score:
    """Runs of one kind of controller on all that tuned ones are scored on."""

    def __init__(self, ways: Sequence[Ground], laws: Sequence[Law]) -> None:
        self.loops = [
            (Loop(ground, laws=[fitted(law, m.plant) for law, m in zip(laws, ground.members, strict=True)]), chosen)
            for ground, chosen in ways
        ]

    def of(self, gains: GainSet) -> dict[str, Figures]:
        """Figures by scenario."""
        return {
            s.name: m
            for loop, chosen in self.loops
            for s, m in zip(chosen, loop.figures([Run(gains=gains, scenario=s) for s in chosen]), strict=True)
        }


def _law(loop: Loop, tuned: Tuned, score: _Score) -> Trial:
    problem, chosen = loop.problem, cost_scenarios(loop.problem)
    shown = loop.figures([Run(gains=tuned.gains, scenario=s) for s in chosen])
    return Trial(
        gains=named_gains(problem, tuned.gains), cost=simulated_cost(problem, shown),
        evaluations=tuned.evaluations, certified=_bound(problem, tuned.gains), figures=score.of(tuned.gains),
    )  # fmt: skip


def _bound(problem: Problem, gains: GainSet) -> float | None:
    """The certified bound on the output, m; None where there is none, or where the certified set passes a limit."""
    found = strongest(problem, gains).contracts
    if isinstance(found, Failure) or violation(problem, found, gains) > 0:
        return None
    return certified_error(problem, found)


class _Simulated:
    """A controller that is tuned in simulation alone: the law itself, with gains that need no proof."""

    def __init__(self, problem: Problem, ways: Sequence[Ground], laws: Sequence[Law]) -> None:
        self.problem, self.size = problem, problem.searched
        self.loop, self.score = Loop(problem, laws=laws), _Score(ways, laws)

    def gains(self, point: Array) -> GainSet:
        """Gains of all members at a point of the unit cube."""
        return self.problem.at(point)

    def named(self, point: Array) -> Mapping[str, float]:
        """What a point stands for."""
        return named_gains(self.problem, self.gains(point))

    def bound(self, gains: GainSet) -> float | None:
        """A certified bound, m, where the gains happen to have one."""
        return _bound(self.problem, gains)

    def tuned(self, budget: tuple[int, int], seed: int, jobs: int, progress: Progress) -> Trial:
        """What a search from the middle of its ranges finds."""
        problem, chosen = self.problem, cost_scenarios(self.problem)
        population, rounds = budget
        allowed = Budget(evaluations=population * (rounds + 1), seconds=problem.study.tuning.seconds or math.inf)

        def evaluate(points: Sequence[Array]) -> list[Outcome]:
            runs = [Run(gains=self.gains(p), scenario=s) for p in points for s in chosen]
            shown = self.loop.figures(runs, jobs=jobs)
            return [_outcome(problem, shown[k : k + len(chosen)]) for k in range(0, len(shown), len(chosen))]

        def after(now: Any) -> None:
            cost = now.outcomes[now.best].cost
            progress.update(
                now.evaluations / allowed.evaluations, f"best {cost:.4g}" if math.isfinite(cost) else "lost"
            )

        found = run_search(METHOD, evaluate, np.full(self.size, 0.5), population, seed, allowed, after=after)
        point = found.points[found.best]
        gains = self.gains(point)
        return Trial(
            cost=found.outcomes[found.best].cost, gains=self.named(point), evaluations=found.evaluations,
            certified=self.bound(gains), figures=self.score.of(gains),
        )  # fmt: skip


class _Rival(_Simulated):
    """A rival on a problem, with gains that all members share."""

    def __init__(self, problem: Problem, ways: Sequence[Ground], name: str, laws: Sequence[Rival]) -> None:
        super().__init__(problem, ways, laws)
        self.schema: tuple[GainSpec, ...] = laws[0].schema
        self.size = len(self.schema)
        if any([spec.name for spec in law.schema] != [spec.name for spec in self.schema] for law in laws):
            raise InvalidInputError(f"{name} needs members of one kind, which share its gains: compare another machine")

    def named(self, point: Array) -> Mapping[str, float]:
        found = {}
        for spec, share in zip(self.schema, point, strict=True):
            assert spec.low is not None and spec.high is not None
            found[spec.name] = float(spec.low * (spec.high / spec.low) ** share)
        return found

    def gains(self, point: Array) -> GainSet:
        return dict.fromkeys(self.problem.machine.members, tuple(self.named(point).values()))

    def bound(self, gains: GainSet) -> float | None:
        return None


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
    head = "".join(f"{h:>{w}}" for h, w in zip(heads, widths, strict=True))
    writes(f"{'scenario':18}{'controller':15}{head}  peaks in SI units")
    for scenario in found[0].trials[0].figures:
        best = min(c.middle(scenario).maximum_error_m for c in found)
        for c in found:
            errors, m = c.errors(scenario), c.middle(scenario)
            bound = "" if c.certified is None or scenario not in proved else upward(1e3 * c.certified)
            sizes = [error_text(error) for error in (m.maximum_error_m, errors[0], errors[-1])]
            sizes[0] += "*" if math.isfinite(best) and m.maximum_error_m == best else ""
            travel = sum(own.travel for own in m.members.values())
            rest = (error_text(m.rms_error_m), f"{m.settling_time_s:.3g}", f"{m.limit_use:.3g}", f"{travel:.4g}", bound)
            cells = zip((*sizes, *rest), widths, strict=True)
            line = "".join(f"{text:>{width}}" for text, width in cells)
            writes(f"{scenario:18}{c.name:15}{line}  {peaks_text(m)}".rstrip())
