"""Limits of a motion and of its derivatives: what holds on control points holds for all t."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .bezier import pieces
from .spline import Spline

Array = NDArray[np.float64]

#: A limit counts as kept up to this share, for rounding; a position up to a larger one, for the solver's tolerance
#: where phases meet.
ROOM, POSITION_ROOM = 1e-9, 1e-7
#: Derivatives that have limits, by order.
ORDERS = {1: "speed", 2: "acceleration", 3: "jerk"}


class LimitViolatedError(Exception):
    """A reference breaks a limit; the message says which, where, by how much, and what would do."""


@dataclass(frozen=True, kw_only=True)
class MotionLimits:
    """Limits of n coordinates. A number stands for all of them.

    Attributes:
        position: Lowest and highest positions, [m] or [rad]. Each a number or shape (n,).
        speed: Largest |x'|, [m/s] or [rad/s]. A number or shape (n,); infinite for none.
        acceleration: Largest |x''|.
        jerk: Largest |x'''|.
        names: Names of the coordinates, for messages.
        units: Their units.
    """

    position: tuple[ArrayLike, ArrayLike]
    speed: ArrayLike = np.inf
    acceleration: ArrayLike = np.inf
    jerk: ArrayLike = np.inf
    names: tuple[str, ...] = ("",)
    units: tuple[str, ...] = ("m",)

    def __post_init__(self) -> None:
        for order, name in ORDERS.items():
            if not (self.of(order) > 0).all():
                raise ValueError(f"a limit of {name} is positive: got {getattr(self, name)}; infinite means none")

    def of(self, order: int) -> Array:
        """The largest size of a derivative, for each coordinate. Shape (n,)."""
        return np.broadcast_to(np.asarray(getattr(self, ORDERS[order]), dtype=float), len(self.names))

    @property
    def room(self) -> tuple[Array, Array]:
        """Lowest and highest position of each coordinate. Each shape (n,)."""
        low, high = (np.broadcast_to(np.asarray(end, dtype=float), len(self.names)) for end in self.position)
        return low, high

    def holds(self, place: Array) -> bool:
        """Whether a place, shape (n,), is inside the ranges of the coordinates."""
        low, high = self.room
        return bool((place >= low).all() and (place <= high).all())

    def title(self, order: int, index: int) -> str:
        """What a limit is called, such as "lift speed"."""
        return f"{self.names[index]} {ORDERS[order]}".strip()

    def unit(self, order: int, index: int) -> str:
        """The unit of a derivative, such as "rad/s^2"."""
        return f"{self.units[index]}/s" + (f"^{order}" if order > 1 else "")


def violations(spline: Spline, limits: MotionLimits) -> list[str]:
    """Motion limits that the hulls of the spline's pieces do not respect, as text; empty where all hold for all t."""
    found = []
    lows, highs = _hulls(spline)
    for k, (least, most) in enumerate(zip(*limits.room, strict=True)):
        low, high, room = lows[0, k], highs[0, k], POSITION_ROOM * max(1.0, float(np.abs([least, most]).max()))
        if not (low >= least - room and high <= most + room):
            name = f"{limits.names[k]} position".strip()
            unit = limits.units[k]
            found.append(f"{name} {low:.4g}…{high:.4g} {unit} leaves the stroke {least:g}…{most:g} {unit}")
    for order in ORDERS:
        for k, limit in enumerate(limits.of(order)):
            size, unit = max(abs(lows[order, k]), abs(highs[order, k])), limits.unit(order, k)
            if not size <= limit * (1 + ROOM):
                found.append(f"{limits.title(order, k)} {size:.4g} {unit} is over the limit {limit:g} {unit}")
    return found


def _hulls(spline: Spline) -> tuple[Array, Array]:
    """Bounds of position … jerk for all t, by the Bezier points of every piece. Each shape (4, n)."""
    low, high = pieces(spline).ranges()
    return low.min(axis=2), high.max(axis=2)
