"""What a motion is to do: where it goes, what limits it, and what it costs."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .limits import MotionLimits
from .quantity import Quantities
from .spline import DEGREE

Array = NDArray[np.float64]

#: Share of a tolerance that is left to that of the solver.
SOLVED = 1e-5


@dataclass(frozen=True, kw_only=True)
class Waypoint:
    """A place that the motion passes.

    Attributes:
        value: What the coordinates, or what `through` makes of them, must be there. NaN leaves an entry free.
            Shape (n,), or that of the output of `through`.
        through: CasADi function of the coordinates, shape (n,), such as the place of a tool; None for the coordinates
            themselves.
        near: Coordinates from which the search starts where `value` does not give them all. Shape (n,).
        tolerance: How far the motion may be from each entry of `value`; None for not at all. The shape of `value`.
        speed: Speed of the coordinates there, of the first or the last waypoint; None for rest. Shape (n,).
        acceleration: Their acceleration, where `speed` is given; None for none. Shape (n,).
    """

    value: Array
    through: Any = None
    near: Array | None = None
    tolerance: Array | None = None
    speed: Array | None = None
    acceleration: Array | None = None

    def __post_init__(self) -> None:
        if self.acceleration is not None and self.speed is None:
            raise ValueError("an acceleration stands beside a speed: got it alone; give the speed too")
        if self.tolerance is not None and not (np.asarray(self.tolerance) >= 0).all():
            raise ValueError(
                f"a tolerance is not negative: got {np.asarray(self.tolerance).tolist()}; give none or more"
            )
        if self.through is not None and self.near is None:
            raise ValueError(
                "a place that a function gives needs coordinates near it to start from: got none; give near"
            )

    @property
    def guess(self) -> Array:
        """Coordinates to start from. Shape (n,)."""
        value = np.asarray(self.value, dtype=float)
        if self.through is None and self.near is not None:
            return np.where(np.isnan(value), self.near, value)
        return np.asarray(self.near if self.near is not None else value, dtype=float)

    @property
    def moving(self) -> bool:
        """Whether the motion does not rest there."""
        return self.speed is not None

    @property
    def asked(self) -> NDArray[np.int64]:
        """Indices of the entries of `value` that are given."""
        return np.flatnonzero(np.isfinite(np.asarray(self.value, dtype=float))).astype(np.int64)

    @property
    def ends(self) -> tuple[Array, Array]:
        """Least and largest admissible entries of `value`; NaN where they are free."""
        value = np.asarray(self.value, dtype=float)
        room = 0.0 if self.tolerance is None else (1 - SOLVED) * np.asarray(self.tolerance, dtype=float)
        return value - room, value + room

    @property
    def known(self) -> Array:
        """The coordinates that are given exactly, NaN elsewhere. Shape (n,)."""
        if self.through is not None:
            return np.full(len(self.guess), np.nan)
        low, high = self.ends
        return np.where(low == high, low, np.nan)

    def rate(self, order: int, count: int) -> Array:
        """Speed (order 1) or acceleration (order 2) there. Shape (count,)."""
        given = (self.speed, self.acceleration)[order - 1]
        return np.zeros(count) if given is None else np.asarray(given, dtype=float)


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A weighted sum of duration and integrals.

    Attributes:
        time: Weight of the duration, 1/s.
        jerk: Weight of the integral of the sum of squared jerks.
        running: CasADi function (x, x', x'', x''') -> column of running costs; None for none.
        names: Names of the running costs, such as "energy".
        weights: Their weights.
    """

    time: float = 1.0
    jerk: float = 0.0
    running: Any = None
    names: tuple[str, ...] = ()
    weights: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        count = 0 if self.running is None else self.running.numel_out(0)
        if not len(self.names) == len(self.weights) == count:
            raise ValueError(
                f"every running cost needs a name and a weight: got {count} costs, {len(self.names)} names and "
                f"{len(self.weights)} weights"
            )

    def value(self, parts: dict[str, float]) -> float:
        """The weighted sum of a duration, a squared jerk and running costs."""
        known = {"time": self.time, "jerk": self.jerk, **dict(zip(self.names, self.weights, strict=True))}
        return sum(known[name] * part for name, part in parts.items())


@dataclass(frozen=True, kw_only=True)
class Task:
    """A motion through waypoints.

    Attributes:
        waypoints: At least two; the motion rests at the first and the last, unless they give a speed.
        limits: Limits of the coordinates and their derivatives.
        quantities: What else is limited; None for nothing.
        cost: What is minimised.
        duration: Total duration, s; None to choose it.
        longest: Longest admissible duration, s.
        spans: Spans of the spline between two waypoints.
        degree: Degree of the spline, 3 or more.
        rest: 3 where position, speed and acceleration match rest at the ends, 2 for position and speed alone.
    """

    waypoints: tuple[Waypoint, ...]
    limits: MotionLimits
    quantities: Quantities | None = None
    cost: Cost = Cost()
    duration: float | None = None
    longest: float = 60.0
    spans: int = 24
    degree: int = DEGREE
    rest: int = 3

    def __post_init__(self) -> None:
        count = len(self.limits.names)
        for rule, right, got in (
            ("a motion needs two waypoints or more", len(self.waypoints) >= 2, len(self.waypoints)),
            ("a spline needs degree 3 or more", self.degree >= 3, self.degree),
            ("a motion needs two spans or more, and control points for its rest at both ends",
             self.spans >= 2 and self.spans + self.degree >= 2 * self.rest, self.spans),
            ("a motion goes from one place to another, and not to the same one",
             all(not np.array_equal(a.guess, b.guess) for a, b in pairwise(self.waypoints)),
             [w.guess.tolist() for w in self.waypoints]),
            ("rest is 2 or 3", self.rest in (2, 3), self.rest),
            ("a motion takes a positive, finite time", 0 < self.longest < np.inf, self.longest),
            ("a given duration is positive and finite", self.duration is None or 0 < self.duration < np.inf,
             self.duration),
            (f"waypoints need {count} coordinates, or a place to start the search from",
             all(w.guess.shape == (count,) and np.isfinite(w.guess).all() for w in self.waypoints),
             [w.guess.tolist() for w in self.waypoints]),
            ("a speed is that of the first or the last waypoint, and has an entry for each coordinate",
             all(w.rate(order, count).shape == (count,) for w in self.waypoints for order in (1, 2))
             and not any(w.moving for w in self.waypoints[1:-1]),
             [None if w.speed is None else np.asarray(w.speed).tolist() for w in self.waypoints]),
        ):  # fmt: skip
            if not right:
                raise ValueError(f"{rule}: got {got}")

    @property
    def phases(self) -> int:
        """Number of moves between waypoints."""
        return len(self.waypoints) - 1


@dataclass(frozen=True, kw_only=True)
class Limit:
    """A limit that a relaxation may widen.

    Attributes:
        name: What is limited, such as "lift speed".
        unit: Its unit.
        value: The limit.
        scale: What a relaxation of 1 adds to it.
        side: +1 for an upper limit, -1 for a lower one, 0 for a limit of the size.
        order: Order of the derivative that is limited; 0 for a quantity.
        index: Which coordinate, or which quantity.
    """

    name: str
    unit: str
    value: float
    scale: float
    side: int
    order: int
    index: int
