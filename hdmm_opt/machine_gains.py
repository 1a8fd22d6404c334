"""Gains of a machine: bandwidth ladders to a proved start, then a search over the proved set."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stability import Failure, Gains, error_rows
from stability.network import Contract
from tuning import Budget, Outcome, Population, best_of
from tuning import search as run_search

from .axis import KINDS, Axis
from .errors import InvalidInputError
from .machine_loop import MachineLoop, MachineScenario
from .machine_problem import MachineProblem, assemble_machine, tool_errors
from .machine_study import MachineStudy
from .plants.rigid_joint import healthy
from .selection import SHORT_DIGITS, Options, Progress, kept_population, to_data, with_digits
from .simulation import Fault
from .state import State
from .workers import workers

Array = NDArray[np.float64]
GainSet = dict[str, tuple[Gains, ...]]

#: Bandwidths of the outermost row, rad/s, and ratios of successive ones, from which the first stage starts.
OUTER, RATIOS = (5.0, 10.0, 18.0), (8.0, 14.0)
#: Step factors of the pattern search that improves the best of them.
STEPS = (1.5, 1.2)
#: A search goes this far from its start, as a share of the range of each gain on a logarithmic scale.
REACH = 0.1
#: Limits and requirements must hold with this relative room, so that the exact check agrees.
HEADROOM = 2e-3
#: Violations of gains that are proved alone but not together, and of gains that are not proved alone.
APART, UNPROVED = 10.0, 100.0
#: Scenarios of the study that enter the cost of a candidate.
COST_SCENARIOS = 4


@dataclass(frozen=True, kw_only=True)
class Tuned:
    """Gains with their proof, or why there is none.

    Attributes:
        gains: Gains by joint.
        contracts: The joints' proofs, or why there are none.
        evaluations: Candidates that were looked at.
        runs: Closed-loop runs that were spent.
    """

    gains: GainSet
    contracts: dict[str, Contract] | Failure
    evaluations: int
    runs: int = 0


def shortfall(problem: MachineProblem, contracts: Mapping[str, Contract] | Failure, gains: GainSet) -> float:
    """How far gains are from being proved inside all limits and requirements; 0 where they are."""
    if isinstance(contracts, Failure):
        return APART if problem.alone(gains) is None else UNPROVED
    return max(0.0, *(size / limit - 1 + HEADROOM for _, size, limit, _ in uses(problem, contracts)))


def uses(problem: MachineProblem, contracts: Mapping[str, Contract]) -> list[tuple[str, float, float, str]]:
    """Name, certified size, limit and unit of everything that is bounded."""
    study, found = problem.study, []
    for name, axis in zip(problem.machine.joints, problem.axes, strict=True):
        certificate, plant = contracts[name].certificate, axis.plant
        sizes = dict(zip(plant.inputs, certificate.effort, strict=True))
        sizes |= dict(zip(plant.states, certificate.states, strict=True))
        for limit in plant.limits:
            size = math.sqrt(sum(float(sizes[s]) ** 2 for s in limit.signals))
            found.append((f"{name} {limit.name}", size, limit.value, limit.unit))
        unit, radius = plant.state_units[0], float(certificate.radii[0])
        span, middle = axis.bounds.reference[0], sum(plant.stroke) / 2
        size = max(span.high + radius - middle, middle - span.low + radius)
        found.append((f"{name} travel", size, (plant.stroke[1] - plant.stroke[0]) / 2, unit))
        found.append((f"{name} error", float(certificate.ball[0]), study.requirements.joint_error[name], unit))
    balls = np.array([contracts[name].certificate.ball[0] for name in problem.machine.joints])
    return [*found, ("tool error", tool_errors(problem, balls), study.requirements.tool_error_m, "m")]


def ladder(problem: MachineProblem, outer: float, ratios: Sequence[float]) -> GainSet:
    """Gains with bandwidths ω_1 and ω_{i+1} = ratio_i ω_i in every joint, inside the ranges of the study.

    Args:
        problem: The machine's problem.
        outer: ω_1, rad/s.
        ratios: Ratios of the bandwidths of successive rows; the last one is repeated.
    """
    return {name: _rungs(axis, outer, ratios) for name, axis in zip(problem.machine.joints, problem.axes, strict=True)}


def _rungs(axis: Axis, outer: float, ratios: Sequence[float]) -> tuple[Gains, ...]:
    quiet = axis.gains(np.array([1.0 if axis.ranges[i].name[0] == "s" else 0.0 for i in axis.searched]))
    widths: list[float] = []
    for i in axis.law.governed:
        # a row that tracks nothing is as fast as the row before it
        follows = isinstance(axis.law.rows[i].target, int)
        ratio = ratios[min(len(widths), len(ratios)) - 1] if widths and follows else 1.0
        widths.append(widths[-1] * ratio if widths else outer)
    return with_bandwidths(axis, quiet, widths)


def bandwidths(axis: Axis, gains: tuple[Gains, ...]) -> list[float]:
    """ω_i = g_i β_i / (2 M_i) of the governed rows at the largest inertia, 1/s."""
    return [per * g.beta for per, g in zip(_per_gain(axis, gains), gains, strict=True)]


def with_bandwidths(axis: Axis, gains: tuple[Gains, ...], widths: Sequence[float]) -> tuple[Gains, ...]:
    """The gains with other β, inside their ranges and in four digits."""
    made = []
    for k, (g, per, width) in enumerate(zip(gains, _per_gain(axis, gains), widths, strict=True)):
        item = axis.ranges[4 * k]
        made.append(replace(g, beta=min(max(float(f"{width / per:.4g}"), item.low), item.high)))
    return tuple(made)


def _per_gain(axis: Axis, gains: tuple[Gains, ...]) -> list[float]:
    rows = error_rows(axis.model, axis.bounds, gains, 1e-9 * axis.box, np.zeros(len(axis.model.inputs)))
    # no effect at all: an actuator that may be stuck
    return [float((rows.control_gain[i] or 1.0) / (2 * rows.mass_high[i])) for i in axis.law.governed]


def starting_gains(problem: MachineProblem, progress: Progress) -> Tuned:
    """Stage one: the ladder with the smallest certified bound on the tool, by a grid and a pattern search."""
    stages = max(len(axis.law.governed) for axis in problem.axes)
    count = min(stages, 3)  # ω_1 and up to two ratios
    seen: dict[tuple[float, ...], tuple[tuple[float, float], Tuned]] = {}

    def at(point: tuple[float, ...]) -> tuple[float, float]:
        key = tuple(float(f"{v:.4g}") for v in point)
        if key not in seen:
            gains = ladder(problem, key[0], key[1:])
            contracts = problem.composed(gains)
            lacking = shortfall(problem, contracts, gains)
            bound = math.inf if isinstance(contracts, Failure) else uses(problem, contracts)[-1][1]
            seen[key] = ((lacking, bound), Tuned(gains=gains, contracts=contracts, evaluations=0))
            progress.update(0.0, f"{len(seen)} ladders")
        return seen[key][0]

    grid = [(outer, *[ratio] * (count - 1)) for outer in OUTER for ratio in RATIOS]
    best = min(grid, key=at)
    if at(best)[0] < UNPROVED or not any(axis.searched for axis in problem.axes):
        for step in STEPS:
            better = True
            while better:
                around = [
                    (*best[:k], best[k] * factor, *best[k + 1 :]) for k in range(count) for factor in (step, 1 / step)
                ]
                found = min(around, key=at)
                better = at(found) < at(best)
                best = found if better else best
    key = tuple(float(f"{v:.4g}") for v in best)
    return replace(seen[key][1], evaluations=len(seen))


def point_of(problem: MachineProblem, gains: GainSet) -> Array:
    """Gains as a point of the unit cube of what the study searches."""
    parts = [axis.point(gains[name]) for name, axis in zip(problem.machine.joints, problem.axes, strict=True)]
    return np.concatenate(parts)


def gains_of_point(problem: MachineProblem, point: Array) -> GainSet:
    """The gains at a point of that cube."""
    found, first = {}, 0
    for name, axis in zip(problem.machine.joints, problem.axes, strict=True):
        size = len(axis.searched)
        found[name] = axis.gains(point[first : first + size])
        first += size
    return found


def machine_scenarios(study: MachineStudy) -> list[MachineScenario]:
    """The scenarios of a study; the payload is the middle of its range where none is given."""
    middle = sum(study.uncertainty.payload_kg) / 2
    return [
        MachineScenario(
            name=s.name, payload=middle if s.payload_kg is None else s.payload_kg, parameters=s.parameters,
            noise=s.noise, quantisation=s.quantisation, initial=s.initial,
            faults={joint: Fault(**fault.model_dump()) for joint, fault in s.faults.items()},
            seed=study.tuning.seed + k,
        )
        for k, s in enumerate(study.validation.scenarios)
    ]  # fmt: skip


def covered(problem: MachineProblem, scenario: MachineScenario) -> bool:
    """Whether the assumptions of the proof hold a scenario: faults may only take effectiveness that is allowed for."""
    for name, fault in scenario.faults.items():
        plant = problem.machine.plants[problem.machine.joints.index(name)]
        if "effectiveness" not in plant.parameters or any(fault.stuck):
            return False
        p = plant.parameters["effectiveness"]
        low, high = p.value * (1 - p.tolerance), p.value * (1 + p.tolerance)
        at = p.value * (1 + p.tolerance * scenario.parameters.get(f"{name}.effectiveness", healthy(p)))
        if not (low - 1e-12 <= at * (1 - fault.share) and at <= high + 1e-12):
            return False
    return True


@dataclass(frozen=True, kw_only=True)
class Window:
    """The part of the unit cube of all gains that a search goes through: few points far from a proved one are proved.

    Attributes:
        low: Lower corner. Shape (d,).
        high: Upper corner.
    """

    low: Array
    high: Array

    @staticmethod
    def around(point: Array) -> Window:
        """The window around a point."""
        return Window(low=np.clip(point - REACH, 0.0, 1.0), high=np.clip(point + REACH, 0.0, 1.0))

    def at(self, local: Array) -> Array:
        """The point of the cube for one of the window's own unit cube."""
        return self.low + np.asarray(local) * (self.high - self.low)

    def local(self, point: Array) -> Array:
        """The reverse."""
        return (point - self.low) / (self.high - self.low)


