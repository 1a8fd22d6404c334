"""PMSM-driven electromechanical linear actuator (EMLA): motor, gear, screw, load (publications P-1, P-2, P-4, P-6).

Amplitude-invariant Park frame, L_d = L_q. With transmission r = lead / (2 pi · gear ratio) and motor speed x'/r:

    (J/r + r m) x'' (1 + rho s l) = tau - B x'/r - r (1 + s l)(F_load + F_friction),   rho = r m / (J/r + r m)
    L i_q' = u_q - R i_q - L w_e i_d - psi w_e,    L i_d' = u_d - R i_d + L w_e i_q,   w_e = pole pairs · x'/r

The screw and the gear need 1 + s l times the ideal torque: s = +1 where the motor drives the load, -1 where the load
drives the motor, smoothed over a small power; l = mu / tan(lead angle) + gear loss. With mu = 0.003, 0.005 and 0.01,
1/(1 + l) and 1 - l are the driving and back-driving efficiencies of the screw (0.963/0.941/0.888; 0.962/0.937/0.874).
The direction is that of (F_load + F_friction) x', the inertia of the load is left out of that decision.

At torque level the drive closes its own current loop, seen as a lag: T tau' = e u - tau, e the effectiveness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from .parameter import EFFECTIVENESS, Parameter, effectiveness
from .plant import Efforts, Limit, Plant
from .registry import PlantModel

_LEAD_ANGLE = math.radians(4.55)

_MECHANICAL = {
    "transmission": Parameter(
        value=0.016 / (2 * math.pi * 7.7), unit="m/rad", source="derived", meaning="screw lead / (2 pi · gear ratio)"
    ),
    "lead_angle_tangent": Parameter(
        value=math.tan(_LEAD_ANGLE), unit="1", source="derived", meaning="tangent of the screw's lead angle, 4.55 deg"
    ),
    "screw_friction": Parameter(
        value=0.0065, unit="1", tolerance=0.54, source="table", meaning="friction coefficient of the screw, 0.003-0.01"
    ),
    "gear_loss": Parameter(value=0.02, unit="1", tolerance=0.5, meaning="share of torque lost in the gear"),
    "motor_inertia": Parameter(value=0.012, unit="kg m^2", tolerance=0.1, meaning="rotor, gear and screw inertia"),
    "viscous_friction": Parameter(value=0.01, unit="N m s/rad", tolerance=0.3, meaning="viscous friction at the motor"),
    "coulomb_friction": Parameter(value=300.0, unit="N", tolerance=0.5, meaning="Coulomb friction of the rod"),
    "friction_speed": Parameter(value=0.002, unit="m/s", meaning="speed over which Coulomb friction builds up"),
    "power_scale": Parameter(value=100.0, unit="W", meaning="power over which the screw's loss changes direction"),
    "load_mass": Parameter(value=2000.0, unit="kg", tolerance=0.2, meaning="mass that moves with the rod"),
}
_TORQUE = {
    "torque_scale": Parameter(value=1.0, unit="1", tolerance=0.03, meaning="torque delivered per torque commanded"),
    "drive_lag": Parameter(value=0.0003, unit="s", tolerance=0.2, meaning="time constant of the drive's current loop"),
    EFFECTIVENESS: effectiveness(1.0),
}
_VOLTAGE = {
    "flux": Parameter(
        value=0.134 * math.sqrt(2.0), unit="Wb", tolerance=0.03, source="derived", meaning="flux, amplitude"
    ),
    "resistance": Parameter(value=0.08, unit="ohm", tolerance=0.2, source="table", meaning="phase resistance"),
    "inductance": Parameter(value=0.00242, unit="H", tolerance=0.05, source="table", meaning="phase inductance"),
}
POLE_PAIRS = 4
TORQUE_CONSTANT = 1.5 * POLE_PAIRS * 0.134 * math.sqrt(2.0)
PEAK_CURRENT = 48.2 * math.sqrt(2.0)
RATED_CURRENT = 23.1 * math.sqrt(2.0)
PEAK_TORQUE = 77.0
PHASE_VOLTAGE = 380.0 * math.sqrt(2.0 / 3.0)
MAXIMUM_SPEED = 3877.0 / 60.0 * 0.016 / 7.7
STROKE = (0.0, 0.6)

#: Half the stroke at half the largest speed.
_OPERATING = (sum(STROKE) / 2, MAXIMUM_SPEED / 2)
_OUTPUT_UNITS = {"torque": "N m", "current": "A", "power": "W"}

LEVELS = ("torque", "voltage")


def defaults(level: str) -> dict[str, Parameter]:
    """The parameters of an input level, with units, tolerances and sources.

    Raises:
        ValueError: unknown level.
    """
    if level not in LEVELS:
        raise ValueError(f'plant.level is "torque" or "voltage": got "{level}"')
    return {**_MECHANICAL, **(_TORQUE if level == "torque" else _VOLTAGE)}


def pmsm_emla(level: str, parameters: Mapping[str, Parameter] | None = None) -> Plant:
    """Build the symbolic model.

    Args:
        level: "torque" (u in N m, drive with its own current loop) or "voltage" (u_q, u_d in V).
        parameters: Replacements for `defaults(level)`.

    Returns:
        The plant. Torque level: states position, speed, torque. Voltage level: position, speed, i_q, i_d, of which
        i_d couples into the i_q row against the strict-feedback order.

    References:
        Heydari Shahna (2025), publications P-1, P-2 and P-4; Krause et al. (2013), ch. 4, for the dq equations.

    Not guaranteed: backlash, screw and gear compliance, cogging, saturation and thermal effects are not modelled.
    """
    known = {**defaults(level), **(parameters or {})}
    return _torque_level(known) if level == "torque" else _voltage_level(known)


def _mechanics(v: Any, torque: Any, load: Any, q: Mapping[str, Any]) -> tuple[Any, Any]:
    """M_2 and h_2."""
    import casadi as ca

    r = q["transmission"]
    mass = q["motor_inertia"] / r + r * q["load_mass"]
    force = load + q["coulomb_friction"] * ca.tanh(v / q["friction_speed"])
    direction = ca.tanh(force * v / q["power_scale"])
    loss = direction * (q["screw_friction"] / q["lead_angle_tangent"] + q["gear_loss"])
    driving = torque - q["viscous_friction"] * (v / r) - r * force - r * (loss * force)
    # what is lost stands apart, so that in a proof the rest cancels against the law term by term
    slowed = loss * (r * q["load_mass"] / mass)
    return mass, driving - driving * (slowed / (1 + slowed))


def shaft_torque(force: Any, speed: Any, acceleration: Any, values: Mapping[str, Any]) -> Any:
    """Motor torque of a motion of the rod against a force, N m.

    Args:
        force: Force on the rod without its friction, N; inertia of what it moves included.
        speed: Speed of the rod, m/s.
        acceleration: Its acceleration, m/s².
        values: Values of the mechanical parameters by name; the load mass is not used.
    """
    inertia, driving = _mechanics(speed, 0.0, force, {**values, "load_mass": 0.0})
    return inertia * acceleration - driving


def steady_power(force: Any, speed: Any, values: Mapping[str, Any]) -> Any:
    """Electrical power at constant speed against a force, W; negative where the motor feeds back.

    Args:
        force: Force on the rod without its friction, N.
        speed: Speed of the rod, m/s.
        values: Values of the parameters of the voltage level by name.
    """
    torque = shaft_torque(force, speed, 0.0, values)
    current = torque / (1.5 * POLE_PAIRS * values["flux"])
    return torque * (speed / values["transmission"]) + 1.5 * values["resistance"] * current**2


def _symbols(states: int, inputs: int, known: Mapping[str, Parameter]) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
    import casadi as ca

    x, u, w = ca.SX.sym("x", states), ca.SX.sym("u", inputs), ca.SX.sym("w", 1)
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    return x, u, w, p, {name: p[k] for k, name in enumerate(known)}


_SPEED_LIMIT = Limit(name="speed", signals=("speed",), value=MAXIMUM_SPEED, unit="m/s", source="derived")


def _torque_level(known: Mapping[str, Parameter]) -> Plant:
    import casadi as ca

    x, u, w, p, q = _symbols(3, 1, known)
    torque = q["torque_scale"] * x[2]
    mass, force = _mechanics(x[1], torque, w[0], q)
    return Plant(
        name="pmsm_emla",
        level="torque",
        efforts=EFFORTS,
        states=("position", "speed", "torque"),
        state_units=("m", "m/s", "N m"),
        inputs=("torque_command",),
        input_unit="N m",
        disturbances=("load_force",),
        parameters=known,
        targets=("reference", 0, 1),
        controlled=(True, True, False),
        input_map=(1,),
        x=x, u=u, w=w, p=p,
        mass=ca.vertcat(1, mass, q["drive_lag"]),
        force=ca.vertcat(x[1], force, q[EFFECTIVENESS] * u[0] - x[2]),
        limits=(
            Limit(name="torque", signals=("torque_command",), value=PEAK_TORQUE, unit="N m", source="table"),
            _SPEED_LIMIT,
        ),
        stroke=STROKE,
        outputs={
            "torque": torque, "current": ca.fabs(torque) / TORQUE_CONSTANT, "power": torque * x[1] / q["transmission"]
        },
        output_units=_OUTPUT_UNITS, operating=(*_OPERATING, 0.0), carried="load_mass",
    )  # fmt: skip


def _voltage_level(known: Mapping[str, Parameter]) -> Plant:
    import casadi as ca

    x, u, w, p, q = _symbols(4, 2, known)
    electrical_speed = POLE_PAIRS * (x[1] / q["transmission"])
    torque = 1.5 * POLE_PAIRS * q["flux"] * x[2]
    mass, force = _mechanics(x[1], torque, w[0], q)
    resistance, inductance = q["resistance"], q["inductance"]
    return Plant(
        name="pmsm_emla",
        level="voltage",
        efforts=EFFORTS,
        states=("position", "speed", "i_q", "i_d"),
        state_units=("m", "m/s", "A", "A"),
        inputs=("u_q", "u_d"),
        input_unit="V",
        disturbances=("load_force",),
        parameters=known,
        targets=("reference", 0, 1, "zero"),
        controlled=(True, True, True, True),
        input_map=(2, 3),
        x=x, u=u, w=w, p=p,
        mass=ca.vertcat(1, mass, inductance, inductance),
        force=ca.vertcat(
            x[1],
            force,
            u[0] - resistance * x[2] - inductance * (electrical_speed * x[3]) - q["flux"] * electrical_speed,
            u[1] - resistance * x[3] + inductance * (electrical_speed * x[2]),
        ),
        limits=(
            Limit(name="voltage", signals=("u_q", "u_d"), value=PHASE_VOLTAGE, unit="V", source="derived"),
            Limit(name="current", signals=("i_q", "i_d"), value=PEAK_CURRENT, unit="A", source="derived"),
            _SPEED_LIMIT,
        ),
        stroke=STROKE,
        outputs={"torque": torque, "current": ca.norm_2(x[2:4]), "power": torque * x[1] / q["transmission"]},
        output_units=_OUTPUT_UNITS, operating=(*_OPERATING, 0.0, 0.0), carried="load_mass",
    )  # fmt: skip


def effort(plant: Plant, loads: Sequence[float]) -> tuple[Any, Any]:
    """What a motion asks of the motor at nominal parameters and a constant load.

    Args:
        plant: An EMLA at either level; electrical parameters that it lacks take their default values.
        loads: Load on the rod, N. Shape (1,).

    Returns:
        Two CasADi functions of (position, speed, acceleration, jerk): the column of `EFFORTS`, and the electrical
        power in W. The current's rate is that of the acceleration torque; the rate of the friction torque is left out.
    """
    import casadi as ca

    known = {**_VOLTAGE, **plant.parameters}
    x, v, a, j = (ca.SX.sym(name) for name in ("x", "v", "a", "j"))
    values = ca.SX([p.value for p in plant.parameters.values()])
    state = ca.vertcat(x, v, *[0] * (len(plant.states) - 2))
    demand = plant.demand(1, a, x=state, w=ca.SX(list(loads)), p=values)
    constant = 1.5 * POLE_PAIRS * known["flux"].value
    current = demand / constant if plant.level == "torque" else demand
    torque = current * constant
    inertia = known["motor_inertia"].value / known["transmission"].value
    inertia += known["transmission"].value * known["load_mass"].value
    resistance, inductance = known["resistance"].value, known["inductance"].value
    speed = POLE_PAIRS * v / known["transmission"].value
    u_q = resistance * current + inductance * (inertia / constant) * j + known["flux"].value * speed
    u_d = -inductance * speed * current
    power = torque * v / known["transmission"].value + 1.5 * resistance * current**2
    column = ca.vertcat(torque, -torque, current, -current, ca.sqrt(u_q**2 + u_d**2 + 1e-12))
    return ca.Function("effort", [x, v, a, j], [column]), ca.Function("power", [x, v, a, j], [power])


#: Torque, current and voltage of the motor.
EFFORTS = Efforts(
    names=("torque", "negative torque", "current", "negative current", "voltage"), units=("N m", "N m", "A", "A", "V"),
    limits=("torque_nm", "torque_nm", "current_a", "current_a", "voltage_v"), of=effort,
)  # fmt: skip

PLANT = PlantModel(levels=LEVELS, defaults=defaults, build=pmsm_emla)
