"""What a candidate is worth: its proof first, its closed-loop cost where there is one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from stability import Failure
from tuning import Outcome

from ..problem import GainSet, Problem, assemble
from ..problem.margins import certified_error, margins, violation
from ..problem.problem import Contracts
from ..simulation import Figures, Loop, Run, Scenario, scenarios, within_assumptions
from ..study import Study
from .certify import contracts_of
from .space import Window

Array = NDArray[np.float64]

#: So many scenarios of the study enter the cost of a candidate, each with the same noise for every candidate.
COST_SCENARIOS = 4

#: Objectives of a Pareto set: RMS error over the required error, certified bound over it, share of the limits used.
OBJECTIVES = ("rms error", "certified bound", "effort")


def make_evaluator(study: Study, window: Window, refine: bool = False) -> Callable[[Sequence[Array]], list[Outcome]]:
    """The outcomes of a batch of points of a window as a pure function.

    Args:
        study: The study.
        window: Where the points lie.
        refine: Judge them by refined certificates.
    """
    problem = assemble(study)
    loop = Loop(problem)
    return lambda points: evaluate(loop, [problem.at(window.at(point)) for point in points], refine=refine)


def evaluate(loop: Loop, candidates: Sequence[GainSet], *, refine: bool = False) -> list[Outcome]:
    """The outcomes of some gains; infeasible ones are never simulated, the others together."""
    problem, chosen = loop.problem, cost_scenarios(loop.problem)
    found = [contracts_of(problem, gains, refine=refine) for gains in candidates]
    excess = [violation(problem, entry, gains) for entry, gains in zip(found, candidates, strict=True)]
    proved = [i for i, entry in enumerate(found) if not isinstance(entry, Failure) and not excess[i] > 0]
    runs = [Run(gains=candidates[i], scenario=scenario) for i in proved for scenario in chosen]
    shown = loop.figures(runs)
    outcomes = [Outcome(violation=max(value, 1e-12), cost=math.inf) for value in excess]
    for k, i in enumerate(proved):
        entry = found[i]
        assert not isinstance(entry, Failure)
        outcomes[i] = outcome(problem, entry, shown[k * len(chosen) : (k + 1) * len(chosen)])
    return outcomes


def cost_scenarios(problem: Problem) -> list[Scenario]:
    """The study's first scenarios inside the assumptions."""
    return [s for s in scenarios(problem) if within_assumptions(problem, s)][:COST_SCENARIOS]


def outcome(problem: Problem, found: Contracts, shown: Sequence[Figures]) -> Outcome:
    """The outcome of proved gains from their certificates and their runs."""
    required = problem.study.requirements.tracking_error_m
    if any(m.diverged for m in shown):
        return Outcome(violation=0.0, cost=math.inf, runs=len(shown))
    cost = certified_cost(problem, found) + simulated_cost(problem, shown)
    rms = sum(m.rms_error_m for m in shown) / max(len(shown), 1)
    objectives = (rms / required, certified_error(problem, found) / required, effort(problem, found))
    return Outcome(violation=0.0, cost=cost, objectives=objectives, runs=len(shown))


def certified_cost(problem: Problem, found: Contracts) -> float:
    """Weighted certified bound over the required error, and weighted share of the limits."""
    weights, required = problem.study.tuning.weights, problem.study.requirements.tracking_error_m
    return weights.certified_bound * certified_error(problem, found) / required + weights.effort * effort(
        problem, found
    )


def effort(problem: Problem, found: Contracts) -> float:
    """The largest share of a limit over the certified set."""
    return max(m.share for m in margins(problem, found) if m.kind == "limit")


def simulated_cost(problem: Problem, shown: Sequence[Figures]) -> float:
    """Weighted RMS error and ITAE, relative to what the required error gives, mean over the runs."""
    rms, itae = cost_scales(problem)
    return sum(rms * m.rms_error_m + itae * m.itae for m in shown) / max(len(shown), 1)


def cost_scales(problem: Problem) -> tuple[float, float]:
    """Factors of RMS error and ITAE in the cost."""
    weights, required = problem.study.tuning.weights, problem.study.requirements.tracking_error_m
    return weights.rms_error / required, weights.itae * 2 / (required * problem.duration**2)
