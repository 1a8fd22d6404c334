"""A machine as motions see it: what limits its joints and drives, where its tool is, and what its motions cost."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from trajectories import Cost, LimitViolatedError, MotionLimits, Quantities
from trajectories.limits import ORDERS
from trajectories.obstacle import Obstacle

from ..errors import InvalidInputError
from .enclosure import enclosure

Array = NDArray[np.float64]

#: Name and unit of the squared speed and acceleration of the tool: a norm has no slope at rest.
SQUARES = (("squared speed of the tool", "m^2/s^2"), ("squared acceleration of the tool", "m^2/s^4"))
#: Postures that a place of the tool is looked for from, and how close to it the tool must be, m.
STARTS, CLOSE = 24, 1e-9


@dataclass(frozen=True, kw_only=True)
class Bounded:
    """Limits of a job in place of the machine's.

    Attributes:
        speed, acceleration, jerk: Of the joints, rad or m. Each shape (n,), or None.
        drives: Of every drive by the kind of quantity, such as ("current", 50.0).
        tool: Largest speed, m/s, and acceleration, m/s², of the tool; infinite for none.
    """

    speed: tuple[float, ...] | None = None
    acceleration: tuple[float, ...] | None = None
    jerk: tuple[float, ...] | None = None
    drives: tuple[tuple[str, float], ...] = ()
    tool: tuple[float, float] = (math.inf, math.inf)

    def of(self, limits: MotionLimits) -> MotionLimits:
        """Limits of the joints with these in place of theirs."""
        own = {name: np.array(size) for name in ORDERS.values() if (size := getattr(self, name))}
        return replace(limits, **own)


@dataclass(frozen=True, kw_only=True)
class Drives:
    """What a motion asks of the drives.

    Attributes:
        function: CasADi SX function (x, x', x'', x''') -> column: all drives of the first kind, then of the next.
        kinds: Name and unit of each kind, such as ("force", "N").
        sizes: Largest size of each entry of the column. Shape (kinds * n,).
    """

    function: Any
    kinds: tuple[tuple[str, str], ...]
    sizes: tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Mover:
    """A machine as motions see it. Its joints are rad where they turn and m where they slide.

    Attributes:
        limits: Limits of the joints, with their names and units.
        pose: CasADi SX function of the joints, shape (n,) -> place of the tool, m, and its angle where there is one.
        coordinates: Names of the entries of the place, without the angle.
        turned: Whether the last entry of the pose is the angle of the tool, rad.
        drives: Payload, kg -> the drives.
        costs: Payload, kg -> CasADi function (x, x', x'', x''') -> column of running costs.
        cost_names: What they are called: of "energy" [J], "loss" [J], "effort" [s].
        assumed: What a motion rests on that has no public source.
    """

    limits: MotionLimits
    pose: Any
    coordinates: tuple[str, ...]
    turned: bool
    drives: Callable[[float], Drives]
    costs: Callable[[float], Any]
    cost_names: tuple[str, ...]
    assumed: tuple[str, ...] = ()
    _made: dict[Any, Any] = field(default_factory=dict, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.limits.names

    def place(self, joints: Any) -> Array:
        """Place of the tool at joint coordinates, m, and its angle, rad, where there is one."""
        return np.array(self.pose(joints)).ravel()

    def quantities(
        self, payload: float = 0.0, obstacles: tuple[Obstacle, ...] = (), bounds: Bounded | None = None, *,
        jerk: bool = True,
    ) -> Quantities:  # fmt: skip
        """What is limited beside the joints: drives, the tool's clearance from obstacles, its speed and acceleration.

        Args:
            payload: Mass at the tool, kg, beside the end mass.
            obstacles: What the tool keeps clear of.
            bounds: Limits in place of the machine's, and those of the tool.
            jerk: Whether kinds that depend on the jerk are kept.
        """
        key = (float(payload), tuple(obstacles), bounds or Bounded(), jerk)
        if key not in self._made:
            self._made[key] = self._quantities(*key)
        return self._made[key]

    def _quantities(self, payload: float, obstacles: tuple[Obstacle, ...], bounds: Bounded, jerk: bool) -> Quantities:
        count = len(self.names)
        curves = [ca.SX.sym(name, count) for name in "wvaj"]
        drives = self.drives(payload)
        column = drives.function(*curves)
        own, kinds, sizes = dict(bounds.drives), [k for k, _ in drives.kinds], np.array(drives.sizes)
        for k, kind in enumerate(kinds):
            sizes[k * count : (k + 1) * count] = own.get(kind, sizes[k * count : (k + 1) * count])
        kept = [
            i for i in range(column.numel())
            if np.isfinite(sizes[i]) and (jerk or not ca.depends_on(column[i], curves[3]))
        ]  # fmt: skip
        place = self.pose(curves[0])[: len(self.coordinates)]
        clear = [obstacle.clearance(ca.vertsplit(place)) for obstacle in obstacles]
        fast = [k for k, size in enumerate(bounds.tool) if math.isfinite(size)]
        rates = [tool_rates(place, *curves[:3])[k] for k in fast]
        function = ca.Function("limited", curves, [ca.densify(ca.vertcat(column[kept], *clear, *rates))])
        return Quantities(
            function=function,
            names=(
                *(f"{self.names[i % count]} {kinds[i // count]}" for i in kept),
                *(f"clearance of {obstacle.name}" for obstacle in obstacles), *(SQUARES[k][0] for k in fast),
            ),
            units=(
                *(drives.kinds[i // count][1] or _effort(self.limits.units[i % count]) for i in kept),
                *("m" for _ in obstacles), *(SQUARES[k][1] for k in fast),
            ),
            lower=np.concatenate([-sizes[kept], np.zeros(len(obstacles)), np.full(len(fast), -np.inf)]),
            upper=np.concatenate([sizes[kept], np.full(len(obstacles), np.inf), [bounds.tool[k] ** 2 for k in fast]]),
            enclose=enclosure(function),
        )  # fmt: skip

    def cost(self, *, time: float = 1.0, jerk: float = 0.0, payload: float = 0.0, **weights: float) -> Cost:
        """A weighted sum of duration, squared jerk, and running costs: "energy" [1/J], "loss" [1/J], "effort" [1/s].

        Raises:
            InvalidInputError: an unknown cost.
        """
        unknown = sorted(name for name, weight in weights.items() if weight and name not in self.cost_names)
        if unknown:
            known = ", ".join(("time", "jerk", *self.cost_names))
            raise InvalidInputError(f"costs are {known}: got {', '.join(unknown)}; use those")
        return Cost(
            time=time, jerk=jerk, running=self.costs(payload), names=self.cost_names,
            weights=tuple(weights.get(name, 0.0) for name in self.cost_names),
        )  # fmt: skip

    def posture(self, value: Sequence[float], at: Array, limits: MotionLimits) -> Array:
        """Joint coordinates with the tool at a place, the nearest to given ones that were found.

        Args:
            value: Place of the tool, m, and its angle, rad; NaN where an entry is free.
            at: Joint coordinates to be near to. Shape (n,).
            limits: Ranges of the joints.

        Raises:
            LimitViolatedError: no posture was found. Not guaranteed: that there is none.
        """
        low, high = limits.room
        wide = [np.where(np.isfinite(end), end, at + side) for end, side in ((low, -math.pi), (high, math.pi))]
        random = np.random.default_rng(0)
        first = self._reached(value, np.clip(at, *wide), *wide)
        if first is not None:
            return first
        starts = [wide[0] + (wide[1] - wide[0]) * random.uniform(0.02, 0.98, len(at)) for _ in range(STARTS)]
        found = [w for w in (self._reached(value, start, *wide) for start in starts) if w is not None]
        if not found:
            raise LimitViolatedError(
                f"no posture with the tool at {self.said(value)} was found; move the place, or give joints"
            )
        return min(found, key=lambda w: float(np.abs(w - at).max()))

    def _reached(self, value: Sequence[float], start: Array, low: Array, high: Array) -> Array | None:
        from scipy.optimize import least_squares

        wanted = np.asarray(value, dtype=float)
        asked = np.flatnonzero(np.isfinite(wanted))
        evaluate = _pose_and_slope(self.pose)

        def off(w: Array) -> Array:
            return np.array(evaluate(w)[0]).ravel()[asked] - wanted[asked]

        def slope(w: Array) -> Array:
            return np.array(evaluate(w)[1])[asked]

        inside = np.clip(start, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
        found = least_squares(off, inside, slope, bounds=(low, high), xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=60)  # pyright: ignore[reportArgumentType]
        return found.x if np.abs(found.fun).max() < CLOSE else None

    def said(self, value: Sequence[float] | Array) -> str:
        """A place of the tool in words."""
        count = len(self.coordinates)
        text = f"({', '.join(f'{x:g}' for x in value[:count])}) m"
        angle = value[count] if len(value) > count else math.nan
        return text if math.isnan(angle) else f"{text} at {angle:g} rad"


def _effort(unit: str) -> str:
    """Unit of what turns or pushes a joint."""
    return "N m" if unit == "rad" else "N"


@lru_cache(maxsize=8)
def _pose_and_slope(pose: Any) -> Any:
    w = ca.SX.sym("w", pose.numel_in(0))
    value = pose(w)
    return ca.Function("pose", [w], [value, ca.jacobian(value, w)])


def tool_rates(place: Any, w: Any, v: Any, a: Any) -> list[Any]:
    """Squared speed, m²/s², and squared acceleration, m²/s⁴, of a place that depends on w."""
    speed = ca.jtimes(place, w, v)
    gain = ca.jtimes(speed, w, v) + ca.jtimes(speed, v, a)
    return [ca.sumsqr(speed), ca.sumsqr(gain)]
