"""Quantities that a motion asks for, such as torques and distances, and their bounds for all t."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .bezier import Pieces, pieces
from .spline import Spline

Array = NDArray[np.float64]

#: Lower and upper bounds of every quantity on every piece of a motion, each shape (q, pieces): rigorous if the
#: arithmetic behind it is; infinite where it cannot tell.
Enclosure = Callable[[Pieces], tuple[Array, Array]]

#: How often pieces may be cut while a quantity is not yet shown to be inside its limits, and halvings in each cut.
CUTS, HALVINGS = 4, 3
#: A bound is sharpened until it takes no more than this share of the room that samples show.
SHARPNESS = 0.1


@dataclass(frozen=True, kw_only=True)
class Quantities:
    """Functions of position, speed, acceleration and jerk that have limits.

    Attributes:
        function: CasADi function of four columns of shape (n,) -> column of shape (q,).
        names: What each quantity is called.
        units: Their units.
        lower: Least admissible values; -inf for none. Shape (q,).
        upper: Largest admissible values; inf for none. Shape (q,).
        enclose: Bounds on a piece of a motion.
    """

    function: Any
    names: tuple[str, ...]
    units: tuple[str, ...]
    lower: Array
    upper: Array
    enclose: Enclosure

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            ends = np.array(getattr(self, name), dtype=float)
            ends.setflags(write=False)
            object.__setattr__(self, name, ends)
        count = len(self.names)
        if not (self.lower.shape == self.upper.shape == (count,) and len(self.units) == count):
            raise ValueError(
                f"quantities need a unit and two limits each: got {count} names, {self.lower.shape} limits"
            )
        if not (self.lower < self.upper).all():
            name = self.names[int(np.argmin(self.lower < self.upper))]
            raise ValueError(f"a quantity needs a lower limit below its upper one: got others for {name}; widen them")

    @property
    def needs_jerk(self) -> bool:
        """Whether a quantity depends on jerk."""
        return bool(self.function.jac_sparsity(0, 3).nnz())

    @property
    def scale(self) -> Array:
        """Size of each quantity, from its limits. Shape (q,)."""
        return sizes(self.lower, self.upper)

    def values(self, spline: Spline, times: Array) -> Array:
        """The quantities at given times. Shape (q, len(times))."""
        return np.array(self.function.map(len(times))(*(curve.T for curve in spline.curves(times))))


def sizes(lower: Array, upper: Array) -> Array:
    """The larger of the finite limits in size; 1 where they are 0 or infinite. Shape (q,)."""
    ends = np.abs(np.stack([lower, upper]))
    size = np.where(np.isfinite(ends), ends, 0.0).max(axis=0)
    return np.where(size > 0, size, 1.0)


@dataclass(frozen=True, kw_only=True)
class Peaks:
    """Bounds of quantities over a motion.

    Attributes:
        lower: Lower bounds for all t. Shape (q,).
        upper: Upper bounds for all t. Shape (q,).
        under: How far the lower bounds lie below the limits, 0 where inside, on each span. Shape (q, spans).
        over: How far the upper bounds lie above the limits.
    """

    lower: Array
    upper: Array
    under: Array
    over: Array

    @property
    def excess(self) -> Array:
        """The larger of `under` and `over`. Shape (q, spans)."""
        return np.maximum(self.under, self.over)

    @property
    def inside(self) -> bool:
        """True where every limit holds for all t."""
        return not self.excess.any()


def peaks(spline: Spline, quantities: Quantities) -> Peaks:
    """Bounds of the quantities for all t: pieces are cut until the limits are shown, `CUTS` times at the most.

    Args:
        spline: The motion.
        quantities: What to bound, and the limits.

    Returns:
        The bounds; outside a limit only where cutting could not bring them inside.

    Raises:
        ValueError: a quantity depends on jerk, and the spline has none: its acceleration jumps.
    """
    if spline.degree < 3 and quantities.needs_jerk:
        raise ValueError(
            f"a quantity that depends on jerk needs a spline of degree 3 or more: got degree {spline.degree}; "
            "limit the jerk, or leave such quantities out"
        )
    work = pieces(spline)
    span, spans = np.arange(len(work.start)), len(work.start)
    least, most = _targets(spline, work, quantities)
    low, high = np.full((len(quantities.names), spans), np.inf), np.full((len(quantities.names), spans), -np.inf)
    for cuts in range(CUTS + 1):
        under, over = quantities.enclose(work)
        below = (under < least[:, None]) & (over >= quantities.lower[:, None])  # and not outside all the way
        above = (over > most[:, None]) & (under <= quantities.upper[:, None])
        coarse = (below | above).any(axis=0) & (cuts < CUTS)
        for rows, bound, keep in ((low, under, np.minimum), (high, over, np.maximum)):
            keep.at(rows.T, span[~coarse], bound[:, ~coarse].T)
        if not coarse.any():
            break
        work, span = work.chosen(coarse), span[coarse]
        for _ in range(HALVINGS):
            work, span = work.halved(), np.tile(span, 2)
    below, above = quantities.lower[:, None], quantities.upper[:, None]
    with np.errstate(invalid="ignore"):  # a limit that there is not, and a bound that could not be told
        under = np.where(np.isfinite(below), np.maximum(below - low, 0.0), 0.0)
        over = np.where(np.isfinite(above), np.maximum(high - above, 0.0), 0.0)
    return Peaks(lower=low.min(axis=1), upper=high.max(axis=1), under=under, over=over)


def _targets(spline: Spline, work: Pieces, quantities: Quantities) -> tuple[Array, Array]:
    """Bounds at which halving ends: a little beyond what samples take, and the limits where there is little room."""
    times = (work.start[:, None] + work.width[:, None] * np.linspace(0.0, 1.0, 5)).ravel()
    values = quantities.values(spline, times)
    slack = 0.01 * quantities.scale
    least, most = values.min(axis=1), values.max(axis=1)
    room_below = np.where(np.isfinite(quantities.lower), least - quantities.lower, np.inf)
    room_above = np.where(np.isfinite(quantities.upper), quantities.upper - most, np.inf)
    sharp_below = least - np.minimum(SHARPNESS * room_below, np.maximum(SHARPNESS * np.abs(least), slack))
    sharp_above = most + np.minimum(SHARPNESS * room_above, np.maximum(SHARPNESS * np.abs(most), slack))
    return (
        np.where(room_below < slack, quantities.lower, sharp_below),
        np.where(room_above < slack, quantities.upper, sharp_above),
    )
