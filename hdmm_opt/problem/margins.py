"""One record of everything that is bounded: certified size, limit, unit; and how far gains are from being proved."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from stability import Failure, Impulse, Interval, enclose, tangents_many
from stability.certificates.certificate import Certificate
from stability.networks.contracts import Contract

from ..plants.sound import program_of
from .member import Member
from .problem import Contracts, GainSet, Problem

Array = NDArray[np.float64]

#: Limits and requirements must hold with this relative room, so that the exact check, which rounds outwards, agrees.
HEADROOM = 1e-3
#: Violations of gains that are proved member by member but not together, and of gains that are not.
APART, UNPROVED = 10.0, 100.0


@dataclass(frozen=True, kw_only=True)
class Margin:
    """Something that is bounded.

    Attributes:
        member: Whose it is; empty for the output of the machine.
        name: What it is, for messages.
        kind: "limit" of a signal, "travel" inside the stroke, "network" for the estimate of a load network, or "error"
            against a requirement.
        certified: Bound over the certified set, [unit].
        limit: What it must not pass, [unit].
        unit: SI unit.
    """

    member: str
    name: str
    kind: Literal["limit", "travel", "network", "error"]
    certified: float
    limit: float
    unit: str

    @property
    def share(self) -> float:
        """Certified size over the limit; infinite where there is no room at all."""
        return self.certified / self.limit if self.limit > 0 else math.inf

    @property
    def label(self) -> str:
        """Member and name."""
        return f"{self.member} {self.name}" if self.member else self.name


def member_margins(member: Member, found: Certificate, *, shown: bool) -> list[Margin]:
    """Limits, travel and error of one member over its certified set.

    Args:
        member: The member.
        found: Its certificate.
        shown: Whether its name belongs into messages.
    """
    plant, name = member.plant, member.name if shown else ""
    sizes = dict(zip(plant.inputs, found.effort, strict=True)) | dict(zip(plant.states, found.states, strict=True))
    made = []
    for limit in plant.limits:
        size = math.sqrt(sum(float(sizes[s]) ** 2 for s in limit.signals))
        made.append(
            Margin(member=name, name=limit.name, kind="limit", certified=size, limit=limit.value, unit=limit.unit)
        )
    unit, radius = plant.state_units[0], float(found.half_widths[0])
    span, middle = member.bounds.reference[0], sum(plant.stroke) / 2
    size = max(span.high + radius - middle, middle - span.low + radius)
    half = (plant.stroke[1] - plant.stroke[0]) / 2
    made.append(Margin(member=name, name="stroke", kind="travel", certified=size, limit=half, unit=unit))
    if isinstance(found, Impulse):
        units = dict(zip(plant.states, member.control_units, strict=True))
        for state, size, capacity in zip(found.networks, found.estimates, found.capacity, strict=True):
            made.append(Margin(
                member=name, name=f"phi of {state}", kind="network", certified=float(size), limit=float(capacity),
                unit=units[state],
            ))  # fmt: skip
    error = float(found.ultimate[0])
    made.append(
        Margin(member=name, name="tracking error", kind="error", certified=error, limit=member.accuracy, unit=unit)
    )
    return made


def margins(problem: Problem, contracts: Mapping[str, Contract]) -> list[Margin]:
    """Everything that is bounded, the error of the output last."""
    several = len(problem.members) > 1
    made = []
    for member in problem.members:
        made += member_margins(member, contracts[member.name].certificate, shown=several)
    made += [_drawn(problem, contracts, output) for output in problem.machine.shared]
    if problem.loads is not None or several:
        ultimates = np.array([contracts[member.name].certificate.ultimate[0] for member in problem.members])
        made.append(Margin(
            member="", name="output error", kind="error", certified=output_bound(problem, ultimates),
            limit=problem.study.requirements.tracking_error_m, unit=problem.machine.output_unit,
        ))  # fmt: skip
    return made


def of_machine(problem: Problem) -> int:
    """How many of the margins are the machine's own, beside those of its members."""
    return len(problem.machine.shared) + (problem.loads is not None or len(problem.members) > 1)


def _drawn(problem: Problem, contracts: Mapping[str, Contract], output: str) -> Margin:
    """What all members together take of something over their certified sets."""
    limit, total = problem.machine.shared[output], 0.0
    for member in problem.members:
        plant, found = member.plant, contracts[member.name].certificate
        program, _ = program_of(plant, plant.outputs[output])
        assert program is not None
        sizes = dict(zip(plant.inputs, found.effort, strict=True)) | dict(zip(plant.states, found.states, strict=True))
        ranges = {name: Interval.symmetric(float(size)) for name, size in sizes.items()}
        total += enclose(program, {**member.bounds.parameters, **ranges})[0].magnitude
    return Margin(
        member="", name=f"{output} of all members", kind="limit", certified=total, limit=limit.value, unit=limit.unit
    )


def certified_error(problem: Problem, contracts: Mapping[str, Contract]) -> float:
    """Certified bound on the error of the output after the transient, m."""
    return margins(problem, contracts)[-1].certified


def lateness(problem: Problem, gains: GainSet) -> float:
    """By how much sampled adaptation is too fast for the control rate; 0 where it is not."""
    return sum(
        max(0.0, member.bounds.period * g.delta * g.sigma - 1.0)
        for member in problem.members for g in member.gains(gains[member.name])
    )  # fmt: skip


def violation(problem: Problem, contracts: Contracts | Failure, gains: GainSet) -> float:
    """How far gains are from being proved inside all limits and requirements; 0 where they are."""
    late = lateness(problem, gains)
    if isinstance(contracts, Failure):
        return (APART if contracts.together else UNPROVED) + late
    return late + sum(max(0.0, m.share * (1 + HEADROOM) - 1.0) for m in margins(problem, contracts))


def output_bound(problem: Problem, half_widths: Array) -> float:
    """Bound on the distance of the output from its reference while |x_i - r_i| <= half_widths_i, m.

    Of members that nothing joins it is that of the worst one, in its unit.
    """
    if problem.loads is None:
        return float(max(half_widths))
    low, high = problem.slices.low[0], problem.slices.high[0]
    ranges = {f"x{j}": (low[j] - radius, high[j] + radius) for j, radius in enumerate(half_widths)}
    unit = np.ones(problem.slices.low.shape[2])
    along = tangents_many(problem.machine.place_expression, ranges, {name: {name: (unit, unit)} for name in ranges})
    squared = np.zeros_like(unit)
    for coordinate in along:
        size = np.zeros_like(unit)
        for name, (low, high) in coordinate.items():
            size = size + np.maximum(np.abs(low), np.abs(high)) * half_widths[int(name[1:])]
        squared = squared + size**2
    return float(np.sqrt(squared.max()) * (1 + 1e-9))
