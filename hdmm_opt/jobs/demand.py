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


def resting_demand(member: Member) -> float | None:
    """What holds the largest load at rest at nominal parameters, in the unit of the input; None where it is another."""
    import casadi as ca

    plant, row = member.plant, member.plant.accelerating
    following = [j for j, target in enumerate(plant.targets) if target == row]
    unit = plant.state_units[following[0]] if following else plant.input_unit
    if unit != plant.limits[0].unit:
        return None
    loads = [max(member.bounds.disturbances[name].low, member.bounds.disturbances[name].high, key=abs)
             for name in plant.disturbances]  # fmt: skip
    rest = ca.DM(plant.standing(loads))
    values = ca.DM([p.value for p in plant.parameters.values()])
    held = plant.demand(row, 0.0, x=ca.SX(rest), w=ca.SX(loads), p=ca.SX(values))
    return abs(float(ca.evalf(ca.SX(held))))


def terms_that_help(problem: Problem, gains: GainSet, member: Member) -> str:
    """The fewest electrical modelling terms that bring the demand inside the limit, as advice."""
    limit, given = member.plant.limits[0], problem.study.controller.modelling
    missing = [term for term in ("back_emf", "decoupling", "resistance") if term not in given]
    if member.plant.level != "voltage" or not set(missing) <= set(ELECTRICAL):
        return ""
    for count in range(1, len(missing) + 1):
        for terms in combinations(missing, count):
            helped, _ = largest_demand(with_terms(problem, (*given, *terms)), gains, member.name)
            if helped <= limit.value:
                named = " and ".join(f'"{term}"' for term in terms)
                return f"with {named} in controller.modelling the same scenarios ask for {helped:.4g} {limit.unit}"
    return ""


def with_terms(problem: Problem, modelling: tuple[str, ...]) -> Problem:
    """The problem with other modelling terms in the law."""
    members = []
    for member in problem.members:
        law = law_for(problem.study.controller.law, member.plant, modelling)
        members.append(replace(member, law=law, model=law.loop_model()))
    return replace(problem, members=tuple(members))
