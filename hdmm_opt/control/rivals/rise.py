"""RISE, the robust integral of the sign of the error, member by member.

    e_1 = q_d - q,   e_2 = e_1' + α_1 e_1,   a = k e_2 + v,   v' = k α_2 e_2 + β sgn(e_2)

Continuous; semi-globally asymptotic where the disturbance and its derivative are bounded, with β above what both ask,
α_1, α_2 > 1/2, and k large enough for the initial error. Faults that come on smoothly are such disturbances; a loss of
effectiveness scales the input. Its proof does not cover the onset itself, saturation (the integral is frozen while it
would push further outwards), sampling, noise, and effectiveness 0.

References:
    Xian, Dawson, de Queiroz and Chen (2004), A continuous asymptotic tracking control strategy for uncertain nonlinear
    systems, IEEE Transactions on Automatic Control 49(7), 1206-1211; Fischer, Kan, Kamalapurkar and Dixon (2014),
    Saturated RISE feedback control for a class of second-order nonlinear systems, ibid. 59(4), 1094-1099.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ..law import GainSpec
from .cascade import Cascade, Command
from .rival import frozen, searched


class Rise(Cascade):
    """The law for one plant; k and β per unit of inertia."""

    NAME = "rise"
    OUTER: ClassVar[tuple[GainSpec, ...]] = (
        searched("alpha_1", "1/s", "decay of the error", 1.0, 60.0),
        searched("alpha_2", "1/s", "decay of the filtered error", 1.0, 60.0),
        searched("k", "1/s", "proportional gain per inertia", 5.0, 500.0),
        searched("beta", "1/s^3", "gain of the sign per inertia", 1e-3, 100.0),
    )

    @property
    def states(self) -> int:
        """The integral."""
        return 1

    def outer(self, x: Any, r: Any, z: Any, gains: Any, command: Command, period: float) -> tuple[Any, Any]:
        """The command, and the integral after a period."""
        import casadi as ca

        first, second, stiff, sign = (gains[k] for k in range(4))
        filtered = r[1] - x[1] + first * (r[0] - x[0])
        wanted = stiff * filtered + z[0]
        value, given = command(wanted)
        growth = stiff * second * filtered + sign * ca.sign(filtered)
        return value, z[0] + period * frozen(wanted, given, growth)


RIVAL = Rise
