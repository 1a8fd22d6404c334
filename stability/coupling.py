"""What the joints of a machine do to each other: loads along a motion, and how far they are from the foreseen ones.

The load on actuator i is ``w_i = F_i(x, v, a, p) - m_i a_i``: what the multi-body machine asks of it, less the mass m_i
that its own model carries. Along a motion r(t), with |x - r| <= X, |v - r'| <= V, |a - r''| <= A and a payload within P
of its nominal value, the mean value theorem gives

    |w_i - w_i(r)| <= sup|∂F_i/∂x| X + sup|∂F_i/∂v| V + sup|∂F_i/∂a - m_i e_i| A + sup|∂F_i/∂p| P

on every slice of time. The acceleration a is itself decided by the loads: where every actuator meets
``|a_i - a_i'| <= s_i |w_i - w_i'|``, the loads are the only solution of their equations, and inside these bounds, if
the matrix of ``sup|∂F_i/∂a_j - m_i e_i| s_j`` has a spectral radius below 1: a contraction that maps the bounds into
themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arrays import enclose_many, tangents_many
from .expression import Expression
from .interval import Interval

Array = NDArray[np.float64]

PAYLOAD = "payload"


@dataclass(frozen=True, kw_only=True)
class Slices:
    """Ranges of a motion of n joints over slices of time that cover it.

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
    """How far a joint may be from its reference, for all t.

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
        expression: F_1 … F_n; inputs x0 …, v0 …, a0 … of the n joints and "payload".
        own: m_i. Shape (n,).
        payload: Range of the payload, kg.
    """

    expression: Expression
    own: tuple[float, ...]
    payload: Interval

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.own)

    def foreseen(self, slices: Slices) -> list[tuple[Interval, Interval]]:
        """Range of each load along the reference at the middle payload, and of its rate."""
        ranges = self._ranges(slices, [Tube(position=0.0, speed=0.0, acceleration=0.0)] * self.count)
        middle = np.full_like(ranges[PAYLOAD][0], self.middle)
        ranges[PAYLOAD] = (middle, middle)
        low, high = enclose_many(self.expression, ranges)
        directions = {
            f"{letter}{j}": {"t": (slices.low[order, j], slices.high[order, j])}
            for order, letter in enumerate("xva", 1)
            for j in range(self.count)
        }
        along = tangents_many(self.expression, ranges, directions)
        found = []
        for i, own in enumerate(self.own):
            load = Interval(float(low[i].min()), float(high[i].max()))
            rates = along[i]["t"]
            rate = Interval(float(rates[0].min()), float(rates[1].max()))
            if own:
                # slice by slice the own mass cancels; the difference of hulls would not
                own_low, own_high = own * slices.low[2, i], own * slices.high[2, i]
                load = _hull(low[i] - own_high, high[i] - own_low)
                rate = _hull(rates[0] - own * slices.high[3, i], rates[1] - own * slices.low[3, i])
            # after its end the reference rests
            rate = Interval(min(rate.low, 0.0), max(rate.high, 0.0))
            found.append((_widened(load), _widened(rate)))
        return found

    def surprise(self, slices: Slices, tubes: Sequence[Tube]) -> tuple[list[float], Array]:
        """Bounds on |w_i - w_i(r)| while all joints keep their tubes, and on |∂F_i/∂a_j - m_i e_i|, shape (n, n)."""
        ranges = self._ranges(slices, tubes)
        unit = np.ones_like(ranges[PAYLOAD][0])
        one = unit, unit
        directions = {name: {name: one} for name in (*(f"{x}{j}" for x in "xva" for j in range(self.count)), PAYLOAD)}
        along = tangents_many(self.expression, ranges, directions)
        sizes, inertia = [], np.zeros((self.count,) * 2)
        for i, found in enumerate(along):
            total = np.zeros_like(one[0])
            for j, tube in enumerate(tubes):
                radii = {"x": tube.position, "v": tube.speed, "a": tube.acceleration}
                for letter, radius in radii.items():
                    shift = self.own[i] if letter == "a" and i == j else 0.0
                    slope = _magnitude(found.get(f"{letter}{j}"), shift, unit)
                    total = total + slope * radius
                    if letter == "a":
                        inertia[i, j] = slope.max()
            total = total + _magnitude(found.get(PAYLOAD), 0.0, one[0]) * (self.payload.high - self.payload.low) / 2
            sizes.append(float(total.max()) * (1 + 1e-9))
        return sizes, inertia * (1 + 1e-9)

    @property
    def middle(self) -> float:
        """The payload that is foreseen, kg."""
        return (self.payload.low + self.payload.high) / 2

    def _ranges(self, slices: Slices, tubes: Sequence[Tube]) -> dict[str, tuple[Array, Array]]:
        ranges = {}
        for j, tube in enumerate(tubes):
            for order, (letter, radius) in enumerate(
                (("x", tube.position), ("v", tube.speed), ("a", tube.acceleration))
            ):
                ranges[f"{letter}{j}"] = (slices.low[order, j] - radius, slices.high[order, j] + radius)
        size = slices.low.shape[2]
        ranges[PAYLOAD] = (np.full(size, self.payload.low), np.full(size, self.payload.high))
        return ranges


def _magnitude(slope: tuple[Array, Array] | None, shift: float, like: Array) -> Array:
    if slope is None:
        return np.full_like(like, abs(shift))
    return np.maximum(np.abs(slope[0] - shift), np.abs(slope[1] - shift)) + 0.0 * like


def _hull(low: Array, high: Array) -> Interval:
    return Interval(float(low.min()), float(high.max()))


def _widened(interval: Interval) -> Interval:
    """A billionth wider: the checker computes the ranges anew, and rounds otherwise."""
    return interval + Interval.symmetric(1e-9 * interval.magnitude)
