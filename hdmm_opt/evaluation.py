"""What a candidate is worth: its proof first, its closed-loop cost where there is one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from stability import Certificate, Failure, Gains, certify_sampled
from tuning import Outcome

from .problem import Problem, assemble
from .proof import certificate, slacks, violation
from .simulation import Metrics, Run, Scenario, scenarios
from .study import Study

Array = NDArray[np.float64]

#: So many scenarios of the study enter the cost of a candidate, each with the same noise for every candidate.
COST_SCENARIOS = 4

#: Objectives of a Pareto set: RMS error over the required error, certified bound over it, share of the limits used.
OBJECTIVES = ("rms error", "certified bound", "effort")


def make_evaluator(study: Study, composed: bool = False) -> Callable[[Sequence[Array]], list[Outcome]]:
    """The outcomes of a batch of points as a pure function.

    Args:
        study: The study.
        composed: Whether to look for a composition where there is no sampled certificate; that takes long.
    """
    problem = assemble(study)
    return lambda points: evaluate(problem, [problem.gains(point) for point in points], composed=composed)


def evaluate(problem: Problem, candidates: Sequence[tuple[Gains, ...]], *, composed: bool = False) -> list[Outcome]:
    """The outcomes of some gains; infeasible ones are never simulated, the others together."""
    found = [find(problem, gains, composed=composed) for gains in candidates]
    excess = [violation(problem, entry, gains) for entry, gains in zip(found, candidates, strict=True)]
    chosen = cost_scenarios(problem)
    proved = [i for i, entry in enumerate(found) if isinstance(entry, Certificate) and not excess[i] > 0]
    runs = [Run(gains=candidates[i], scenario=scenario) for i in proved for scenario in chosen]
    shown = problem.loop.figures(runs, problem.reference)
    outcomes = [Outcome(violation=max(value, 1e-12), cost=math.inf) for value in excess]
    for k, i in enumerate(proved):
        entry = found[i]
        assert isinstance(entry, Certificate)
        outcomes[i] = outcome(problem, entry, shown[k * len(chosen) : (k + 1) * len(chosen)])
    return outcomes


def cost_scenarios(problem: Problem) -> list[Scenario]:
    """The study's first scenarios without a fault."""
    return [s for s in scenarios(problem.study) if s.covered][:COST_SCENARIOS]


def find(problem: Problem, gains: tuple[Gains, ...], *, composed: bool = False) -> Certificate | Failure:
    """A certificate at the study's control period; of all kinds where `composed`."""
    if composed:
        return certificate(problem, gains)
    return certify_sampled(problem.model, problem.bounds, gains, problem.box)


def outcome(problem: Problem, found: Certificate, shown: Sequence[Metrics]) -> Outcome:
    """The outcome of proved gains from their certificate and their runs."""
    required = problem.study.requirements.tracking_error_m
    if any(m.diverged for m in shown):
        return Outcome(violation=0.0, cost=math.inf, runs=len(shown))
    cost = certified_cost(problem, found) + simulated_cost(problem, shown)
    rms = sum(m.rms_error_m for m in shown) / max(len(shown), 1)
    objectives = (rms / required, float(found.ball[0]) / required, effort(problem, found))
    return Outcome(violation=0.0, cost=cost, objectives=objectives, runs=len(shown))


def certified_cost(problem: Problem, found: Certificate) -> float:
    """Weighted certified bound over the required error, and weighted share of the limits."""
    weights, required = problem.study.tuning.weights, problem.study.requirements.tracking_error_m
    return weights.certified_bound * float(found.ball[0]) / required + weights.effort * effort(problem, found)


def effort(problem: Problem, found: Certificate) -> float:
    """The largest share of a limit over the certified set."""
    return max(size / limit for name, size, limit, _ in slacks(problem, found) if name != "tracking error")


def simulated_cost(problem: Problem, shown: Sequence[Metrics]) -> float:
    """Weighted RMS error and ITAE, relative to what the required error gives, mean over the runs."""
    rms, itae = cost_scales(problem)
    return sum(rms * m.rms_error_m + itae * m.itae for m in shown) / max(len(shown), 1)


def cost_scales(problem: Problem) -> tuple[float, float]:
    """Factors of RMS error and ITAE in the cost."""
    weights, required = problem.study.tuning.weights, problem.study.requirements.tracking_error_m
    return weights.rms_error / required, weights.itae * 2 / (required * problem.reference.duration**2)
