"""What a law asks of its actuators where sampling plays no part."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

from ..control.modelling import ELECTRICAL
from ..control.registry import law_for
from ..problem import GainSet, Member, Problem
from ..simulation import Loop, Scenario, scenarios

#: A control period at which sampling plays no part, s; shorter where the study's own is.
SHORT = 1 / 16000


def demand_period(problem: Problem) -> float:
    """A control period so short that sampling plays no part, s."""
    return min(problem.period / 8, SHORT) if problem.period > SHORT else problem.period


def largest_demand(problem: Problem, gains: GainSet, name: str) -> tuple[float, Scenario]:
    """The largest input norm that a member's law asks for in the study's scenarios, before its limit, and where."""
    loop = Loop(problem, period=demand_period(problem))
    found = [replace(scenario, noise=0.0, faults={}) for scenario in scenarios(problem)]
    demands = [loop.demand(loop.trace(gains, scenario), gains)[name] for scenario in found]
    worst = max(range(len(found)), key=demands.__getitem__)
    return demands[worst], found[worst]


def terms_that_help(problem: Problem, gains: GainSet, member: Member) -> str:
    """The fewest electrical modelling terms that bring the demand inside the limit, as advice."""
    limit, given = member.plant.limits[0], problem.study.controller.modelling
    missing = [term for term in ("back_emf", "decoupling", "resistance") if term not in given]
    if member.plant.level != "voltage" or not set(missing) <= set(ELECTRICAL):
        return ""
    for count in range(1, len(missing) + 1):
        for terms in combinations(missing, count):
            helped, _ = largest_demand(_with_terms(problem, (*given, *terms)), gains, member.name)
            if helped <= limit.value:
                named = " and ".join(f'"{term}"' for term in terms)
                return f"with {named} in controller.modelling the same scenarios ask for {helped:.4g} {limit.unit}"
    return ""


def _with_terms(problem: Problem, modelling: tuple[str, ...]) -> Problem:
    members = []
    for member in problem.members:
        law = law_for(problem.study.controller.law, member.plant, modelling)
        members.append(replace(member, law=law, model=law.loop_model()))
    return replace(problem, members=tuple(members))
