"""From gains to a certificate, and from a missing certificate to what would have to change.

Verdicts here steer the search and explain refusals. A gain file is written only after `stability/checker.py` has proved
the finished document.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from stability import (
    Bounds,
    Certificate,
    Composition,
    Failure,
    Gains,
    Interval,
    certify,
    certify_sampled,
    deviation_rows,
    quadratic,
)

from .control import RAC
from .problem import Problem
from .simulation import ClosedLoop, Run, Scenario, scenarios

#: Limits and requirements must hold with this relative room, so that the exact check, which rounds outwards, agrees.
HEADROOM = 2e-4
#: How many times the study's control period a certificate is looked for.
LONGEST = 64


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """One obligation, decided.

    Attributes:
        name: Name of the obligation.
        statement: What had to be shown.
        margin: Distance from failing, [unit]; negative where it fails.
        unit: Unit of the margin.
        verdict: "proved", "refuted" or "undecided".
        remedy: What would make it pass, or help; empty where it passes.
        sure: True where the remedy was tried and makes it pass.
        witness: For a refuted obligation, the scenario and control rate that replay it.
    """

    name: str
    statement: str
    margin: float
    unit: str
    verdict: str
    remedy: str = ""
    sure: bool = False
    witness: dict[str, Any] | None = None


def certificate(problem: Problem, gains: tuple[Gains, ...], *, period: float | None = None) -> Certificate | Failure:
    """Search a certificate at the study's control period, or at another one (0: a continuous law).

    The sampled certificate comes first; the composition is looked for where there is none, and for a continuous law.
    """
    bounds = problem.bounds if period is None else replace(problem.bounds, period=period)
    if bounds.period == 0:
        return composition(problem, bounds, gains)
    sampled = certify_sampled(problem.model, bounds, gains, problem.box)
    if isinstance(sampled, Certificate):
        return sampled
    return min((sampled, composition(problem, bounds, gains)), key=lambda c: _rank(problem, c, gains))


@dataclass(frozen=True, kw_only=True)
class Candidates:
    """The certificates of some gains at the study's control period, the best of each kind.

    Attributes:
        sampled: The better of the plain and the refined sampled certificate.
        composed: The composition.
    """

    sampled: Certificate | Failure
    composed: Composition | Failure


def candidates(problem: Problem, gains: tuple[Gains, ...]) -> Candidates:
    """Search all kinds of certificates that a gain file can carry."""
    found = certify_sampled(problem.model, problem.bounds, gains, problem.box)
    if isinstance(found, Certificate):
        refined = certify_sampled(problem.model, problem.bounds, gains, problem.box, refine=True)
        found = min((found, refined), key=lambda c: _rank(problem, c, gains))
    return Candidates(sampled=found, composed=composition(problem, problem.bounds, gains))


def strongest(problem: Problem, gains: tuple[Gains, ...], found: Candidates) -> Certificate | Failure:
    """The one with the smaller bound among those that meet the limits."""
    return min((found.sampled, found.composed), key=lambda c: _rank(problem, c, gains))


def composition(problem: Problem, bounds: Bounds, gains: tuple[Gains, ...]) -> Composition | Failure:
    """The better composition certificate of those without and with θ̂ in V."""
    plain = certify(problem.model, bounds, gains, problem.box)
    if not any(g.epsilon > 0 for g in gains):
        return plain
    adaptive = certify(problem.model, bounds, gains, problem.box, adaptive=True)
    return min((plain, adaptive), key=lambda c: _rank(problem, c, gains))


def _rank(problem: Problem, found: Certificate | Failure, gains: tuple[Gains, ...]) -> tuple[float, float]:
    return (violation(problem, found, gains), math.inf if isinstance(found, Failure) else float(found.ball[0]))


def compared(problem: Problem, gains: tuple[Gains, ...], found: Candidates, taken: Certificate) -> str:
    """Which certificate was taken, and what the other kinds give."""
    if isinstance(taken, Composition):
        return f"composition certificate, {_told(taken)} (sampled: {_told(found.sampled)})"
    others = (
        f"composition: {_told(found.composed)}, quadratic, at the samples: {quadratic_bound(problem, gains, taken)}"
    )
    return f"sampled certificate, {_told(taken)} ({others})"


def _told(found: Certificate | Failure) -> str:
    return found.reason if isinstance(found, Failure) else f"{1e3 * float(found.ball[0]):.4g} mm"


def quadratic_bound(problem: Problem, gains: tuple[Gains, ...], found: Certificate) -> str:
    """The ultimate bound at the samples by one ellipsoid for the exact map, over the box of a sampled certificate."""
    rows = deviation_rows(problem.model, problem.bounds, gains, found.radii, found.held)
    inclusion = quadratic.from_period(rows, problem.bounds.period, found.radii)
    ellipsoid = quadratic.search(inclusion, np.eye(len(found.radii))[0], found.radii)
    squared = None if ellipsoid is None else quadratic.prove(inclusion, ellipsoid)
    return "none" if squared is None else f"{1e3 * math.sqrt(squared):.4g} mm"


def slacks(problem: Problem, found: Certificate) -> list[tuple[str, float, float, str]]:
    """Limits over the certified set as (name, certified size, limit, unit): norms, stroke, tracking error."""
    plant = problem.plant
    result = []
    for limit in plant.limits:
        sizes = [
            found.effort[plant.inputs.index(s)] if s in plant.inputs else found.states[plant.states.index(s)]
            for s in limit.signals
        ]
        result.append((limit.name, float(np.linalg.norm(sizes)), limit.value, limit.unit))
    low, high = problem.bounds.reference[0].low, problem.bounds.reference[0].high
    room = min(low - plant.stroke[0], plant.stroke[1] - high)
    result.append(("stroke", float(found.radii[0]), room, "m"))
    result.append(("tracking error", float(found.ball[0]), problem.study.requirements.tracking_error_m, "m"))
    return result


def violation(problem: Problem, found: Certificate | Failure, gains: tuple[Gains, ...]) -> float:
    """How far some gains are from being proved; 0 where a certificate exists and every limit holds over its set."""
    late = sum(max(0.0, problem.bounds.period * g.delta * g.sigma - 1.0) for g in gains)
    if isinstance(found, Failure):
        return 10.0 + late
    excess = (size * (1 + HEADROOM) / limit - 1.0 if limit > 0 else 1.0 for _, size, limit, _ in slacks(problem, found))
    return late + sum(max(0.0, value) for value in excess)


def longest_period(problem: Problem, gains: tuple[Gains, ...], *, steps: int = 12) -> float:
    """The largest control period at which everything is certified, s, by bisection; 0 where none is.

    Certified at the period returned, not certified at one a little longer; beyond, nothing is said.
    """

    def good(period: float) -> bool:
        return violation(problem, certificate(problem, gains, period=period), gains) == 0.0

    low = high = problem.bounds.period
    if good(high):
        while good(2 * high) and high < LONGEST * problem.bounds.period:
            high *= 2
        low, high = high, 2 * high
    else:
        low = high / 2.0**steps
        if not good(low):
            return 0.0
    for _ in range(steps):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def diagnose(problem: Problem, gains: tuple[Gains, ...]) -> list[Verdict]:
    """Why some gains are not proved: the failing obligations, the cause before its consequences.

    The continuous law is looked at first: what fails there (gain conditions, authority, accuracy) does not come from
    sampling. Authority is refuted where a simulated run inside the assumptions asks for more than the limit, the rest
    where one diverges or breaks the required error.
    """
    continuous = certificate(problem, gains, period=0.0)
    found = [*_authority(problem, gains, continuous), *_conditions(problem, continuous)]
    if not found:
        found = [*_sampling(problem, gains)]
    return [*_refuted(problem, gains, found), *_uncertainty(problem, gains)]


def _refuted(problem: Problem, gains: tuple[Gains, ...], found: list[Verdict]) -> list[Verdict]:
    """The verdicts, with a refutation where a run inside the assumptions diverges or breaks the required error.

    Tried are the scenarios of the study, and the first of them with each parameter at either end of its tolerance.
    """
    if found[0].verdict == "refuted":
        return found
    required = problem.study.requirements.tracking_error_m
    tried = [scenario for scenario in scenarios(problem.study) if scenario.covered]
    uncertain = [name for name, p in problem.plant.parameters.items() if p.tolerance > 0]
    tried += [replace(s, parameters={name: end}) for s in tried[:1] for name in uncertain for end in (-1.0, 1.0)]
    shown = problem.loop.figures([Run(gains=gains, scenario=scenario) for scenario in tried], problem.reference)
    for scenario, figures in zip(tried, shown, strict=True):
        late = figures.maximum_error_m
        if figures.diverged or late > required:
            corner = "".join(
                f" and {name} at its {'upper' if v > 0 else 'lower'} end" for name, v in scenario.parameters.items()
            )
            seen = "diverges" if figures.diverged else f"reaches {1e3 * late:.4g} mm of {1e3 * required:.4g} mm"
            run = f'simulated with scenario "{scenario.name}"{corner} the loop {seen}'
            witness = {"scenario": asdict(scenario), "rate_hz": 1 / problem.bounds.period}
            if figures.diverged or found[0].name == "accuracy":
                text = f"{found[0].statement}; {run}"
                return [replace(found[0], verdict="refuted", statement=text, witness=witness), *found[1:]]
            broken = Verdict(
                name="accuracy", statement=run, margin=required - late, unit="m", verdict="refuted",
                remedy=f"larger gains, or a requirement above {1e3 * late:.4g} mm", witness=witness,
            )  # fmt: skip
            return [*found, broken]
    return found


def provable_share(problem: Problem, gains: tuple[Gains, ...]) -> float:
    """The largest share of every uncertainty at which the gains are proved, by bisection; 0 where none was found.

    Parameters and loads keep the middle of their ranges; noise and initial errors shrink to zero.
    """

    def good(share: float) -> bool:
        smaller = replace(problem, bounds=shrunk(problem.bounds, share))
        return violation(smaller, certificate(smaller, gains), gains) == 0.0

    if not good(0.0):
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(10):
        middle = (low + high) / 2
        low, high = (middle, high) if good(middle) else (low, middle)
    return low


def shrunk(bounds: Bounds, share: float) -> Bounds:
    """The assumptions with every uncertainty at a share of its size."""

    def smaller(interval: Interval) -> Interval:
        middle = (interval.low + interval.high) / 2
        return Interval(middle) + Interval.symmetric(share * (interval.high - interval.low) / 2)

    return replace(
        bounds,
        parameters={name: smaller(value) for name, value in bounds.parameters.items()},
        disturbances={name: smaller(value) for name, value in bounds.disturbances.items()},
        noise=tuple(share * value for value in bounds.noise),
        initial=tuple(share * value for value in bounds.initial),
    )


def _uncertainty(problem: Problem, gains: tuple[Gains, ...]) -> list[Verdict]:
    share = provable_share(problem, gains)
    what = "every tolerance, load range, noise bound and initial error"
    if share == 0.0:
        statement, remedy = "not proved for the nominal machine either", "other gains, or another modelling term"
    else:
        statement = f"proved with {what} at {100 * share:.3g} % of the study's"
        remedy = f"{what} at {100 * share:.3g} %"
    return [
        Verdict(
            name="uncertainty", statement=statement, margin=share - 1.0, unit="share", verdict="undecided",
            remedy=remedy, sure=share > 0.0,
        )
    ]  # fmt: skip


def _authority(problem: Problem, gains: tuple[Gains, ...], continuous: Certificate | Failure) -> list[Verdict]:
    if isinstance(continuous, Certificate):
        worst = [entry for entry in slacks(problem, continuous) if entry[0] != "tracking error"]
        name, size, top, unit = max(worst, key=lambda entry: entry[1] / entry[2])
        if size <= top:
            return []
        return [
            Verdict(
                name="authority", margin=top - size, unit=unit, verdict="undecided",
                statement=f"the certified set asks for {size:.4g} {unit} of {name}, the limit is {top:.4g} {unit}",
                remedy=_less_demand(problem, size - top, unit),
            )
        ]  # fmt: skip
    limit = problem.plant.limits[0]
    demand, scenario = largest_demand(problem, gains)
    if demand <= limit.value:
        return []
    return [
        Verdict(
            name="authority",
            statement=f"simulated without sampling, the law asks for {demand:.4g} {limit.unit} of {limit.name} in "
            f'scenario "{scenario.name}"; the limit is {limit.value:.4g} {limit.unit}',
            margin=limit.value - demand,
            unit=limit.unit,
            verdict="refuted",
            remedy=_terms_that_help(problem, gains) or _less_demand(problem, demand - limit.value, limit.unit),
            witness={"scenario": asdict(scenario), "rate_hz": 1 / demand_period(problem)},
        )
    ]


def _less_demand(problem: Problem, excess: float, unit: str) -> str:
    hint = "" if "mechanics" in problem.law.modelling else ', or the modelling term "mechanics"'
    return f"lower the demand by {excess:.4g} {unit}: a slower reference, a smaller load range, smaller gains{hint}"


def _terms_that_help(problem: Problem, gains: tuple[Gains, ...]) -> str:
    """The fewest electrical modelling terms that bring the demand inside the limit, as advice."""
    if problem.plant.level != "voltage":
        return ""
    limit = problem.plant.limits[0]
    missing = [term for term in ("back_emf", "decoupling", "resistance") if term not in problem.law.modelling]
    for count in range(1, len(missing) + 1):
        for terms in combinations(missing, count):
            law = RAC(plant=problem.plant, modelling=(*problem.law.modelling, *terms))
            helped, _ = largest_demand(replace(problem, law=law, model=law.loop_model()), gains)
            if helped <= limit.value:
                named = " and ".join(f'"{term}"' for term in terms)
                return f"with {named} in controller.modelling the same scenarios ask for {helped:.4g} {limit.unit}"
    return ""


def demand_period(problem: Problem) -> float:
    """A control period so short that sampling plays no part, s."""
    return min(problem.bounds.period / 8, 1 / 16000)


def largest_demand(problem: Problem, gains: tuple[Gains, ...]) -> tuple[float, Scenario]:
    """The largest input norm that the law asks for in the study's scenarios, before the amplitude limit, and where."""
    loop = ClosedLoop(
        law=problem.law, period=demand_period(problem), noise=problem.bounds.noise, initial=problem.bounds.initial,
        nominal_load=problem.loop.nominal_load, yardstick=problem.loop.yardstick,
    )  # fmt: skip
    found = [replace(scenario, noise=0.0, fault=None) for scenario in scenarios(problem.study)]
    demands = [loop.demand(loop.run(gains, problem.reference, scenario), gains) for scenario in found]
    worst = int(np.argmax(demands))
    return demands[worst], found[worst]


