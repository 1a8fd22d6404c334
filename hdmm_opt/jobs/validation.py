"""Closed-loop runs that a proved design must agree with: scenarios, corners of the assumptions, Monte Carlo."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from stability.networks.contracts import Contract

from ..errors import DefectError
from ..files.result import Validation
from ..problem import GainSet, Problem
from ..problem.margins import output_bound
from ..problem.problem import Contracts
from ..simulation import Figures, Loop, Run, Scenario, rated, scenarios, within_assumptions
from ..simulation.requirements import missed, missed_in
from .worst_case import uncertain, worst_corner

#: The integration error may be this share of the largest simulated error.
INTEGRATION_SHARE = 0.01


def validate(
    loop: Loop, gains: GainSet, *, seed: int, monte_carlo: int, jobs: int, progress: Callable[[str], None]
) -> Validation:
    """Run the scenarios, the corners and the Monte Carlo draws.

    Args:
        loop: The problem's loop.
        gains: Gains of all members.
        seed: Seed of the draws.
        monte_carlo: Number of draws.
        jobs: Threads.
        progress: Called with a line before each part.

    Returns:
        The figures, and which requirements were missed. Runs outside the assumptions are shown, and count for nothing
        else.
    """
    problem = loop.problem

    def simulate(chosen: Sequence[Scenario]) -> list[Figures]:
        return loop.figures([Run(gains=gains, scenario=s) for s in chosen], jobs=jobs)

    progress("scenarios")
    given = scenarios(problem)
    runs = tuple(zip(given, simulate(given), strict=True))
    everything = [(s, m) for s, m in runs if within_assumptions(problem, s, m)]
    worst = None
    if problem.study.validation.worst_case:
        progress("corners of the assumptions")
        worst = worst_corner(problem, simulate)
        everything.append(worst)
    drawn = None
    if monte_carlo:
        progress("Monte Carlo")
        chosen = draws(problem, monte_carlo, seed)
        random = list(zip(chosen, simulate(chosen), strict=True))
        good = sum(not missed(problem, s.name, m) for s, m in random)
        drawn = {"runs": monte_carlo, "met": good}
        everything += random
    progress("integration error")
    estimate = loop.integration_error(gains, replace(given[0], faults={}))
    failures = missed_in(problem, [(s.name, m) for s, m in everything])
    seen = max((m.largest_error_m for _, m in (*runs, *everything)), default=0.0)
    if not estimate <= INTEGRATION_SHARE * seen:
        failures.append(
            f"the integration error must stay below {INTEGRATION_SHARE:.0%} of the largest error, "
            f"{seen:.3g} m: estimated {estimate:.3g} m"
        )
    return Validation(
        runs=runs, worst=worst, monte_carlo=drawn, inside=tuple(m for _, m in everything), integration_error=estimate,
        missed=tuple(failures),
    )  # fmt: skip


def shown_scenarios(loop: Loop, gains: GainSet) -> Validation:
    """The scenarios of a study alone, of gains that are not proved."""
    given = scenarios(loop.problem)
    shown = loop.figures([Run(gains=gains, scenario=s) for s in given])
    runs = tuple(zip(given, shown, strict=True))
    inside = tuple(m for s, m in runs if within_assumptions(loop.problem, s, m))
    return Validation(runs=runs, worst=None, monte_carlo=None, inside=inside, integration_error=0.0, missed=())


def draws(problem: Problem, count: int, seed: int) -> list[Scenario]:
    """Random scenarios inside the assumptions; half of those of linked members at corners of the parameters."""
    random = np.random.default_rng([seed, 20])
    names, end = uncertain(problem), problem.duration
    made = []
    for k in range(count):
        courses = {}
        for disturbance in problem.machine.disturbances:
            span = problem.disturbance(disturbance.name)
            if disturbance.course == "constant":
                courses[disturbance.name] = ((0.0, float(random.uniform(span.low, span.high))),)
                continue
            times, values = np.sort(random.uniform(0.0, end, 3)), random.uniform(span.low, span.high, 4)
            points = [(0.0, float(values[0]))]
            points += [(float(t), float(f)) for t, f in zip(times, values[1:], strict=True) if t > points[-1][0]]
            courses[disturbance.name] = tuple(points)
        corner = problem.linked and k % 2
        shares = random.choice((-1.0, 1.0), len(names)) if corner else random.uniform(-1, 1, len(names))
        drawn = Scenario(
            name=f"draw-{k + 1}", disturbances=courses, parameters=dict(zip(names, map(float, shares), strict=True)),
            noise=1.0, initial=float(random.uniform(-1, 1)), seed=seed + k,
        )  # fmt: skip
        made.append(rated(problem, drawn))
    return made


def agree(problem: Problem, contracts: Contracts, shown: Validation) -> None:
    """Stop where a simulation did what the certificates exclude.

    Raises:
        DefectError: it did.
    """
    half_widths = np.array([contracts[m.name].certificate.half_widths[0] for m in problem.members])
    pairs: list[tuple[str, float, float, str]] = [
        ("the output", shown.largest_error, output_bound(problem, half_widths), "m")
    ]
    for member in problem.members:
        unit, contract = member.plant.state_units[0], contracts[member.name]
        seen = max((m.members[member.name].largest_error for m in shown.inside), default=0.0)
        pairs.append((member.name, seen, float(contract.certificate.half_widths[0]), unit))
        pairs += _estimated(member.name, contract, shown, unit)
    for what, reached, bound, unit in pairs:
        if not reached <= bound:
            raise DefectError(
                f"a simulation reached {reached:.6g} {unit} in {what}, outside the certified {bound:.6g} {unit}; "
                "no file was written, please report this study"
            )


def _estimated(
    name: str, contract: Contract, shown: Validation, unit: str
) -> list[tuple[str, float, float, str]]:  # fmt: skip
    watched = [m.members[name].estimates for m in shown.inside if m.members[name].estimates]
    if not watched:
        return []
    return [
        (
            f"the estimate of {name}'s {what}",
            max(column),
            float(contract.certificate.box.shown[k]),
            unit + ("/s" if k else ""),
        )
        for k, (what, column) in enumerate(zip(("position", "speed"), zip(*watched, strict=True), strict=True))
    ]
