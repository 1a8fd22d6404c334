"""The search that tries to break a proof: the worst load, parameters and start inside the assumptions.

A witness outside the certified envelope is a defect of the prover. A search that finds none proves nothing; the
distance between its worst find and the certified bound is the price of the proof, from above.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Gains

from .problem import Problem
from .simulation import Metrics, Scenario, Trace
from .validation import figures

Array = NDArray[np.float64]

#: Share of the budget that the structured seeds may use; CMA-ES has the rest.
STRUCTURED = 0.4
#: Switching times in the load that CMA-ES moves.
SWITCHES = 6
#: Half periods of the bang-bang loads among the seeds, s.
HALF_PERIODS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
#: A load changes within this time, s.
EDGE = 1e-3


@dataclass(frozen=True, kw_only=True)
class Witness:
    """The worst run that was found.

    Attributes:
        scenario: Replays the run.
        metrics: Its figures.
        largest_error: Largest |tracking error| at any time of any run of the search, m.
        largest_use: Largest share of a limit that any run used; 1 where an input saturated.
        runs: Number of simulated runs.
    """

    scenario: Scenario
    metrics: Metrics
    largest_error: float
    largest_use: float
    runs: int


def falsify(
    problem: Problem, gains: tuple[Gains, ...], known: Sequence[Scenario], budget: int, seed: int,
    progress: Callable[[float, str], None],
) -> Witness:  # fmt: skip
    """Search the largest tracking error after the transient.

    Args:
        problem: The study's problem.
        gains: Gains to attack.
        known: Scenarios to begin with, such as the worst ones on record.
        budget: Number of simulated runs.
        seed: Seed of the search.
        progress: Called with the share done and the worst so far.

    Returns:
        The worst run: constant, stepped, ramped, sinusoidal and bang-bang loads at the corners of the parameters first,
        then CMA-ES (Hansen 2016) over parameters, start and switching times of the load.

    Not guaranteed: that it is the worst case.
    """
    attack = _Attack(problem, gains, budget, seed, progress)
    for scenario in list(known)[:budget]:
        attack.error(scenario)
    attack.structured()
    attack.evolve()
    assert attack.worst is not None
    return Witness(
        scenario=attack.worst[0], metrics=attack.worst[1], largest_error=attack.largest, largest_use=attack.use,
        runs=attack.runs,
    )  # fmt: skip


class _Attack:
    """Counts runs and keeps the worst."""

    def __init__(
        self, problem: Problem, gains: tuple[Gains, ...], budget: int, seed: int, progress: Callable[[float, str], None]
    ) -> None:
        self.problem, self.gains, self.budget, self.seed, self.progress = problem, gains, budget, seed, progress
        self.names = [name for name, p in problem.plant.parameters.items() if p.tolerance > 0]
        self.low, self.high = problem.study.uncertainty.load_force_n
        self.end = problem.reference.duration
        self.runs, self.largest, self.use = 0, 0.0, 0.0
        self.worst: tuple[Scenario, Metrics] | None = None

    def error(self, scenario: Scenario) -> float:
        """Run a scenario; its largest error after the transient."""
        trace = self.problem.loop.run(self.gains, self.problem.reference, scenario)
        metrics = figures(self.problem, trace)
        self.runs += 1
        self.largest = max(self.largest, np.inf if trace.diverged else float(np.abs(trace.error).max()))
        self.use = max(self.use, limit_use(self.problem, trace))
        if self.worst is None or metrics.maximum_error_m > self.worst[1].maximum_error_m:
            self.worst = (scenario, metrics)
        self.progress(self.runs / self.budget, f"worst {1e3 * self.worst[1].maximum_error_m:.4g} mm")
        return metrics.maximum_error_m

    def structured(self) -> None:
        """Loads of simple shapes, then the sign of each parameter by its own effect, then all together."""
        limit = max(2, int(STRUCTURED * self.budget))
        make = partial(Scenario, name="falsified", noise=1.0, initial=1.0, seed=self.seed)
        shapes = self._loads()[: max(1, min(limit - 2 * len(self.names) - 4, self.budget - self.runs))]
        load = max(shapes, key=lambda points: self.error(make(load=points)))
        signs: dict[str, float] = {}
        for name in self.names:
            if self.runs + 2 > limit:
                break
            errors = {s: self.error(make(load=load, parameters={name: s})) for s in (1.0, -1.0)}
            signs[name] = max(errors, key=errors.__getitem__)
        for initial, bias in ((1.0, 0.0), (-1.0, 0.0), (1.0, 1.0), (1.0, -1.0)):
            if self.runs < self.budget:
                self.error(make(load=load, parameters=signs, initial=initial, bias=bias))

    def _loads(self) -> list[tuple[tuple[float, float], ...]]:
        low, high, end = self.low, self.high, self.end
        constant = [((0.0, high),), ((0.0, low),)]
        ramps = [((0.0, low), (end, high)), ((0.0, high), (end, low))]
        orders = ((low, high), (high, low))
        steps = [_switched(first, second, (share * end,)) for share in (0.3, 0.5, 0.7) for first, second in orders]
        bangs = [_switched(low, high, tuple(np.arange(h, end, h))) for h in HALF_PERIODS]
        t = np.linspace(0.0, end, 400)
        middle, swing = (low + high) / 2, (high - low) / 2
        sines = [middle + swing * np.sin(2 * np.pi * t / cycle) for cycle in (1.0, 4.0)]
        waves = [tuple(zip(t.tolist(), values.tolist(), strict=True)) for values in sines]
        return [*constant, *steps, *bangs, *ramps, *waves]

    def evolve(self) -> None:
        """CMA-ES from the worst of the structured runs, in the unit cube, until the budget is used."""
        left = self.budget - self.runs
        if left < 4 or self.worst is None:
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import cma

            found = self.worst[0]
            signs = [0.5 + 0.45 * found.parameters.get(name, 0.0) for name in self.names]
            start = [0.5 + 0.45 * found.initial, 0.5 + 0.45 * found.bias]
            first = np.array([*signs, *start, *np.linspace(0.1, 0.9, SWITCHES), 0.5])
            options = {"bounds": [0, 1], "seed": self.seed + 1, "verbose": -9, "maxfevals": left, "popsize": 8}
            search = cma.CMAEvolutionStrategy(first, 0.25, options)
            while self.runs + 8 <= self.budget:
                points = search.ask()
                search.tell(points, [-self.error(self._scenario(np.asarray(p))) for p in points])

    def _scenario(self, point: Array) -> Scenario:
        """A point of the unit cube: parameters, start, bias, switching times, and which load comes first."""
        k = len(self.names)
        pushed = np.clip(1.2 * (2 * point - 1), -1, 1)
        times = np.unique(np.sort(point[k + 2 : k + 2 + SWITCHES]) * self.end)
        first, second = (self.low, self.high) if point[-1] < 0.5 else (self.high, self.low)
        return Scenario(
            name="falsified",
            load=_switched(first, second, tuple(times)),
            parameters=dict(zip(self.names, pushed[:k].tolist(), strict=True)),
            noise=1.0,
            bias=float(pushed[k + 1]),
            initial=float(pushed[k]),
            seed=self.seed,
        )


def limit_use(problem: Problem, trace: Trace) -> float:
    """The largest share of a limit that a run uses."""
    plant = problem.plant
    signals = dict(zip((*plant.states, *plant.inputs), (*trace.x, *trace.u), strict=True))
    sizes = (np.linalg.norm([signals[s] for s in limit.signals], axis=0).max() / limit.value for limit in plant.limits)
    return float(max(sizes))


def _switched(first: float, second: float, times: tuple[float, ...]) -> tuple[tuple[float, float], ...]:
    """A load that jumps between two values at given times."""
    points: list[tuple[float, float]] = [(0.0, first)]
    now, following = first, second
    for time in times:
        start = max(float(time), points[-1][0] + EDGE)
        points += [(start, now), (start + EDGE, following)]
        now, following = following, now
    return tuple(points)


def stored(document: dict[str, Any], witness: Witness, ball: float) -> dict[str, Any]:
    """A gain file's document with the witness as its worst case, where it is worse than the one there."""
    shown = dict(document["validation"])
    late = witness.metrics.maximum_error_m
    shown["largest_error_m"] = max(shown["largest_error_m"], witness.largest_error)
    if late >= shown["largest_error_after_transient_m"]:
        scenario = {**asdict(witness.scenario), "load": [list(p) for p in witness.scenario.load]}
        shown["worst_case"] = {"scenario": scenario, "metrics": asdict(witness.metrics)}
        shown["largest_error_after_transient_m"] = late
        shown["bound_over_simulated"] = ball / late if late > 0 else None
    return {**document, "validation": shown}
