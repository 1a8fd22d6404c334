"""Linear active disturbance rejection: an extended state observer of position, speed and all that is not known.

    ẑ <- A ẑ + B a + L (q - ẑ_1),   a = q_d'' + 2 ω_c (q_d' - ẑ_2) + ω_c² (q_d - ẑ_1) - ẑ_3

with a triple pole of the observer at exp(-ω_o T). The observer knows the position alone, and the command as it was
limited. ρ is the share of the nominal inertia that the law uses. Bounded errors where the disturbance has a bounded
rate and ω_o is far below what delay and lag leave; a bound on the sampled, limited, noisy loop is not claimed.

References:
    Gao (2003), Scaling and bandwidth-parameterization based controller tuning, American Control Conference, 4989-4996;
    Herbst (2013), A simulative study on active disturbance rejection control as a control tool for practitioners,
    Electronics 2(3), 246-279, for the discrete observer.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..law import GainSpec
from .cascade import Cascade, Command
from .rival import searched


class Adrc(Cascade):
    """The law for one plant."""

    NAME = "adrc"
    OUTER: ClassVar[tuple[GainSpec, ...]] = (
        searched("omega_c", "1/s", "bandwidth of the closed loop", 3.0, 200.0),
        searched("omega_o", "1/s", "bandwidth of the observer", 10.0, 2000.0),
        searched("rho", "1", "share of the nominal inertia", 0.2, 5.0),
    )

    @property
    def states(self) -> int:
        """Estimates of position, speed and disturbance before the measurement."""
        return 3

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """The observer starts at the first measurement, at rest."""
        return [float(x[0]), 0.0, 0.0]

    def outer(self, x: Any, r: Any, z: Any, gains: Any, command: Command, period: float) -> tuple[Any, Any]:
        """The command, and the observer after a period."""
        import casadi as ca

        closed, observer, share = (gains[k] for k in range(3))
        p = ca.exp(-observer * period)
        correction = (1 - p**3, 1.5 * (1 - p) ** 2 * (1 + p) / period, (1 - p) ** 3 / period**2)
        place, speed, unknown = (z[k] + correction[k] * (x[0] - z[0]) for k in range(3))
        # a modelling term that holds the reference's acceleration takes its part of the command
        ahead = self.ahead(r)
        wanted = ahead + 2 * closed * (r[1] - speed) + closed**2 * (r[0] - place) - unknown
        value, given = command(share * wanted)
        acting = r[2] - ahead + given / share + unknown
        after = ca.vertcat(place + period * speed + period**2 / 2 * acting, speed + period * acting, unknown)
        return value, after


RIVAL = Adrc
