"""Closed-loop runs that a proved design must agree with: scenarios, Monte Carlo, corners of the assumptions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from stability import Certificate, Gains

from .problem import Problem
from .simulation import Metrics, Run, Scenario, scenarios
from .study import Study

#: Confidence of the Clopper-Pearson interval.
CONFIDENCE = 0.95

#: Requirement -> metric that must not exceed it.
METRIC_OF = {
    "tracking_error_m": "maximum_error_m",
    "settling_time_s": "settling_time_s",
    "peak_torque_nm": "peak_torque_nm",
    "rms_torque_nm": "rms_torque_nm",
    "peak_current_a": "peak_current_a",
    "rms_current_a": "rms_current_a",
    "peak_voltage_v": "peak_input",
}


#: The integration error may be this share of the largest simulated error.
INTEGRATION_SHARE = 0.01

Simulate = Callable[[Sequence[Scenario]], list[Metrics]]


@dataclass(frozen=True, kw_only=True)
class Validation:
    """What the simulations showed.

    Attributes:
        runs: Scenario and figures of every scenario of the study.
        worst: The corner of the assumptions with the largest tracking error, and its figures; None where not asked.
        monte_carlo: Numbers of runs and successes, interval of the success probability; None where not asked.
        largest_error: Largest |tracking error| at any time of a run inside the assumptions, m.
        largest_late_error: The same after the transient, m.
        integration_error: Estimated error of the integration on the first scenario, m.
        count: Runs inside the assumptions.
        missed: Requirements that one of them missed, as text.
    """

    runs: tuple[tuple[Scenario, Metrics], ...]
    worst: tuple[Scenario, Metrics] | None
    monte_carlo: dict[str, float] | None
    largest_error: float
    largest_late_error: float
    integration_error: float
    count: int
    missed: tuple[str, ...]


def validate(
    problem: Problem, gains: tuple[Gains, ...], *, seed: int, monte_carlo: int, jobs: int,
    progress: Callable[[str], None],
) -> Validation:  # fmt: skip
    """Run the scenarios, the corners and the Monte Carlo draws.

    Args:
        problem: The study's problem.
        gains: Proved gains.
        seed: Seed of the draws.
        monte_carlo: Number of draws.
        jobs: Threads.
        progress: Called with a line before each part.

    Returns:
        The figures, and which requirements were missed. Runs with a fault are outside the assumptions: their figures
        are shown, and count for nothing else.
    """

    def simulate(chosen: Sequence[Scenario]) -> list[Metrics]:
        runs = [Run(gains=gains, scenario=s) for s in chosen]
        return problem.loop.figures(runs, problem.reference, jobs=jobs)

    progress("scenarios")
    given = scenarios(problem.study)
    runs = tuple(zip(given, simulate(given), strict=True))
    worst = None
    if problem.study.validation.worst_case:
        progress("corners of the assumptions")
        worst = worst_corner(problem, simulate)
    everything = [(s, m) for s, m in runs if s.covered] + ([worst] if worst else [])
    drawn = None
    if monte_carlo:
        progress("Monte Carlo")
        chosen = _draws(problem, monte_carlo, seed)
        draws = list(zip(chosen, simulate(chosen), strict=True))
        good = sum(not missed(problem.study, s.name, m) for s, m in draws)
        drawn = {"runs": float(monte_carlo), "met": float(good), **clopper_pearson(good, monte_carlo)}
        everything += draws
    progress("integration error")
    estimate = problem.loop.integration_error(gains, problem.reference, replace(given[0], fault=None))
    failures = [text for s, m in everything for text in missed(problem.study, s.name, m)]
    largest = max((m.largest_error_m for _, m in everything), default=0.0)
    seen = max([m.largest_error_m for _, m in runs], default=largest)
    if not estimate <= INTEGRATION_SHARE * seen:
        failures.append(
            f"the integration error must stay below {INTEGRATION_SHARE:.0%} of the largest error, "
            f"{seen:.3g} m: estimated {estimate:.3g} m"
        )
    late = max((m.maximum_error_m for _, m in everything), default=0.0)
    return Validation(
        runs=runs, worst=worst, monte_carlo=drawn, largest_error=largest, largest_late_error=late,
        integration_error=estimate, count=len(everything), missed=tuple(failures),
    )  # fmt: skip


def worst_corner(problem: Problem, simulate: Simulate) -> tuple[Scenario, Metrics]:
    """The corner of parameters and loads with the largest error: each sign from its own effect, then all together.

    Not guaranteed: that it is the worst; it is a lower bound on the worst case.
    """
    names = [name for name, p in problem.plant.parameters.items() if p.tolerance > 0]
    low, high = problem.study.uncertainty.load_force_n
    end = problem.reference.duration
    loads = {
        "high": ((0.0, high),),
        "low": ((0.0, low),),
        "step-up": ((0.0, low), (end / 2, low), (end / 2 + 1e-3, high)),
        "step-down": ((0.0, high), (end / 2, high), (end / 2 + 1e-3, low)),
    }
    shapes = [Scenario(name=f"worst-{key}", load=load) for key, load in loads.items()]
    tried = list(zip(shapes, simulate(shapes), strict=True))
    base = max(tried, key=_late)[0]
    ends = [replace(base, parameters={name: sign}) for name in names for sign in (1.0, -1.0)]
    tried += zip(ends, simulate(ends), strict=True)
    signs = {}
    for name in names:
        own = [entry for entry in tried if name in entry[0].parameters]
        signs[name] = max(own, key=_late)[0].parameters[name]
    corners = [replace(shape, parameters=signs) for shape in shapes]
    corners += [replace(c, noise=1.0, bias=bias, initial=1.0) for c in corners for bias in (0.0, 1.0, -1.0)]
    tried += zip(corners, simulate(corners), strict=True)
    return max(tried, key=_late)


def _late(entry: tuple[Scenario, Metrics]) -> float:
    return entry[1].maximum_error_m


def _draws(problem: Problem, count: int, seed: int) -> list[Scenario]:
    random = np.random.default_rng([seed, 20])
    low, high = problem.study.uncertainty.load_force_n
    names = [name for name, p in problem.plant.parameters.items() if p.tolerance > 0]
    end = problem.reference.duration
    made = []
    for k in range(count):
        times = np.sort(random.uniform(0.0, end, 3))
        loads = random.uniform(low, high, 4)
        points = [(0.0, float(loads[0]))]
        points += [(float(t), float(f)) for t, f in zip(times, loads[1:], strict=True) if t > points[-1][0]]
        made.append(
            Scenario(
                name=f"draw-{k + 1}", load=tuple(points),
                parameters={name: float(random.uniform(-1, 1)) for name in names},
                noise=1.0, initial=float(random.uniform(-1, 1)), seed=seed + k,
            )
        )  # fmt: skip
    return made


def clopper_pearson(good: int, count: int) -> dict[str, float]:
    """Exact confidence interval of a success probability (Clopper and Pearson 1934)."""
    from scipy.stats import beta

    tail = (1 - CONFIDENCE) / 2
    low = 0.0 if good == 0 else float(beta.ppf(tail, good, count - good + 1))
    high = 1.0 if good == count else float(beta.ppf(1 - tail, good + 1, count - good))
    return {"lower": low, "upper": high, "confidence": CONFIDENCE}


def missed(study: Study, name: str, metrics: Metrics) -> list[str]:
    """Requirements of the study that a run missed, as text."""
    found = ["diverged in scenario " + name] if metrics.diverged else []
    for requirement, limit in required(study).items():
        value = getattr(metrics, METRIC_OF[requirement])
        if not value <= limit:
            found.append(f"{requirement} = {limit:g} is missed in scenario {name}: {value:.4g}")
    return found


def required(study: Study) -> dict[str, float]:
    """The study's requirements by name; a voltage is required of nothing where the input is a torque."""
    given = study.requirements.model_dump(exclude_none=True)
    return {name: v for name, v in given.items() if name != "peak_voltage_v" or study.plant.level == "voltage"}


