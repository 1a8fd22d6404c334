"""Where a loop is bounded, and the enclosures that hold there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..enclosures.form import Form
from ..enclosures.interval import Interval, total

Array = NDArray[np.float64]


class UnboundedError(ValueError):
    """The model has no enclosures over a box."""


@dataclass(frozen=True, kw_only=True)
class Box:
    """Where the enclosures hold: |z_i| <= half_widths_i, |v_k| <= input_bound_k, and the demand of each network.

    Attributes:
        half_widths: Shape (n,).
        input_bound: Shape (m,).
        low: Lower ends of φ*, of the rows with a network. Shape (q,).
        high: Upper ends of φ*. Shape (q,).
        middle: What of a row's disturbance is constant and met by φ*, in the unit of h. Shape (q,).
        network_bound: Bounds on |φ̂ - φ*| at the samples. Shape (q,).
        shown: Bounds on what an observer shows at the samples: ẑ_1 - z_1, ẑ_2 - z_2, correction. Shape (3,) or (0,).
    """

    half_widths: Array
    input_bound: Array
    low: Array
    high: Array
    middle: Array
    network_bound: Array
    shown: Array


@dataclass(frozen=True, kw_only=True)
class DeviationRows:
    """Enclosures that hold inside a box.

    Attributes:
        low: Lower ends of J. Shape (n, n).
        high: Upper ends of J. Shape (n, n).
        input_low: Lower ends of B. Shape (n, m).
        input_high: Upper ends of B. Shape (n, m).
        disturbance: Bounds on |d_i|. Shape (n,).
        mass_low: Lower ends of M. Shape (n,).
        mass_high: Upper ends of M. Shape (n,).
        half_low: Lower ends of b, of each governed row. Shape (g,).
        half_high: Upper ends of b. Shape (g,).
        noise: What measurement errors make of the modelling term of each input. Shape (m,).
        drift: Bounds on |d m_k(x(t), r(t)) / dt|. Shape (m,).
        signals: What the states and then the inputs are at the operating point, with what the terms read of deviations.
        ranges: Range of every symbol; and while the reference rests at first, of those that are other ones then.
        demand: Range of φ* of each row with a network. Shape (q, 2).
        demand_rate: Bounds on |φ*'|. Shape (q,).
        settled: Bounds on |φ̂ - φ*| at rest: what a network cannot tell from the demand. Shape (q,).
        lean: Middles of the disturbances that are left in rows with a network, for the box's `middle`. Shape (q,).
        measured: Bounds on the errors of what the controller knows of the states. Shape (n,).
    """

    low: Array
    high: Array
    input_low: Array
    input_high: Array
    disturbance: Array
    mass_low: Array
    mass_high: Array
    half_low: Array
    half_high: Array
    noise: Array
    drift: Array
    signals: tuple[Form, ...]
    ranges: tuple[Mapping[str, Interval], Mapping[str, Interval]]
    demand: Array
    demand_rate: Array
    settled: Array
    lean: Array
    measured: Array

    def sizes(self, deviations: Array, *, resting: bool) -> Array:
        """Bounds on |x_i| and |u_k| for bounds on |z_i| and |v_k|, in motion or while the reference rests.

        Args:
            deviations: Shape (n + m,).
            resting: Which of both.
        """
        n = len(self.disturbance)
        known = {**self.ranges[0], **(self.ranges[1] if resting else {})}
        known |= {f"Q{i}": Interval.symmetric(float(r)) for i, r in enumerate(deviations[:n])}
        return deviations + np.array([over(form, known).magnitude for form in self.signals])


def over(form: Form, ranges: Mapping[str, Interval]) -> Interval:
    """The range of a form over given ranges of its symbols."""
    return form.constant + total(c * ranges[s] for s, c in form.coefficients.items())