def make_machine_evaluator(study: MachineStudy, window: Window) -> Callable[[Sequence[Array]], list[Outcome]]:
    """The outcomes of a batch of points of a window as a pure function."""
    problem = assemble_machine(study)
    loop = MachineLoop(problem)
    return lambda points: evaluate_machine(
        problem, loop, [gains_of_point(problem, window.at(point)) for point in points]
    )


def evaluate_machine(problem: MachineProblem, loop: MachineLoop, candidates: Sequence[GainSet]) -> list[Outcome]:
    """The outcomes of some gains; infeasible ones are never simulated."""
    chosen = [s for s in machine_scenarios(problem.study) if covered(problem, s)][:COST_SCENARIOS]
    outcomes, feasible = [], []
    for gains in candidates:
        contracts = problem.composed(gains)
        lacking = shortfall(problem, contracts, gains)
        outcomes.append(Outcome(violation=max(lacking, 1e-12), cost=math.inf))
        if not lacking > 0 and not isinstance(contracts, Failure):
            feasible.append((len(outcomes) - 1, gains, uses(problem, contracts)[-1][1]))
    runs = [(gains, scenario) for _, gains, _ in feasible for scenario in chosen]
    shown = loop.figures(runs)
    for k, (index, _, bound) in enumerate(feasible):
        mine = shown[k * len(chosen) : (k + 1) * len(chosen)]
        cost = machine_cost(problem, [(m.tool_rms, m.itae) for m in mine], bound)
        outcomes[index] = Outcome(violation=0.0, cost=cost, runs=len(mine))
    return outcomes


