"""Accuracy against effort: the proved designs that no other one beats in every objective."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from stability import Composition, Gains
from tuning import Outcome, Population, front, pareto_jaya, start

from .axis import KINDS
from .evaluation import OBJECTIVES, make_evaluator
from .problem import Problem, assemble
from .selection import Options, Progress, kept_population, starting_point, to_data
from .state import State
from .study import Study
from .workers import workers

SCHEMA = "hdmm-opt/tradeoff/1"


@dataclass(frozen=True, kw_only=True)
class Tradeoff:
    """A Pareto set.

    Attributes:
        gains: Proved gains, in the order of the first objective.
        outcomes: What each is worth; the objectives are `evaluation.OBJECTIVES`.
        evaluations: Candidates evaluated.
    """

    gains: tuple[tuple[Gains, ...], ...]
    outcomes: tuple[Outcome, ...]
    evaluations: int


def tradeoff(study: Study, options: Options, progress: Progress, size: tuple[int, int]) -> tuple[Tradeoff, State]:
    """Search the Pareto set of a study's gains by multi-objective JAYA.

    Args:
        study: A validated study with gains to search.
        options: Seed, workers, state.
        progress: Where to report.
        size: Population and iterations.

    Returns:
        The set, and the state, to be removed once the set is safe. Certificates are searched, not checked exactly: a
        design that is to be used goes through `design` with its gains as values.
    """
    problem = assemble(study)
    seed = study.tuning.seed if options.seed is None else options.seed
    population, iterations = size
    job = {"tradeoff": study.model_dump(mode="json"), "seed": seed, "size": list(size)}
    state = State(options.state, job, resume=options.resume)
    progress.stage("convex selection")
    first = starting_point(problem)
    progress.stage("Pareto search")
    composed = isinstance(first.certificate, Composition)
    with workers(make_evaluator, (study, composed), options.jobs, options.cluster) as pool:
        now = kept_population(state) or start(pool.map, problem.point(first.gains), population, seed)
        while now.iteration < iterations:
            now = pareto_jaya(pool.map, now)
            state.put("search", to_data(now))
            progress.update(now.iteration / iterations, f"{len(front(now.outcomes))} designs")
    return _set(problem, now), state


def _set(problem: Problem, now: Population) -> Tradeoff:
    """The front, each design once."""
    found: dict[tuple[Gains, ...], Outcome] = {}
    for i in front(now.outcomes):
        found.setdefault(problem.gains(now.points[i]), now.outcomes[i])
    return Tradeoff(gains=tuple(found), outcomes=tuple(found.values()), evaluations=now.evaluations)


def rows(found: Tradeoff) -> list[dict[str, Any]]:
    """The set as data: gains, and objectives by name."""
    return [
        {
            "gains": {f"{kind}_{k + 1}": getattr(g, kind) for k, g in enumerate(gains) for kind in KINDS},
            "objectives": dict(zip(OBJECTIVES, outcome.objectives, strict=True)),
            "cost": outcome.cost if math.isfinite(outcome.cost) else None,
        }
        for gains, outcome in zip(found.gains, found.outcomes, strict=True)
    ]
