"""PI control of a speed behind an inverted valve map, with its integral frozen at the limit.

    u = u_flow(v_d) + K_p (v_d - v) + y,   y' = (K_p / T_i) (v_d - v)

Industrial practice for wheel and winch drives: the flow that the speed takes is fed forward through the valve's
characteristic. Stable for gains far below what the hydraulic mode and the valve leave, K_p / T_i < 2 zeta omega of the
mode; no bound on the error is claimed.

References:
    Merritt (1967), Hydraulic control systems, ch. 6 and 8; Åström and Hägglund (2006), Advanced PID control.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ..law import GainSpec
from .metering import Command, Metering
from .rival import frozen, searched


class ValvePI(Metering):
    """The law for one plant."""

    NAME = "valve-pi"
    GAINS: ClassVar[tuple[GainSpec, ...]] = (
        searched("K_p", "s/m", "proportional gain of the speed", 1e-3, 3.0),
        searched("T_i", "s", "integral time", 1e-4, 3.0),
    )

    @property
    def states(self) -> int:
        """The integral."""
        return 1

    def feedback(self, x: dict[str, Any], r: Any, z: Any, gains: Any, command: Command, nominal: dict[str, Any],
                 period: float) -> tuple[Any, Any]:  # fmt: skip
        """The command, and the integral after a period."""
        gain, time = gains[0], gains[1]
        error = r[0] - x["speed"]
        wanted = gain * error + z[0]
        value, given = command(wanted)
        return value, z[0] + frozen(wanted, given, period * gain / time * error)


RIVAL = ValvePI
