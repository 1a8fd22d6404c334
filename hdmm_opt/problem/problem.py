"""Everything that the design of a machine works on, whether it has one member or many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Interval
from stability.networks.contracts import Contract, Subsystem
from stability.networks.coupling import Loads, Slices, Tube

from ..machines.machine import Machine, kind_of
from ..study import Study
from .member import Member, Values

Array = NDArray[np.float64]
#: Gains of all members.
GainSet = dict[str, Values]
#: Proofs of all members.
Contracts = dict[str, Contract]

#: Loads are assumed this much larger than they come out here: the checker encloses them in another arithmetic.
SPARE = 1.005


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A study made concrete.

    Attributes:
        study: The study.
        machine: The machine.
        members: Its members; their `bounds` are those of members that keep to their references.
        slices: Ranges of all references over slices of time.
        loads: What the members do to each other; None without a coupling.
    """

    study: Study
    machine: Machine
    members: tuple[Member, ...]
    slices: Slices
    loads: Loads | None

    @property
    def linked(self) -> bool:
        """Whether the proof of a member rests on what members guarantee."""
        return self.loads is not None

    @property
    def foreseeing(self) -> bool:
        """Whether the law knows the loads of a coupling along the reference."""
        return self.loads is not None and "mechanics" in self.study.controller.modelling

    @property
    def period(self) -> float:
        """Shortest control period, s."""
        return min(member.bounds.period for member in self.members)

    @property
    def duration(self) -> float:
        """Duration of the reference, s."""
        return self.members[0].reference.duration

    @property
    def searched(self) -> int:
        """Number of gains that are not fixed."""
        return sum(len(group[0].searched) for group in self.groups)

    @property
    def groups(self) -> list[list[Member]]:
        """Members that share what is searched: those that nothing joins and that have the same ranges of gains."""
        found: dict[object, list[Member]] = {}
        for k, member in enumerate(self.members):
            key = tuple(member.ranges[i] for i in member.searched) if self.machine.free else k
            found.setdefault(key, []).append(member)
        return list(found.values())

    def member(self, name: str) -> Member:
        """A member by its name."""
        return self.members[self.machine.members.index(name)]

    def prefix(self, member: Member) -> str:
        """What a line about a member begins with where there are several."""
        return f"{member.name}: " if len(self.members) > 1 else ""

    def disturbance(self, name: str) -> Interval:
        """The assumed range of one of the machine's disturbances."""
        return Interval(*self.study.uncertainty.disturbances[kind_of(name)].range)

    def rate_of(self, name: str) -> float | None:
        """The assumed bound on the rate of one of the machine's disturbances; None where it may change at any rate."""
        return self.study.uncertainty.disturbances[kind_of(name)].rate

    def at(self, point: Array, *, digits: int = 4) -> GainSet:
        """The gains at a point of the unit cube of all that is searched."""
        found: GainSet = {}
        first = 0
        for group in self.groups:
            own = point[first : first + len(group[0].searched)]
            found |= {member.name: member.values(own, digits=digits) for member in group}
            first += len(own)
        return {member.name: found[member.name] for member in self.members}

    def point(self, gains: GainSet) -> Array:
        """The point of that cube that stands for some gains."""
        return np.concatenate([group[0].point(gains[group[0].name]) for group in self.groups])

    def subsystems(self, gains: GainSet) -> dict[str, Subsystem]:
        """The loops with given gains."""
        return {member.name: member.subsystem(gains[member.name]) for member in self.members}

    def assume(self, guarantees: Mapping[str, Tube]) -> dict[str, Bounds]:
        """What each member's proof assumes when all keep their guarantees."""
        found = {member.name: member.bounds for member in self.members}
        if self.loads is not None:
            sizes, _ = self.loads.deviation(self.slices, [guarantees[member.name] for member in self.members])
            for member, size in zip(self.members, sizes, strict=True):
                (load,) = member.plant.disturbances
                spread = {load: Interval.symmetric(SPARE * size)}
                found[member.name] = replace(member.bounds, disturbances=spread)
        return found

    def still(self) -> dict[str, Tube]:
        """Guarantees of members that keep to their references."""
        return dict.fromkeys(self.machine.members, Tube(position=0.0, speed=0.0, acceleration=0.0))
