"""Model-free adaptive control in compact form: an integral with a gain from an estimated pseudo partial derivative.

    p <- p + h Δu (Δv - p Δu) / (m + Δu²),   p <- p_1 where |p| or |Δu| is below 1e-5 or p has not the sign of p_1
    Δu = Δu_flow + rho p (v_d - v) / (lambda + p²)

Δ is over a period. The gain of the integral is rho p / ((lambda + p²) T): lambda must grow as 1/T, and is searched so
far. The command is limited before Δu is formed. Bounded errors for a constant reference and lambda above a bound that
depends on the plant; no proof for a moving reference.

References:
    Hou and Jin (2011), A novel data-driven control approach for a class of discrete-time nonlinear systems, IEEE
    Transactions on Control Systems Technology 19(6), 1549-1558. A port of the family: gains and tables of publication
    P-2's rival are not public.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..law import GainSpec
from .metering import Command, Metering
from .rival import searched

#: Where the estimate starts anew.
LEAST = 1e-5


class ModelFree(Metering):
    """The law for one plant."""

    NAME = "mfac"
    GAINS: ClassVar[tuple[GainSpec, ...]] = (
        searched("p_1", "m/s", "first estimate of the pseudo partial derivative", 0.01, 10.0),
        searched("eta", "1", "step of the estimate", 1e-3, 1.0),
        searched("mu", "1", "weight against fast estimates", 1e-6, 10.0),
        searched("rho", "1", "step of the control", 0.05, 1.0),
        searched("lambda", "m^2/s^2", "weight against fast control", 0.01, 1e4),
    )

    @property
    def states(self) -> int:
        """Estimate, last speed, last feedback, last change of the command, last command, whether there was one."""
        return 6

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """The estimate starts where the gains say, at the first speed."""
        return [float(gains[0]), float(x[0]), 0.0, 0.0, 0.0, 0.0]

    def feedback(self, x: dict[str, Any], r: Any, z: Any, gains: Any, command: Command, nominal: dict[str, Any],
                 period: float) -> tuple[Any, Any]:  # fmt: skip
        """The command, and the states after a period."""
        import casadi as ca

        first, step, weight, share, damping = (gains[k] for k in range(5))
        speed, moved, pushed = x["speed"], x["speed"] - z[1], z[3]
        estimate = z[0] + step * pushed * (moved - z[0] * pushed) / (weight + pushed**2)
        anew = ca.logic_or(estimate < LEAST, ca.fabs(pushed) < LEAST)
        estimate = ca.if_else(anew, first, estimate)
        value, given = command(z[2] + share * estimate * (r[0] - speed) / (damping + estimate**2))
        change = ca.if_else(z[5] > 0, value - z[4], 0)
        return value, ca.vertcat(estimate, speed, given, change, value, 1)


RIVAL = ModelFree
