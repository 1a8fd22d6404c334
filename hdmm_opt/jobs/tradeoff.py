"""Accuracy against effort: the proved designs that no other one beats in every objective."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tuning import Outcome, Population, front, pareto_jaya, start

from ..errors import InvalidInputError
from ..files.sections import named_gains
from ..files.state import State
from ..problem import GainSet, Problem, assemble
from ..study import Study
from .checkpoint import kept_population, to_data
from .evaluation import OBJECTIVES, make_evaluator
from .options import FULL, Options, Progress
from .space import Window
from .start import starting_point
from .workers import workers

SCHEMA = "hdmm-opt/tradeoff/1"


@dataclass(frozen=True, kw_only=True)
class Tradeoff:
    """A Pareto set.

    Attributes:
        problem: What was worked on.
        gains: Proved gains, in the order of the first objective.
        outcomes: What each is worth; the objectives are `evaluation.OBJECTIVES`.
        evaluations: Candidates evaluated.
    """

    problem: Problem
    gains: tuple[GainSet, ...]
    outcomes: tuple[Outcome, ...]
    evaluations: int


#: Population and iterations of a quick trade-off of one member; those of the study where members are linked.
QUICK = (32, 25)


def tradeoff(
    study: Study, options: Options, progress: Progress, size: tuple[int, int] | None = None
) -> tuple[Tradeoff, State]:
    """Search the Pareto set of a study's gains by multi-objective JAYA.

    Args:
        study: A validated study with gains to search.
        options: Seed, workers, state.
        progress: Where to report.
        size: Population and iterations; those of the budget where None.

    Raises:
        InvalidInputError: all gains are fixed.

    Returns:
        The set, and the state, to be removed once the set is safe. Certificates are searched, not checked exactly: a
        design that is to be used goes through `design` with its gains as values.
    """
    problem = assemble(study)
    if not problem.searched:
        raise InvalidInputError("a trade-off needs gains to search: all are fixed; give one min and max")
    seed = options.seed_of(study)
    own = (study.tuning.population, study.tuning.iterations) if problem.linked else QUICK
    size = size or ((FULL.population, FULL.iterations) if options.full else own)
    population, iterations = size
    job = {"tradeoff": study.model_dump(mode="json"), "seed": seed, "size": list(size)}
    state = State(options.state, job, resume=options.resume)
    progress.stage("bandwidth cascades")
    first = starting_point(problem, progress)
    progress.stage("Pareto search")
    begin = problem.point(first.gains)
    window = Window.around(problem, begin)
    with workers(make_evaluator, (study, window), options.jobs, options.cluster) as pool:
        now = kept_population(state) or start(pool.map, window.local(begin), population, seed)
        while now.iteration < iterations:
            now = pareto_jaya(pool.map, now)
            state.put("search", to_data(now))
            progress.update(now.iteration / iterations, f"{len(front(now.outcomes))} designs")
    return _set(problem, window, now), state


def _set(problem: Problem, window: Window, now: Population) -> Tradeoff:
    """The front, each design once."""
    found: dict[tuple, tuple[GainSet, Outcome]] = {}
    for i in front(now.outcomes):
        gains = problem.at(window.at(now.points[i]))
        found.setdefault(tuple(gains.values()), (gains, now.outcomes[i]))
    return Tradeoff(
        problem=problem, gains=tuple(gains for gains, _ in found.values()),
        outcomes=tuple(outcome for _, outcome in found.values()), evaluations=now.evaluations,
    )  # fmt: skip


def rows(found: Tradeoff) -> list[dict[str, Any]]:
    """The set as data: gains, and objectives by name."""
    return [
        {
            "gains": named_gains(found.problem, gains),
            "objectives": dict(zip(OBJECTIVES, outcome.objectives, strict=True)),
            "cost": outcome.cost if math.isfinite(outcome.cost) else None,
        }
        for gains, outcome in zip(found.gains, found.outcomes, strict=True)
    ]
