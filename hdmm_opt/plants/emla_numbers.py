"""The bundled EMLA in numbers: parameters, ratings and limits, with their sources; a study replaces any of them."""

from __future__ import annotations

import math

from .parameter import EFFECTIVENESS, Parameter, effectiveness
from .plant import Limit

_FLUX = 0.134 * math.sqrt(2.0)

MECHANICAL = {
    "screw_lead": Parameter(value=0.016, unit="m", source="table", meaning="travel of the rod per turn of the screw"),
    "screw_diameter": Parameter(
        value=0.064,
        unit="m",
        source="derived",
        meaning="pitch diameter of the screw",
    ),
    "gear_ratio": Parameter(value=7.7, unit="1", source="table", meaning="turns of the motor per turn of the screw"),
    "screw_friction": Parameter(
        loss=True,
        value=0.0065,
        unit="1",
        tolerance=0.54,
        source="table",
        meaning="friction coefficient of the screw, 0.003-0.01",
    ),
    "gear_loss": Parameter(loss=True, value=0.02, unit="1", tolerance=0.5, meaning="share of torque lost in the gear"),
    "motor_inertia": Parameter(value=0.012, unit="kg m^2", tolerance=0.1, meaning="rotor, gear and screw inertia"),
    "viscous_friction": Parameter(
        loss=True, value=0.01, unit="N m s/rad", tolerance=0.3, meaning="viscous friction at the motor"
    ),
    "coulomb_friction": Parameter(
        loss=True, value=300.0, unit="N", tolerance=0.5, meaning="Coulomb friction of the rod"
    ),
    "friction_speed": Parameter(value=0.002, unit="m/s", meaning="speed over which Coulomb friction builds up"),
    "power_scale": Parameter(value=100.0, unit="W", meaning="power over which the screw's loss changes direction"),
    "load_mass": Parameter(value=2000.0, unit="kg", tolerance=0.2, meaning="mass that moves with the rod"),
}
#: What a study may add: friction that is larger at standstill. Without it nothing of the plant reads them.
STRIBECK = {
    "stribeck_friction": Parameter(
        loss=True, value=0.0, unit="N", tolerance=0.5, meaning="friction beyond Coulomb's before the rod slides"
    ),
    "stribeck_speed": Parameter(value=0.01, unit="m/s", meaning="speed at which half of that is left"),
}
TORQUE = {
    "torque_scale": Parameter(value=1.0, unit="1", tolerance=0.03, meaning="torque delivered per torque commanded"),
    "drive_lag": Parameter(value=0.0003, unit="s", tolerance=0.2, meaning="time constant of the drive's current loop"),
    EFFECTIVENESS: effectiveness(1.0),
}
MOTOR = {
    "pole_pairs": Parameter(value=4.0, unit="1", source="table", meaning="pole pairs of the motor"),
    "torque_constant": Parameter(
        value=6 * _FLUX, unit="N m/A", tolerance=0.03, source="derived",
        meaning="torque per ampere of amplitude: that per ampere RMS divided by sqrt(2)",
    ),
    "resistance": Parameter(value=0.08, unit="ohm", tolerance=0.2, source="table", meaning="phase resistance"),
    "inductance": Parameter(value=0.00242, unit="H", tolerance=0.05, source="table", meaning="phase inductance"),
}  # fmt: skip
RATED = {
    "rated_torque": Parameter(
        value=37.1, unit="N m", source="derived", meaning="torque that it may deliver all the time"
    ),
    "rated_current": Parameter(
        value=23.1 * math.sqrt(2.0),
        unit="A",
        source="table",
        meaning="current that it may carry all the time, amplitude",
    ),
    "peak_current": Parameter(
        value=48.2 * math.sqrt(2.0), unit="A", source="table", meaning="largest current, amplitude"
    ),
}
PEAK = {"peak_torque": Parameter(value=77.0, unit="N m", source="table", meaning="largest torque of the motor")}
#: Peaks of the bundled motor, for limits that a study does not give.
_SPEED = 3877.0 / 60.0 * 0.016 / 7.7
LIMITS = {
    "torque": Limit(name="torque", signals=("torque_command",), value=77.0, unit="N m", source="table"),
    "voltage": Limit(
        name="voltage", signals=("u_q", "u_d"), value=380.0 * math.sqrt(2.0 / 3.0), unit="V", source="derived"
    ),
    "current": Limit(name="current", signals=("i_q", "i_d"), value=48.2 * math.sqrt(2.0), unit="A", source="derived"),
    "speed": Limit(name="speed", signals=("speed",), value=_SPEED, unit="m/s", source="derived"),
}
STROKE = (0.0, 0.6)
