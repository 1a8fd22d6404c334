"""The plant in deviations from a moving operating point, with the inputs as they are held between two samples.

The operating point x*(t) follows from the reference and from the demand φ*(t) that a load network estimates: x*_i is
r0, zero, or m_j - φ*_j of the row j that x_i answers to. With z = x - x*, c = φ̂ - φ* and u = m_k - φ*_k + v_k

    M_i z_i' = sum_j J_ij z_j + sum_k B_ik v_k + d_i + M_i φ*_j',      Q_i = z_i + b_j Q_j + c_j,      v = -b Q - c

where j is the row that row i tracks. In the row that a network acts in φ* is what the constant coefficients of h make
of signals of bounded rate, and a constant; what is left, and what has no bounded rate, is d. Products and tanh are
enclosed as in `form.py`; what plant and law share cancels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..enclosures.form import ONE, Form
from ..enclosures.interval import Interval, total
from .box import Box, DeviationRows, UnboundedError, over
from .model import Bounds, Gains, LoopModel, balance_of
from .observer import SHOWN
from .rows import Builder

Array = NDArray[np.float64]

#: A bound on what is not known yet.
NOTHING = 1e-9
#: Steps in which the demand of the load networks settles.
SETTLING = 4
#: Room for the demands in a larger box, as a share of them.
MOVED = 1e-3
#: Gains may be rounded to float32 on their way into a machine; the bounds cover twice that.
ROUNDED = Interval(1 - 2.0**-22, 1 + 2.0**-22)


def networks(model: LoopModel, gains: tuple[Gains, ...]) -> list[int]:
    """The rows with a load network."""
    return [i for i, g in zip(model.controlled, gains, strict=True) if g.gamma > 0]


def first_box(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], half_widths: Array
) -> tuple[Box, DeviationRows]:
    """A box with the demands that the networks have to meet, and next to nothing for the inputs; and its enclosures.

    Args:
        model: Plant and law.
        bounds: Assumptions.
        gains: One for each controlled row.
        half_widths: Bounds on |z_i|. Shape (n,).

    Raises:
        As `deviation_rows`.
    """
    capacity = np.array([g.capacity for g in gains if g.gamma > 0])
    box = Box(
        half_widths=half_widths, input_bound=np.full(len(model.inputs), NOTHING), low=-capacity, high=capacity,
        middle=np.zeros(len(capacity)), network_bound=np.full(len(capacity), NOTHING),
        shown=np.full(SHOWN if bounds.observer is not None else 0, NOTHING),
    )  # fmt: skip
    rows = deviation_rows(model, bounds, gains, box)
    for _ in range(SETTLING if len(capacity) else 0):
        # what is left leans to a side until its middle is met too
        following = replace(_demanding(box, rows), middle=rounded(box.middle + rows.lean))
        if all((getattr(box, key) == getattr(following, key)).all() for key in ("low", "high", "middle")):
            break
        box, rows = following, deviation_rows(model, bounds, gains, following)
    return box, rows


def _demanding(box: Box, rows: DeviationRows, room: float = 1e-6) -> Box:
    """The box with the demands of these rows, and a little room as a share of them."""
    low, high = rows.demand.T
    more = room * np.maximum(np.abs(low), np.abs(high))
    return replace(box, low=low - more, high=high + more)


def demanded(box: Box, rows: DeviationRows) -> Box | None:
    """The box with room for the demands of these rows, None where they are in it: what a mode carries depends on it."""
    low, high = rows.demand.T
    if (box.low <= low).all() and (high <= box.high).all():
        return None
    return _demanding(box, rows, room=MOVED)


def rounded(values: Array) -> Array:
    """Values with the digits that a file carries."""
    return np.array([float(f"{v:.8e}") for v in values])


def deviation_rows(model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], box: Box) -> DeviationRows:
    """Enclose the plant over a box.

    Args:
        model: Plant and law.
        bounds: Assumptions.
        gains: One for each controlled row, in order.
        box: Where.

    Returns:
        The enclosures.

    Raises:
        UnboundedError: a divisor of the model can vanish in the box, or numbers grow beyond floats; the modelling term
            of a tracked row reads a state, so that no operating point follows from the reference alone; nothing drives
            a row with a network.

    Not guaranteed: that the box is invariant, or that `demand` is inside the box. The caller checks both.
    """
    tracked = {row.target for row in model.rows if isinstance(row.target, int)}
    states = {row.state for row in model.rows}
    if model.leads and any(row.controlled and row.target in model.input_map for row in model.rows):
        raise UnboundedError("a row with leads is tracked by no row under the law")
    for row, term in zip(model.controlled, model.law, strict=True):
        if row in tracked and states & set(term.inputs):
            raise UnboundedError(f"the modelling term of row {row + 1} reads a state; a certificate needs it free")
    try:
        return _Builder(model, bounds, gains, box).deviations()
    except (ZeroDivisionError, ValueError, OverflowError) as error:
        raise UnboundedError(f"the model cannot be bounded over the box: {error}") from error


@dataclass(frozen=True, kw_only=True)
class _Demand:
    """What a network has to meet: range and rate of φ*, and the row's disturbance that is left, also as a part of φ̂."""

    range: Interval
    rate: float
    rest: float
    lean: float
    settled: float
    resting: Interval


