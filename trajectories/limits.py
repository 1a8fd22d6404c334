"""Limits of a motion and of its derivatives: what holds on control points holds for all t."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .spline import Spline

Array = NDArray[np.float64]

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

    def of(self, order: int) -> Array:
        """The largest size of a derivative, for each coordinate. Shape (n,)."""
        return np.broadcast_to(np.asarray(getattr(self, ORDERS[order]), dtype=float), len(self.names))

    @property
    def room(self) -> tuple[Array, Array]:
        """Lowest and highest position of each coordinate. Each shape (n,)."""
        low, high = (np.broadcast_to(np.asarray(end, dtype=float), len(self.names)) for end in self.position)
        return low, high

    def title(self, order: int, index: int) -> str:
        """What a limit is called, such as "lift speed"."""
        return f"{self.names[index]} {ORDERS[order]}".strip()

    def unit(self, order: int, index: int) -> str:
        """The unit of a derivative, such as "rad/s^2"."""
        return f"{self.units[index]}/s" + (f"^{order}" if order > 1 else "")


def violations(spline: Spline, limits: MotionLimits) -> list[str]:
    """Motion limits that the control points do not respect, as text; empty where all hold for all t."""
    found = []
    low, high = _ends(spline, 0)
    for k, (least, most) in enumerate(zip(*limits.room, strict=True)):
        if not (low[k] >= least and high[k] <= most):
            name = f"{limits.names[k]} position".strip()
            unit = limits.units[k]
            found.append(f"{name} {low[k]:.4g}…{high[k]:.4g} {unit} leaves the stroke {least:g}…{most:g} {unit}")
    for order in ORDERS:
        low, high = _ends(spline, order)
        for k, limit in enumerate(limits.of(order)):
            size, unit = max(abs(low[k]), abs(high[k])), limits.unit(order, k)
            if not size <= limit * (1 + 1e-9):
                found.append(f"{limits.title(order, k)} {size:.4g} {unit} is over the limit {limit:g} {unit}")
    return found


def _ends(spline: Spline, order: int) -> tuple[Any, Any]:
    low, high = spline.bounds(order)
    return np.atleast_1d(low), np.atleast_1d(high)
