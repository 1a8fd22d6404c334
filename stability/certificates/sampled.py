"""The sampled certificate: a comparison system for the exact zero-order-hold map of the loop.

In coordinates y = W z in which the nominal map over a period is nearly triangular and positive (see `period.py`), |y|
obeys

    |y(t + T)| <= A_v |y(t)| + b_v      at every vertex v of the uncertain inertias,

so that any R with A_v R + b_v <= R is never left (R the ultimate set, P >= |y(0)| the set that is never left), and
s >= P - R with A_v s <= (1 - μT) s tells how fast R is approached: a vector Lyapunov function (Bellman 1962;
Siljak 1978, ch. 2), here for sampled data. No matrix inequality is needed. Inertias are constant, so their ranges may
be split into cells with a certificate each.

Nothing here proves anything; `checker.py` does, in exact arithmetic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..loops.deviation import DeviationRows, deviation_rows
from ..loops.model import Bounds, Gains, LoopModel
from ..loops.period import Map, comparison, coordinates, nominal
from .cell import Cell, cells_of, least_reach, rounded
from .certificate import Certificate, Failure

Array = NDArray[np.float64]

#: The assumed box grows by this factor over what an iterate needs, and is accepted once it keeps this room.
WIDENING, ROOM = 1.004, 1.001
#: A refined certificate splits the range of an inertia in two where half its width is more than this share of it.
SPLIT = 0.06
#: Rates of approach that are tried, as shares of the slowest contraction.
APPROACHES = (0.5, 0.7, 0.8, 0.9, 0.95, 0.98)


@dataclass(frozen=True, kw_only=True)
class Sampled(Certificate):
    """A sampled certificate: box and ultimate set bound the deviations z_i, `input_bound` the inputs u - m.

    Attributes:
        split: Number of equal parts of each inertia's range. Length n.
        cells: A certificate for each combination of parts, the last index running fastest.
    """

    split: tuple[int, ...]
    cells: tuple[Cell, ...]


def certify_sampled(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], limit: Array, *, refine: bool = False
) -> Sampled | Failure:
    """Search a sampled certificate for fixed gains.

    Args:
        model: Plant and law.
        bounds: Assumptions, with a positive period.
        gains: One for each controlled row.
        limit: Largest admissible box, |z_i| <= limit_i. Shape (n,).
        refine: Split the inertias and improve the coordinates by a local search; tighter, and much slower.

    Returns:
        The numbers, or why there are none.

    Not guaranteed: optimality; proof (see `checker.py`). Loops with complex poles far from the real axis have no
    positive comparison system and fail here.
    """
    if not bounds.period > 0:
        return Failure(reason="a sampled certificate needs a control period above 0")
    search = _Search(model, bounds, gains, limit)
    try:
        found = search.run((1,) * len(model.rows))
        if not refine or isinstance(found, Failure):
            return found
        rows = search.rows(found.half_widths, found.input_bound)
        split = tuple(2 if wide else 1 for wide in (rows.mass_high - rows.mass_low) / 2 > SPLIT * rows.mass_low)
        better = search.run(split)
        if isinstance(better, Sampled):
            better = search.run(split, search.refined(better))
        return better if isinstance(better, Sampled) and better.ultimate[0] < found.ultimate[0] else found
    except np.linalg.LinAlgError:
        return Failure(reason="the coordinates of the comparison system are singular")
    except (ZeroDivisionError, ValueError, OverflowError) as error:
        return Failure(reason=f"the model cannot be bounded over the box: {error}")


@dataclass(frozen=True)
class _Bounds:
    """What one cell reaches, and needs of the box."""

    transform: Array
    reach: Array
    start: Array
    rows: DeviationRows
    image: Map
    needed: Array
    inputs: Array


class _Search:
    """Fixed point of box -> enclosures -> comparison systems -> box."""

    STEPS = 120

    def __init__(self, model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], limit: Array) -> None:
        self.model, self.bounds, self.gains, self.limit = model, bounds, gains, limit
        self.initial, self.period = np.array(bounds.initial), bounds.period

    def rows(self, half_widths: Array, input_bound: Array) -> DeviationRows:
        return deviation_rows(self.model, self.bounds, self.gains, half_widths, input_bound)

    def run(self, split: tuple[int, ...], fixed: list[Array] | None = None) -> Sampled | Failure:
        n, m = len(self.model.rows), len(self.model.inputs)
        half_widths, input_bound = np.maximum(self.initial, 1e-9 * self.limit), np.full(m, 1e-9)
        transforms = fixed
        for step in range(self.STEPS):
            rows = self.rows(half_widths, input_bound)
            parts = cells_of(rows, split)
            if transforms is None or (fixed is None and step in (2, 5, 9)):
                transforms = [rounded(coordinates(self.model, part, self.period)) for part in parts]
            found = [self._cell(part, w, half_widths, input_bound) for part, w in zip(parts, transforms, strict=True)]
            solved = [entry for entry in found if isinstance(entry, _Bounds)]
            if len(solved) < len(found):
                return next(entry for entry in found if isinstance(entry, Failure))
            needed = np.max([entry.needed for entry in solved], axis=0)
            inputs = np.max([entry.inputs for entry in solved], axis=0)
            if (needed * ROOM <= half_widths).all() and (inputs * ROOM <= input_bound).all():
                return self._certificate(rows, split, solved, half_widths, input_bound)
            if (needed > self.limit).any():
                worst = int(np.argmax(needed / self.limit))
                return Failure(reason="the certified set outgrows the operating box", row=worst)
            half_widths = np.where(needed * ROOM <= half_widths, half_widths, needed * WIDENING)
            input_bound = np.where(inputs * ROOM <= input_bound, input_bound, inputs * WIDENING)
        return Failure(reason=f"the box did not settle in {self.STEPS} iterations", row=n - 1)

    def _certificate(
        self, rows: DeviationRows, split: tuple[int, ...], solved: list[_Bounds], half_widths: Array, input_bound: Array
    ) -> Sampled:
        """What the cells certify over a box that holds what they need."""
        ways = [self._approach(entry.image, entry.reach, entry.start) for entry in solved]
        decay = min(rate for _, rate in ways)
        cells = tuple(
            Cell(transform=entry.transform, reach=entry.reach, start=entry.start, shape=shape)
            for entry, (shape, _) in zip(solved, ways, strict=True)
        )
        ultimate = np.max(
            [self._ball(*pair, decay, half_widths, input_bound) for pair in zip(solved, cells, strict=True)], axis=0
        )
        return Sampled(
            decay=decay,
            half_widths=half_widths,
            input_bound=input_bound,
            ultimate=np.minimum(ultimate, half_widths),
            effort=rows.feedforward + input_bound,
            states=rows.states,
            split=split,
            cells=cells,
        )

    def _cell(self, rows: DeviationRows, transform: Array, half_widths: Array, input_bound: Array) -> _Bounds | Failure:
        n = len(half_widths)
        image = comparison(rows, self.period, transform)
        reach = least_reach(image.vertices)
        if reach is None:
            return Failure(reason=_obstacle(image, self.period), row=n - 1)
        start = least_reach([*image.vertices, (np.zeros((n, n)), self._start(transform, rows))])
        if start is None:
            return Failure(reason="the initial errors lead out of every contracting set", row=n - 1)
        start = np.maximum(start, reach)
        return _Bounds(
            transform=transform,
            reach=reach,
            start=start,
            rows=rows,
            image=image,
            needed=self._between(rows, image, start, half_widths, input_bound),
            inputs=image.control @ start + rows.noise + self.period * rows.drift,
        )

    def _ball(self, found: _Bounds, cell: Cell, decay: float, half_widths: Array, input_bound: Array) -> Array:
        """Bounds on |z| after the transient."""
        left = math.exp(-decay * max(0.0, self.bounds.transient - self.period))
        late = np.minimum(cell.reach + cell.shape * left, cell.start)
        return self._between(found.rows, found.image, late, half_widths, input_bound)

    def _approach(self, image: Map, reach: Array, start: Array) -> tuple[Array, float]:
        """The s >= P - R and its rate μ that leave the least error after the transient."""
        excess = start - reach
        push = np.maximum(excess, 1e-9 * (np.max(excess) or 1.0))
        radius = max(float(np.max(np.abs(np.linalg.eigvals(a)))) for a, _ in image.vertices)
        after = max(0.0, self.bounds.transient - self.period)
        best, least = (push, 0.0), math.inf
        for share in APPROACHES:
            factor = 1 - share * (1 - radius)
            shape = least_reach([(a / factor, push) for a, _ in image.vertices])
            if shape is None:
                continue
            decay = (1 - factor) * (1 - 1e-9) / self.period
            late = reach[0] + shape[0] * math.exp(-decay * after)
            if late < least:
                best, least = (shape, decay), late
        return best

    def refined(self, found: Sampled) -> list[Array]:
        """Coordinates with a smaller reach of y_1 in each cell over the box of a certificate."""
        parts = cells_of(self.rows(found.half_widths, found.input_bound), found.split)
        return [self._turned(part, cell) for part, cell in zip(parts, found.cells, strict=True)]

    def _turned(self, rows: DeviationRows, cell: Cell) -> Array:
        """Mix the coordinates y_2 … y_n by a local search (Nelder and Mead 1965)."""
        from scipy.optimize import minimize

        n = len(cell.reach)
        free = [(i, j) for i in range(1, n) for j in range(n) if i != j]
        if not free:
            return cell.transform

        def mixed(point: Array) -> Array:
            mixing = np.eye(n)
            for (i, j), value in zip(free, point, strict=True):
                mixing[i, j] = value * cell.reach[i] / cell.reach[j]
            return rounded(mixing @ cell.transform)

        def cost(point: Array) -> float:
            try:
                reach = least_reach(comparison(rows, self.period, mixed(point)).vertices)
            except np.linalg.LinAlgError:
                return 1e6
            return 1e6 if reach is None else float(reach[0] / cell.reach[0])

        simplex = np.vstack([np.zeros(len(free)), 0.05 * np.eye(len(free))])
        options = {"maxfev": 40 * len(free), "fatol": 1e-4, "xatol": 1e-3, "initial_simplex": simplex}
        return mixed(minimize(cost, simplex[0], method="Nelder-Mead", options=options).x)

    def _start(self, transform: Array, rows: DeviationRows) -> Array:
        """|y(0)| over the initial errors Q(0)."""
        back = np.eye(len(self.initial))
        for i, row in enumerate(self.model.rows):
            if isinstance(row.target, int):
                back[i, row.target] -= rows.start[i]
        return np.abs(transform @ back) @ self.initial

    def _between(self, rows: DeviationRows, image: Map, top: Array, half_widths: Array, input_bound: Array) -> Array:
        """Bounds on |z(t)| for all t, between samples too."""
        at_samples = np.abs(image.inverse) @ top
        moved = image.motion[0] @ top + image.motion[1]
        return at_samples + np.minimum(moved, self.period / 2 * rates(rows, half_widths, input_bound))


def _obstacle(image: Map, period: float) -> str:
    """Why a loop has no comparison system that contracts, by the poles of its nominal map."""
    poles = np.linalg.eigvals(image.nominal)
    largest = poles[np.argmax(np.abs(poles))]
    if abs(largest) >= 1:
        return f"the nominal sampled loop is unstable, with a pole of size {abs(largest):.4g} at {1 / period:g} Hz"
    text = "no positive comparison system contracts"
    turning = max(poles, key=lambda pole: abs(pole.imag))
    if abs(turning.imag) > 1e-6:
        return (
            f"{text}: the map has poles at {turning.real:.3g} ± {abs(turning.imag):.2g}i, the bandwidths are too close"
        )
    return f"{text}: the uncertainty is too large for poles at {', '.join(f'{p.real:.3g}' for p in poles)}"


def rates(rows: DeviationRows, half_widths: Array, input_bound: Array) -> Array:
    """Bounds on |z_i'| over the box. Shape (n,)."""
    size = np.maximum(np.abs(rows.low), np.abs(rows.high)) @ half_widths
    size = size + np.maximum(np.abs(rows.input_low), np.abs(rows.input_high)) @ input_bound + rows.disturbance
    return size / rows.mass_low


def speeds(rows: DeviationRows, found: Sampled, period: float) -> Array:
    """Bounds on |z_i'| for all t, from the coordinates y of the certificate. Shape (n,).

    ``z' = (M0/M) (a z(t) + b v + d)`` with ``v = -K z(t_k) + noise + drift``: the state at the last sample enters
    through a - bK, so what the feedback balances is not counted twice, as over the box (`rates`) it would be.
    """
    best = np.zeros(len(found.half_widths))
    for part, cell in zip(cells_of(rows, found.split), found.cells, strict=True):
        at, image = nominal(part), comparison(part, period, cell.transform)
        back, plain = image.inverse, rates(part, found.half_widths, found.input_bound)
        here = np.abs(back) @ cell.start
        moved = np.minimum(image.motion[0] @ cell.start + image.motion[1], period * plain)  # since the sample before
        shaken = part.noise + period * part.drift + at.k_spread @ here
        size = np.abs((at.a - at.b @ at.k) @ back) @ cell.start + np.abs(at.a) @ moved + at.a_spread @ (here + moved)
        size = size + np.abs(at.b) @ shaken + at.b_spread @ found.input_bound + part.disturbance / at.mass
        best = np.maximum(best, np.minimum((1 + at.inertia) * size, plain))
    return best
