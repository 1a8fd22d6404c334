"""Sliding mode control on a time-delay estimate of everything unknown, of a speed alone.

    s = v - v_d + c ∫ (v - v_d),   u = u_- + (v_d' - a - c (v - v_d) - k s - h sat(s / w)) / b,   a = filtered v'

u_- is the last feedback: with the last acceleration it stands for load, friction, pressure and all else (Youcef-Toumi
and Ito 1990). Needs b above half of the plant's gain; bounded errors in a boundary layer of width w in continuous time.
The acceleration is a difference of speeds behind a low pass, which amplifies noise and lags.

References:
    Youcef-Toumi and Ito (1990), A time delay controller for systems with unknown dynamics, ASME Journal of Dynamic
    Systems, Measurement, and Control 112(1), 133-142; Truong et al. (2022), Journal of Drive and Control 19(1), 51, for
    backstepping with it on electro-hydraulic systems, of which this is a port for one measured state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from ..law import GainSpec
from .metering import Command, Metering
from .rival import searched


class ValveSliding(Metering):
    """The law for one plant."""

    NAME = "bsmc-tde"
    GAINS: ClassVar[tuple[GainSpec, ...]] = (
        searched("b", "m/s^2", "gain of the command that the estimate takes", 1.0, 1e4),
        searched("c", "1/s", "slope of the sliding surface", 0.1, 50.0),
        searched("k", "1/s", "rate of approach", 0.1, 100.0),
        searched("h", "m/s^2", "gain of the sign", 1e-3, 10.0),
        searched("w", "m/s", "width of the boundary layer", 1e-3, 0.1),
        searched("T_f", "s", "time of the filter of the acceleration", 1e-3, 0.1),
    )

    @property
    def states(self) -> int:
        """Last feedback, last speed, filtered acceleration, integral of the error."""
        return 4

    def start(self, x: Sequence[float], gains: Sequence[float]) -> list[float]:
        """At the first speed."""
        return [0.0, float(x[0]), 0.0, 0.0]

    def feedback(self, x: dict[str, Any], r: Any, z: Any, gains: Any, command: Command, nominal: dict[str, Any],
                 period: float) -> tuple[Any, Any]:  # fmt: skip
        """The command, and the states after a period."""
        import casadi as ca

        gain, slope, rate, sign, width, time = (gains[k] for k in range(6))
        error = x["speed"] - r[0]
        moving = z[2] + period / (period + time) * ((x["speed"] - z[1]) / period - z[2])
        sliding = error + slope * z[3]
        side = ca.fmin(ca.fmax(sliding / width, -1), 1)
        asked = z[0] + (r[1] - moving - slope * error - rate * sliding - sign * side) / gain
        value, given = command(asked)
        held = ca.fabs(asked - given) > 1e-9
        return value, ca.vertcat(given, x["speed"], moving, z[3] + ca.if_else(held, 0, period * error))


RIVAL = ValveSliding
