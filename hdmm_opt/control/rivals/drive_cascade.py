"""The cascade that servo drives carry: proportional position loop, PI speed loop, feedforward of speed and torque.

    v_set = q_d' + K_v (q_d - q),   e = v_set - q',   a = ω_s (e + y) + η q_d'',   y' = e / T_i

a is an acceleration, which the nominal inertia turns into a torque; the integral is frozen while it would push the
limited torque further outwards. Bandwidths a factor of four apart, K_v : ω_s, and T_i = 4/ω_s are what is taught; all
four are tuned here like the gains of every rival. Stable for a rigid axis, a fast current loop and gains far below the
sampling rate; no bound on the error is claimed.

References:
    Groß, Hamann and Wiegärtner (2001), Electrical feed drives in automation, for structure and ratios; Åström and
    Hägglund (2006), Advanced PID control, for the frozen integral.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ..law import GainSpec
from .cascade import Cascade, Command
from .rival import frozen, searched


class DriveCascade(Cascade):
    """The law for one plant."""

    NAME = "drive-cascade"
    OUTER: ClassVar[tuple[GainSpec, ...]] = (
        searched("K_v", "1/s", "proportional gain of the position", 2.0, 200.0),
        searched("omega_s", "1/s", "bandwidth of the speed loop", 10.0, 1000.0),
        searched("T_i", "s", "integral time of the speed loop", 1e-3, 1.0),
        searched("eta", "1", "share of the nominal inertia in the feedforward", 0.05, 1.5),
    )

    @property
    def states(self) -> int:
        """The integral of the speed's error over T_i."""
        return 1

    def outer(self, x: Any, r: Any, z: Any, gains: Any, command: Command, period: float) -> tuple[Any, Any]:
        """The command, and the integral after a period."""
        position, speed, time, share = (gains[k] for k in range(4))
        error = r[1] + position * (r[0] - x[0]) - x[1]
        wanted = speed * (error + z[0]) + share * self.ahead(r)
        value, given = command(wanted)
        return value, z[0] + period / time * frozen(wanted, given, error)


RIVAL = DriveCascade