def _conditions(problem: Problem, continuous: Certificate | Failure) -> list[Verdict]:
    if isinstance(continuous, Failure):
        row = continuous.row
        where = f" at subsystem {row + 1} ({problem.plant.states[row]})" if row is not None else ""
        return [
            Verdict(
                name="composition",
                statement=f"the gain conditions of the continuous law: {continuous.reason}{where}",
                margin=continuous.margin,
                unit="1/s",
                verdict="undecided",
                remedy="separate the bandwidths (a larger gain in that row or a smaller one before it), add a "
                "modelling term for that row, or narrow the tolerances and the noise that enter it",
            )
        ]
    name, size, limit, unit = slacks(problem, continuous)[-1]
    if size <= limit:
        return []
    return [
        Verdict(
            name="accuracy", statement=f"the certified {name} is {size * 1e3:.4g} mm, {limit * 1e3:.4g} mm is required",
            margin=limit - size, unit=unit, verdict="undecided",
            remedy=f"larger gains, a narrower load range, or a requirement of {1.01 * size * 1e3:.3g} mm",
        )
    ]  # fmt: skip


def _sampling(problem: Problem, gains: tuple[Gains, ...]) -> list[Verdict]:
    period = problem.bounds.period
    longest = longest_period(problem, gains)
    sampled = certificate(problem, gains)
    detail = sampled.reason if isinstance(sampled, Failure) else "a limit is passed over the certified set"
    if longest == 0.0:
        remedy = "no control period was found that would do; smaller gains in the last row would help"
    else:
        remedy = f"a control period of at most {longest * 1e6:.4g} us ({1 / longest:.6g} Hz or faster)"
    return [
        Verdict(
            name="sampling",
            statement=f"held inputs at {1 / period:g} Hz (period {period * 1e6:g} us): {detail}",
            margin=(longest - period) * 1e6, unit="us", verdict="undecided", remedy=remedy, sure=longest > 0.0,
        )
    ]  # fmt: skip