def machine_cost(problem: MachineProblem, shown: Sequence[tuple[float, float]], bound: float | None) -> float:
    """Weighted RMS and ITAE of the tool, mean over runs, and certified bound, relative to the required error."""
    study = problem.study
    weights, required = study.tuning.weights, study.requirements.tool_error_m
    itae = weights.itae * 2 / (required * problem.axes[0].reference.duration ** 2)
    cost = sum(weights.rms_error * rms / required + itae * v for rms, v in shown) / max(len(shown), 1)
    return cost if bound is None else cost + weights.certified_bound * bound / required


def tuned_gains(
    problem: MachineProblem, first: Tuned, method: str, budget: tuple[int, int], seed: int, options: Options,
    state: State, progress: Progress,
) -> Tuned:  # fmt: skip
    """Stage two: a method over the proved set with the closed-loop cost; then fewer digits.

    Args:
        problem: The machine's problem.
        first: Where stage one ended.
        method: "jaya", "tlbo" or "random".
        budget: Population, and evaluations of each candidate of the population.
        seed: Seed of the search.
        options: Workers.
        state: Keeps the population after each iteration.
        progress: Where to report.

    Raises:
        InvalidInputError: a method that is not made for machines.
    """
    if method == "gradient":
        raise InvalidInputError('tuning.method of a machine is "jaya", "tlbo" or "random": got "gradient"; choose one')
    population, rounds = budget
    allowed = Budget(evaluations=population * (rounds + 1), seconds=problem.study.tuning.seconds or math.inf)

    def after(now: Population) -> None:
        state.put("search", to_data(now))
        cost = now.outcomes[now.best].cost
        progress.update(
            now.evaluations / allowed.evaluations, f"best {cost:.4g}" if math.isfinite(cost) else "none proved yet"
        )

    start = point_of(problem, first.gains)
    window = Window.around(start)
    with workers(make_machine_evaluator, (problem.study, window), options.jobs, options.cluster) as pool:
        found = run_search(
            method, pool.map, window.local(start), population, seed, allowed,
            restored=kept_population(state), after=after,
        )  # fmt: skip
    gains = gains_of_point(problem, window.at(found.points[found.best]))
    contracts = problem.composed(gains)
    for digits in SHORT_DIGITS if best_of(found) is not None else ():
        short = {
            name: with_digits(axis, gains[name], digits)
            for name, axis in zip(problem.machine.joints, problem.axes, strict=True)
        }
        proofs = problem.composed(short)
        if shortfall(problem, proofs, short) == 0.0:
            gains, contracts = short, proofs
            break
    return Tuned(gains=gains, contracts=contracts, evaluations=found.evaluations, runs=found.runs)


def named_gains(gains: GainSet) -> dict[str, float]:
    """Gains by "joint.name"."""
    return {
        f"{joint}.{kind}_{k + 1}": getattr(row, kind)
        for joint, rows in gains.items() for k, row in enumerate(rows) for kind in KINDS
    }  # fmt: skip
