"""Fault-tolerant control by time-delay estimation, a nonsingular fast terminal sliding mode and super-twisting.

    s = ω (e + k_1 |e|² sgn e + k_2 |e'|^g sgn e'),   e = q_d - q,   g = 1.4
    ν = q_d'' + |e'|^(2-g) sgn(e') (1 + 2 k_1 |e|)/(g k_2) + K_1 |s|^½ sgn s + z,   z' = K_2 sgn s
    a_j = a_{j-1} + ρ (ν_j - (q'_j - q'_{j-1})/T)

The last command and the last acceleration stand for everything unknown: load, coupling, fault. Finite-time
convergence is claimed for continuous time where the estimate's error has a bounded rate; sampled, a ball of the order
of T. ρ is the share of the nominal inertia that the estimate uses; 0 < ρ M̂/M < 2 is needed. Not covered: noise, which
the difference of speeds over a period amplifies by 1/T, saturation (the integral is frozen there), and actuator lag.

The structure is that of Van et al., the estimate with a constant inertia that of Kali et al.; k_1 = 0.5, and
k_2 = e_0^(1-g) ω^(-g) with e_0 = 0.02.

References:
    Van, Ge and Ren (2017), Finite time fault tolerant control for robot manipulators using time delay estimation and
    continuous nonsingular fast terminal sliding mode control, IEEE Transactions on Cybernetics 47(7), 1681-1693;
    Kali, Saad and Benjelloun (2017), ICINCO, for the constant inertia.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ..law import GainSpec
from .cascade import Cascade, Command
from .rival import searched

#: Exponent g, k_1, and the error e_0 at which both parts of the sliding variable weigh the same.
EXPONENT, LINEAR, TYPICAL = 1.4, 0.5, 0.02


class TimeDelay(Cascade):
    """The law for one plant."""

    NAME = "tde-nftsm"
    OUTER: ClassVar[tuple[GainSpec, ...]] = (
        searched("omega", "1/s", "slope of the sliding surface", 3.0, 60.0),
        searched("rho", "1", "share of the inertia that the estimate uses", 0.01, 1.0),
        searched("K_1", "m^0.5/s^1.5", "gain of the root of the sliding variable", 0.05, 10.0),
        searched("K_2", "m/s^3", "gain of its sign", 0.02, 20.0),
    )

    @property
    def states(self) -> int:
        """Last command, last speed, integral."""
        return 3

    def outer(self, x: Any, r: Any, z: Any, gains: Any, command: Command, period: float) -> tuple[Any, Any]:
        """The command, and the states after a period."""
        import casadi as ca

        omega, share, first, second = (gains[k] for k in range(4))
        curved = TYPICAL ** (1 - EXPONENT) * omega ** (-EXPONENT)
        error, rate = r[0] - x[0], r[1] - x[1]
        size = ca.sqrt(rate**2 + 1e-20)
        sliding = omega * (error + LINEAR * ca.fabs(error) * error + curved * size ** (EXPONENT - 1) * rate)
        twist = ca.sign(sliding) * ca.sqrt(ca.fabs(sliding))
        reach = size ** (1 - EXPONENT) * rate * (1 + 2 * LINEAR * ca.fabs(error)) / (EXPONENT * curved)
        wanted = r[2] + reach + first * twist + z[2]
        measured = (x[1] - z[1]) / period
        # a modelling term that holds the reference's acceleration takes its part of the command
        asked = z[0] + share * (wanted - measured)
        value, given = command(asked)
        held = ca.fabs(asked - given) > 1e-9
        after = ca.vertcat(given, x[1], z[2] + ca.if_else(held, 0, period * second * ca.sign(sliding)))
        return value, after


RIVAL = TimeDelay
