"""A hydraulic cylinder behind a valve that meters its oil, with equal areas on both sides.

x' = v,    m v' = A p - friction(v) - F,    (V / 4 B) p' = k y sqrt(p_s - sgn(y) p) - A v - c p,    T y' = u - y
"""

from __future__ import annotations

from collections.abc import Mapping

from .hydraulics import FRICTION, LINE, RELIEF, VALVES, compliance, friction, valve_flow
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
    level: str, parameters: Mapping[str, Parameter] | None = None, rated: Mapping[str, Parameter] | None = None
) -> Plant:
    """Build the symbolic model.

    Args:
        level: "valve" (u is the opening that the spool is to have, -1 … 1) or "flow" (u is the flow that a compensated
            valve is to keep, as a share of its rated flow).
        parameters: Replacements for `defaults(level)`.
        rated: Nothing: all numbers are read.

    Returns:
        The plant: states position, speed, pressure, opening of the valve.

    References:
        Merritt (1967), ch. 6.

    Not guaranteed: dead band and slew of the valve, unequal areas, the stroke's effect on the oil's stiffness
        and cavitation are not modelled; relief valves only in simulation.
    """
    import casadi as ca

    known = {**defaults(level), **(parameters or {})}
    x, u, w = ca.SX.sym("x", 4), ca.SX.sym("u"), ca.SX.sym("w")
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    q = {name: p[k] for k, name in enumerate(known)}
    pushed, flow = q["area"] * x[2], valve_flow(x[3], x[2], q)
    return Plant(
        name="hydraulic_cylinder", level=level, states=("position", "speed", "pressure", "opening"),
        state_units=("m", "m/s", "Pa", "1"), inputs=("valve_command",), input_unit="1", disturbances=("load_force",),
        parameters=known, targets=("reference", 0, 1, 2), controlled=(True, True, True, False), input_map=(2,),
        x=x, u=u, w=w, p=p, mass=ca.vertcat(1, q["load_mass"], compliance(q), q["valve_lag"]),
        force=ca.vertcat(
            x[1], pushed - friction(x[1], q) - w[0], flow - q["area"] * x[1] - q["leakage"] * x[2], u[0] - x[3]
        ),
        relief={"pressure": RELIEF}, limits=LIMITS, stroke=(0.0, 0.8), carried="load_mass",
        outputs={"rod_force": pushed, "flow": flow, "power": pushed * x[1]},
        output_units={"rod_force": "N", "flow": "m^3/s", "power": "W"},
    )  # fmt: skip


PLANT = PlantModel(levels=tuple(VALVES), defaults=defaults, build=hydraulic_cylinder)
