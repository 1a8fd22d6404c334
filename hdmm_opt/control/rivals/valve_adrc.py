"""Linear active disturbance rejection of first order: an extended state observer of a speed and of all that moves it.

    ẑ <- ẑ + L (v - ẑ_1),   u = u_flow + (omega_c (v_d - ẑ_1) + v_d' - ẑ_2) / b,   v' = ẑ_2 + b (u - u_flow)

with a double pole of the observer at exp(-omega_o T), and the command as it was limited. Bounded errors where the
disturbance has a bounded rate and omega_o is far below what delay, valve and hydraulic mode leave.

References:
    Gao (2003), American Control Conference, 4989-4996; Herbst (2013), Electronics 2(3), 246-279, for the discrete form.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..law import GainSpec
from .metering import Command, Metering
from .rival import searched


class ValveAdrc(Metering):
    """The law for one plant."""

    NAME = "valve-adrc"
    GAINS: ClassVar[tuple[GainSpec, ...]] = (
        searched("omega_c", "1/s", "bandwidth of the closed loop", 0.3, 100.0),
        searched("omega_o", "1/s", "bandwidth of the observer", 1.0, 1000.0),
        searched("b", "m/s^2", "gain of the command", 0.3, 1000.0),
    )

    @property
    def states(self) -> int:
        """Estimates of speed and disturbance before the measurement."""
        return 2

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """The observer starts at the first measurement."""
        return [float(x[0]), 0.0]

    def feedback(self, x: dict[str, Any], r: Any, z: Any, gains: Any, command: Command, nominal: dict[str, Any],
                 period: float) -> tuple[Any, Any]:  # fmt: skip
        """The command, and the observer after a period."""
        import casadi as ca

        closed, observer, gain = (gains[k] for k in range(3))
        p = ca.exp(-observer * period)
        apart = x["speed"] - z[0]
        speed, unknown = z[0] + (1 - p**2) * apart, z[1] + (1 - p) ** 2 / period * apart
        value, given = command((closed * (r[0] - speed) + r[1] - unknown) / gain)
        return value, ca.vertcat(speed + period * (unknown + gain * given), unknown)


RIVAL = ValveAdrc
