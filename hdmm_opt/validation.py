"""Closed-loop runs that a proved design must agree with: scenarios, Monte Carlo, corners of the assumptions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from stability import Certificate, Gains

from .problem import Problem
from .simulation import Metrics, Scenario, Trace, measure, scenarios
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


@dataclass(frozen=True, kw_only=True)
class Validation:
    """What the simulations showed.

    Attributes:
        runs: Scenario and figures of every scenario of the study.
        worst: The corner of the assumptions with the largest tracking error, and its figures; None where not asked.
        monte_carlo: Numbers of runs and successes, interval of the success probability; None where not asked.
        largest_error: Largest |tracking error| of all runs at any time, m.
        largest_late_error: Largest |tracking error| of all runs after the transient, m.
        missed: Requirements that a run missed, as text.
    """

    runs: tuple[tuple[Scenario, Metrics], ...]
    worst: tuple[Scenario, Metrics] | None
    monte_carlo: dict[str, float] | None
    largest_error: float
    largest_late_error: float
    missed: tuple[str, ...]


def figures(problem: Problem, trace: Trace) -> Metrics:
    """The figures of a run, by the study's transient and required error."""
    study = problem.study
    return measure(
        trace,
        study.validation.transient_s,
        study.requirements.tracking_error_m,
        problem.plant.parameters["transmission"].value,
    )


def validate(
    problem: Problem, gains: tuple[Gains, ...], *, seed: int, monte_carlo: int, progress: Callable[[str], None]
) -> Validation:
    """Run the scenarios, the corners and the Monte Carlo draws.

    Args:
        problem: The study's problem.
        gains: Proved gains.
        seed: Seed of the draws.
        monte_carlo: Number of draws.
        progress: Called with a line before each part.

    Returns:
        The figures, and which requirements were missed.
    """
    errors: list[float] = []

    def run(scenario: Scenario) -> Metrics:
        trace = problem.loop.run(gains, problem.reference, scenario)
        errors.append(math.inf if trace.diverged else float(np.abs(trace.error).max()))
        return figures(problem, trace)

    progress("scenarios")
    runs = tuple((s, run(s)) for s in scenarios(problem.study))
    worst = None
    if problem.study.validation.worst_case:
        progress("corners of the assumptions")
        worst = worst_corner(problem, run)
    drawn = None
    everything = [*runs, *([worst] if worst else [])]
    if monte_carlo:
        progress("Monte Carlo")
        draws = [(s, run(s)) for s in _draws(problem, monte_carlo, seed)]
        good = sum(not missed(problem.study, s.name, m) for s, m in draws)
        drawn = {"runs": float(monte_carlo), "met": float(good), **clopper_pearson(good, monte_carlo)}
        everything += draws
    failures = tuple(text for s, m in everything for text in missed(problem.study, s.name, m))
    late = max(m.maximum_error_m for _, m in everything)
    return Validation(
        runs=runs, worst=worst, monte_carlo=drawn, largest_error=max(errors), largest_late_error=late, missed=failures
    )


def worst_corner(problem: Problem, run: Callable[[Scenario], Metrics]) -> tuple[Scenario, Metrics]:
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
    best: tuple[Scenario, Metrics] | None = None

    def consider(scenario: Scenario) -> float:
        nonlocal best
        figures_of = run(scenario)
        if best is None or figures_of.maximum_error_m > best[1].maximum_error_m:
            best = (scenario, figures_of)
        return figures_of.maximum_error_m

    base = max(loads, key=lambda key: consider(Scenario(name=f"worst-{key}", load=loads[key])))
    signs = {}
    for name in names:
        errors = {
            sign: consider(Scenario(name=f"worst-{base}", load=loads[base], parameters={name: sign}))
            for sign in (1.0, -1.0)
        }
        signs[name] = max(errors, key=errors.__getitem__)
    for key, load in loads.items():
        consider(Scenario(name=f"worst-{key}", load=load, parameters=signs))
        for bias in (0.0, 1.0, -1.0):
            consider(Scenario(name=f"worst-{key}", load=load, parameters=signs, noise=1.0, bias=bias, initial=1.0))
    assert best is not None
    return best


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
    for requirement, metric in METRIC_OF.items():
        limit, value = getattr(study.requirements, requirement), getattr(metrics, metric)
        applies = requirement != "peak_voltage_v" or study.plant.level == "voltage"
        if limit is not None and applies and not value <= limit:
            found.append(f"{requirement} = {limit:g} is missed in scenario {name}: {value:.4g}")
    return found


def to_data(problem: Problem, found: Validation, certificate: Certificate) -> dict[str, Any]:
    """The `validation` section of a gain file."""

    def entry(scenario: Scenario, metrics: Metrics) -> dict[str, Any]:
        given = asdict(scenario)
        return {"scenario": {**given, "load": [list(p) for p in scenario.load]}, "metrics": asdict(metrics)}

    requirements = problem.study.requirements.model_dump(exclude_none=True)
    everything = [m for _, m in found.runs] + ([found.worst[1]] if found.worst else [])
    bound = float(certificate.ball[0])
    return {
        "requirements": [
            {
                "name": name,
                "required": limit,
                "simulated": max(getattr(m, METRIC_OF[name]) for m in everything),
                "certified": bound if name == "tracking_error_m" else None,
            }
            for name, limit in requirements.items()
        ],
        "nominal": [entry(s, m) for s, m in found.runs],
        "worst_case": entry(*found.worst) if found.worst else None,
        "monte_carlo": found.monte_carlo,
        "largest_error_m": found.largest_error,
        "largest_error_after_transient_m": found.largest_late_error,
        "bound_over_simulated": bound / found.largest_late_error if found.largest_late_error > 0 else None,
    }
