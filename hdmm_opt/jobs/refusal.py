"""Why some gains are not proved: the failing obligations, the cause before its consequences.

A member that fails by itself is looked at first, its continuous law before its sampled one: what fails there (gain
conditions, authority, accuracy) does not come from sampling, and what fails by itself not from the neighbours.
"""

from __future__ import annotations

import math
from dataclasses import replace

from stability import Certificate, Failure

from ..files.result import Design
from ..plants import EFFECTIVENESS
from ..problem import GainSet, Member, Problem
from ..problem.margins import Margin, margins, member_margins
from ..problem.problem import Contracts
from ..problem.verdict import Verdict
from ..simulation import Figures, Loop, Run, Scenario, scenarios, within_assumptions
from .certify import certificate, composition, longest_period
from .demand import demand_period, largest_demand, resting_demand, terms_that_help
from .shrinking import uncertainty
from .validation import shown_scenarios

#: A law at so many times its rate counts as continuous.
FASTER = 32


def refused(problem: Problem, loop: Loop, gains: GainSet, contracts: Contracts | Failure) -> Design:
    """A design that is not proved, with what failed and what simulations show (they prove nothing)."""
    shown = shown_scenarios(loop, gains)
    return Design(
        document=None, report=None, verdicts=tuple(diagnose(problem, loop, gains, contracts)), missed=(), gains=gains,
        problem=problem, shown=shown,
    )  # fmt: skip


def diagnose(problem: Problem, loop: Loop, gains: GainSet, contracts: Contracts | Failure) -> list[Verdict]:
    """What fails, refuted where a run inside the assumptions is lost or misses what is required."""
    found = _stuck(problem)
    if not found:
        found = _alone(problem, gains)
    if not found and isinstance(contracts, Failure) and contracts.together:
        found = [Verdict(
            name="coupling", margin=-math.inf, unit="1", verdict="undecided",
            statement=f"each member is proved alone, not all together: {contracts.reason}",
            remedy="more inertia of the actuators, a motion nearer to the base, less uncertainty, or other gains",
        )]  # fmt: skip
    if not found and not isinstance(contracts, Failure):
        found = [_broken(m) for m in sorted(margins(problem, contracts), key=lambda m: -m.share) if m.share > 1]
    if not found:
        found = [_sampling(problem, gains, contracts)]
    refuted = _refuted(problem, loop, gains, found)
    return refuted if _stuck(problem) else [*refuted, uncertainty(problem, gains)]


def _stuck(problem: Problem) -> list[Verdict]:
    names = [
        m.name for m in problem.members
        if EFFECTIVENESS in m.plant.parameters and (m.plant.parameters[EFFECTIVENESS].ends or (1.0,))[0] <= 0
    ]  # fmt: skip
    if not names:
        return []
    return [Verdict(
        name="authority", margin=-math.inf, unit="1", verdict="undecided",
        statement=f"the actuator of {' and '.join(names)} may deliver nothing: no gain holds a stuck member",
        remedy="least_effectiveness above 0 for every member",
    )]  # fmt: skip


def _alone(problem: Problem, gains: GainSet) -> list[Verdict]:
    """What fails of members whose neighbours keep to their references."""
    still = problem.assume(problem.still()) if problem.linked else {m.name: m.bounds for m in problem.members}
    several = len(problem.members) > 1
    for member in problem.members:
        own = member.under(still[member.name])
        values = gains[member.name]
        if not isinstance(certificate(_faster(own), values), Failure):
            continue  # what fails is not the law, but its rate
        continuous = composition(own, values)
        if isinstance(continuous, Certificate) and any(g.gamma > 0 for g in own.gains(values)):
            continue  # it is of the law without load networks: what it bounds is not what this one does
        found = [*_authority(problem, own, gains, continuous), *_conditions(problem, own, continuous)]
        if found:
            return [replace(v, member=member.name if several else "") for v in found]
    return []


def _faster(member: Member) -> Member:
    """The member with a law that is nearly continuous."""
    return member.under(replace(member.bounds, period=member.bounds.period / FASTER, delay=0.0, jitter=0.0))


def _broken(margin: Margin) -> Verdict:
    """A limit or a requirement that the certified set passes."""
    size, limit, unit, error = margin.certified, margin.limit, margin.unit, margin.kind == "error"
    statement = f"the certified set asks for {size:.4g} {unit} of {margin.label}, the limit is {limit:.4g} {unit}"
    if error:
        statement = f"the certified {margin.label} is {size * 1e3:.4g} m{unit}, {limit * 1e3:.4g} m{unit} is required"
    return Verdict(
        name="accuracy" if error else "authority", margin=limit - size, unit=unit, verdict="undecided",
        statement=statement, member=margin.member,
        remedy=f"{'a requirement' if error else 'a limit'} of {1.01 * size:.4g} {unit}",
    )  # fmt: skip


