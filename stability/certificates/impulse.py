"""The impulse-response certificate: any sampled loop with a dynamic controller, delay and complex poles included.

Rows of the plant in deviations, divided by a middle inertia, are z' = a z + b v + ρ with constant a and b and

    |ρ_i| <= μ_i |s_i| + (1 + μ_i)( Σ_j σ_ij |z_j| + Σ_k τ_ik |v_k| + D_i ),      s = a z + b v

and the gains of the controller are constant but for pulses that are small multiples of |z|, |c| and |w|. With the L1
norms Λ of `responses.py`, the non-negative S that these bounds read off y = (z, s, v, c, w), and y0 what known bounds
make of y,

    sup y <= y0 + Λ S sup y   ⇒   sup y <= (I - Λ S)^-1 y0      where some s > 0 has Λ S s < s

(Khammash and Pearson 1991; Dahleh and Diaz-Bobillo 1995, ch. 7). The part that starts at Z(0) without disturbance
obeys the same with weights growth^periods. The ranges of what is constant may be cut into cells.

Nothing here proves anything; `checker.py` does, in fixed point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..loops.box import Box, DeviationRows, UnboundedError
from ..loops.deviation import demanded, deviation_rows, rounded
from ..loops.model import Bounds, Gains, LoopModel
from ..loops.responses import Responses
from ..loops.stack import MAX_DELAY, Controller, Stack, controller
from ..loops.turn import turn
from .cells import Cells, Part
from .certificate import Certificate, Failure
from .cut import Partition
from .small_gain import Cell, Uncertain, cell_of, closed, late_of, small_gain

Array = NDArray[np.float64]

#: The box grows by this factor over what an iterate needs, and is accepted once it keeps this room.
WIDENING, ROOM = 1.004, 1.001
#: Iterations of the box.
STEPS = 120
#: Responses are summed anew where the middle of a gain moves by this share.
MOVED = 1e-9


@dataclass(frozen=True, kw_only=True)
class Impulse(Certificate):
    """An impulse-response certificate; `half_widths` and `ultimate` bound the deviations z_i.

    Attributes:
        box: Where the model was bounded.
        partition: How the ranges of inertias and other constants are cut.
        cells: One for each combination of parts, those of the inertias running fastest.
        rates: Bounds on |z_i'|. Shape (n,).
        networks: States of the rows with a load network. Length q.
        lags: States whose own time constant acts through another state, see `with_lags`.
        estimates: Bounds on their |φ̂|. Shape (q,).
        capacity: What those must stay below. Shape (q,).
    """

    box: Box
    partition: Partition
    cells: tuple[Cell, ...]
    rates: Array
    networks: tuple[str, ...]
    lags: tuple[str, ...]
    estimates: Array
    capacity: Array


def certify_impulse(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], limit: Array, *, refine: bool = False
) -> Impulse | Failure:
    """Search an impulse-response certificate for fixed gains.

    Args:
        model: Plant and law.
        bounds: Assumptions, with a positive period.
        gains: One for each controlled row.
        limit: Largest admissible box, |z_i| <= limit_i. Shape (n,).
        refine: Cut the ranges of what is constant more finely; tighter, and slower.

    Returns:
        The numbers, or why there are none.

    Not guaranteed: optimality; proof (see `checker.py`).
    """
    search = begun(model, bounds, gains, limit, fine=refine)
    return search if isinstance(search, Failure) else search.run(bounds)


def begun(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], limit: Array, *, fine: bool = False
) -> Search | Failure:
    """A search with the responses of its loop, or why there is none; arguments as in `Search`."""
    if not bounds.period > 0:
        return Failure(reason="a sampled loop needs a control period above 0")
    if bounds.delay > MAX_DELAY * bounds.period:
        late = bounds.delay / bounds.period
        return Failure(reason=f"the computing delay is of {late:.3g} periods, {MAX_DELAY} is the limit")
    if not 0 <= bounds.jitter <= min(bounds.delay, 0.499 * bounds.period):
        return Failure(reason="the jitter of a delay is at most the delay, and less than half a period")
    try:
        return Search(model, bounds, gains, limit, fine=fine)
    except np.linalg.LinAlgError:
        return Failure(reason="the loop has no coordinates in which a period contracts")
    except UnboundedError as error:
        return Failure(reason=str(error))


@dataclass(frozen=True)
class _Bound:
    """What one cell reaches over (z, s, v, c), from what is uncertain and from what Z(0) is made of.

    The forced part and all of it; |z'|; and the amplitude of what starts at Z(0), with the growth of which it shrinks.
    """

    forced: Array
    whole: Array
    rates: Array
    uncertain: Uncertain
    first: Array
    amplitude: Array
    growth: float = 1.0


class Search(Cells):
    """Fixed point of box -> enclosures -> small gain -> box; the responses are those of the first enclosures."""

    def run(self, bounds: Bounds) -> Impulse | Failure:
        """The certificate under some assumptions, which may be other ones than the search was begun with."""
        try:
            return self._settled(bounds)
        except UnboundedError as error:
            return Failure(reason=str(error))

    def _settled(self, bounds: Bounds) -> Impulse | Failure:
        summed, box, taken = self.responses, self.box, self.pieces(bounds, self.box, self.rows)
        for _ in range(STEPS):
            known = [r for r in summed if r is not None]
            if len(known) < len(summed):
                return self._unstable(self.parts(taken)[summed.index(None)], bounds)
            known_rows = box is self.box and bounds is self.bounds
            rows = self.rows if known_rows else deviation_rows(self.model, bounds, self.gains, box)
            pieces = self.pieces(bounds, box, rows)
            moved = [found for piece in (rows, *pieces) if (found := demanded(box, piece))]
            if moved:
                ends = [found.low for found in moved], [found.high for found in moved]
                low, high = np.minimum.reduce([box.low, *ends[0]]), np.maximum.reduce([box.high, *ends[1]])
                box = replace(box, low=low, high=high)
                continue
            parts, control = self.parts(pieces), controller(self.model, self.gains, rows, bounds.period)
            found = [self._cell(part.rows, r, control, bounds, box) for part, r in zip(parts, known, strict=True)]
            solved = [entry for entry in found if isinstance(entry, _Bound)]
            if len(solved) < len(found):
                return next(entry for entry in found if isinstance(entry, Failure))
            needed = self._needed(rows, solved, bounds)
            have = [box.half_widths, box.input_bound, box.network_bound, box.shown]
            if all((want * ROOM <= own).all() for want, own in zip(needed, have, strict=True)):
                if _moved(taken[0], rows) <= MOVED:
                    return self._certificate(rows, pieces, known, solved, bounds, box)
                # an adaptive gain has a middle that depends on the box
                summed, taken = self._responses(parts, bounds), pieces
                continue
            if (needed[0] > self.limit).any():
                worst = int(np.argmax(needed[0] / self.limit))
                return Failure(reason="the certified set outgrows the operating box", row=worst)
            # coordinates are in units of the box, as a file carries it
            grown = [np.where(w * ROOM <= o, o, rounded(w * WIDENING)) for w, o in zip(needed, have, strict=True)]
            box = replace(box, half_widths=grown[0], input_bound=grown[1], network_bound=grown[2], shown=grown[3])
        return Failure(reason=f"the box did not settle in {STEPS} iterations", row=len(self.limit) - 1)

    def _needed(self, rows: DeviationRows, solved: list[_Bound], bounds: Bounds) -> list[Array]:
        n, m, q = len(self.limit), len(self.model.inputs), len(self.own)
        whole = np.max([entry.whole for entry in solved], axis=0)
        leads = m * self.model.leads
        _, _, inputs, missed, _, shown, _ = np.split(whole, np.cumsum((n, n, m, q, leads, self.box.shown.size)))
        return [whole[:n], inputs + late_of(rows, bounds), missed, shown]

    def _cell(
        self, rows: DeviationRows, known: Responses, control: Controller, bounds: Bounds, box: Box
    ) -> _Bound | Failure:
        """The small-gain bounds of one cell."""
        stack = known.stack
        n = stack.sizes[0]
        uncertain = small_gain(rows, stack, control, bounds)
        reads, push = uncertain.reads, uncertain.push
        first = self._start(rows, bounds, box)
        plain, forced = known.plain, self.forced(known, uncertain, rows, bounds)
        begun = plain.begin @ first
        found = closed(plain, reads, np.column_stack([forced, forced + begun]))
        if isinstance(found, Failure):
            return replace(found, row=len(self.limit) - 1)
        moved = stack.sources()[:n, n:] @ rows.demand_rate
        rates = found[n : 2 * n, 1] + reads[:n] @ found[:, 1] + push[:n] + moved
        if stack.kicked:
            rates = rates + uncertain.sudden @ (found[-stack.turned :, 1] + uncertain.changed)
        forced, whole = (self._read(stack, uncertain, found[:, k]) for k in range(2))
        return _Bound(forced, whole, uncertain.whole(stack, rates)[: len(self.limit)], uncertain, first, whole)

    def _read(self, stack: Stack, uncertain: Uncertain, reached: Array) -> Array:
        """Bounds on y with z as it is, and without what only `stack.lags` have."""
        n, count = len(self.limit), len(stack.lags)
        gone = [*range(n, n + count), *range(2 * n + count, 2 * (n + count))]
        return np.asarray(np.delete(uncertain.whole(stack, reached), gone), dtype=np.float64)

    def _shrinking(self, known: Responses, bound: _Bound, bounds: Bounds) -> _Bound:
        """The bound with the transient that is smallest when the bound on the error must hold."""
        late, best = periods_in(bounds.transient, bounds.period), math.inf
        for growth, sums in known.weighted.items():
            found = closed(sums, bound.uncertain.reads, (sums.begin @ bound.first)[:, None])
            if not isinstance(found, Failure) and found[0, 0] * growth**-late < best:
                best = found[0, 0] * growth**-late
                amplitude = self._read(known.stack, bound.uncertain, found[:, 0])
                bound = replace(bound, amplitude=amplitude, growth=growth)
        return bound

    def _start(self, rows: DeviationRows, bounds: Bounds, box: Box) -> Array:
        """What Z(0) is made of, see `Stack.begin`.

        A network starts at its preload under any demand of the range, or where it rested before.
        """
        own = [g for g in self.gains if g.gamma > 0]
        released = [
            max(abs(g.preload - low), abs(high - g.preload), settled)
            for g, low, high, settled in zip(own, box.low, box.high, rows.settled, strict=True)
        ]
        none = np.zeros(len(self.lags))
        return np.concatenate([bounds.initial, none, released, bounds.noise, none, rows.noise])

    def _certificate(
        self, rows: DeviationRows, pieces: list[DeviationRows], known: list[Responses], solved: list[_Bound],
        bounds: Bounds, box: Box,
    ) -> Impulse:  # fmt: skip
        n, m = len(self.limit), len(self.model.inputs)
        solved = [self._shrinking(r, s, bounds) for r, s in zip(known, solved, strict=True)]
        settled = _after(solved, periods_in(bounds.transient, bounds.period))
        whole = np.concatenate([box.half_widths, box.input_bound])
        sizes = np.max([own.sizes(whole, resting=False) for own in pieces], axis=0)
        if bounds.rest[1] > 0:  # what a start makes of the loop has shrunk when the motion begins
            late = _after(solved, periods_in(bounds.rest[1], bounds.period))
            moving = np.minimum(whole, np.concatenate([late[:n], late[2 * n : 2 * n + m] + late_of(rows, bounds)]))
            ways = [(own.sizes(moving, resting=False), own.sizes(whole, resting=True)) for own in pieces]
            sizes = np.max([size for pair in ways for size in pair], axis=0)
        decay = min(math.log(s.growth) for s in solved) / bounds.period
        return Impulse(
            decay=decay, half_widths=box.half_widths, input_bound=box.input_bound, ultimate=settled[:n],
            effort=sizes[n:], states=sizes[:n], box=box, partition=self.partition,
            cells=tuple(
                cell_of(r, (part.force, part.drive), s.growth, box, self.model.input_map)
                for part, r, s in zip(self.parts(pieces), known, solved, strict=True)
            ),
            rates=np.max([s.rates for s in solved], axis=0),
            networks=tuple(self.model.rows[i].state for i in self.own),
            lags=tuple(self.model.rows[i].state for i in self.lags),
            capacity=np.array([g.capacity for g in self.gains if g.gamma > 0]),
            estimates=np.max(np.abs([box.low, box.high]), axis=0) + box.network_bound,
        )  # fmt: skip

    def _unstable(self, part: Part, bounds: Bounds) -> Failure:
        """Why the loop of a cell has no summable responses."""
        stack = self._stack(part, bounds)
        poles = np.linalg.eigvals(turn(stack, 1).image[:, : stack.order])
        largest = float(np.max(np.abs(poles)))
        rate = 1 / bounds.period
        if largest >= 1 - 1e-9:
            text = f"the nominal sampled loop is unstable, with a pole of size {largest:.4g} at {rate:g} Hz"
        else:
            text = f"no coordinates are found in which the loop contracts at {rate:g} Hz"
        return Failure(reason=text, row=len(self.limit) - 1)


def _moved(before: DeviationRows, after: DeviationRows) -> float:
    """The largest change of a gain's middle, as a share."""
    old, new = (rows.half_low + rows.half_high for rows in (before, after))
    return float(np.max(np.abs(new / old - 1)))


def periods_in(time: float, period: float) -> int:
    """Whole periods of a time."""
    return math.floor(time / period * (1 + 1e-9))


def _after(solved: list[_Bound], periods: int) -> Array:
    """Bounds on y from so many periods after the start on."""
    return np.max([np.minimum(s.forced + s.amplitude * s.growth**-periods, s.whole) for s in solved], axis=0)
