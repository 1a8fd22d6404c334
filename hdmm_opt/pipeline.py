"""The main job: study -> reference -> gains -> proof -> validation -> gain file."""

from __future__ import annotations

import json
import math
import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Composition, Failure, Gains, checker
from tuning import Executor, Outcome, SearchState, Selection, select, start, step

from . import gain_file, validation
from .errors import InvalidInputError
from .problem import KINDS, Problem, assemble, resolved
from .proof import Verdict, certificate, diagnose, slacks, violation
from .simulation import scenarios
from .study import Study

Array = NDArray[np.float64]

#: Scenarios of the study that enter the cost of a candidate.
COST_SCENARIOS = 2
#: Population, iterations and Monte Carlo runs of `--budget full`.
FULL = (50, 100, 1000)
#: Points of the gain ranges at which the first stage begins, on the diagonal of the unit cube.
LADDER = (0.2, 0.35, 0.5, 0.65, 0.8)


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Where the pipeline reports to.

    Attributes:
        stage: Called with the name of a stage.
        update: Called with a share of the stage done, and a text such as the best so far.
    """

    stage: Callable[[str], None] = lambda name: None
    update: Callable[[float, str], None] = lambda share, text: None


@dataclass(frozen=True, kw_only=True)
class Design:
    """A finished run.

    Attributes:
        document: The gain file; None where the design was refused.
        report: The checker's report on it; None where no certificate was found.
        verdicts: What failed, the cause first; empty for a proved design that meets its requirements.
        missed: Requirements that a simulation missed.
        gains: The gains.
    """

    document: dict[str, Any] | None
    report: checker.Report | None
    verdicts: tuple[Verdict, ...]
    missed: tuple[str, ...]
    gains: tuple[Gains, ...]


@dataclass(frozen=True, kw_only=True)
class Options:
    """How to run.

    Attributes:
        seed: Seed of the search; that of the study where None.
        jobs: Processes for candidates.
        full: The large budget.
        state: File that keeps the state of the search; None keeps none.
        resume: Go on from that file.
    """

    seed: int | None = None
    jobs: int = 1
    full: bool = False
    state: Path | None = None
    resume: bool = False


def design(study: Study, options: Options, progress: Progress) -> Design:
    """Run the whole pipeline.

    Args:
        study: A validated study.
        options: Seed, processes, budget.
        progress: Where to report.

    Returns:
        The design; proved by the checker, or with what failed.

    Raises:
        InvalidInputError: the study cannot be made concrete, or a state file does not fit it.
    """
    begun = time.perf_counter()
    progress.stage("reference")
    problem = assemble(study)
    seed = study.tuning.seed if options.seed is None else options.seed
    progress.stage("gains: convex selection")
    chosen = starting_point(problem)
    gains, evaluations = chosen.gains, chosen.rounds
    budget = _budget(study, options)
    if problem.searched and budget[1]:
        progress.stage("gains: JAYA")
        gains, evaluations = search(problem, chosen.gains, budget, seed, options, progress)
    progress.stage("proof")
    found = certificate(problem, gains)
    if isinstance(found, Failure) or violation(problem, found, gains) > 0:
        return _refused(problem, gains)
    progress.stage("validation")
    shown = validation.validate(
        problem, gains, seed=seed, monte_carlo=budget[2], progress=lambda part: progress.update(0.0, part)
    )
    provenance = _provenance(seed, options, evaluations, begun)
    document = gain_file.build(problem, gains, found, validation.to_data(problem, shown, found), provenance)
    progress.stage("exact check")
    finished, report = gain_file.prove(document)
    if shown.largest_error > found.radii[0]:
        raise AssertionError(
            f"defect: a simulation reached {shown.largest_error} m, outside the certified {found.radii[0]} m"
        )
    verdicts = tuple(_from_checker(report))
    accepted = report.status == 0 and not shown.missed
    return Design(
        document=finished if accepted else None, report=report, verdicts=verdicts, missed=shown.missed, gains=gains
    )


def starting_point(problem: Problem) -> Selection:
    """Stage one: proved gains by convex programs, or the least bad that were met."""
    count = len(problem.law.governed)
    if not problem.searched:
        gains = problem.gains(np.zeros(0))
        return Selection(gains=gains, certificate=certificate(problem, gains), rounds=1)
    ladder = [problem.gains(np.full(len(problem.searched), share)) for share in LADDER]
    return select(
        lambda gains: certificate(problem, gains),
        lambda found: violation(problem, found, ()),
        ladder,
        [(problem.ranges[4 * k].low, problem.ranges[4 * k].high) for k in range(count)],
        problem.study.requirements.tracking_error_m,
    )


def _budget(study: Study, options: Options) -> tuple[int, int, int]:
    if options.full:
        return FULL
    return study.tuning.population, study.tuning.iterations, study.validation.monte_carlo


def search(
    problem: Problem, first: tuple[Gains, ...], budget: tuple[int, int, int], seed: int, options: Options,
    progress: Progress,
) -> tuple[tuple[Gains, ...], int]:  # fmt: skip
    """Stage two: JAYA over the proved set, with the closed-loop cost."""
    population, iterations, _ = budget
    key = checker.digest({"study": resolved(problem), "seed": seed, "budget": list(budget)})
    with Executor(make_evaluator, (problem.study,), options.jobs) as executor:
        state = _restore(options, key)
        if state is None:
            state = start(executor.map, problem.point(first), population, seed)
            _keep(options, key, state)
        while state.iteration < iterations:
            state = step(executor.map, state)
            _keep(options, key, state)
            cost = state.outcomes[state.best].cost
            progress.update(
                state.iteration / iterations, f"best {cost:.4g}" if math.isfinite(cost) else "none proved yet"
            )
    return problem.gains(state.population[state.best]), state.evaluations


def make_evaluator(study: Study) -> Callable[[Array], Outcome]:
    """The outcome of a candidate as a pure function; infeasible candidates are never simulated."""
    problem = assemble(study)
    runs = scenarios(study)[:COST_SCENARIOS]

    def evaluate(point: Array) -> Outcome:
        gains = problem.gains(point)
        found = certificate(problem, gains)
        excess = violation(problem, found, gains)
        if excess > 0 or isinstance(found, Failure):
            return Outcome(violation=max(excess, 1e-12), cost=math.inf)
        return Outcome(violation=0.0, cost=closed_loop_cost(problem, gains, found, runs))

    return evaluate


def closed_loop_cost(problem: Problem, gains: tuple[Gains, ...], found: Composition, runs: list[Any]) -> float:
    """Weighted RMS error, certified bound, ITAE and effort, each relative to its requirement or limit."""
    weights, required = problem.study.tuning.weights, problem.study.requirements.tracking_error_m
    duration = problem.reference.duration
    effort = max(size / limit for name, size, limit, _ in slacks(problem, found) if name != "tracking error")
    total = weights.certified_bound * float(found.ball[0]) / required + weights.effort * effort
    for scenario in runs:
        shown = validation.figures(problem, problem.loop.run(gains, problem.reference, scenario))
        if shown.diverged:
            return math.inf
        total += weights.rms_error * shown.rms_error_m / required / len(runs)
        total += weights.itae * 2 * shown.itae / (required * duration**2) / len(runs)
    return total


def _refused(problem: Problem, gains: tuple[Gains, ...]) -> Design:
    return Design(document=None, report=None, verdicts=tuple(diagnose(problem, gains)), missed=(), gains=gains)


def _from_checker(report: checker.Report) -> list[Verdict]:
    if report.status == 0:
        return []
    failed = [
        Verdict(
            name=o.name, statement=o.statement, margin=o.margin, unit=o.unit, verdict=o.verdict,
            remedy="the search accepted these gains with too little room; widen the gain ranges or the limits",
        )
        for o in report.obligations
        if o.verdict != "proved"
    ]  # fmt: skip
    return failed or [
        Verdict(name="exact check", statement=report.message, margin=-1.0, unit="1", verdict="undecided", remedy="")
    ]


def rejected_document(problem_study: Study, design_: Design) -> dict[str, Any]:
    """What a refused design leaves behind: the study, the gains, and what failed."""
    return {
        "schema": gain_file.REJECTED,
        "study": problem_study.model_dump(mode="json", exclude_none=True),
        "gains": [
            {"name": f"{kind}_{k + 1}", "value": getattr(g, kind)}
            for k, g in enumerate(design_.gains)
            for kind in KINDS
        ],
        "obligations": [
            {"name": v.name, "statement": v.statement, "margin": _finite(v.margin), "unit": v.unit,
             "verdict": v.verdict, "remedy": v.remedy, "witness": v.witness}
            for v in design_.verdicts
        ],
        "missed": list(design_.missed),
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _provenance(seed: int, options: Options, evaluations: int, begun: float) -> dict[str, Any]:
    packages = ("hdmm-opt", "casadi", "cvxpy", "clarabel", "numpy", "scipy")
    return {
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in packages}},
        "seed": seed,
        "budget": "full" if options.full else "quick",
        "evaluations": evaluations,
        "wall_time_s": round(time.perf_counter() - begun, 3),
        "threads": options.jobs,
        "cpus": os.cpu_count(),
    }


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"


def _keep(options: Options, key: str, state: SearchState) -> None:
    """Write the state of the search atomically, so that an interrupted run can go on."""
    if options.state is None:
        return
    data = {
        "schema": "hdmm-opt/state/1",
        "key": key,
        "iteration": state.iteration,
        "population": state.population.tolist(),
        "outcomes": [[o.violation, o.cost if math.isfinite(o.cost) else None] for o in state.outcomes],
        "random": state.random,
        "evaluations": state.evaluations,
    }
    gain_file.write_text(options.state, json.dumps(data))


def _restore(options: Options, key: str) -> SearchState | None:
    if not options.resume or options.state is None or not options.state.exists():
        return None
    try:
        data = json.loads(options.state.read_text(encoding="utf-8"))
        same = data["key"] == key
        state = SearchState(
            iteration=int(data["iteration"]),
            population=np.array(data["population"], dtype=float),
            outcomes=tuple(Outcome(violation=v, cost=math.inf if c is None else c) for v, c in data["outcomes"]),
            random=data["random"],
            evaluations=int(data["evaluations"]),
        )
    except (OSError, ValueError, KeyError, TypeError):
        raise InvalidInputError(
            f"{options.state}: not a state of this release; delete it or leave out --resume"
        ) from None
    if not same:
        raise InvalidInputError(
            f"{options.state}: belongs to another study, seed or budget; delete it or leave out --resume"
        )
    return state
