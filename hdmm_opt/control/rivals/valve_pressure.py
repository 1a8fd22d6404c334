"""Cascade of a speed over a pressure that is measured: flow for the reference's speed, and for the pressure asked.

    p_d = (m v_d' + K_w (v_d - v) + y) / A,   y' = (K_w / T_i) (v_d - v),   q u = A v_d + (V / 4 B) K_p (p_d - p) + c p

What is left on one valve of the robust control of decentralised valve structures (Schwarz et al. 2024), which sets
meter-in and meter-out apart. It knows mass, area, oil and leakage of the nominal plant, and measures the pressure
without error: more than the other laws do. K_p below a quarter of the valve's bandwidth keeps the inner loop stable.

References:
    Schwarz et al. (2024), Robust identification and control of mobile hydraulic systems using a decentralized valve
    structure, Control Engineering Practice 151, 106030: a port of the family.
"""

from __future__ import annotations

from typing import Any, ClassVar

from ...plants import Plant
from ..law import GainSpec
from .metering import Command, Metering
from .rival import frozen, searched

#: Parameters that it knows.
KNOWN = ("reduction", "displacement", "wheel_radius", "wheel_mass", "bulk_modulus", "line_volume", "rated_flow")


class ValvePressure(Metering):
    """The law for one plant."""

    NAME = "dvsc"
    NEEDS = "meters oil for a speed and a pressure: it needs a wheel with a hydraulic motor behind a compensated valve"
    GAINS: ClassVar[tuple[GainSpec, ...]] = (
        searched("K_w", "N s/m", "force for an error of speed", 100.0, 3e5),
        searched("T_i", "s", "integral time of the speed", 1e-4, 3.0),
        searched("K_p", "1/s", "bandwidth of the pressure", 0.3, 100.0),
    )

    @classmethod
    def suits(cls, plant: Plant) -> bool:
        """A wheel of which it knows the oil."""
        return super().suits(plant) and "pressure" in plant.states and set(KNOWN) <= set(plant.parameters)

    @property
    def states(self) -> int:
        """The integral."""
        return 1

    def feedback(self, x: dict[str, Any], r: Any, z: Any, gains: Any, command: Command, nominal: dict[str, Any],
                 period: float) -> tuple[Any, Any]:  # fmt: skip
        """The command, and the integral after a period."""
        force, time, inner = (gains[k] for k in range(3))
        area = nominal["reduction"] * nominal["displacement"] / nominal["wheel_radius"]
        soft = nominal["line_volume"] / (4 * nominal["bulk_modulus"])
        error = r[0] - x["speed"]
        asked = (nominal["wheel_mass"] * r[1] + force * error + z[0]) / area
        wanted = (soft * inner * (asked - x["pressure"]) + nominal["leakage"] * x["pressure"]) / nominal["rated_flow"]
        value, given = command(wanted)
        return value, z[0] + frozen(wanted, given, period * force / time * error)


RIVAL = ValvePressure
