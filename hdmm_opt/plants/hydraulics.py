"""What hydraulic drives share: a valve that meters oil into a line, the line's pressure, and friction.

With p the difference of the pressures of both ports and x the opening of the valve, -1 … 1, the oil that goes in is

    Q = k x sqrt(p_s - sgn(x) p),  k = q / sqrt(2 p_N),      (V / 4 B) p' = Q - A v - c p,        T x' = u - x

for a symmetric valve and equal areas: two edges in series share p_s - sgn(x) p, and each lets q through at p_N; V is
the oil of both lines together and B its bulk modulus (Merritt 1967, ch. 6). sgn is smoothed over a small opening. A
valve with a pressure compensator keeps the flow that it is told instead, Q = q x.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .parameter import Parameter

#: What may be measured of a drive beside its first state: its speed alone, or pressure and opening too.
SENSORS = ("speed", "pressure")
#: Over which the flow turns round, a direction of a force shows, and friction builds up: sharp, and without a kink.
OPENING, POWER, SPEED = 0.02, 5.0, 0.005
COMPENSATED = {
    "valve_lag": Parameter(value=0.01, unit="s", tolerance=0.1, meaning="time constant of the valve"),
    "rated_flow": Parameter(
        value=40 / 6e4, unit="m^3/s", tolerance=0.05, source="table", meaning="flow of the whole opening: 40 l/min"
    ),
}
VALVE = {
    **COMPENSATED,
    "rated_pressure": Parameter(value=3.5e6, unit="Pa", source="table", meaning="pressure over one edge at that flow"),
    "supply_pressure": Parameter(value=20e6, unit="Pa", tolerance=0.05, meaning="pressure of the supply"),
}
#: How far relief valves open beyond the limit on the pressure, m³/s per Pa: 40 l/min at 2.7 MPa over it (assumed).
RELIEF = 2.5e-10
#: Levels of a valve: its opening is commanded, or the flow that a compensator then keeps whatever the pressure.
VALVES = {"valve": VALVE, "flow": COMPENSATED}
LINE = {
    "bulk_modulus": Parameter(value=1.1e9, unit="Pa", tolerance=0.273, meaning="bulk modulus of oil, air and hoses"),
    "line_volume": Parameter(value=5e-4, unit="m^3", meaning="oil between valve and motor, both lines"),
    "leakage": Parameter(
        loss=True,
        value=4.1e-12,
        unit="m^4 s/kg",
        tolerance=0.61,
        meaning="leakage across the motor: 3.3e-12, twice or half",
    ),
}
FRICTION = {
    "coulomb_friction": Parameter(loss=True, value=330.0, unit="N", tolerance=0.2, meaning="Coulomb friction"),
    "stribeck_friction": Parameter(
        loss=True, value=130.0, unit="N", tolerance=0.2, meaning="friction beyond Coulomb's at standstill"
    ),
    "stribeck_speed": Parameter(value=0.025, unit="m/s", meaning="speed at which half of that is left"),
    "viscous_friction": Parameter(loss=True, value=90.0, unit="N s/m", tolerance=0.3, meaning="viscous friction"),
}


def valve_flow(opening: Any, pressure: Any, q: Mapping[str, Any]) -> Any:
    """Oil into the line, m³/s.

    Args:
        opening: Opening of the valve, -1 … 1.
        pressure: Difference of the pressures of both ports, Pa; below that of the supply.
        q: Values of the parameters by name; those of a compensated valve where they hold no supply pressure.
    """
    import casadi as ca

    if "supply_pressure" not in q:
        return q["rated_flow"] * opening
    drop = q["supply_pressure"] - ca.tanh(opening / OPENING) * pressure
    return q["rated_flow"] / ca.sqrt(2 * q["rated_pressure"]) * (opening * ca.sqrt(drop))


def compliance(q: Mapping[str, Any]) -> Any:
    """V / 4 B: how much oil a unit of the difference of pressures takes, m³/Pa."""
    return q["line_volume"] / (4 * q["bulk_modulus"])


def friction(v: Any, q: Mapping[str, Any]) -> Any:
    """Friction against a speed, N: viscous, Coulomb's and Stribeck's (Hess and Soom 1990)."""
    import casadi as ca

    # constant times what may change: a proof knows of a constant that it is one
    side, more = ca.tanh(v / SPEED), 1 + (v / q["stribeck_speed"]) ** 2
    return q["viscous_friction"] * v + q["coulomb_friction"] * side + q["stribeck_friction"] * (side / more)


class Row(NamedTuple):
    """A state of a plant: its symbol and unit, and M and h of M x' = h."""

    state: Any
    unit: str
    mass: Any
    force: Any


def line(pressure: Any, flow: Any, displaced: Any, q: Mapping[str, Any]) -> Row:
    """The pressure of the line, from the oil that comes in and what the motion takes, m³/s."""
    return Row(pressure, "Pa", compliance(q), flow - (displaced + q["leakage"] * pressure))


def spool(opening: Any, u: Any, q: Mapping[str, Any]) -> Row:
    """The opening of the valve, which follows what is commanded."""
    return Row(opening, "1", q["valve_lag"], u - opening)


def ordered(moved: Sequence[Row], pressure: Row, opening: Row, *, sensor: str) -> dict[str, Any]:
    """States of a drive in the order in which a law goes through them, and its relief valves, as fields of a plant.

    Args:
        moved: What the oil moves, from its first state to the speed that the pressure acts on.
        pressure: `line`.
        opening: `spool`.
        sensor: "pressure": every state is tracked by the one after it. "speed": the law goes from the speed, the last
            row of `moved`, to the valve with two leads, and the pressure is a mode that carries what the motion needs.
    """
    import casadi as ca

    chain = sensor == "pressure"
    rows = [*moved, pressure, opening] if chain else [moved[-1], opening, pressure]
    states, units, masses, forces = zip(*rows, strict=True)
    n = len(rows)
    return {
        "states": tuple(state.name() for state in states), "state_units": units,
        "x": ca.vertcat(*states), "mass": ca.vertcat(*masses), "force": ca.vertcat(*forces),
        "targets": ("reference", *range(n - 1)) if chain else ("reference", 0, "balance"),
        "controlled": (*[True] * (n - 1), False) if chain else (True, False, False),
        "input_map": (n - 2 if chain else 0,), "leads": 0 if chain else 2,
        "relief": {pressure.state.name(): RELIEF},
    }  # fmt: skip
