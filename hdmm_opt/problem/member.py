"""One member: a plant under a law along a reference, with what its proof assumes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Gains, LoopModel
from stability.networks.contracts import Subsystem
from trajectories import Reference
from tuning.decimals import rounded

from ..control import ProvableLaw
from ..plants import Plant

Array = NDArray[np.float64]
#: Values of all gains of a member, in the order of its law's schema.
Values = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class GainRange:
    """A gain of the study: fixed, or between two values.

    Attributes:
        name: Name in the study, for example "beta_1".
        low: Smallest value.
        high: Largest value; equal to `low` for a fixed gain.
        unit: SI unit.
        meaning: One line.
    """

    name: str
    low: float
    high: float
    unit: str
    meaning: str

    @property
    def fixed(self) -> bool:
        """True where nothing is searched."""
        return self.low == self.high


@dataclass(frozen=True, kw_only=True)
class Member:
    """What a proof works on.

    Attributes:
        name: Its name in the machine.
        plant: The plant.
        law: The law.
        model: Plant and law as data.
        reference: The reference.
        bounds: The assumptions of the proof; of a member whose neighbours keep to their references.
        box: Largest set of errors that the proof may use. Shape (n,).
        ranges: The gains, in the order of the law's schema.
        accuracy: Required bound on the error after the transient, in the unit of the first state.
        resolution: Steps in which the sensors count, 0 where they do not. Length n.
    """

    name: str
    plant: Plant
    law: ProvableLaw
    model: LoopModel
    reference: Reference
    bounds: Bounds
    box: Array
    ranges: tuple[GainRange, ...]
    accuracy: float
    resolution: tuple[float, ...]

    @property
    def control_units(self) -> list[str]:
        """The unit of each row's virtual control, or of the input."""
        plant = self.plant
        following = [[u for t, u in zip(plant.targets, plant.state_units, strict=True) if t == i]
                     for i in range(len(plant.states))]  # fmt: skip
        return [units[0] if units else plant.input_unit for units in following]

    @property
    def searched(self) -> list[int]:
        """Indices of the gains that are not fixed."""
        return [i for i, gain in enumerate(self.ranges) if not gain.fixed]

    def values(self, point: Array, *, digits: int = 4) -> Values:
        """Gains at a point of the unit cube, logarithmic in every range, as decimals of so many digits."""
        found = [gain.low for gain in self.ranges]
        for index, share in zip(self.searched, point, strict=True):
            gain = self.ranges[index]
            exact = gain.low * (gain.high / gain.low) ** float(share)
            found[index] = min(max(float(f"{exact:.{digits}g}"), gain.low), gain.high)
        return tuple(found)

    def point(self, values: Values) -> Array:
        """The point of the unit cube that stands for some gains."""
        shares = []
        for index in self.searched:
            gain = self.ranges[index]
            shares.append(math.log(values[index] / gain.low) / math.log(gain.high / gain.low))
        return np.clip(np.array(shares), 0.0, 1.0)

    def shortened(self, values: Values, digits: int) -> Values:
        """The gains as shorter decimals inside their ranges; those that the study fixes stay."""
        found = list(values)
        for i in self.searched:
            found[i] = rounded(found[i], digits, self.ranges[i].low, self.ranges[i].high)
        return tuple(found)

    def gains(self, values: Sequence[float]) -> tuple[Gains, ...]:
        """Gains as the prover takes them."""
        return self.law.rows_of(values)

    def subsystem(self, values: Sequence[float]) -> Subsystem:
        """The loop with given gains, as the prover takes it."""
        return Subsystem(model=self.model, gains=self.gains(values), limit=self.box, first=self.plant.first)

    def under(self, bounds: Bounds) -> Member:
        """The same member under other assumptions."""
        return replace(self, bounds=bounds)
