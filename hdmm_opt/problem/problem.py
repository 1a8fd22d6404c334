"""Everything that the design of a machine works on, whether it has one member or many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Interval
from stability.networks.contracts import Contract, Subsystem
from stability.networks.coupling import Loads, Slices, Tube

from ..machines.machine import Machine
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
        return sum(len(member.searched) for member in self.members)

    def member(self, name: str) -> Member:
        """A member by its name."""
        return self.members[self.machine.members.index(name)]

    def prefix(self, member: Member) -> str:
        """What a line about a member begins with where there are several."""
        return f"{member.name}: " if len(self.members) > 1 else ""

    def disturbance(self, name: str) -> Interval:
        """The assumed range of one of the machine's disturbances."""
        return Interval(*self.study.uncertainty.disturbances[name].range)

    def rate_of(self, name: str) -> float | None:
        """The assumed bound on the rate of one of the machine's disturbances; None where it may change at any rate."""
        return self.study.uncertainty.disturbances[name].rate

    def at(self, point: Array, *, digits: int = 4) -> GainSet:
        """The gains at a point of the unit cube of all that is searched."""
        found, first = {}, 0
        for member in self.members:
            size = len(member.searched)
            found[member.name] = member.values(point[first : first + size], digits=digits)
            first += size
        return found

    def point(self, gains: GainSet) -> Array:
        """The point of that cube that stands for some gains."""
        return np.concatenate([member.point(gains[member.name]) for member in self.members])

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
