"""The closed loop around the moving operating point, with the input as it is held."""

from __future__ import annotations

from fractions import Fraction

from .arithmetic import ZERO, Interval, magnitude, mul
from .claim import Claim
from .forms import Form, derivative
from .limits import need
from .loop import Loop
from .parsing import reads


class Deviation(Loop):
    """M_i z_i' = sum_j J_ij z_j + sum_k B_ik e_k + d_i around the operating point x*(t).

    The symbols Q are the deviations z = x - x*; the symbols e are u - m(x(t), r(t)) = -K z(t_k) + noise + drift, all of
    it inside the bounds `input_bound`. x* follows from the reference: the term of a tracked row must not read a state.
    """

    moving = "Qe"

    def __init__(self, claim: Claim, inflate: Fraction) -> None:
        tracked = {row["target"] for row in claim.rows}
        states = {row["state"] for row in claim.rows}
        for i, term in zip(claim.controlled, claim.law, strict=True):
            need(i not in tracked or not states & reads(term), "the modelling term of a tracked row reads a state")
        super().__init__(claim, inflate)

    def _error(self, i: int) -> Fraction:
        target = self.claim.rows[i]["target"]
        upstream = Fraction(0) if isinstance(target, str) else self.half[target][1] * self._error(target)
        return self.claim.half_widths[i] + upstream

    def _kappa(self, i: int) -> Form:
        self._control(i)
        return self.model[i]

    def _virtual_rate(self, i: int, moving: dict[str, Form]) -> Form:
        return self.table.expand(derivative(self.term[i], self._ranges(), moving))

    def _beyond(self, row: int) -> Fraction:
        return self.claim.input_bound[self.claim.input_map.index(row)]

    def feedback(self, k: int) -> list[Interval]:
        """K of input k: b_i Q_i, where Q_i = z_i + b_t Q_t."""
        row = self.claim.input_map[k]
        factor, found = self.half[row], [ZERO] * len(self.claim.rows)
        found[row] = factor
        while not isinstance(self.claim.rows[row]["target"], str):
            row = self.claim.rows[row]["target"]
            factor = found[row] = mul(factor, self.half[row])
        return found

    def drift(self, k: int) -> Fraction:
        """Bound on |d m_k(x(t), r(t)) / dt|."""
        return magnitude(self.table.over(self.virtual[self.claim.input_map[k]]))

    def noise_of(self, k: int) -> Fraction:
        """What measurement errors make of input k."""
        return self._control_noise(self.claim.input_map[k])
