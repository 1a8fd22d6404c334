"""PMSM-driven electromechanical linear actuator (EMLA): motor, gear, screw, load (publications P-1, P-2, P-4, P-6).

Amplitude-invariant Park frame, L_d = L_q. With transmission r = screw lead / (2 pi · gear ratio), motor speed x'/r and
torque constant k = 3/2 · pole pairs · psi:

    (J/r + r m) x'' (1 + rho s l) = tau - B x'/r - r (1 + s l)(F_load + F_friction),   rho = r m / (J/r + r m)
    L i_q' = u_q - R i_q - L w_e i_d - 2/3 k x'/r,    L i_d' = u_d - R i_d + L w_e i_q,   w_e = pole pairs · x'/r

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

from .emla_numbers import LIMITS, MECHANICAL, MOTOR, PEAK, RATED, STRIBECK, STROKE, TORQUE
from .parameter import EFFECTIVENESS, Parameter
from .plant import Efforts, Plant
from .registry import PlantModel

OUTPUT_UNITS = {"torque": "N m", "current": "A", "power": "W"}

LEVELS = ("torque", "voltage")


def defaults(level: str) -> dict[str, Parameter]:
    """The parameters of an input level, with units, tolerances and sources.

    Raises:
        ValueError: unknown level.
    """
    if level not in LEVELS:
        raise ValueError(f'plant.level is "torque" or "voltage": got "{level}"')
    return {**MECHANICAL, **(TORQUE if level == "torque" else MOTOR)}


def parameters_of(level: str) -> dict[str, Parameter]:
    """`defaults`, and what a study may add."""
    return {**defaults(level), **STRIBECK}


def completed(known: Mapping[str, Parameter], given: Mapping[str, Parameter] | None) -> dict[str, Parameter]:
    """Known parameters with replacements, and those of Stribeck's friction where one of them is given."""
    asked = STRIBECK if set(given or {}) & set(STRIBECK) else {}
    return {**known, **asked, **(given or {})}


def ratings(level: str) -> dict[str, Parameter]:
    """Numbers of the motor that the equations of a level do not read; its currents and voltages follow from them."""
    rated = {name: RATED[name] for name in ("rated_torque", "rated_current")}
    return {**MOTOR, **RATED} if level == "torque" else {**PEAK, **rated}


def transmission(values: Mapping[str, Any]) -> Any:
    """Travel of the rod per radian of the motor, m/rad.

    Args:
        values: Values of the parameters by name.
    """
    return values["screw_lead"] / (2 * math.pi * values["gear_ratio"])


def lead_angle_tangent(values: Mapping[str, Any]) -> Any:
    """Tangent of the screw's lead angle."""
    return values["screw_lead"] / (math.pi * values["screw_diameter"])


def pmsm_emla(
    level: str, parameters: Mapping[str, Parameter] | None = None, rated: Mapping[str, Parameter] | None = None
) -> Plant:
    """Build the symbolic model.

    Args:
        level: "torque" (u in N m, drive with its own current loop) or "voltage" (u_q, u_d in V).
        parameters: Replacements for `parameters_of(level)`.
        rated: Replacements for `ratings(level)`.

    Returns:
        The plant. Torque level: states position, speed, torque. Voltage level: position, speed, i_q, i_d, of which
        i_d couples into the i_q row against the strict-feedback order.

    References:
        Heydari Shahna (2025), publications P-1, P-2 and P-4; Krause et al. (2013), ch. 4, for the dq equations.

    Not guaranteed: backlash, cogging, saturation and thermal effects are not modelled; screw and gear are rigid, see
    `elastic_emla`.
    """
    known, motor = completed(defaults(level), parameters), {**ratings(level), **(rated or {})}
    return _torque_level(known, motor) if level == "torque" else _voltage_level(known, motor)


def friction_of(v: Any, q: Mapping[str, Any]) -> Any:
    """Friction at the rod, N: Coulomb's, and where it is given Stribeck's (Hess and Soom 1990)."""
    import casadi as ca

    size, direction = q["coulomb_friction"], ca.tanh(v / q["friction_speed"])
    if "stribeck_friction" not in q:
        return size * direction
    return (size + q["stribeck_friction"] / (1 + (v / q["stribeck_speed"]) ** 2)) * direction


def screw_loss(force: Any, v: Any, q: Mapping[str, Any]) -> Any:
    """S l: the share of a force that screw and gear need or hold in addition."""
    import casadi as ca

    direction = ca.tanh(force * v / q["power_scale"])
    return direction * (q["screw_friction"] / lead_angle_tangent(q) + q["gear_loss"])


