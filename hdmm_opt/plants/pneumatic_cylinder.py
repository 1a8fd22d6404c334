"""A pneumatic cylinder behind a fast valve whose flow is choked, with equal areas on both sides.

    x' = v,    m v' = A p - friction(v) - F,    (V / 2 n p_0) p' = q u - A v - c p

p is the difference of the pressures of both chambers around their mean p_0, V the air of one chamber, n the polytropic
exponent: what goes into one chamber leaves the other, so that their difference changes twice. A choked edge lets so
much air through as its opening says, whatever is behind it (ISO 6358).
"""

from __future__ import annotations

from collections.abc import Mapping

from .hydraulics import FRICTION, friction
from .parameter import Parameter
from .plant import Limit, Plant
from .registry import PlantModel

AIR = {
    "load_mass": Parameter(value=20.0, unit="kg", tolerance=0.1, meaning="mass that moves with the rod"),
    "area": Parameter(value=2e-3, unit="m^2", meaning="area of the piston"),
    "chamber": Parameter(value=4e-4, unit="m^3", tolerance=0.2, meaning="air of a chamber in the middle of the stroke"),
    "mean_pressure": Parameter(value=4e5, unit="Pa", tolerance=0.05, meaning="mean pressure of both chambers"),
    "exponent": Parameter(value=1.2, unit="1", tolerance=0.16, meaning="from isothermal to adiabatic"),
    "flow_gain": Parameter(value=2e-3, unit="m^3/s", tolerance=0.1, meaning="choked flow of the whole opening"),
    "leakage": Parameter(loss=True, value=1e-9, unit="m^4 s/kg", tolerance=0.5, meaning="leakage across the piston"),
}
#: Seals of a small cylinder.
SEALS = {
    "stribeck_speed": FRICTION["stribeck_speed"],
    "coulomb_friction": Parameter(loss=True, value=20.0, unit="N", tolerance=0.3, meaning="Coulomb friction"),
    "stribeck_friction": Parameter(loss=True, value=8.0, unit="N", tolerance=0.3, meaning="more at standstill"),
    "viscous_friction": Parameter(loss=True, value=60.0, unit="N s/m", tolerance=0.3, meaning="viscous friction"),
}
LIMITS = (
    Limit(name="valve", signals=("opening",), value=1.0, unit="1", source="derived"),
    Limit(name="speed", signals=("speed",), value=0.8, unit="m/s", source="assumed"),
    Limit(name="pressure", signals=("pressure",), value=3e5, unit="Pa", source="assumed"),
)


def defaults(level: str) -> dict[str, Parameter]:
    """The parameters with units, tolerances and sources."""
    return {**AIR, **SEALS}


def pneumatic_cylinder(
    level: str, parameters: Mapping[str, Parameter] | None = None, rated: Mapping[str, Parameter] | None = None
) -> Plant:
    """Build the symbolic model.

    Args:
        level: "valve" (u is the opening of the valve, -1 … 1).
        parameters: Replacements for `defaults(level)`.
        rated: Nothing: all numbers are read.

    Returns:
        The plant: states position, speed, pressure.

    Not guaranteed: the valve is there at once; flow that is not choked, temperatures, and chambers that change with the
        stroke are ranges of numbers and no dynamics.
    """
    import casadi as ca

    known = {**defaults(level), **(parameters or {})}
    x, u, w = ca.SX.sym("x", 3), ca.SX.sym("u"), ca.SX.sym("w")
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    q = {name: p[k] for k, name in enumerate(known)}
    pushed = q["area"] * x[2]
    return Plant(
        name="pneumatic_cylinder", level=level, states=("position", "speed", "pressure"),
        state_units=("m", "m/s", "Pa"), inputs=("opening",), input_unit="1", disturbances=("load_force",),
        parameters=known, targets=("reference", 0, 1), controlled=(True, True, True), input_map=(2,),
        x=x, u=u, w=w, p=p,
        mass=ca.vertcat(1, q["load_mass"], q["chamber"] / (2 * q["exponent"] * q["mean_pressure"])),
        force=ca.vertcat(
            x[1], pushed - friction(x[1], q) - w[0],
            q["flow_gain"] * u[0] - q["area"] * x[1] - q["leakage"] * x[2],
        ),
        limits=LIMITS, stroke=(0.0, 0.4), carried="load_mass", outputs={"rod_force": pushed, "power": pushed * x[1]},
        output_units={"rod_force": "N", "power": "W"},
    )  # fmt: skip


PLANT = PlantModel(levels=("valve",), defaults=defaults, build=pneumatic_cylinder)
