"""What rivals for a speed behind a valve share: a command beside the flow that the speed asked for takes.

They measure the speed; those that follow a pressure measure that too. All know the flow term where the study's law
does: what a compensated valve must be told for the speed of the reference, without leakage or load.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from ...plants import Plant
from ..law import GainSpec
from ..modelling import METERED, modelling_term
from .rival import Rival

#: Turns feedback beside the flow term into the command inside its limit, and what of it is feedback then.
Command = Callable[[Any], tuple[Any, Any]]


class Metering(Rival):
    """A rival for a speed behind a valve."""

    NEEDS = "meters oil for a speed: it needs a first state that is a speed, and a valve"
    #: Its gains.
    GAINS: ClassVar[tuple[GainSpec, ...]]

    @classmethod
    def suits(cls, plant: Plant) -> bool:
        """A plant whose speed one valve makes."""
        return plant.first == "speed" and plant.level in METERED and len(plant.inputs) == 1

    @property
    def schema(self) -> tuple[GainSpec, ...]:
        """Its gains."""
        return self.GAINS

    @abstractmethod
    def feedback(self, x: dict[str, Any], r: Any, z: Any, gains: Any, command: Command, nominal: dict[str, Any],
                 period: float) -> tuple[Any, Any]:  # fmt: skip
        """The command, and the states after a period; measured states and nominal parameters by name."""

    def step(self, x: Any, r: Any, z: Any, gains: Any, nominal: Any, load: Any, period: float) -> Any:
        """One control period; as in `control/law.py`."""
        import casadi as ca

        plant = self.plant
        (row,) = plant.input_map
        limit = plant.limits[0].value
        term = modelling_term(plant, self.modelling, row, x, r, nominal, load)

        def command(feedback: Any) -> tuple[Any, Any]:
            value = ca.fmin(ca.fmax(term + feedback, -limit), limit)
            return value, value - term

        measured = {name: x[k] for k, name in enumerate(plant.states)}
        known = {name: nominal[k] for k, name in enumerate(plant.parameters)}
        value, after = self.feedback(measured, r, z, gains, command, known, period)
        return value, after, ca.vertcat(x[0] - r[0])
