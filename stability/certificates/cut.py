"""How the ranges of inertias and of other constants are cut into cells.

Inertias are cut where they enter, as ranges of M_i; whatever else is constant is cut as the parameter that it is. Each
cell is a loop of its own, so that what one cell leaves uncertain is a part of the whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from ..enclosures.interval import Interval
from ..loops.box import DeviationRows
from ..loops.model import Bounds, LoopModel
from ..loops.responses import Responses
from ..loops.rows import VARYING

Array = NDArray[np.float64]

#: Half of a part's width, as a share of its middle, that is wide for a refined certificate.
WIDE = 0.06


@dataclass(frozen=True)
class Cut:
    """How the ranges of the inertias are cut into parts of equal ratios.

    Attributes:
        width: Half the width that a part may have, as a share of its middle.
        most: Parts of one range at most.
        cells: Parts of all ranges together at most.
        more: The same where fewer would leave a part wider than `WIDE`.
    """

    width: float
    most: int
    cells: int
    more: int

    def of(self, rows: DeviationRows, ringing: Array | float = 1.0) -> tuple[int, ...]:
        """Number of parts of each range, where what a part leaves uncertain counts `ringing` times. Shape (n,)."""
        wide = np.log(rows.mass_high / rows.mass_low) / 2 * ringing
        counts = np.clip(np.ceil(wide / self.width), 1, self.most)
        while counts.prod() > self.cells:
            after = np.where(counts > 1, wide / np.maximum(counts - 1, 1), np.inf)
            if after.min() > WIDE and counts.prod() <= self.more:
                break
            counts[np.argmin(after)] -= 1
        return tuple(int(v) for v in counts)


#: For candidates of a search; for a certificate that is refined, and with more rows, of which the checker takes less.
COARSE, FINE, FEWER, MANY = Cut(0.1, 4, 4, 4), Cut(0.008, 12, 12, 24), Cut(0.008, 12, 8, 8), 4
#: The same of a loop with a mode that the law leaves to itself.
RINGING = Cut(0.1, 8, 8, 8), Cut(0.008, 10, 10, 10)
#: Cells of one with leads, where other constants than inertias are cut too and the checker takes longer for a cell.
LED = 6, 9
#: What a push makes of the rate of its own row in a loop that does not ring, over the push, is at most this.
CALM = 2.5
#: A range whose spread costs less than this share of the bound is not cut.
FELT = 0.002


def cut_for(rows: int, *, fine: bool) -> Cut:
    """How a loop of so many rows is cut."""
    if not fine:
        return COARSE
    return FEWER if rows > MANY else FINE


def ringing_of(whole: Responses) -> Array:
    """How much longer each row's rate answers to a push of its own than in a loop that does not ring. Shape (n,)."""
    n = whole.stack.sizes[0]
    return np.asarray(np.maximum(1.0, np.diag(whole.plain.rest[n : 2 * n]) / CALM), dtype=np.float64)


@dataclass(frozen=True)
class Partition:
    """Numbers of parts.

    Attributes:
        split: Of the range of each inertia. Shape (n,).
        parts: Of the ranges of other constants, by name; none of those that are whole.
    """

    split: tuple[int, ...]
    parts: Mapping[str, int]

    def pieces(self, bounds: Bounds) -> list[Bounds]:
        """The assumptions with every combination of parts of the constants, the last one running fastest."""
        cuts = [parts_of(bounds.parameters[name], count) for name, count in self.parts.items()]
        return [
            replace(bounds, parameters={**bounds.parameters, **dict(zip(self.parts, chosen, strict=True))})
            for chosen in product(*cuts)
        ]


def parts_of(whole: Interval, count: int) -> list[Interval]:
    """A range in parts that cover it: of equal ratios where it is positive, of equal widths elsewhere."""
    if whole.low > 0:
        ends = [whole.low * (whole.high / whole.low) ** (k / count) for k in range(1, count)]
    else:
        ends = [whole.low + (whole.high - whole.low) * k / count for k in range(1, count)]
    return [Interval(*pair) for pair in pairwise([whole.low, *ends, whole.high])]


def cells_of(rows: DeviationRows, split: tuple[int, ...]) -> list[DeviationRows]:
    """The enclosures with each inertia's range cut into parts of equal ratios, every combination."""
    low, step = rows.mass_low, (rows.mass_high / rows.mass_low) ** (1 / np.array(split))
    parts = []
    for index in product(*(range(count) for count in split)):
        begin = low * step ** np.array(index)
        parts.append(replace(rows, mass_low=begin, mass_high=begin * step))
    return parts


def constants_of(model: LoopModel, bounds: Bounds) -> list[str]:
    """Constants of the forces that are not known exactly."""
    read = set().union(*map(model.plant.reads, model.plant.outputs[len(model.rows) :]))
    return [name for name, span in bounds.parameters.items() if name in read and name != VARYING and not span.is_point]


def middles(bounds: Bounds, but: str = "") -> Bounds:
    """The assumptions with all constants at the middles of their ranges, but one."""
    still = {
        name: span if name in (but, VARYING) else Interval((span.low + span.high) / 2)
        for name, span in bounds.parameters.items()
    }
    return replace(bounds, parameters=still)


def shared(costs: Sequence[float], cells: int) -> list[int]:
    """Numbers of parts of ranges whose spreads cost so much, as shares of a bound: the sum of cost / parts is small."""
    counts = [1] * len(costs)
    while True:
        ways = [
            (cost / (k * (k + 1)) / np.log1p(1 / k), i)
            for i, (cost, k) in enumerate(zip(costs, counts, strict=True))
            if cost / k > FELT and np.prod(counts) // k * (k + 1) <= cells
        ]
        if not ways:
            return counts
        counts[max(ways)[1]] += 1