class _Builder(Builder):
    """Rows without the proportional parts: the symbols Q are the deviations z, e the inputs v, p the demands φ*."""

    def __init__(self, model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], box: Box) -> None:
        self.box, self.networks = box, networks(model, gains)
        if bounds.observer is not None:
            bounds = replace(bounds, noise=(*(float(v) for v in box.shown[:2]), *bounds.noise[2:]))
        super().__init__(model, bounds, gains, box.half_widths, box.input_bound)
        for k, i in enumerate(self.networks):
            self.symbols.ranges[f"p{i}"] = Interval(float(box.low[k]), float(box.high[k]))

    def _error(self, i: int) -> float:
        target = self.model.rows[i].target
        if not isinstance(target, int):
            return self.half_widths[i]
        upstream = self.half_gain[target].high * self._error(target)
        if target in self.networks:
            upstream += float(self.box.network_bound[self.networks.index(target)])
        return (self.half_widths[i] + upstream) * (1 + 1e-12)

    def _control(self, row: int) -> Form:
        return self.model_term[row] - Form.of(f"p{row}") if row in self.networks else self.model_term[row]

    def _virtual_rate(self, i: int, error_rate: Form) -> Form:
        return Form()

    def deviations(self) -> DeviationRows:
        """The enclosures."""
        n, m = len(self.model.rows), len(self.model.inputs)
        self._states()
        values = self._plant()
        masses = [values[i].range for i in range(n)]
        raw = [values[n + i].form for i in range(n)]
        forces = [self.symbols.expand(form) for form in raw]
        rows, term_rates = self._rows(
            forces, masses, [f.scaled(ONE / mass) for f, mass in zip(forces, masses, strict=True)]
        )
        places = {i: self.model.driven[i] for i in self.networks}
        held = [*places.values(), *self.model.balanced.values()]
        if len(set(held)) < len(held):
            raise ValueError("a row is held by one load network or one mode")
        demands = {i: self._demand(i, raw[k], rows[k], masses[k], self.target_rate[k]) for i, k in places.items()}
        rest = {places[i]: demand.rest for i, demand in demands.items()}
        rest |= {k: self.symbols.range_of(self.balances[i].left).magnitude for i, k in self.model.balanced.items()}
        left = [rest[k] if k in rest else self._disturbance(row, "Qe") for k, row in enumerate(rows)]
        halves = [self.half_gain[i] * ROUNDED for i in self.model.controlled]
        inputs = self.model.input_map
        return DeviationRows(
            low=np.array([[row.coefficient(f"Q{j}").low for j in range(n)] for row in rows]),
            high=np.array([[row.coefficient(f"Q{j}").high for j in range(n)] for row in rows]),
            input_low=np.array([[row.coefficient(f"e{k}").low for k in range(m)] for row in rows]),
            input_high=np.array([[row.coefficient(f"e{k}").high for k in range(m)] for row in rows]),
            disturbance=np.array(left),
            mass_low=np.array([mass.low for mass in masses]),
            mass_high=np.array([mass.high for mass in masses]),
            half_low=np.array([half.low for half in halves]),
            half_high=np.array([half.high for half in halves]),
            noise=np.array([self._term_noise(row) for row in inputs]),
            drift=np.array([
                self.symbols.range_of(self.symbols.expand(term_rates[row])).magnitude for row in inputs
            ]),
            signals=(*(self._target(i) for i in range(n)), *(self._control(row) for row in inputs)),
            ranges=(dict(self.symbols.ranges), self._resting() | {f"p{i}": d.resting for i, d in demands.items()}),
            demand=np.array([[d.range.low, d.range.high] for d in demands.values()]).reshape(-1, 2),
            demand_rate=np.array([d.rate for d in demands.values()]),
            settled=np.array([d.settled for d in demands.values()]),
            lean=np.array([d.lean for d in demands.values()]), measured=np.array(self.bounds.noise),
        )  # fmt: skip

    def _demand(self, i: int, raw: Form, row: Form, mass: Interval, moving: Form) -> _Demand:
        """Split the row that φ̂_i acts in into what φ*_i meets and what is left; `moving` is the rate of its target.

        Only constant coefficients count: those of the force before nonlinear operations are replaced by what bounds
        them, and of those of the target's rate, which may change, their middles.
        """
        rates = self._rates_of_signals()
        shift = {s: Interval((c.low + c.high) / 2) for s, c in moving.coefficients.items() if s in rates}
        own = {s: c for s, c in raw.coefficients.items() if s in rates}
        met = Form(own) - Form(shift).scaled(mass)
        drive, constant = self._drive(i, raw, row)
        known = {*own, f"p{i}"} if constant else {*own}
        rest = self.symbols.expand(Form({s: c for s, c in raw.coefficients.items() if s not in known}, raw.constant))
        late = moving - Form(shift)
        middle = Form(constant=Interval(float(self.box.middle[self.networks.index(i)])))
        level = self.symbols.range_of(met + middle)
        change = total(c * rates[s] for s, c in met.coefficients.items()).magnitude
        rest, least = rest - late.scaled(mass) - middle, drive.low
        if not constant:  # where the effect of φ̂ may change, φ* is for its middle
            centre, around = (drive.high + drive.low) / 2, (drive.high - drive.low) / 2 * (1 + 1e-12)
            drive = Interval(centre)
            rest = Form({s: c for s, c in rest.coefficients.items() if s != f"p{i}"}, rest.constant)
            rest = rest + Form(constant=Interval.symmetric(around * (level / drive).magnitude))
        kept = {s: c for s, c in rest.coefficients.items() if s[0] not in "Qe"}
        left = self.symbols.range_of(Form(kept, rest.constant))
        still = over(met + middle, {**self.symbols.ranges, **self._resting()})
        # what stands beside a foreseen load is of others that move: at rest it is not there
        alone = dict.fromkeys((f"d:{name}" for name in self.bounds.feedforward), Interval(0.0))
        rested = over(Form(kept, rest.constant), {**self.symbols.ranges, **alone}).magnitude
        for j, other in enumerate(self.model.rows):  # a mode may rest beside what it carries, as far as it may begin
            if not other.controlled and not isinstance(other.target, int):
                rested += row.coefficient(f"Q{j}").magnitude * self.bounds.initial[j] * (1 + 1e-12)
        return _Demand(
            range=level / drive, rate=change / drive.low * (1 + 1e-12), rest=left.magnitude,
            lean=(left.low + left.high) / 2, settled=rested / least, resting=still / drive,
        )  # fmt: skip

    def _resting(self) -> dict[str, Interval]:
        """The reference while it rests at first, and what modes carry then."""
        still = {f"r{k}": Interval(self.bounds.rest[0] if k == 0 else 0.0) for k in range(4)}
        known = {**self.symbols.ranges, **still}
        held = {f"w:{balance_of(self.model.rows[i].state)}": found.range(known) for i, found in self.balances.items()}
        return still | held

    def _drive(self, i: int, raw: Form, row: Form) -> tuple[Interval, bool]:
        """The effect of φ̂_i on its row, and whether it is constant.

        Raises:
            ValueError: nothing that keeps its sign drives the row.
        """
        direct = -raw.coefficient(f"p{i}")
        found = direct if direct.low > 0 else -row.coefficient(f"p{i}")
        if not found.low > 0:
            raise ValueError(f"the load network of row {i + 1} has no effect of a known sign")
        return found, direct.low > 0
