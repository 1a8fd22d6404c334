"""The law against its rivals: equal budget, the same scenarios, the same cost, the same inner loops."""

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

from .control.benchmarks import RIVALS
from .machine_gains import (
    COST_SCENARIOS,
    GainSet,
    Tuned,
    covered,
    machine_cost,
    machine_scenarios,
    named_gains,
    starting_gains,
    tuned_gains,
    uses,
)
from .machine_loop import MachineFigures, MachineLoop, MachineScenario
from .machine_problem import MachineProblem
from .selection import Options, Progress
from .state import State

Array = NDArray[np.float64]

SCHEMA = "hdmm-opt/comparison/1"
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
        certified: Certified bound on the tool, m; None for a law without one.
        figures: Figures by scenario.
    """

    name: str
    gains: Mapping[str, float]
    cost: float
    evaluations: int
    certified: float | None
    figures: Mapping[str, MachineFigures]


def compare(
    problem: MachineProblem, budget: tuple[int, int], seed: int, options: Options, progress: Progress
) -> list[Contender]:
    """Tune the law and its rivals on the study's scenarios, and run them on all.

    Args:
        problem: The machine's problem.
        budget: Population, and evaluations of each candidate of the population, the same for all.
        seed: Seed of every search.
        options: Workers of the law's search.
        progress: Where to report.

    Returns:
        The law tuned by each method, then the rivals.

    Not guaranteed: that any search found the best gains; all had the same number of candidates. The law's candidates
    must be proved besides; the rivals have no such constraint, and no certificate.
    """
    scenarios = machine_scenarios(problem.study)
    chosen = [s for s in scenarios if covered(problem, s)][:COST_SCENARIOS]
    progress.stage("proof of a start")
    first = starting_gains(problem, progress)
    found = []
    plain = MachineLoop(problem)
    for method in METHODS:
        progress.stage(f"rac: {method}")
        tuned = tuned_gains(problem, first, method, budget, seed, options, _forgetful(), progress)
        found.append(_law(problem, plain, tuned, method, chosen, scenarios))
    for name, kind in RIVALS.items():
        progress.stage(f"{name}: {METHODS[0]}")
        loop = MachineLoop(problem, kind(len(problem.machine.joints)))
        found.append(_rival(problem, loop, name, first.gains, budget, seed, chosen, scenarios, progress))
    return found


def _forgetful() -> State:
    return State(None, {}, resume=False)


def _law(
    problem: MachineProblem, loop: MachineLoop, tuned: Tuned, method: str, chosen: Sequence[MachineScenario],
    scenarios: Sequence[MachineScenario],
) -> Contender:  # fmt: skip
    shown = loop.figures([(tuned.gains, s) for s in (*chosen, *scenarios)])
    parts = [(m.tool_rms, m.itae) for m in shown[: len(chosen)]]
    bound = None if isinstance(tuned.contracts, Failure) else uses(problem, tuned.contracts)[-1][1]
    return Contender(
        name=f"rac, {method}", gains=named_gains(tuned.gains), cost=machine_cost(problem, parts, None),
        evaluations=tuned.evaluations, certified=bound,
        figures={s.name: m for s, m in zip(scenarios, shown[len(chosen) :], strict=True)},
    )  # fmt: skip


def _rival(
    problem: MachineProblem, loop: MachineLoop, name: str, inner: GainSet, budget: tuple[int, int], seed: int,
    chosen: Sequence[MachineScenario], scenarios: Sequence[MachineScenario], progress: Progress,
) -> Contender:  # fmt: skip
    ranges = loop.outer.GAINS
    population, rounds = budget
    allowed = Budget(evaluations=population * (rounds + 1), seconds=problem.study.tuning.seconds or math.inf)

    def values(point: Array) -> Array:
        return np.array([low * (high / low) ** share for (_, low, high), share in zip(ranges, point, strict=True)])

    def evaluate(points: Sequence[Array]) -> list[Outcome]:
        runs = [(point, scenario) for point in points for scenario in chosen]
        shown = loop.figures([(inner, s) for _, s in runs], tuned=[values(point) for point, _ in runs])
        return [_outcome(problem, shown[k : k + len(chosen)]) for k in range(0, len(shown), len(chosen))]

    def after(now: Any) -> None:
        cost = now.outcomes[now.best].cost
        progress.update(now.evaluations / allowed.evaluations, f"best {cost:.4g}" if math.isfinite(cost) else "lost")

    middle = np.full(len(ranges), 0.5)
    found = run_search(METHODS[0], evaluate, middle, population, seed, allowed, after=after)
    point = values(found.points[found.best])
    shown = loop.figures([(inner, s) for s in scenarios], tuned=[point] * len(scenarios))
    return Contender(
        name=f"{name}, {METHODS[0]}", gains={key: float(v) for (key, _, _), v in zip(ranges, point, strict=True)},
        cost=found.outcomes[found.best].cost, evaluations=found.evaluations, certified=None,
        figures={s.name: m for s, m in zip(scenarios, shown, strict=True)},
    )  # fmt: skip


def _outcome(problem: MachineProblem, shown: Sequence[MachineFigures]) -> Outcome:
    """Lost runs last, the earlier the worse; otherwise the cost."""
    lost = [m.lost for m in shown if math.isfinite(m.lost)]
    if lost:
        return Outcome(violation=1.0 + 1.0 / (1.0 + min(lost)), cost=math.inf)
    return Outcome(
        violation=0.0, cost=machine_cost(problem, [(m.tool_rms, m.itae) for m in shown], None), runs=len(shown)
    )


def table(found: Sequence[Contender], proved: Sequence[str], writes: Callable[[str], None]) -> None:
    """Write the comparison as text: a line for each scenario and controller, the best figure marked.

    Args:
        found: The controllers.
        proved: Scenarios inside the assumptions of the certificates.
        writes: Called with each line.
    """
    writes(f"{'scenario':16}{'controller':17}{'max [mm]':>12}{'RMS [mm]':>13}{'limit use':>11}{'certified [mm]':>16}")
    for scenario in found[0].figures:
        best = min(c.figures[scenario].tool_rms for c in found)
        for c in found:
            m = c.figures[scenario]
            sound = not math.isfinite(m.lost)
            mark = "*" if sound and m.tool_rms == best else " "
            size = (
                f"{1e3 * m.tool_late:12.3g}{1e3 * m.tool_rms:12.3g}{mark}"
                if sound
                else f"{f'lost at {m.lost:.3g} s':>25}"
            )
            bound = "" if c.certified is None or scenario not in proved else f"{1e3 * c.certified:.4g}"
            writes(f"{scenario:16}{c.name:17}{size}{max(m.uses):11.3g}{bound:>16}")
