"""The two stages of the gain selection: convex programs to a proved start, then JAYA over the proved set."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Certificate, Failure, Gains, certify, checker, error_rows
from tuning import Executor, Outcome, SearchState, Selection, select, start, step

from . import validation
from .errors import InvalidInputError
from .files import write_text
from .problem import Problem, assemble, resolved
from .proof import certificate, slacks, violation
from .simulation import scenarios
from .study import Study

Array = NDArray[np.float64]

#: Scenarios of the study that enter the cost of a candidate.
COST_SCENARIOS = 2
#: Where the first stage begins: positions of the outer gain in its range, and ratios of successive bandwidths.
OUTER_SHARES, SEPARATIONS = (0.1, 0.25, 0.4, 0.6), (5.0, 8.0, 12.0)
#: The first stage aims at this share of the required error, so that the proof keeps room.
AIM = 0.8


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


def starting_point(problem: Problem) -> Selection:
    """Stage one: proved gains by convex programs, or the least bad that were met."""
    count = len(problem.law.governed)
    if not problem.searched:
        gains = problem.gains(np.zeros(0))
        return Selection(gains=gains, certificate=certificate(problem, gains), rounds=1)
    return select(
        lambda gains: certificate(problem, gains),
        lambda gains: certify(problem.model, replace(problem.bounds, period=0.0), gains, problem.box),
        lambda found: violation(problem, found, ()),
        bandwidth_ladder(problem),
        [(problem.ranges[4 * k].low, problem.ranges[4 * k].high) for k in range(count)],
        AIM * problem.study.requirements.tracking_error_m,
    )


def bandwidth_ladder(problem: Problem) -> list[tuple[Gains, ...]]:
    """Gains with separated bandwidths ω_i = g_i β_i / (2 M_i) inside the ranges, and the least adaptation."""
    quiet = problem.gains(np.array([1.0 if problem.ranges[i].name[0] == "s" else 0.0 for i in problem.searched]))
    rows = error_rows(problem.model, problem.bounds, quiet, 1e-9 * problem.box, np.zeros(len(problem.model.inputs)))
    made = []
    for share, ratio in product(OUTER_SHARES, SEPARATIONS):
        betas: list[float] = []
        widths: list[float] = []
        for k, i in enumerate(problem.law.governed):
            item, target = problem.ranges[4 * k], problem.law.rows[i].target
            per_gain = rows.control_gain[i] / (2 * rows.mass_high[i])
            # a row that tracks nothing is as fast as the row before it
            wanted = ratio * widths[-1] if isinstance(target, int) else widths[-1] if widths else 0.0
            beta = wanted / per_gain if widths else item.low * (item.high / item.low) ** share
            betas.append(min(max(float(f"{beta:.4g}"), item.low), item.high))
            widths.append(betas[-1] * per_gain)
        made.append(tuple(replace(g, beta=beta) for g, beta in zip(quiet, betas, strict=True)))
    return made


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


def closed_loop_cost(problem: Problem, gains: tuple[Gains, ...], found: Certificate, runs: list[Any]) -> float:
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
    write_text(options.state, json.dumps(data))


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
