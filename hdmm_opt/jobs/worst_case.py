"""Corners of the assumptions: where a run is likely to be worst."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

from ..problem import Problem
from ..simulation import Figures, Scenario, rated
from ..simulation.scenario import Course

Simulate = Callable[[Sequence[Scenario]], list[Figures]]
#: A disturbance changes within this time, s.
EDGE = 1e-3


def uncertain(problem: Problem) -> list[str]:
    """Every uncertain parameter as "member.parameter"; as "parameter" where there is one member."""
    several = len(problem.members) > 1
    return [
        f"{m.name}.{name}" if several else name
        for m in problem.members for name, p in m.plant.parameters.items() if p.tolerance > 0
    ]  # fmt: skip


def shapes(problem: Problem) -> dict[str, dict[str, Course]]:
    """Disturbances at their ends, and for those of any course steps from one to the other half-way."""
    end, free, constant = problem.duration, [], []
    for disturbance in problem.machine.disturbances:
        (free if disturbance.course == "any" else constant).append(disturbance.name)
    found: dict[str, dict[str, Course]] = {}
    for signs in product(("high", "low"), repeat=len(constant)):
        ends = {name: problem.disturbance(name) for name in constant}
        base: dict[str, Course] = {
            name: ((0.0, ends[name].high if sign == "high" else ends[name].low),)
            for name, sign in zip(constant, signs, strict=True)
        }
        if not free:
            found["-".join(signs) or "plain"] = base
            continue
        for shape in ("high", "low", "step-up", "step-down"):
            label = "-".join([*signs, shape])
            found[label] = base | {name: _course(problem, name, shape, end) for name in free}
    return found


def _course(problem: Problem, name: str, shape: str, end: float) -> Course:
    span = problem.disturbance(name)
    first, last = {"high": (span.high,) * 2, "low": (span.low,) * 2, "step-up": (span.low, span.high),
                   "step-down": (span.high, span.low)}[shape]  # fmt: skip
    return ((0.0, first),) if first == last else ((0.0, first), (end / 2, first), (end / 2 + EDGE, last))


def worst_corner(problem: Problem, simulate: Simulate) -> tuple[Scenario, Figures]:
    """The corner of parameters and disturbances with the largest error: each sign from its own effect, then together.

    Not guaranteed: that it is the worst; it is a lower bound on the worst case.
    """
    names = uncertain(problem)
    made = [
        rated(problem, Scenario(name=f"worst-{key}", disturbances=courses)) for key, courses in shapes(problem).items()
    ]
    tried = list(zip(made, simulate(made), strict=True))
    base = max(tried, key=_late)[0]
    ends = [replace(base, parameters={name: sign}) for name in names for sign in (1.0, -1.0)]
    tried += zip(ends, simulate(ends), strict=True)
    signs = {}
    for name in names:
        own = [entry for entry in tried if name in entry[0].parameters]
        signs[name] = max(own, key=_late)[0].parameters[name]
    corners = [replace(shape, parameters=signs) for shape in made]
    corners += [replace(c, noise=1.0, bias=bias, initial=1.0) for c in corners for bias in (0.0, 1.0, -1.0)]
    tried += zip(corners, simulate(corners), strict=True)
    return max(tried, key=_late)


def _late(entry: tuple[Scenario, Figures]) -> float:
    return entry[1].maximum_error_m
