"""A hydraulic cylinder behind a valve that meters its oil, with equal areas on both sides.

x' = v,    m v' = A p - friction(v) - F,    (V / 4 B) p' = k y sqrt(p_s - sgn(y) p) - A v - c p,    T y' = u - y

A rod that is driven in speed has no first row. Its law acts from the speed on the valve, and the pressure is a mode
that in the motion asked for carries F, the inertia of the load and the friction of a rod that moves forwards.
"""

from __future__ import annotations

from collections.abc import Mapping

from .hydraulics import FRICTION, LINE, SENSORS, VALVES, Row, friction, line, ordered, spool, valve_flow
from .parameter import Parameter
from .plant import Limit, Plant
from .registry import PlantModel

CYLINDER = {
    "load_mass": Parameter(value=800.0, unit="kg", tolerance=0.1, meaning="mass that moves with the rod"),
    "area": Parameter(value=2e-3, unit="m^2", meaning="area of the piston"),
}
LIMITS = (
    Limit(name="valve", signals=("valve_command",), value=1.0, unit="1", source="derived"),
    Limit(name="speed", signals=("speed",), value=0.4, unit="m/s", source="assumed"),
    Limit(name="pressure", signals=("pressure",), value=17e6, unit="Pa", source="assumed"),
)


def defaults(level: str) -> dict[str, Parameter]:
    """The parameters with units, tolerances and sources."""
    return {**CYLINDER, **FRICTION, **LINE, **VALVES[level]}


def hydraulic_cylinder(
    level: str, parameters: Mapping[str, Parameter] | None = None, rated: Mapping[str, Parameter] | None = None,
    *, sensor: str,
) -> Plant:  # fmt: skip
    """Build the symbolic model.

    Args:
        level: "valve" (u is the opening that the spool is to have, -1 … 1) or "flow" (u is the flow that a compensated
            valve is to keep, as a share of its rated flow).
        parameters: Replacements for `defaults(level)`.
        rated: Nothing: all numbers are read.
        sensor: "pressure" where the rod is driven in position and position, speed, pressure and opening are measured,
            "speed" where it is driven in speed, as with a joystick, and nothing else is measured.

    Returns:
        The plant: states position, speed, pressure, opening of the valve, or speed, opening, pressure; its first state
        is then a speed.

    References:
        Merritt (1967), ch. 6.

    Not guaranteed: dead band and slew of the valve, unequal areas, the stroke's effect on the oil's stiffness
        and cavitation are not modelled; relief valves only in simulation.
    """
    import casadi as ca

    known = {**defaults(level), **(parameters or {})}
    names = ("position", "speed", "pressure", "opening", "u", "w")
    place, v, pressure, opening, u, w = (ca.SX.sym(name) for name in names)
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    q = {name: p[k] for k, name in enumerate(known)}
    pushed, flow = q["area"] * pressure, valve_flow(opening, pressure, q)
    rod = Row(place, "m", 1, v), Row(v, "m/s", q["load_mass"], pushed - friction(v, q) - w)
    rows = ordered(rod, line(pressure, flow, q["area"] * v, q), spool(opening, u, q), sensor=sensor)
    return Plant(
        name="hydraulic_cylinder", level=level, inputs=("valve_command",), input_unit="1",
        disturbances=("load_force",), parameters=known, u=u, w=w, p=p, **rows, limits=LIMITS,
        carried="load_mass", first="speed" if sensor == "speed" else "position",
        stroke=(-0.4, 0.4) if sensor == "speed" else (0.0, 0.8),
        outputs={"rod_force": pushed, "flow": flow, "power": pushed * v},
        output_units={"rod_force": "N", "flow": "m^3/s", "power": "W"},
    )  # fmt: skip


PLANT = PlantModel(levels=tuple(VALVES), defaults=defaults, build=hydraulic_cylinder, sensors=SENSORS)
