"""Cells of the inertias' ranges, what is uncertain in one, and the closed inequality sup y <= y0 + Λ S sup y."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ..loops.box import Box, DeviationRows
from ..loops.deviation import ROUNDED
from ..loops.model import Bounds
from ..loops.responses import Responses, Sums
from ..loops.stack import Controller, Stack
from .certificate import Failure

Array = NDArray[np.float64]

#: Largest small gain that is accepted: the checker rounds outwards.
LARGEST = 0.999


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


#: What a push makes of the rate of its own row in a loop that does not ring, over the push, is at most this.
CALM = 2.5
#: Half of a part's width, as a share of its middle, that is wide for a refined certificate.
WIDE = 0.06
#: For candidates of a search; for a certificate that is refined, and with more rows, of which the checker takes less.
COARSE, FINE, FEWER, MANY = Cut(0.1, 4, 4, 4), Cut(0.008, 12, 12, 24), Cut(0.008, 12, 8, 8), 4
#: The same of a loop with a mode that the law leaves to itself.
RINGING = Cut(0.1, 8, 8, 8), Cut(0.008, 10, 10, 10)


def cut_for(rows: int, *, ringing: bool, fine: bool) -> Cut:
    """How a loop of so many rows is cut."""
    if ringing:
        return RINGING[fine]
    if not fine:
        return COARSE
    return FEWER if rows > MANY else FINE


def ringing_of(whole: Responses) -> Array:
    """How much longer each row's rate answers to a push of its own than in a loop that does not ring. Shape (n,)."""
    n = whole.stack.sizes[0]
    return np.asarray(np.maximum(1.0, np.diag(whole.plain.rest[n : 2 * n]) / CALM), dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class Cell:
    """What the checker needs to know of the loop for a part of the inertias' ranges.

    Attributes:
        columns: Coordinates V in which a period contracts, over Z in units of the box. Shape (order, order).
        blocks: Sizes of their blocks.
        groups: Numbers of periods whose responses are summed together.
        growth: Weight of a period in the transient.
    """

    columns: Array
    blocks: tuple[int, ...]
    groups: tuple[int, ...]
    growth: float


def middle_of(rows: DeviationRows) -> Array:
    """M0: the middle of 1/M. Shape (n,)."""
    return 2 / (1 / rows.mass_low + 1 / rows.mass_high)


def late_of(rows: DeviationRows, bounds: Bounds) -> Array:
    """What the modelling term of each input changes until it acts. Shape (m,)."""
    return (bounds.period + bounds.delay + bounds.jitter) * rows.drift


@dataclass(frozen=True)
class Uncertain:
    """What is uncertain of a loop.

    Attributes:
        reads: S over y = (z, s, v, c, what is bounded of an observer, changes of inputs): ρ, then pulses.
        push: Their known part.
        sudden: What jitter makes of |z'| for a change of 1 of each input. Shape (n, m).
        changed: The known part of those changes. Shape (m,).
    """

    reads: Array
    push: Array
    sudden: Array
    changed: Array


def small_gain(rows: DeviationRows, stack: Stack, ctl: Controller, bounds: Bounds) -> Uncertain:
    """What is uncertain of the loop; `ctl` is the controller in the box."""
    n, m, q = stack.sizes
    mass = middle_of(rows)
    change = np.maximum(mass / rows.mass_low - 1, 1 - mass / rows.mass_high)
    per, more = 1 / mass[:, None], (1 + change)[:, None]
    spread = np.maximum(np.abs(rows.low * per - stack.a), np.abs(rows.high * per - stack.a))
    loose = np.maximum(np.abs(rows.input_low * per - stack.b), np.abs(rows.input_high * per - stack.b))
    first = 2 * n + m
    reads = np.zeros((n + stack.pulses, first + q + stack.shown + stack.turned))
    reads[:n, :n], reads[:n, n : 2 * n], reads[:n, 2 * n : first] = more * spread, np.diag(change), more * loose
    reads[n : n + m, :n], reads[n : n + m, first : first + q] = ctl.feedback_spread, ctl.network_spread
    reads[n + m : n + m + q, :n], reads[n + m : n + m + q, first : first + q] = ctl.entry_spread, ctl.keep_spread
    if stack.observer is not None:
        corrected = (ROUNDED.high - 1) * np.array([stack.observer.first, stack.observer.second])
        reads[n + m + q : n + m + q + stack.watched, first + q + stack.shown - 1] = corrected
    kicks, sudden, changed = np.zeros((stack.kicked, m)), np.zeros((n, m)), bounds.period * rows.drift
    if stack.kicked:  # of the input and, as long as it lasts, of what the uncertainty makes of that and of the kick
        area, worse = stack.meanwhile()[1], change[:, None] * np.abs(stack.a) + more * spread
        driven = more * (np.abs(stack.b) + loose)
        kicks = np.linalg.solve(np.eye(n) - area @ worse, area @ driven)
        sudden = np.asarray(driven + (worse + np.abs(stack.a)) @ kicks, dtype=np.float64)
        reads[n + m + q + stack.watched :, first + q + stack.shown :] = kicks
    drift = (np.abs(stack.b) + loose) @ late_of(rows, bounds)
    push = np.concatenate([
        (1 + change) * (rows.disturbance / mass + drift), rows.noise + ctl.feedback_spread @ rows.measured,
        ctl.entry_spread @ rows.measured, np.zeros(stack.watched), kicks @ changed,
    ])  # fmt: skip
    return Uncertain(reads=reads, push=push, sudden=sudden, changed=changed)


def cells_of(rows: DeviationRows, split: tuple[int, ...]) -> list[DeviationRows]:
    """The enclosures with each inertia's range cut into parts of equal ratios, every combination."""
    low, step = rows.mass_low, (rows.mass_high / rows.mass_low) ** (1 / np.array(split))
    parts = []
    for index in product(*(range(count) for count in split)):
        begin = low * step ** np.array(index)
        parts.append(replace(rows, mass_low=begin, mass_high=begin * step))
    return parts


def closed(sums: Sums, reads: Array, known: Array) -> Array | Failure:
    """(I - Λ S)^-1 known, where Λ S contracts. Shape of known."""
    gain = np.hstack([sums.rest[:, : reads.shape[0] - sums.pulses.shape[1]], sums.pulses]) @ reads
    one = np.eye(len(gain))
    # a non-negative matrix is below LARGEST where some s > 0 has gain s < LARGEST s (Berman and Plemmons 1994, ch. 6)
    if (np.linalg.solve(LARGEST * one - gain, np.ones(len(gain))) > 0).all():
        return np.asarray(np.linalg.solve(one - gain, known), dtype=np.float64)
    radius = float(np.max(np.abs(np.linalg.eigvals(gain))))
    return Failure(reason=f"the uncertainty is too large for this loop: its small gain is {radius:.3g}, 1 is the limit")


def cell_of(found: Responses, growth: float, box: Box) -> Cell:
    """What the checker needs to know of some responses, in units of the box."""
    stack = found.stack
    own = box.half_widths[: stack.watched]
    unit = np.concatenate([box.half_widths, box.network_bound, own, np.tile(box.input_bound, stack.pending)])
    columns = found.basis.columns / unit[:, None]
    columns = columns / np.repeat(_sizes(columns, found.basis.blocks), found.basis.blocks)
    return Cell(columns=columns, blocks=found.basis.blocks, groups=found.groups, growth=growth)


def _sizes(columns: Array, blocks: tuple[int, ...]) -> Array:
    """The largest entry of each block of columns."""
    starts = np.cumsum((0, *blocks[:-1]))
    return np.asarray(np.maximum.reduceat(np.abs(columns).max(axis=0), starts), dtype=np.float64)
