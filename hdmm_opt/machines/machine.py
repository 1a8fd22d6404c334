"""A machine: members with a plant each, what they do to each other, and where its output is.

A coupling is written once, as F(x, v, a, d) in coordinates of the members, d the machine's disturbances. The proof
reads F as operations (`Loads`), the simulation solves it together with the plants, the law foresees it along the
reference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import casadi as ca

from stability import Expression, Interval, algebraic
from stability.enclosures.translation import straight_line
from stability.networks.coupling import Loads

from ..plants import Limit, Plant
from .body import Body


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """Something from outside that a study gives a range.

    Attributes:
        name: Its name; "member.name" where several members meet one each of the same range.
        unit: SI unit.
        course: "constant" in a run, or "any" course in time.
    """

    name: str
    unit: str
    course: Literal["constant", "any"]

    @property
    def kind(self) -> str:
        """The name under which a study gives its range."""
        return kind_of(self.name)


def kind_of(name: str) -> str:
    """The name of a disturbance without the member that meets it."""
    return name.rpartition(".")[2]


@dataclass(frozen=True, kw_only=True)
class Machine:
    """Members with their plants, and what couples them.

    Attributes:
        name: Model name, as in a study.
        members: Names of the members.
        plants: The plant of each.
        disturbances: What the machine meets; without a coupling what each plant meets by itself.
        forces: CasADi function (x, v, a, d) -> what the coupling asks of each member, shape (n,); x, v and a are the
            members' position, speed and acceleration, d the disturbances in order. None where nothing joins the
            members, whose first states are then the output.
        place: CasADi function x -> output, m, of the members' first states.
        planner: How `motions` makes references for it.
        assumed: What has no public source, beside the parameters that say so.
        coordinates: Names of the output's coordinates.
        of_joints: CasADi function joint coordinates -> the members' first states; None where they are the same.
        sticks: CasADi function of the members' first states -> points of a stick figure, m. Shape (3, k).
        bundled: Numbers of each member that the study leaves to the bundled machine.
        body: What free members move, in simulation.
        shared: What members draw on together, by the output of each that adds up: a limit on the sum of its amounts.
    """

    name: str
    members: tuple[str, ...]
    plants: tuple[Plant, ...]
    disturbances: tuple[Disturbance, ...]
    forces: Any
    place: Any
    planner: str
    assumed: tuple[str, ...] = ()
    coordinates: tuple[str, ...] = ("",)
    of_joints: Any = None
    sticks: Any = None
    bundled: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    body: Body | None = None
    shared: Mapping[str, Limit] = field(default_factory=dict)

    @property
    def own(self) -> tuple[float, ...]:
        """The part of the bodies' inertia that each plant carries itself."""
        return tuple(plant.parameters[plant.carried].value for plant in self.plants)

    @property
    def free(self) -> bool:
        """Whether nothing joins the members: each is by itself, and the machine's error is that of the worst one."""
        return self.forces is None

    @property
    def output_unit(self) -> str:
        """Unit of the output: a length, or that of the first states where nothing joins the members."""
        return self.plants[0].state_units[0] if self.free else "m"

    def met_by(self, k: int) -> list[int]:
        """Indices of the disturbances that a member of a free machine meets, in the order of its plant."""
        own = f"{self.members[k]}." if len(self.members) > 1 else ""
        names = [d.name for d in self.disturbances]
        return [names.index(own + name) for name in self.plants[k].disturbances]

    @cached_property
    def expression(self) -> Expression:
        """F as operations over x0…, v0…, a0…, and the disturbances."""
        n = len(self.members)
        names = (*(f"{letter}{j}" for letter in "xva" for j in range(n)), *(d.name for d in self.disturbances))
        flat = ca.SX.sym("flat", len(names))
        value = self.forces(flat[:n], flat[n : 2 * n], flat[2 * n : 3 * n], flat[3 * n :])
        return algebraic(straight_line(ca.Function("forces", [flat], [ca.densify(value)], {"cse": True}), names))

    @cached_property
    def place_expression(self) -> Expression:
        """The output as operations over x0…."""
        n = len(self.members)
        flat = ca.SX.sym("flat", n)
        names = tuple(f"x{j}" for j in range(n))
        place = ca.densify(self.place(flat))
        return algebraic(straight_line(ca.Function("place", [flat], [place], {"cse": True}), names))

    def loads(self, ranges: Mapping[str, Interval]) -> Loads | None:
        """What the members do to each other, as data for the prover; None without a coupling."""
        if self.forces is None:
            return None
        return Loads(
            expression=self.expression, own=self.own, disturbances=dict(ranges),
            first=tuple(plant.first for plant in self.plants),
        )  # fmt: skip

    def carrying(self, own: tuple[float, ...]) -> Machine:
        """The same machine with other parts of the bodies' inertia in the plants' own models."""
        plants = tuple(
            plant.with_values(parameters={plant.carried: replace(plant.parameters[plant.carried], value=value)})
            for plant, value in zip(self.plants, own, strict=True)
        )
        return replace(self, plants=plants)
