"""The plant in deviations from a moving operating point, with the inputs as they are held between two samples.

The operating point x*(t) follows from the reference alone: x*_i is r0, zero, or the modelling term of the row that x_i
answers to. With z = x - x* and the input u_k = m_k(x, r) + v_k,

    M_i z_i' = sum_j J_ij z_j + sum_k B_ik v_k + d_i,      Q = (I + b) z,      v = -K z(t_k) + noise + drift.

Products and tanh are enclosed as in `form.py`; what plant and law share cancels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..enclosures.form import ONE, Form
from ..enclosures.interval import Interval
from .model import Bounds, Gains, LoopModel
from .rows import Builder

Array = NDArray[np.float64]

#: Gains may be rounded to float32 on their way into a machine; the bounds cover twice that.
ROUNDED = Interval(1 - 2.0**-22, 1 + 2.0**-22)


@dataclass(frozen=True, kw_only=True)
class DeviationRows:
    """Enclosures that hold while |z_i| <= half_widths_i and |v_k| <= input_bound_k.

    Attributes:
        low: Lower ends of J. Shape (n, n).
        high: Upper ends of J. Shape (n, n).
        input_low: Lower ends of B. Shape (n, m).
        input_high: Upper ends of B. Shape (n, m).
        disturbance: Bounds on |d_i|. Shape (n,).
        mass_low: Lower ends of M. Shape (n,).
        mass_high: Upper ends of M. Shape (n,).
        feedback_low: Lower ends of K. Shape (m, n).
        feedback_high: Upper ends of K. Shape (m, n).
        start: Half gains b at θ̂ = 0 by row that is tracked; z_i(0) = Q_i(0) - b_t Q_t(0). Shape (n,).
        noise: Bounds on the input errors that noise makes. Shape (m,).
        drift: Bounds on |d m_k(x(t), r(t)) / dt|. Shape (m,).
        feedforward: Bounds on |m_k|. Shape (m,).
        states: Bounds on |x_i|. Shape (n,).
    """

    low: Array
    high: Array
    input_low: Array
    input_high: Array
    disturbance: Array
    mass_low: Array
    mass_high: Array
    feedback_low: Array
    feedback_high: Array
    start: Array
    noise: Array
    drift: Array
    feedforward: Array
    states: Array


def deviation_rows(
    model: LoopModel, bounds: Bounds, gains: tuple[Gains, ...], half_widths: Array, input_bound: Array
) -> DeviationRows:
    """Enclose the plant over the box |z_i| <= half_widths_i, |v_k| <= input_bound_k.

    Args:
        model: Plant and law.
        bounds: Assumptions.
        gains: One for each controlled row, in order.
        half_widths: Half widths of the box, in the units of the states. Shape (n,).
        input_bound: Half widths for v, in the units of the inputs. Shape (m,).

    Returns:
        The enclosures.

    Raises:
        ZeroDivisionError: a divisor of the model can vanish in the box.
        ValueError: the modelling term of a tracked row reads a state, so that no operating point follows from the
            reference alone.

    Not guaranteed: that the box is invariant. The caller checks it.
    """
    tracked = {row.target for row in model.rows if isinstance(row.target, int)}
    states = {row.state for row in model.rows}
    for row, term in zip(model.controlled, model.law, strict=True):
        if row in tracked and states & set(term.inputs):
            raise ValueError(f"the modelling term of row {row + 1} reads a state; a sampled certificate needs it free")
    return _Builder(model, bounds, gains, half_widths, input_bound).deviations()


class _Builder(Builder):
    """Rows without the proportional parts: the symbols Q are the deviations z, e the held inputs v."""

    def _error(self, i: int) -> float:
        target = self.model.rows[i].target
        upstream = self.half_gain[target].high * self._error(target) if isinstance(target, int) else 0.0
        return (self.half_widths[i] + upstream) * (1 + 1e-12)

    def _control(self, row: int) -> Form:
        return self.model_term[row]

    def _virtual_rate(self, i: int, error_rate: Form) -> Form:
        return Form()

    def deviations(self) -> DeviationRows:
        """The enclosures."""
        n, m = len(self.model.rows), len(self.model.inputs)
        self._states()
        values = self._plant()
        masses = [values[i].range for i in range(n)]
        forces = [self.symbols.expand(values[n + i].form) for i in range(n)]
        rows, term_rates = self._rows(
            forces, masses, [f.scaled(ONE / mass) for f, mass in zip(forces, masses, strict=True)]
        )
        feedback = [self._feedback(row) for row in self.model.input_map]
        return DeviationRows(
            low=np.array([[row.coefficient(f"Q{j}").low for j in range(n)] for row in rows]),
            high=np.array([[row.coefficient(f"Q{j}").high for j in range(n)] for row in rows]),
            input_low=np.array([[row.coefficient(f"e{k}").low for k in range(m)] for row in rows]),
            input_high=np.array([[row.coefficient(f"e{k}").high for k in range(m)] for row in rows]),
            disturbance=np.array([self._disturbance(row, "Qe") for row in rows]),
            mass_low=np.array([mass.low for mass in masses]),
            mass_high=np.array([mass.high for mass in masses]),
            feedback_low=np.array([[c.low for c in row] for row in feedback]),
            feedback_high=np.array([[c.high for c in row] for row in feedback]),
            start=np.array([self._start(i) for i in range(n)]),
            noise=np.array([self._control_noise(row) for row in self.model.input_map]),
            drift=np.array([
                self.symbols.range_of(self.symbols.expand(term_rates[row])).magnitude for row in self.model.input_map
            ]),
            feedforward=np.array([self.symbols.range_of(self._control(row)).magnitude for row in self.model.input_map]),
            states=np.array([self.inputs[row.state].range.magnitude for row in self.model.rows]),
        )  # fmt: skip

    def _feedback(self, row: int) -> list[Interval]:
        """K for one input: b_i Q_i with Q_i = z_i + b_t Q_t."""
        factor, column = self.half_gain[row] * ROUNDED, [Interval(0.0)] * len(self.model.rows)
        column[row] = factor
        target = self.model.rows[row].target
        while isinstance(target, int):
            factor = factor * self.half_gain[target] * ROUNDED
            column[target] = factor
            target = self.model.rows[target].target
        return column

    def _start(self, i: int) -> float:
        target = self.model.rows[i].target
        return 0.5 * self.gains[target].beta if isinstance(target, int) else 0.0
