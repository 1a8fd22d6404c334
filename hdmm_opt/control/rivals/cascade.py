"""What rivals for positioning share: they command an acceleration, and turn it into a torque or a current.

A torque or current for an acceleration is taken from the nominal plant, with the same modelling term as the study's law
holds. Where the actuator has currents, proportional loops with the same electrical terms follow them.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from ...plants import Plant
from ..law import GainSpec, limited
from ..modelling import METERED, modelling_term
from .rival import Rival

#: Row of the speed, whose virtual control is the torque or the current.
SPEED = 1
#: Turns a wanted acceleration beside the modelling term into the command inside its limit, and what it stands for.
Command = Callable[[Any], tuple[Any, Any]]


@dataclass(frozen=True, kw_only=True)
class Cascade(Rival):
    """A rival that positions."""

    NEEDS = "positions by a torque, a current or a force: it needs a first state that is a position, and no valve"
    #: Gains of the outer stage, with the range that each is searched in on a logarithmic scale.
    OUTER: ClassVar[tuple[GainSpec, ...]]

    @classmethod
    def suits(cls, plant: Plant) -> bool:
        """A plant that goes to a position under a torque, a current or a force."""
        return plant.first == "position" and len(plant.states) > 1 and plant.level not in METERED

    @property
    def _electrical(self) -> bool:
        return SPEED not in self.plant.input_map

    @property
    def schema(self) -> tuple[GainSpec, ...]:
        """Gains of the outer stage, and the bandwidth of the current loops where there are some."""
        inner = GainSpec(name="inner", unit="1/s", meaning="bandwidth of the current loops", low=200.0, high=8000.0)
        return (*self.OUTER, *((inner,) if self._electrical else ()))

    @abstractmethod
    def outer(self, x: Any, r: Any, z: Any, gains: Any, command: Command, period: float) -> tuple[Any, Any]:
        """The command of the speed's row, and the states after a period."""

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
