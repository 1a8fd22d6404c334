"""What all rivals are: a law for one plant, with ranges that its gains are searched in."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ...plants import Plant
from ..law import GainSpec
from ..modelling import check_modelling


@dataclass(frozen=True, kw_only=True)
class Rival(ABC):
    """A rival for one plant.

    Attributes:
        plant: The plant.
        modelling: Modelling terms; those of the study's law, so that all know the same.

    Raises:
        ValueError: a plant that it is not made for, or a modelling term that the plant has no row for.
    """

    NAME: ClassVar[str]
    #: What it is made for, for messages.
    NEEDS: ClassVar[str]

    plant: Plant
    modelling: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_modelling(self.plant, self.modelling)
        if not self.suits(self.plant):
            raise ValueError(f"{self.NAME} {self.NEEDS}")

    @classmethod
    @abstractmethod
    def suits(cls, plant: Plant) -> bool:
        """Whether it is made for a plant."""

    @property
    @abstractmethod
    def schema(self) -> tuple[GainSpec, ...]:
        """Its gains, each with the range that it is searched in on a logarithmic scale."""

    @property
    @abstractmethod
    def states(self) -> int:
        """Number of discrete states."""

    @abstractmethod
    def step(self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float) -> Any:
        """One control period; as in `control/law.py`."""

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """All states start at zero."""
        return [0.0] * self.states


def frozen(wanted: Any, given: Any, growth: Any) -> Any:
    """The growth of an integral; none while it would push the limited command further outwards."""
    import casadi as ca

    outwards = ca.logic_and(ca.fabs(wanted - given) > 1e-9, (wanted - given) * growth > 0)
    return ca.if_else(outwards, 0, growth)


def searched(name: str, unit: str, meaning: str, low: float, high: float) -> GainSpec:
    """A gain with the range that it is searched in."""
    return GainSpec(name=name, unit=unit, meaning=meaning, low=low, high=high)