def _authority(problem: Problem, member: Member, gains: GainSet, continuous: Certificate | Failure) -> list[Verdict]:
    if isinstance(continuous, Certificate):
        worst = [m for m in member_margins(member, continuous, shown=False) if m.kind != "error"]
        most = max(worst, key=lambda m: m.share)
        if most.share <= 1:
            return []
        made = _broken(most)
        return [replace(made, remedy=_less_demand(member, most.certified - most.limit, most.unit))]
    limit = member.plant.limits[0]
    demand, scenario = largest_demand(problem, gains, member.name)
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
            remedy=terms_that_help(problem, gains, member) or _less_demand(member, demand - limit.value, limit.unit),
            witness={"scenario": scenario.to_data(), "rate_hz": 1 / demand_period(problem)},
        )
    ]


def _less_demand(member: Member, excess: float, unit: str) -> str:
    held = resting_demand(member)
    if held is not None and held > member.plant.limits[0].value:
        limit = member.plant.limits[0]
        return (
            f"the largest load alone asks for {held:.4g} {limit.unit} at rest: a limit on {limit.name} above that, a "
            "smaller load, or another transmission"
        )
    known = "mechanics" in getattr(member.law, "modelling", ())
    hint = "" if known else ', or the modelling term "mechanics"'
    return f"lower the demand by {excess:.4g} {unit}: a slower reference, a smaller load range, smaller gains{hint}"


def _apart(row: int | None) -> str:
    return (
        "bandwidths further apart (a larger gain in that row, or a smaller one before it), " if row else "other gains, "
    )


def _conditions(problem: Problem, member: Member, continuous: Certificate | Failure) -> list[Verdict]:
    if isinstance(continuous, Failure):
        row = continuous.row
        where = f" at subsystem {row + 1} ({member.plant.states[row]})" if row is not None else ""
        return [
            Verdict(
                name="composition",
                statement=f"the gain conditions of the continuous law: {continuous.reason}{where}",
                margin=continuous.margin,
                unit="1/s",
                verdict="undecided",
                remedy=f"{_apart(row)}a faster control rate, a modelling term for that row, or narrower tolerances and "
                "noise that enter it",
            )
        ]
    error = member_margins(member, continuous, shown=False)[-1]
    if error.share <= 1:
        return []
    size, unit = error.certified, error.unit
    remedy = f"larger gains, a narrower load range, or a requirement of {1.01 * size * 1e3:.3g} m{unit}"
    return [replace(_broken(error), remedy=remedy)]


def _sampling(problem: Problem, gains: GainSet, contracts: Contracts | Failure) -> Verdict:
    period = problem.period
    longest = longest_period(problem, gains)
    detail = contracts.reason if isinstance(contracts, Failure) else "a limit is passed over the certified set"
    if longest == 0.0:
        remedy = "no control period was found that would do; smaller gains in the last row would help"
    else:
        remedy = f"a control period of at most {longest * 1e6:.4g} us ({1 / longest:.6g} Hz or faster)"
    return Verdict(
        name="sampling",
        statement=f"held inputs at {1 / period:g} Hz (period {period * 1e6:g} us): {detail}",
        margin=(longest - period) * 1e6, unit="us", verdict="undecided", remedy=remedy, sure=longest > 0.0,
    )  # fmt: skip


def _refuted(problem: Problem, loop: Loop, gains: GainSet, found: list[Verdict]) -> list[Verdict]:
    """The verdicts, with a refutation where a run inside the assumptions is lost or breaks the required error.

    Tried are the scenarios of the study, and the first of them with each parameter at either end of its tolerance.
    """
    if found[0].verdict == "refuted":
        return found
    required = problem.study.requirements.tracking_error_m
    tried = [scenario for scenario in scenarios(problem) if within_assumptions(problem, scenario)]
    names = [name for m in problem.members for name, p in m.plant.parameters.items() if p.tolerance > 0]
    ends = dict.fromkeys(names)
    tried += [replace(s, parameters={name: end}) for s in tried[:1] for name in ends for end in (-1.0, 1.0)]
    shown = loop.figures([Run(gains=gains, scenario=scenario) for scenario in tried])
    for scenario, figures in zip(tried, shown, strict=True):
        if figures.diverged or figures.maximum_error_m > required:
            return _with_witness(problem, found, scenario, figures)
    return found


def _with_witness(problem: Problem, found: list[Verdict], scenario: Scenario, figures: Figures) -> list[Verdict]:
    required, late = problem.study.requirements.tracking_error_m, figures.maximum_error_m
    unit = problem.machine.output_unit
    corner = "".join(
        f" and {name} at its {'upper' if v > 0 else 'lower'} end" for name, v in scenario.parameters.items()
    )
    seen = (
        f"is lost at {figures.diverged_s:.3g} s"
        if figures.diverged
        else f"reaches {1e3 * late:.4g} m{unit} of {1e3 * required:.4g} m{unit}"
    )
    run = f'simulated with scenario "{scenario.name}"{corner} the loop {seen}'
    witness = {"scenario": scenario.to_data(), "rate_hz": 1 / problem.period}
    if figures.diverged or found[0].name == "accuracy" or _stuck(problem):
        text = f"{found[0].statement}; {run}"
        return [replace(found[0], verdict="refuted", statement=text, witness=witness), *found[1:]]
    broken = Verdict(
        name="accuracy", statement=run, margin=required - late, unit=unit, verdict="refuted",
        remedy=f"larger gains, or a requirement above {1e3 * late:.4g} m{unit}", witness=witness,
    )  # fmt: skip
    return [*found, broken]
