"""Adaptive backstepping of a speed over a pressure that is measured, with a bound that it learns.

    z = v - v_d,   A p_d = m v_d' - K_1 z - θ z / (|z| + d),   θ' = g_1 (|z| - s θ)
    q u = A v_d + c p - (V / 4 B) K_2 (p - p_d)

The region of Zhang et al. in which no error counts is of width zero here. It knows mass, area, oil and leakage of the
nominal plant, and measures the pressure without error: more than the other laws do. Ultimately bounded in continuous
time; sampled, θ T / (m d) must be far below one.

References:
    Zhang et al. (2017), Backstepping based adaptive region tracking fault tolerant control for autonomous underwater
    vehicles, Journal of Navigation 70(1), 184-204: a port of the family.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...plants import Plant
from ..law import GainSpec
from .metering import Command, Metering
from .rival import searched
from .valve_pressure import KNOWN

#: Speed over which the learned force turns round, m/s, and the leakage of what is learned, m/s per N.
SMALL, FORGETS = 5e-3, 1e-7


class ValveBackstepping(Metering):
    """The law for one plant."""

    NAME = "bac"
    NEEDS = "meters oil for a speed and a pressure: it needs a wheel with a hydraulic motor behind a compensated valve"
    GAINS: ClassVar[tuple[GainSpec, ...]] = (
        searched("K_1", "N s/m", "force for an error of speed", 100.0, 3e5),
        searched("K_2", "1/s", "bandwidth of the pressure", 0.3, 100.0),
        searched("g_1", "N/m", "rate of learning", 1e2, 1e9),
    )

    @classmethod
    def suits(cls, plant: Plant) -> bool:
        """A wheel of which it knows the oil."""
        return super().suits(plant) and "pressure" in plant.states and set(KNOWN) <= set(plant.parameters)

    @property
    def states(self) -> int:
        """The learned bound on the force."""
        return 1

    def feedback(self, x: dict[str, Any], r: Any, z: Any, gains: Any, command: Command, nominal: dict[str, Any],
                 period: float) -> tuple[Any, Any]:  # fmt: skip
        """The command, and the learned bound after a period."""
        import casadi as ca

        outer, inner, learning = (gains[k] for k in range(3))
        area = nominal["reduction"] * nominal["displacement"] / nominal["wheel_radius"]
        soft = nominal["line_volume"] / (4 * nominal["bulk_modulus"])
        error = x["speed"] - r[0]
        size = ca.fabs(error)
        asked = (nominal["wheel_mass"] * r[1] - outer * error - z[0] * error / (size + SMALL)) / area
        wanted = (soft * inner * (asked - x["pressure"]) + nominal["leakage"] * x["pressure"]) / nominal["rated_flow"]
        value, _ = command(wanted)
        return value, z[0] + period * learning * (size - FORGETS * z[0])


RIVAL = ValveBackstepping
