"""What rivals for positioning share: they command an acceleration, and turn it into a torque or a current.

A torque or current for an acceleration is taken from the nominal plant, with the same modelling term as the study's law
holds. Where the actuator has currents, proportional loops with the same electrical terms follow them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ...plants import Plant
from ..law import GainSpec, limited
from ..modelling import METERED, check_modelling, modelling_term

#: Row of the speed, whose virtual control is the torque or the current.
SPEED = 1
#: Turns a wanted acceleration beside the modelling term into the command inside its limit, and what it stands for.
Command = Callable[[Any], tuple[Any, Any]]


@dataclass(frozen=True, kw_only=True)
class Cascade(ABC):
    """A rival for one plant.

    Attributes:
        plant: The plant.
        modelling: Modelling terms; those of the study's law, so that all know the same.

    Raises:
        ValueError: a plant whose first state is no position, or a modelling term that it has no row for.
    """

    NAME: ClassVar[str]
    #: Gains of the outer stage, with the range that each is searched in on a logarithmic scale.
    OUTER: ClassVar[tuple[GainSpec, ...]]

    plant: Plant
    modelling: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_modelling(self.plant, self.modelling)
        if self.plant.first != "position" or len(self.plant.states) < 2:
            raise ValueError(f"{self.NAME} positions: it needs a plant whose first state is a position")
        if self.plant.level in METERED:
            raise ValueError(
                f"{self.NAME} commands a torque, a current or a force: it needs another input than a valve"
            )

    @property
    def _electrical(self) -> bool:
        return SPEED not in self.plant.input_map

    @property
    def schema(self) -> tuple[GainSpec, ...]:
        """Gains of the outer stage, and the bandwidth of the current loops where there are some."""
        inner = GainSpec(name="inner", unit="1/s", meaning="bandwidth of the current loops", low=200.0, high=8000.0)
        return (*self.OUTER, *((inner,) if self._electrical else ()))

    @property
    @abstractmethod
    def states(self) -> int:
        """Number of discrete states."""

    @abstractmethod
    def outer(self, x: Any, r: Any, z: Any, gains: Any, command: Command, period: float) -> tuple[Any, Any]:
        """The command of the speed's row, and the states after a period."""

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """All states start at zero."""
        return [0.0] * self.states

    def step(self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float) -> Any:
        """One control period; as in `control/law.py`."""
        import casadi as ca

        plant = self.plant
        following = [j for j, target in enumerate(plant.targets) if target == SPEED]
        signal = plant.states[following[0]] if self._electrical else plant.inputs[0]
        limit = next(entry.value for entry in plant.limits if signal in entry.signals)
        scale = self._per_acceleration(x, following)
        term = modelling_term(plant, self.modelling, SPEED, x, r, nominal, load)

        def command(feedback: Any) -> tuple[Any, Any]:
            value = ca.fmin(ca.fmax(term + scale * feedback, -limit), limit)
            return value, (value - term) / scale

        value, after = self.outer(x, r, z, gains, command, period)
        if self._electrical:
            inner = gains[len(self.OUTER)]
            masses = ca.substitute([plant.mass], [plant.p], [nominal])[0]
            u = ca.vertcat(*(
                modelling_term(plant, self.modelling, row, x, r, nominal, load)
                - inner * masses[row] * (x[row] - (value if plant.targets[row] == SPEED else 0))
                for row in plant.input_map
            ))  # fmt: skip
        else:
            u = value
        return limited(plant, u), after, ca.vertcat(x[0] - r[0])

    def ahead(self, r: Any) -> Any:
        """The reference's acceleration, where no modelling term holds it."""
        return 0 if "mechanics" in self.modelling else r[2]

    def _per_acceleration(self, x: Any, following: list[int]) -> Any:
        """Torque or current that a unit of acceleration takes on the nominal plant: mass over gain of its row."""
        import casadi as ca

        plant = self.plant
        nominal = ca.DM(list(plant.values().values()))
        source = plant.x[following[0]] if following else plant.u[0]
        gain, mass = ca.substitute([ca.jacobian(plant.force[SPEED], source), plant.mass[SPEED]], [plant.p], [nominal])
        values = [x, ca.SX.zeros(plant.u.numel()), ca.SX.zeros(plant.w.numel())]
        return mass / ca.substitute([gain], [plant.x, plant.u, plant.w], values)[0]


def frozen(wanted: Any, given: Any, growth: Any) -> Any:
    """The growth of an integral; none while it would push the limited command further outwards."""
    import casadi as ca

    outwards = ca.logic_and(ca.fabs(wanted - given) > 1e-9, (wanted - given) * growth > 0)
    return ca.if_else(outwards, 0, growth)


def searched(name: str, unit: str, meaning: str, low: float, high: float) -> GainSpec:
    """A gain with the range that it is searched in."""
    return GainSpec(name=name, unit=unit, meaning=meaning, low=low, high=high)
