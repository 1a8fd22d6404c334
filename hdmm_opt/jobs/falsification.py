"""The search that tries to break a proof: the worst disturbances, parameters and start inside the assumptions.

A witness outside the certified envelope is a defect of the prover. A search that finds none proves nothing; the
distance between its worst find and the certified bound is the price of the proof, from above.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInputError
from ..files.result import Witness
from ..files.state import State
from ..problem import GainSet
from ..simulation import Loop, Run, Scenario, rated, within_assumptions
from ..simulation.scenario import Course
from .matched import matched
from .worst_case import EDGE, uncertain

Array = NDArray[np.float64]

#: Share of the budget that the structured seeds may use; CMA-ES has the rest.
STRUCTURED = 0.4
#: Population of CMA-ES below and from `LARGE_BUDGET` runs on; the large one fills two groups of lanes.
SMALL, LARGE, LARGE_BUDGET = 8, 64, 1000
#: Switching times of every disturbance of any course that CMA-ES moves.
SWITCHES = 6
#: Half periods of the bang-bang courses among the seeds, s.
HALF_PERIODS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


def falsify(
    loop: Loop, gains: GainSet, known: Sequence[Scenario], budget: int, seed: int,
    progress: Callable[[float, str], None], *, jobs: int = 1, state: State | None = None,
) -> Witness:  # fmt: skip
    """Search the largest error of the output after the transient.

    Args:
        loop: The problem's loop.
        gains: Gains to attack.
        known: Scenarios to begin with, such as the worst ones on record; those outside the assumptions are left out.
        budget: Number of simulated runs.
        seed: Seed of the search.
        progress: Called with the share done and the worst so far.
        jobs: Threads.
        state: Keeps the errors of the runs, so that an interrupted search can go on.

    Returns:
        The worst run: constant, stepped, ramped, sinusoidal and bang-bang disturbances, and with many runs those that
        add up in the loop, at the corners of the parameters first, then CMA-ES (Hansen 2016) over parameters, start,
        and values or switching times of the disturbances.

    Not guaranteed: that it is the worst case.
    """
    attack = _Attack(
        loop, gains, budget, seed, jobs, progress, State(None, {}, resume=False) if state is None else state
    )
    attack.errors([scenario for scenario in known if within_assumptions(loop.problem, scenario)][:budget])
    attack.structured()
    attack.evolve()
    assert attack.worst is not None
    (figures,) = loop.figures([Run(gains=gains, scenario=attack.worst[0])])
    return Witness(
        scenario=attack.worst[0], figures=figures, largest_error=attack.largest[0],
        largest_errors=dict(zip(loop.problem.machine.members, attack.largest[1:], strict=True)),
        largest_use=attack.use, runs=attack.runs,
    )  # fmt: skip


class _Attack:
    """Counts runs and keeps the worst.

    The search is a function of its seed and of the errors that it sees, so the errors are all that is kept: a search
    that goes on repeats its questions and has the first answers at hand.
    """

    def __init__(
        self, loop: Loop, gains: GainSet, budget: int, seed: int, jobs: int,
        progress: Callable[[float, str], None], state: State,
    ) -> None:  # fmt: skip
        self.loop, self.problem, self.gains, self.budget, self.seed = loop, loop.problem, gains, budget, seed
        self.jobs, self.progress, self.state = jobs, progress, state
        self.names = uncertain(self.problem)
        disturbances = self.problem.machine.disturbances
        self.constant = [d.name for d in disturbances if d.course == "constant"]
        self.free = [d.name for d in disturbances if d.course == "any"]
        self.end, self.size = self.problem.duration, 3 + len(self.problem.members)
        self.runs, self.use = 0, 0.0
        self.largest = [0.0] * (self.size - 2)
        self.worst: tuple[Scenario, float] | None = None
        self.answers: list[list[list[float]]] = list(state.get("falsify") or [])
        self.asked = 0

    def errors(self, tried: Sequence[Scenario]) -> list[float]:
        """Run scenarios together, disturbances no faster than assumed; their largest errors after the transient."""
        tried = [rated(self.problem, scenario) for scenario in tried]
        if self.asked == len(self.answers):
            found = self.loop.figures([Run(gains=self.gains, scenario=s) for s in tried], jobs=self.jobs)
            self.answers.append([
                [m.maximum_error_m, m.limit_use, m.largest_error_m, *(own.largest_error for own in m.members.values())]
                for m in found
            ])  # fmt: skip
            self.state.put("falsify", self.answers, often=True)
        answers = self.answers[self.asked]
        self.asked += 1
        if len(answers) != len(tried) or not all(len(answer) == self.size for answer in answers):
            raise InvalidInputError(
                f"{self.state.path}: not a state of this falsification; delete it or leave out --resume"
            )
        for scenario, (late, use, *largest) in zip(tried, answers, strict=True):
            self.use = max(self.use, use)
            self.largest = [max(pair) for pair in zip(self.largest, largest, strict=True)]
            if self.worst is None or late > self.worst[1]:
                self.worst = (scenario, late)
        self.runs += len(tried)
        if self.worst is not None:
            self.progress(
                self.runs / self.budget, f"worst {1e3 * self.worst[1]:.4g} m{self.problem.machine.output_unit}"
            )
        return [answer[0] for answer in answers]

    def structured(self) -> None:
        """Disturbances of simple shapes, then the sign of each parameter by its own effect, then all together."""
        limit = max(2, int(STRUCTURED * self.budget))
        make = partial(Scenario, name="falsified", noise=1.0, initial=1.0, seed=self.seed)
        left = self.budget - self.runs
        if left < 1:
            return
        matching = matched(self.loop, self.gains, self.free) if self.budget >= LARGE_BUDGET else []
        shapes = [*matching, *self._shapes()][: max(1, min(limit - 2 * len(self.names) - 4, left))]
        errors = self.errors([make(disturbances=courses) for courses in shapes])
        courses = shapes[int(np.argmax(errors))]
        names = self.names[: max(0, (limit - self.runs) // 2)]
        pairs = self.errors([make(disturbances=courses, parameters={name: s}) for name in names for s in (1.0, -1.0)])
        signs = {
            name: 1.0 if up >= down else -1.0 for name, up, down in zip(names, pairs[::2], pairs[1::2], strict=True)
        }
        starts = ((1.0, 0.0), (-1.0, 0.0), (1.0, 1.0), (1.0, -1.0))[: max(0, self.budget - self.runs)]
        self.errors([
            make(disturbances=courses, parameters=signs, initial=initial, bias=bias) for initial, bias in starts
        ])  # fmt: skip

    def _shapes(self) -> list[dict[str, Course]]:
        """Every constant disturbance at an end, those of any course in simple shapes, each together."""
        ends = [{name: ((0.0, self._span(name)[side]),) for name in self.constant} for side in (1, 0)]
        if not self.free:
            return ends
        shapes = zip(*(self._courses(*self._span(name)) for name in self.free), strict=True)
        made = [dict(zip(self.free, together, strict=True)) for together in shapes]
        return [{**free, **fixed} for fixed in ends[: 2 if self.constant else 1] for free in made]

    def _span(self, name: str) -> tuple[float, float]:
        span = self.problem.disturbance(name)
        return span.low, span.high

    def _courses(self, low: float, high: float) -> list[Course]:
        end = self.end
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
            held = [0.5 for _ in self.constant]
            switching = [share for _ in self.free for share in (*np.linspace(0.1, 0.9, SWITCHES), 0.5)]
            first = np.array([*signs, *start, *held, *switching])
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
        """A point of the unit cube: parameters, start, bias, constants, switching times and which end comes first."""
        k = len(self.names)
        pushed = np.clip(1.2 * (2 * point - 1), -1, 1)
        courses: dict[str, Course] = {}
        for share, name in zip(pushed[k + 2 :], self.constant, strict=False):
            low, high = self._span(name)
            courses[name] = ((0.0, float((low + high) / 2 + share * (high - low) / 2)),)
        first = k + 2 + len(self.constant)
        for name in self.free:
            low, high = self._span(name)
            times = np.unique(np.sort(point[first : first + SWITCHES]) * self.end)
            ends = (low, high) if point[first + SWITCHES] < 0.5 else (high, low)
            courses[name] = _switched(*ends, tuple(times))
            first += SWITCHES + 1
        return Scenario(
            name="falsified",
            disturbances=courses,
            parameters=dict(zip(self.names, pushed[:k].tolist(), strict=True)),
            noise=1.0,
            bias=float(pushed[k + 1]),
            initial=float(pushed[k]),
            seed=self.seed,
        )


def _switched(first: float, second: float, times: tuple[float, ...]) -> Course:
    """A course that jumps between two values at given times."""
    points: list[tuple[float, float]] = [(0.0, first)]
    now, following = first, second
    for time in times:
        start = max(float(time), points[-1][0] + EDGE)
        points += [(start, now), (start + EDGE, following)]
        now, following = following, now
    return tuple(points)
