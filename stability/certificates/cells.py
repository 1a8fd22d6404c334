"""The cells of a loop: how ranges are cut, and for each cell its enclosures, its middles and its responses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..loops.box import Box, DeviationRows
from ..loops.deviation import NOTHING, deviation_rows, first_box, networks, rounded
from ..loops.model import Bounds, Gains, LoopModel
from ..loops.responses import Responses, responses
from ..loops.stack import Stack, controller, delay_of, wiring, with_lags
from .cut import LED, RINGING, Partition, cells_of, constants_of, cut_for, middles, ringing_of, shared
from .small_gain import Uncertain, middle_of, small_gain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """Enclosures of a cell, and the middles that its loop is made of."""

    rows: DeviationRows
    force: Array
    drive: Array


class Cells:
    """A loop in cells; their responses are those of the first enclosures.

    Args:
        model: Plant and law.
        bounds: Assumptions from which the middle of the loop is taken.
        gains: One for each controlled row.
        limit: Largest admissible box.
        fine: Whether ranges are cut finely.
        partition: How they are cut; chosen where it is left out.
    """

    def __init__(
        self, model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], limit: Array, *, fine: bool = False,
        partition: Partition | None = None,
    ) -> None:  # fmt: skip
        self.model, self.gains, self.limit = model, gains, limit
        self.own = networks(model, gains)
        self.steering, self.direct = wiring(model, self.own)
        start = rounded(np.maximum(np.array(bounds.initial), NOTHING * limit))
        self.bounds, (self.box, self.rows) = bounds, first_box(model, bounds, gains, start)
        self.lags = self._lags() if model.rings and model.leads else ()
        self.partition = self._partition(bounds, fine=fine) if partition is None else partition
        pieces = self.pieces(bounds, self.box, self.rows)
        self.middles = [_middle_of(rows) for rows in pieces]
        self.responses = self._responses(self.parts(pieces), bounds)

    def _lags(self) -> tuple[int, ...]:
        """Rows that do nothing but to follow what is commanded, with a time constant that is not known exactly."""
        rows, found = self.rows, []
        for i, row in enumerate(self.model.rows):
            reads = np.maximum(np.abs(rows.low[i]), np.abs(rows.high[i]))
            alone = not np.delete(reads, i).any() and rows.high[i, i] < 0
            if not row.controlled and isinstance(row.target, int) and alone and rows.mass_low[i] < rows.mass_high[i]:
                found.append(i)
        return tuple(found)

    def _partition(self, bounds: Bounds, *, fine: bool) -> Partition:
        """How ranges are cut: with leads by what each leaves uncertain costs, else of inertias by their widths."""
        whole = (1,) * len(self.model.rows)
        if not self.model.rings:
            return Partition(cut_for(len(self.model.rows), fine=fine).of(self.rows), {})
        (known,) = self._responses([Part(self.rows, *_middle_of(self.rows))], bounds)
        if not self.model.leads:
            return Partition(RINGING[fine].of(self.rows, 1.0 if known is None else ringing_of(known)), {})
        if known is None:
            return Partition(whole, {})
        inertias = [
            i for i, (low, high) in enumerate(zip(self.rows.mass_low, self.rows.mass_high, strict=True)) if low < high
        ]
        constants = constants_of(self.model, bounds)
        counts = shared(self._costs(known, bounds, inertias, constants), LED[fine])
        split = dict(zip(inertias, counts, strict=False))
        parts = zip(constants, counts[len(inertias) :], strict=True)
        return Partition(
            tuple(split.get(i, 1) for i in range(len(whole))), {name: count for name, count in parts if count > 1}
        )

    def _costs(self, known: Responses, bounds: Bounds, inertias: list[int], constants: list[str]) -> list[float]:
        """What the spread of each alone adds to the bound on z_1, to first order, as a share of it."""
        stack, mass = known.stack, middle_of(self.rows)

        def enclosed(name: str = "") -> DeviationRows:
            return deviation_rows(self.model, middles(bounds, name), self.gains, self.box)

        def uncertain(rows: DeviationRows, loose: int = -1) -> Uncertain:
            low, high = mass.copy(), mass.copy()
            if loose >= 0:
                low[loose], high[loose] = self.rows.mass_low[loose], self.rows.mass_high[loose]
            rows = replace(rows, mass_low=low, mass_high=high)
            return small_gain(rows, stack, controller(self.model, self.gains, rows, bounds.period), bounds)

        rows = enclosed()
        least = uncertain(rows)
        reached = self.forced(known, least, rows, bounds)
        found = [uncertain(rows, i) for i in inertias] + [uncertain(enclosed(name)) for name in constants]
        n, plain = stack.sizes[0], known.plain
        way = np.concatenate([plain.rest[0, :n], plain.pulses[0]])
        return [float(way @ ((u.reads - least.reads) @ reached + u.push - least.push) / reached[0]) for u in found]

    def forced(self, known: Responses, uncertain: Uncertain, rows: DeviationRows, bounds: Bounds) -> Array:
        """What acts makes of y in a loop without what is uncertain."""
        n, plain, push = known.stack.sizes[0], known.plain, uncertain.push
        forced = plain.rest[:, :n] @ push[:n] + plain.rest[:, n:] @ rows.demand_rate
        noise = np.pad(bounds.noise, (0, len(self.lags)))
        return np.asarray(forced + plain.pulses @ push[n:] + plain.noise @ noise, dtype=np.float64)

    def pieces(self, bounds: Bounds, box: Box, rows: DeviationRows) -> list[DeviationRows]:
        """Enclosures of every combination of parts of the constants; `rows` are those of all of them."""
        if not self.partition.parts:
            return [rows]
        return [deviation_rows(self.model, own, self.gains, box) for own in self.partition.pieces(bounds)]

    def parts(self, pieces: list[DeviationRows]) -> list[Part]:
        """The cells of all pieces."""
        return [
            Part(cell, *middle)
            for piece, middle in zip(pieces, self.middles, strict=True)
            for cell in cells_of(piece, self.partition.split)
        ]

    def _responses(self, parts: list[Part], bounds: Bounds) -> list[Responses | None]:
        return [responses(self._stack(part, bounds)) for part in parts]

    def _stack(self, part: Part, bounds: Bounds) -> Stack:
        rows, mass = part.rows, middle_of(part.rows)
        whole, share = delay_of(bounds.delay, bounds.period)
        made = Stack(
            a=part.force / mass[:, None], b=part.drive / mass[:, None], steering=self.steering, direct=self.direct,
            control=controller(self.model, self.gains, rows, bounds.period), period=bounds.period, whole=whole,
            share=share, observer=bounds.observer, jitter=bounds.jitter,
        )  # fmt: skip
        return with_lags(made, self.lags)


def _middle_of(rows: DeviationRows) -> tuple[Array, Array]:
    """Middles of J and B, as a file carries them."""
    force = np.array([rounded(row) for row in (rows.low + rows.high) / 2])
    return force, np.array([rounded(row) for row in (rows.input_low + rows.input_high) / 2])
