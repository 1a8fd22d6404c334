"""What the certified error is made of: the share of every source, with what the uncertainty of the loop adds to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..loops.deviation import deviation_rows
from ..loops.model import Bounds
from ..loops.stack import controller
from .impulse import Impulse, Search
from .small_gain import closed, small_gain

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Budget:
    """A bound on |z_1| for late times, split.

    Attributes:
        sources: What acts -> its part of the bound, in the unit of z_1; the parts add up to it.
        nominal: The same sum for the loop of middle values, without what is uncertain of it.
    """

    sources: Mapping[str, float]
    nominal: float

    @property
    def whole(self) -> float:
        """The bound."""
        return sum(self.sources.values())


def budget_of(search: Search, bounds: Bounds, found: Impulse) -> Budget:
    """Split the bound of the worst cell by what acts.

    Args:
        search: The search that found the certificate.
        bounds: The assumptions.
        found: The certificate.

    Returns:
        The parts. Those of unmet disturbances are by row: what a load network meets costs its rate, what it does not
        meet, and friction, is a disturbance of its row.

    Not guaranteed: proof; the parts are floats beside the certificate.
    """
    rows = deviation_rows(search.model, bounds, search.gains, found.box)
    control, cells = controller(search.model, search.gains, rows, bounds.period), []
    for part, known in zip(search.parts(search.pieces(bounds, found.box, rows)), search.responses, strict=True):
        assert known is not None
        uncertain = small_gain(part.rows, known.stack, control, bounds)
        reads, push = uncertain.reads, uncertain.push
        n, plain = known.stack.sizes[0], known.plain
        columns = np.hstack([
            plain.rest[:, :n] * push[:n], plain.rest[:, n:] * part.rows.demand_rate, plain.pulses * push[n:],
            plain.noise * np.pad(bounds.noise, (0, len(search.lags))),
        ])  # fmt: skip
        parts = closed(plain, reads, columns)
        assert isinstance(parts, np.ndarray)
        cells.append((parts[0], columns[0]))
    parts, columns = max(cells, key=lambda cell: float(cell[0].sum()))
    named = zip(_names(search), parts, strict=True)
    return Budget(sources={name: float(v) for name, v in named if v > 0}, nominal=float(columns.sum()))


def _names(search: Search) -> list[str]:
    model, observed = search.model, search.bounds.observer is not None
    states = [row.state for row in model.rows]
    lagging = [*states, *(f"{states[i]}'s lag" for i in search.lags)]
    return [
        *(f"what acts on {state}" for state in states),
        *(f"the lag of {states[i]}" for i in search.lags),
        *(f"rate of what the network of {states[i]} meets" for i in search.own),
        *(f"change of {name} until it acts" for name in model.inputs),
        *(f"rounding of the network of {states[i]}" for i in search.own),
        *(f"rounding of lead {k + 1} of {name}" for name in model.inputs for k in range(model.leads)),
        *(f"rounding of the observed {state}" for state in states[: 2 if observed else 0]),
        *(f"jitter, felt by {state}" for state in (lagging if search.bounds.jitter > 0 else ())),
        *(f"measurement of {state}" for state in lagging),
    ]
