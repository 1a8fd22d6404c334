"""One axis: a plant under a law along a reference, with what its proof assumes; no simulation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stability import Bounds, Gains, Interval, LoopModel
from trajectories import Reference

from .control import RAC
from .plants import Parameter, Plant

Array = NDArray[np.float64]

KINDS = ("beta", "epsilon", "delta", "sigma")


@dataclass(frozen=True, kw_only=True)
class GainRange:
    """A gain of the study: fixed, or between two values.

    Attributes:
        name: Name in the study, for example "beta_1".
        low: Smallest value.
        high: Largest value; equal to `low` for a fixed gain.
        unit: SI unit.
    """

    name: str
    low: float
    high: float
    unit: str

    @property
    def fixed(self) -> bool:
        """True where nothing is searched."""
        return self.low == self.high


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What a proof works on.

    Attributes:
        plant: The plant.
        law: The law.
        model: Plant and law as data.
        reference: The reference.
        bounds: The assumptions of the proof.
        box: Largest set of errors that the proof may use. Shape (n,).
        ranges: The gains, four for each governed row.
    """

    plant: Plant
    law: RAC
    model: LoopModel
    reference: Reference
    bounds: Bounds
    box: Array
    ranges: tuple[GainRange, ...]

    @property
    def searched(self) -> list[int]:
        """Indices of the gains that are not fixed."""
        return [i for i, gain in enumerate(self.ranges) if not gain.fixed]

    def gains(self, point: Array, *, digits: int = 4) -> tuple[Gains, ...]:
        """Gains at a point of the unit cube, logarithmic in every range, as decimals of so many digits."""
        values = [gain.low for gain in self.ranges]
        for index, share in zip(self.searched, point, strict=True):
            gain = self.ranges[index]
            exact = gain.low * (gain.high / gain.low) ** float(share)
            values[index] = min(max(float(f"{exact:.{digits}g}"), gain.low), gain.high)
        return tuple(Gains(**dict(zip(KINDS, values[k : k + 4], strict=True))) for k in range(0, len(values), 4))

    def point(self, gains: tuple[Gains, ...]) -> Array:
        """The point of the unit cube that stands for some gains."""
        values = [getattr(g, kind) for g in gains for kind in KINDS]
        shares = []
        for index in self.searched:
            gain = self.ranges[index]
            shares.append(math.log(values[index] / gain.low) / math.log(gain.high / gain.low))
        return np.clip(np.array(shares), 0.0, 1.0)


def parameter_range(parameter: Parameter) -> Interval:
    """The assumed range of a parameter, rounded outwards; a point where the tolerance is zero."""
    if parameter.tolerance == 0:
        return Interval(parameter.value)
    spread = abs(parameter.value) * parameter.tolerance
    return Interval(parameter.value) + Interval.symmetric(spread * (1 + 1e-15))


def reference_ranges(reference: Reference) -> tuple[Interval, Interval, Interval, Interval]:
    """Position … jerk, widened by a billionth: the checker recomputes them in exact arithmetic."""
    ranges = []
    for low, high in reference.bounds():
        room = 1e-9 * max(abs(low), abs(high))
        ranges.append(Interval(low - room, high + room))
    return (ranges[0], ranges[1], ranges[2], ranges[3])
