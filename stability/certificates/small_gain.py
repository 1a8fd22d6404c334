"""What is uncertain in a cell, and the closed inequality sup y <= y0 + Λ S sup y."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True, kw_only=True)
class Cell:
    """What the checker needs to know of the loop for a part of the ranges.

    Attributes:
        force: Middle of J. Shape (n, n).
        drive: Middle of B. Shape (n, m).
        columns: Coordinates V in which a period contracts, over Z in units of the box. Shape (order, order).
        blocks: Sizes of their blocks.
        groups: Numbers of periods whose responses are summed together.
        growth: Weight of a period in the transient.
    """

    force: Array
    drive: Array
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
        reads: S over y = (z, s, v, c, w, what is bounded of an observer, changes of inputs): ρ, then pulses.
        push: Their known part.
        sudden: What jitter makes of |z'| for a change of 1 of each input. Shape (n, m).
        changed: The known part of those changes. Shape (m,).
        lagging: |δ| of each row of `stack.lags`: so many times ζ is added to its z.
    """

    reads: Array
    push: Array
    sudden: Array
    changed: Array
    lagging: Array

    def whole(self, stack: Stack, reached: Array) -> Array:
        """Y with z as it is, of bounds on y; shapes alike."""
        found, first = reached.copy(), stack.sizes[0] - len(stack.lags)
        for k, (i, share) in enumerate(zip(stack.lags, self.lagging, strict=True)):
            found[i] += share * reached[first + k]
        return found


def small_gain(rows: DeviationRows, stack: Stack, ctl: Controller, bounds: Bounds) -> Uncertain:
    """What is uncertain of the loop; `ctl` is the controller in the box."""
    _, m, q = stack.sizes
    n, more_states = len(rows.mass_low), len(stack.lags)
    mass = middle_of(rows)
    change = np.maximum(mass / rows.mass_low - 1, 1 - mass / rows.mass_high)
    per, more = 1 / mass[:, None], (1 + change)[:, None]
    a, b = stack.a[:n, :n], stack.b[:n]
    spread = np.maximum(np.abs(rows.low * per - a), np.abs(rows.high * per - a))
    loose = np.maximum(np.abs(rows.input_low * per - b), np.abs(rows.input_high * per - b))
    known = (1 + change) * (rows.disturbance / mass + (np.abs(b) + loose) @ late_of(rows, bounds))
    own = list(stack.lags)
    lagging = change[own]
    if more_states:  # δ ζ is added to z wherever it is read, but for its own row
        change[own] = 0.0
        felt = np.abs(stack.a[:, own]) * lagging
        felt[own, range(more_states)] = 0.0
        spread = np.pad(spread, ((0, more_states), (0, more_states)))
        spread[:, n:] += felt
        spread[range(n, n + more_states), range(n, n + more_states)] = np.abs(np.diag(stack.a)[own]) * lagging
        loose, more = np.pad(loose, ((0, more_states), (0, 0))), np.vstack([more, np.ones((more_states, 1))])
        change, known = np.pad(change, (0, more_states)), np.pad(known, (0, more_states))
        n += more_states
    first, last = 2 * n + m, 2 * n + m + q + stack.leads
    reads = np.zeros((n + stack.pulses, last + stack.shown + stack.turned))
    reads[:n, :n], reads[:n, n : 2 * n], reads[:n, 2 * n : first] = more * spread, np.diag(change), more * loose
    wrong = np.vstack([ctl.act_spread, ctl.learn_spread, ctl.smooth_spread])
    wrong = np.insert(wrong, [n - more_states] * more_states, 0.0, axis=1)
    corrections = n + len(wrong)
    reads[n:corrections, :n], reads[n:corrections, first:last] = wrong[:, :n], wrong[:, n:]
    if stack.observer is not None:
        corrected = (ROUNDED.high - 1) * np.array([stack.observer.first, stack.observer.second])
        reads[corrections : corrections + stack.watched, last + stack.shown - 1] = corrected
    kicks, sudden, changed = np.zeros((stack.kicked, m)), np.zeros((n, m)), bounds.period * rows.drift
    if stack.kicked:  # of the input and, as long as it lasts, of what the uncertainty makes of that and of the kick
        area, worse = stack.meanwhile()[1], change[:, None] * np.abs(stack.a) + more * spread
        worse[:, n - more_states :] += more * spread[:, own] * lagging
        driven = more * (np.abs(stack.b) + loose)
        kicks = np.linalg.solve(np.eye(n) - area @ worse, area @ driven)
        sudden = np.asarray(driven + (worse + np.abs(stack.a)) @ kicks, dtype=np.float64)
        reads[corrections + stack.watched :, last + stack.shown :] = kicks
    blurred = wrong[:, :n] @ np.pad(rows.measured, (0, more_states))
    blurred[:m] += rows.noise
    push = np.concatenate([known, blurred, np.zeros(stack.watched), kicks @ changed])
    reads[:, n - more_states : n] += reads[:, own] * lagging
    return Uncertain(reads=reads, push=push, sudden=sudden, changed=changed, lagging=lagging)


def closed(sums: Sums, reads: Array, known: Array) -> Array | Failure:
    """(I - Λ S)^-1 known, where Λ S contracts. Shape of known."""
    gain = np.hstack([sums.rest[:, : reads.shape[0] - sums.pulses.shape[1]], sums.pulses]) @ reads
    one = np.eye(len(gain))
    # a non-negative matrix is below LARGEST where some s > 0 has gain s < LARGEST s (Berman and Plemmons 1994, ch. 6)
    if (np.linalg.solve(LARGEST * one - gain, np.ones(len(gain))) > 0).all():
        return np.asarray(np.linalg.solve(one - gain, known), dtype=np.float64)
    radius = float(np.max(np.abs(np.linalg.eigvals(gain))))
    return Failure(reason=f"the uncertainty is too large for this loop: its small gain is {radius:.3g}, 1 is the limit")


def cell_of(found: Responses, middle: tuple[Array, Array], growth: float, box: Box, rows: Sequence[int]) -> Cell:
    """What the checker needs to know of some responses, in units of the box.

    Args:
        found: The responses.
        middle: Middles of J and B.
        growth: Weight of a period in the transient.
        box: The box.
        rows: Those of the inputs.
    """
    stack = found.stack
    own = box.half_widths[: stack.watched], np.repeat(box.half_widths[list(rows)], stack.leads // len(rows))
    plant = box.half_widths, box.half_widths[list(stack.lags)]
    unit = np.concatenate([*plant, box.network_bound, *own, np.tile(box.input_bound, stack.pending)])
    columns = found.basis.columns / unit[:, None]
    columns = columns / np.repeat(_sizes(columns, found.basis.blocks), found.basis.blocks)
    force, drive = middle
    return Cell(
        force=force, drive=drive, columns=columns, blocks=found.basis.blocks, groups=found.groups, growth=growth
    )


def _sizes(columns: Array, blocks: tuple[int, ...]) -> Array:
    """The largest entry of each block of columns."""
    starts = np.cumsum((0, *blocks[:-1]))
    return np.asarray(np.maximum.reduceat(np.abs(columns).max(axis=0), starts), dtype=np.float64)
