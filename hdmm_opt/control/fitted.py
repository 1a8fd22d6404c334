"""A law on a plant that it was not made for: one that has more states and parameters than the law knows of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..plants import Plant
from .law import GainSpec, Law


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """A law that sees the first states of another plant and takes it for its own.

    Attributes:
        law: The law.
        plant: The plant that it meets; states, inputs and disturbances begin with those of the law's own.

    Raises:
        ValueError: states that do not begin with the law's own, or other inputs or disturbances.
    """

    law: Law
    plant: Plant

    def __post_init__(self) -> None:
        own, met = self.law.plant, self.plant
        alike = own.inputs == met.inputs and own.disturbances == met.disturbances
        if met.states[: len(own.states)] != own.states or not alike:
            raise ValueError(f"{met.name} does not begin with the states of {own.name}")

    @property
    def schema(self) -> tuple[GainSpec, ...]:
        """The law's gains."""
        return self.law.schema

    @property
    def states(self) -> int:
        """Number of the law's discrete states."""
        return self.law.states

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """The law's start, from the states that it sees."""
        return self.law.start(x[: len(self.law.plant.states)], gains)

    def step(self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float) -> Any:
        """One control period of the law, by the nominal numbers of its own plant; as in `law.py`."""
        import casadi as ca

        own = self.law.plant
        return self.law.step(x[: len(own.states)], r, z, gains, ca.DM(list(own.values().values())), load, period)


def fitted(law: Law, plant: Plant) -> Law:
    """The law where the plant is its own, otherwise fitted to it."""
    return law if law.plant.states == plant.states else Fitted(law=law, plant=plant)
