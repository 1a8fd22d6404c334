"""What the members of a machine do to each other: loads along a motion, and how far they are from the foreseen ones.

The load on member i is ``w_i = F_i(x, v, a, d) - m_i a_i``: what the machine asks of it, less the inertia m_i that its
own model carries. Along a motion r(t), with |x - r| <= X, |v - r'| <= V, |a - r''| <= A and every disturbance within D
of the middle of its range, constant or of any course, the mean value theorem gives

    |w_i - w_i(r)| <= sup|∂F_i/∂x| X + sup|∂F_i/∂v| V + sup|∂F_i/∂a - m_i e_i| A + sup|∂F_i/∂d| D

A member whose first state is a speed has no x: F does not read one of it.

on every slice of time. The acceleration a is itself decided by the loads: where every actuator meets
``|a_i - a_i'| <= s_i |w_i - w_i'|``, the loads are the only solution of their equations, and inside these bounds, if
the matrix of ``sup|∂F_i/∂a_j - m_i e_i| s_j`` has a spectral radius below 1: a contraction that maps the bounds into
themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..enclosures.arrays import enclose_many, tangents_many
from ..enclosures.expression import Expression
from ..enclosures.interval import Interval

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Slices:
    """Ranges of a motion of n members over slices of time that cover it.

    Attributes:
        low: Lower ends of position, speed, acceleration and jerk. Shape (4, n, slices).
        high: Upper ends.
    """

    low: Array
    high: Array

    def merged(self, other: Slices) -> Slices:
        """The slices of both."""
        return Slices(
            low=np.concatenate([self.low, other.low], axis=2), high=np.concatenate([self.high, other.high], axis=2)
        )


@dataclass(frozen=True, kw_only=True)
class Tube:
    """How far a member may be from its reference, for all t.

    Attributes:
        position: Bound on |x - r|.
        speed: Bound on |v - r'|.
        acceleration: Bound on |a - r''|.
    """

    position: float
    speed: float
    acceleration: float

    def scaled(self, factor: float) -> Tube:
        """The tube times a factor."""
        return Tube(position=factor * self.position, speed=factor * self.speed, acceleration=factor * self.acceleration)

    def holds(self, other: Tube) -> bool:
        """Whether another tube is inside."""
        return other.position <= self.position and other.speed <= self.speed and other.acceleration <= self.acceleration


@dataclass(frozen=True, kw_only=True)
class Loads:
    """The loads of a machine as data.

    Attributes:
        expression: F_1 … F_n; inputs x0 …, v0 …, a0 … of the n members, and the disturbances by name.
        own: m_i. Shape (n,).
        disturbances: Range of each disturbance.
        first: Whether the first state of each member is a position or a speed.
    """

    expression: Expression
    own: tuple[float, ...]
    disturbances: Mapping[str, Interval]
    first: tuple[str, ...]

    @property
    def count(self) -> int:
        """Number of members."""
        return len(self.own)

    def signals(self) -> list[tuple[str, int, int]]:
        """Name, member and order of the reference's derivative of every x, v and a that there is."""
        found = []
        for j, first in enumerate(self.first):
            letters = "xva" if first == "position" else "va"
            found += [(f"{letter}{j}", j, order) for order, letter in enumerate(letters)]
        return found

    def feedforward(self, slices: Slices) -> list[tuple[Interval, Interval]]:
        """Range of each load along the reference at the middle of the disturbances, and of its rate."""
        ranges = self._ranges(slices, [Tube(position=0.0, speed=0.0, acceleration=0.0)] * self.count)
        size = slices.low.shape[2]
        for name, value in self.middle.items():
            ranges[name] = (np.full(size, value), np.full(size, value))
        low, high = enclose_many(self.expression, ranges)
        directions = {
            name: {"t": (slices.low[order + 1, j], slices.high[order + 1, j])} for name, j, order in self.signals()
        }
        along = tangents_many(self.expression, ranges, directions)
        found = []
        for i, own in enumerate(self.own):
            order = 2 if self.first[i] == "position" else 1
            nothing = (np.zeros(size), np.zeros(size))
            rates = along[i].get("t", nothing)  # a load that does not depend on the motion has no rate
            # slice by slice the own mass cancels; the difference of hulls would not
            own_low, own_high = own * slices.low[order, i], own * slices.high[order, i]
            load = _hull(low[i] - own_high, high[i] - own_low)
            rate = _hull(rates[0] - own * slices.high[order + 1, i], rates[1] - own * slices.low[order + 1, i])
            # after its end the reference rests
            rate = Interval(min(rate.low, 0.0), max(rate.high, 0.0))
            found.append((_widened(load), _widened(rate)))
        return found

    def deviation(self, slices: Slices, tubes: Sequence[Tube]) -> tuple[list[float], Array]:
        """Bounds on |w_i - w_i(r)| while all members keep their tubes, and on |∂F_i/∂a_j - m_i e_i|, shape (n, n)."""
        ranges = self._ranges(slices, tubes)
        one = np.ones(slices.low.shape[2])
        along = tangents_many(self.expression, ranges, {name: {name: (one, one)} for name in ranges})
        sizes, inertia = [], np.zeros((self.count,) * 2)
        for i, found in enumerate(along):
            total = np.zeros_like(one)
            for name, j, _ in self.signals():
                slope = _magnitude(found.get(name), self.own[i] if name == f"a{i}" else 0.0, one)
                total = total + slope * _radius(tubes[j], name[0])
                if name[0] == "a":
                    inertia[i, j] = slope.max()
            for name, value in self.disturbances.items():
                total = total + _magnitude(found.get(name), 0.0, one) * (value.high - value.low) / 2
            sizes.append(float(total.max()) * (1 + 1e-9))
        return sizes, inertia * (1 + 1e-9)

    @property
    def middle(self) -> dict[str, float]:
        """The disturbances that are foreseen."""
        return {name: (value.low + value.high) / 2 for name, value in self.disturbances.items()}

    def _ranges(self, slices: Slices, tubes: Sequence[Tube]) -> dict[str, tuple[Array, Array]]:
        ranges = {}
        for name, j, order in self.signals():
            radius = _radius(tubes[j], name[0])
            ranges[name] = (slices.low[order, j] - radius, slices.high[order, j] + radius)
        size = slices.low.shape[2]
        return ranges | {
            name: (np.full(size, value.low), np.full(size, value.high)) for name, value in self.disturbances.items()
        }


def _radius(tube: Tube, letter: str) -> float:
    return {"x": tube.position, "v": tube.speed, "a": tube.acceleration}[letter]


def _magnitude(slope: tuple[Array, Array] | None, shift: float, like: Array) -> Array:
    if slope is None:
        return np.full_like(like, abs(shift))
    return np.maximum(np.abs(slope[0] - shift), np.abs(slope[1] - shift)) + 0.0 * like


def _hull(low: Array, high: Array) -> Interval:
    return Interval(float(low.min()), float(high.max()))


def _widened(interval: Interval) -> Interval:
    """A billionth wider: the checker computes the ranges anew, and rounds otherwise."""
    return interval + Interval.symmetric(1e-9 * interval.magnitude)