def _mechanics(v: Any, torque: Any, load: Any, q: Mapping[str, Any]) -> tuple[Any, Any]:
    """M_2 and h_2."""
    r = transmission(q)
    mass = q["motor_inertia"] / r + r * q["load_mass"]
    force = load + friction_of(v, q)
    loss = screw_loss(force, v, q)
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
    current = torque / values["torque_constant"]
    return torque * (speed / transmission(values)) + 1.5 * values["resistance"] * current**2


def symbols(states: int, inputs: int, known: Mapping[str, Parameter]) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
    """Symbols of states, inputs, one load and parameters, and the last by name."""
    import casadi as ca

    x, u, w = ca.SX.sym("x", states), ca.SX.sym("u", inputs), ca.SX.sym("w", 1)
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    return x, u, w, p, {name: p[k] for k, name in enumerate(known)}


def _torque_level(known: Mapping[str, Parameter], motor: Mapping[str, Parameter]) -> Plant:
    import casadi as ca

    x, u, w, p, q = symbols(3, 1, known)
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
        limits=(LIMITS["torque"], LIMITS["speed"]),
        stroke=STROKE,
        ratings=motor,
        outputs={
            "torque": torque, "current": torque / motor["torque_constant"].value,
            "power": torque * x[1] / transmission(q),
        },
        output_units=OUTPUT_UNITS, carried="load_mass",
    )  # fmt: skip


def _voltage_level(known: Mapping[str, Parameter], motor: Mapping[str, Parameter]) -> Plant:
    import casadi as ca

    x, u, w, p, q = symbols(4, 2, known)
    turning = x[1] / transmission(q)
    electrical_speed = q["pole_pairs"] * turning
    torque = q["torque_constant"] * x[2]
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
            u[0] - resistance * x[2] - inductance * (electrical_speed * x[3]) - q["torque_constant"] * turning / 1.5,
            u[1] - resistance * x[3] + inductance * (electrical_speed * x[2]),
        ),
        limits=(LIMITS["voltage"], LIMITS["current"], LIMITS["speed"]),
        stroke=STROKE,
        ratings=motor,
        outputs={"torque": torque, "current": ca.norm_2(x[2:4]), "power": torque * turning},
        output_units=OUTPUT_UNITS, carried="load_mass",
    )  # fmt: skip


def effort(plant: Plant, loads: Sequence[float]) -> tuple[Any, Any]:
    """What a motion asks of the motor at nominal parameters and a constant load.

    Args:
        plant: An EMLA at either level.
        loads: Load on the rod, N. Shape (1,).

    Returns:
        Two CasADi functions of (position, speed, acceleration, jerk): the column of `EFFORTS`, and the electrical
        power in W. The current's rate is that of the acceleration torque; the rate of the friction torque is left out.
    """
    import casadi as ca

    known = {name: p.value for name, p in {**plant.ratings, **plant.parameters}.items()}
    x, v, a, j = (ca.SX.sym(name) for name in ("x", "v", "a", "j"))
    values = ca.SX([p.value for p in plant.parameters.values()])
    state = ca.vertcat(x, v, *[0] * (len(plant.states) - 2))
    demand = plant.demand(1, a, x=state, w=ca.SX(list(loads)), p=values)
    constant, r = known["torque_constant"], transmission(known)
    current = demand / constant if plant.level == "torque" else demand
    torque = current * constant
    inertia = known["motor_inertia"] / r + r * known["load_mass"]
    resistance, inductance = known["resistance"], known["inductance"]
    speed = known["pole_pairs"] * v / r
    u_q = resistance * current + inductance * (inertia / constant) * j + constant * (v / r) / 1.5
    u_d = -inductance * speed * current
    power = torque * v / r + 1.5 * resistance * current**2
    column = ca.vertcat(torque, -torque, current, -current, ca.sqrt(u_q**2 + u_d**2 + 1e-12))
    return ca.Function("effort", [x, v, a, j], [column]), ca.Function("power", [x, v, a, j], [power])


#: Torque, current and voltage of the motor.
EFFORTS = Efforts(
    names=("torque", "negative torque", "current", "negative current", "voltage"), units=("N m", "N m", "A", "A", "V"),
    limits=("torque_nm", "torque_nm", "current_a", "current_a", "voltage_v"), of=effort,
)  # fmt: skip

PLANT = PlantModel(levels=LEVELS, defaults=parameters_of, build=pmsm_emla, ratings=ratings)
