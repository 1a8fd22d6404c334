"""Super-twisting sliding mode control of second order.

    s = λ e + e',   e = q_d - q,   a = q_d'' + λ e' + k_1 |s|^½ sgn s + v,   v' = k_2 sgn s

Continuous: s and s' reach zero in finite time where the disturbance has a rate of at most L, with k_1 = 1.5 √L and
k_2 = 1.1 L. Sampled: a ball of the order of T² for s, more with a lag, which rules it. The integral is frozen while it
would push the limited command further outwards. No bound on the sampled, limited, noisy loop is claimed.

References:
    Levant (1993), Sliding order and sliding accuracy in sliding mode control, International Journal of Control 58(6),
    1247-1263; Moreno and Osorio (2012), Strict Lyapunov functions for the super-twisting algorithm, IEEE Transactions
    on Automatic Control 57(4), 1035-1040.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ..law import GainSpec
from .cascade import Cascade, Command
from .rival import frozen, searched


class SuperTwisting(Cascade):
    """The law for one plant."""

    NAME = "super-twisting"
    OUTER: ClassVar[tuple[GainSpec, ...]] = (
        searched("lambda", "1/s", "slope of the sliding surface", 3.0, 200.0),
        searched("k_1", "m^0.5/s^1.5", "gain of the root", 0.05, 50.0),
        searched("k_2", "m/s^3", "gain of the sign", 0.02, 200.0),
    )

    @property
    def states(self) -> int:
        """The integral."""
        return 1

    def outer(self, x: Any, r: Any, z: Any, gains: Any, command: Command, period: float) -> tuple[Any, Any]:
        """The command, and the integral after a period."""
        import casadi as ca

        slope, root, sign = (gains[k] for k in range(3))
        rate = r[1] - x[1]
        sliding = slope * (r[0] - x[0]) + rate
        wanted = self.ahead(r) + slope * rate + root * ca.sign(sliding) * ca.sqrt(ca.fabs(sliding)) + z[0]
        value, given = command(wanted)
        return value, z[0] + period * frozen(wanted, given, sign * ca.sign(sliding))


RIVAL = SuperTwisting
