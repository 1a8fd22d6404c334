"""A wheel with a hydraulic motor in it, behind a valve (publications P-2, P-5, P-12), in coordinates of its rim.

    m v' = eta^s A p - friction(v) - F,    (V / 4 B) p' = k x sqrt(p_s - sgn(x) p) - A v - c p,    T x' = u - x

A = n D / r is the area that a motor of displacement D per radian behind a reducer of ratio n stands for at the rim of a
wheel of radius r. Its torque is eta times the ideal one where it drives and 1/eta times where it brakes: s is the sign
of p v, smoothed over a small power. F is what the ground asks of the rim, and roughness what it asks besides, of any
course. Without a sensor of pressure the law acts from the speed on the valve, and the pressure is a mode that in the
motion asked for carries F, the inertia of the wheel and the friction of one that rolls forwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .hydraulics import FRICTION, LINE, POWER, SENSORS, VALVES, Row, friction, line, ordered, spool, valve_flow
from .parameter import Parameter
from .plant import Limit, Plant
from .registry import PlantModel

WHEEL = {
    "wheel_radius": Parameter(value=0.427, unit="m", source="table", meaning="radius of the wheel"),
    "reduction": Parameter(value=17.7, unit="1", source="table", meaning="turns of the motor per turn of the wheel"),
    "displacement": Parameter(
        value=1.5915e-5, unit="m^3/rad", source="derived", meaning="oil per radian of the motor: 100 cm³ per turn"
    ),
    "efficiency": Parameter(value=0.91, unit="1", meaning="torque of the motor over the ideal one where it drives"),
    "wheel_mass": Parameter(value=110.0, unit="kg", tolerance=0.18, meaning="what turns, as a mass at the rim"),
}
#: A force beyond any of these, N.
LARGE = 1e9
LIMITS = (
    Limit(name="valve", signals=("valve_command",), value=1.0, unit="1", source="derived"),
    Limit(name="speed", signals=("speed",), value=1.0, unit="m/s", source="derived"),
    Limit(name="pressure", signals=("pressure",), value=17e6, unit="Pa", source="assumed"),
)


def defaults(level: str) -> dict[str, Parameter]:
    """The parameters with units, tolerances and sources."""
    return {**WHEEL, **FRICTION, **LINE, **VALVES[level]}


def area(q: Mapping[str, Any]) -> Any:
    """N D / r: oil per travel of the rim, m²."""
    return q["reduction"] * q["displacement"] / q["wheel_radius"]


def drive_force(v: Any, pressure: Any, q: Mapping[str, Any]) -> Any:
    """What the motor pushes the rim with, N."""
    import casadi as ca

    side, eta = ca.tanh(pressure * v * (area(q) / POWER)), q["efficiency"]
    # a proof keeps the smaller factor and takes the range of the larger one: the direction is to be that one
    return area(q) * (pressure * ((eta + 1 / eta) / 2)) - (area(q) * pressure / LARGE) * (
        LARGE * side * ((1 / eta - eta) / 2)
    )


def hydraulic_wheel(
    level: str, parameters: Mapping[str, Parameter] | None = None, rated: Mapping[str, Parameter] | None = None,
    *, sensor: str,
) -> Plant:  # fmt: skip
    """Build the symbolic model.

    Args:
        level: "valve" (u is the opening that the spool is to have, -1 … 1) or "flow" (u is the flow that a compensated
            valve is to keep, as a share of its rated flow).
        parameters: Replacements for `defaults(level)`.
        rated: Nothing: all numbers are read.
        sensor: "pressure" where that is measured beside speed and opening, "speed" where it is not.

    Returns:
        The plant: speed of the rim, pressure and opening of the valve as states, in the order in which they follow each
        other; its first state is a speed.

    References:
        Heydari Shahna (2025), publications P-2, P-5 and P-12; Merritt (1967), ch. 6, for valve and motor.

    Not guaranteed: dead band and slew of the valve, the dynamics of the supply and cavitation are not modelled, and
        relief valves only in simulation: limits keep the motion away from them. The tyre is not part of it: its force
        is the load.
    """
    import casadi as ca

    known = {**defaults(level), **(parameters or {})}
    v, pressure, opening, u = (ca.SX.sym(name) for name in ("speed", "pressure", "opening", "u"))
    w = ca.SX.sym("w", 2)
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    q = {name: p[k] for k, name in enumerate(known)}
    pushed, flow = drive_force(v, pressure, q), valve_flow(opening, pressure, q)
    rim = Row(v, "m/s", q["wheel_mass"], pushed - friction(v, q) - w[0] - w[1])
    rows = ordered([rim], line(pressure, flow, area(q) * v, q), spool(opening, u, q), sensor=sensor)
    return Plant(
        name="hydraulic_wheel", level=level, inputs=("valve_command",), input_unit="1",
        disturbances=("traction", "roughness"), parameters=known, u=u, w=w, p=p, **rows,
        limits=LIMITS, stroke=(-1.0, 1.0), first="speed", carried="wheel_mass",
        outputs={
            "wheel_torque": q["wheel_radius"] * pushed, "line_pressure": pressure, "flow": flow, "power": pushed * v
        },
        output_units={"wheel_torque": "N m", "line_pressure": "Pa", "flow": "m^3/s", "power": "W"},
    )  # fmt: skip


PLANT = PlantModel(levels=tuple(VALVES), defaults=defaults, build=hydraulic_wheel, sensors=SENSORS)