def finite(metrics: Metrics) -> dict[str, float | bool | None]:
    """Figures as JSON data; what is not finite, in a run that was lost, is null."""
    return {name: value if isinstance(value, bool) else _finite(value) for name, value in asdict(metrics).items()}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def to_data(problem: Problem, found: Validation, certificate: Certificate) -> dict[str, Any]:
    """The `validation` section of a gain file."""

    def entry(scenario: Scenario, metrics: Metrics) -> dict[str, Any]:
        given = asdict(scenario)
        return {"scenario": {**given, "load": [list(p) for p in scenario.load]}, "metrics": finite(metrics)}

    everything = [m for s, m in found.runs if s.covered] + ([found.worst[1]] if found.worst else [])
    bound = float(certificate.ball[0])
    return {
        "requirements": [
            {
                "name": name,
                "required": limit,
                "simulated": _finite(max((getattr(m, METRIC_OF[name]) for m in everything), default=math.inf)),
                "certified": bound if name == "tracking_error_m" else None,
            }
            for name, limit in required(problem.study).items()
        ],
        "nominal": [entry(s, m) for s, m in found.runs],
        "worst_case": entry(*found.worst) if found.worst else None,
        "monte_carlo": found.monte_carlo,
        "simulated_runs": found.count,
        "integration_error_m": found.integration_error,
        "largest_error_m": _finite(found.largest_error),
        "largest_error_after_transient_m": _finite(found.largest_late_error),
        "bound_over_simulated": bound / found.largest_late_error if found.largest_late_error > 0 else None,
    }
