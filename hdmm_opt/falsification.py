"""The search that tries to break a proof: the worst load, parameters and start inside the assumptions.

A witness outside the certified envelope is a defect of the prover. A search that finds none proves nothing; the
distance between its worst find and the certified bound is the price of the proof, from above.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import Gains

from .errors import InvalidInputError
from .gain_file import ball_of
from .problem import Problem
from .simulation import Metrics, Run, Scenario
from .state import State
from .validation import finite

Array = NDArray[np.float64]

#: Share of the budget that the structured seeds may use; CMA-ES has the rest.
STRUCTURED = 0.4
#: Population of CMA-ES below and from `LARGE_BUDGET` runs on; the large one fills two groups of lanes.
SMALL, LARGE, LARGE_BUDGET = 8, 64, 1000
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
    progress: Callable[[float, str], None], *, jobs: int = 1, state: State | None = None,
) -> Witness:  # fmt: skip
    """Search the largest tracking error after the transient.

    Args:
        problem: The study's problem.
        gains: Gains to attack.
        known: Scenarios to begin with, such as the worst ones on record; those with a fault are left out.
        budget: Number of simulated runs.
        seed: Seed of the search.
        progress: Called with the share done and the worst so far.
        jobs: Threads.
        state: Keeps the errors of the runs, so that an interrupted search can go on.

    Returns:
        The worst run: constant, stepped, ramped, sinusoidal and bang-bang loads at the corners of the parameters first,
        then CMA-ES (Hansen 2016) over parameters, start and switching times of the load.

    Not guaranteed: that it is the worst case.
    """
    attack = _Attack(
        problem, gains, budget, seed, jobs, progress, State(None, {}, resume=False) if state is None else state
    )
    attack.errors([scenario for scenario in known if scenario.covered][:budget])
    attack.structured()
    attack.evolve()
    assert attack.worst is not None
    (metrics,) = problem.loop.figures([Run(gains=gains, scenario=attack.worst[0])], problem.reference)
    return Witness(
        scenario=attack.worst[0], metrics=metrics, largest_error=attack.largest, largest_use=attack.use,
        runs=attack.runs,
    )  # fmt: skip


class _Attack:
    """Counts runs and keeps the worst.

    The search is a function of its seed and of the errors that it sees, so the errors are all that is kept: a search
    that goes on repeats its questions and has the first answers at hand.
    """

    def __init__(
        self, problem: Problem, gains: tuple[Gains, ...], budget: int, seed: int, jobs: int,
        progress: Callable[[float, str], None], state: State,
    ) -> None:  # fmt: skip
        self.problem, self.gains, self.budget, self.seed = problem, gains, budget, seed
        self.jobs, self.progress, self.state = jobs, progress, state
        self.names = [name for name, p in problem.plant.parameters.items() if p.tolerance > 0]
        self.low, self.high = problem.study.uncertainty.load_force_n
        self.end = problem.reference.duration
        self.runs, self.largest, self.use = 0, 0.0, 0.0
        self.worst: tuple[Scenario, float] | None = None
        self.answers: list[list[list[float]]] = list(state.get("falsify") or [])
        self.asked = 0

    def errors(self, tried: Sequence[Scenario]) -> list[float]:
        """Run scenarios together; their largest errors after the transient."""
        if self.asked == len(self.answers):
            runs = [Run(gains=self.gains, scenario=scenario) for scenario in tried]
            found = self.problem.loop.figures(runs, self.problem.reference, jobs=self.jobs)
            self.answers.append([[m.maximum_error_m, m.largest_error_m, m.limit_use] for m in found])
            self.state.put("falsify", self.answers, often=True)
        answers = self.answers[self.asked]
        self.asked += 1
        if len(answers) != len(tried) or not all(len(answer) == 3 for answer in answers):
            raise InvalidInputError(
                f"{self.state.path}: not a state of this falsification; delete it or leave out --resume"
            )
        for scenario, (late, largest, use) in zip(tried, answers, strict=True):
            self.largest, self.use = max(self.largest, largest), max(self.use, use)
            if self.worst is None or late > self.worst[1]:
                self.worst = (scenario, late)
        self.runs += len(tried)
        if self.worst is not None:
            self.progress(self.runs / self.budget, f"worst {1e3 * self.worst[1]:.4g} mm")
        return [late for late, _, _ in answers]

    def structured(self) -> None:
        """Loads of simple shapes, then the sign of each parameter by its own effect, then all together."""
        limit = max(2, int(STRUCTURED * self.budget))
        make = partial(Scenario, name="falsified", noise=1.0, initial=1.0, seed=self.seed)
        left = self.budget - self.runs
        if left < 1:
            return
        shapes = self._loads()[: max(1, min(limit - 2 * len(self.names) - 4, left))]
        errors = self.errors([make(load=points) for points in shapes])
        load = shapes[int(np.argmax(errors))]
        names = self.names[: max(0, (limit - self.runs) // 2)]
        pairs = self.errors([make(load=load, parameters={name: s}) for name in names for s in (1.0, -1.0)])
        signs = {
            name: 1.0 if up >= down else -1.0 for name, up, down in zip(names, pairs[::2], pairs[1::2], strict=True)
        }
        starts = ((1.0, 0.0), (-1.0, 0.0), (1.0, 1.0), (1.0, -1.0))[: max(0, self.budget - self.runs)]
        self.errors([make(load=load, parameters=signs, initial=initial, bias=bias) for initial, bias in starts])

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
        if left < 1 or self.worst is None:
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import cma

            found = self.worst[0]
            signs = [0.5 + 0.45 * found.parameters.get(name, 0.0) for name in self.names]
            start = [0.5 + 0.45 * found.initial, 0.5 + 0.45 * found.bias]
            first = np.array([*signs, *start, *np.linspace(0.1, 0.9, SWITCHES), 0.5])
            size = SMALL if self.budget < LARGE_BUDGET else LARGE
            options = {"bounds": [0, 1], "seed": self.seed + 1, "verbose": -9, "maxfevals": left, "popsize": size}
            search = cma.CMAEvolutionStrategy(first, 0.25, options)
            while self.runs < self.budget:
                points = search.ask()
                if self.runs + size > self.budget:
                    self.errors([self._scenario(np.asarray(p)) for p in points[: self.budget - self.runs]])
                    break
                search.tell(points, [-e for e in self.errors([self._scenario(np.asarray(p)) for p in points])])

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


def _switched(first: float, second: float, times: tuple[float, ...]) -> tuple[tuple[float, float], ...]:
    """A load that jumps between two values at given times."""
    points: list[tuple[float, float]] = [(0.0, first)]
    now, following = first, second
    for time in times:
        start = max(float(time), points[-1][0] + EDGE)
        points += [(start, now), (start + EDGE, following)]
        now, following = following, now
    return tuple(points)


def contradiction(document: dict[str, Any], witness: Witness) -> str | None:
    """What a run did that the certificate of a gain file excludes, as text; None where nothing."""
    if not witness.largest_use < 1 - 1e-9:
        return f"a run used {witness.largest_use:.6g} of a limit that is proved"
    radius, ball = float(Fraction(document["certificate"]["radii"][0])), ball_of(document)
    late = witness.metrics.maximum_error_m
    if not (witness.largest_error <= radius and late <= ball):
        scenario = json.dumps(asdict(witness.scenario))
        return f"a run reached {late:.6g} m, certified {ball:.6g} m, in scenario {scenario}"
    return None


def stored(document: dict[str, Any], witness: Witness) -> dict[str, Any]:
    """A gain file's document with the witness as its worst case, where it is worse than the one there."""
    shown = dict(document["validation"])
    late, ball = witness.metrics.maximum_error_m, ball_of(document)
    shown["simulated_runs"] = shown.get("simulated_runs", 0) + witness.runs
    shown["largest_error_m"] = max(shown["largest_error_m"], witness.largest_error)
    if late >= shown["largest_error_after_transient_m"]:
        scenario = {**asdict(witness.scenario), "load": [list(p) for p in witness.scenario.load]}
        shown["worst_case"] = {"scenario": scenario, "metrics": finite(witness.metrics)}
        shown["largest_error_after_transient_m"] = late
        shown["bound_over_simulated"] = ball / late if late > 0 else None
    return {**document, "validation": shown}
