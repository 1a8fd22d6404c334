"""The EMLA of `pmsm_emla` at torque level with a screw that is not rigid, and its sensor at the motor or at the load.

A spring of stiffness k with a damper T k stands between what the motor moves, J / r of it, and the mass m at the rod.
With the positions of both sides as travel of the rod, v_m and v_l their speeds, and the stretch s:

    s' = v_m - v_l,      (m/k) v_l' = s - F_load/k + T s'
    J/r v_m' = tau - B v_m/r - r (F_load + F_friction) - r s_l l (F_load + F_friction) - r k (s - F_load/k + T s')

The first two states are those of the side of the sensor; the other side follows as the stretch and a speed. The losses
s_l l of screw and gear are those of load and friction: what the spring's force is more is left out of them. In the
motion that is asked for the spring carries the load and the inertia of the nominal mass. Written like this, a proof
needs the ratio of mass and stiffness, which decides the mode's frequency, and neither of both alone.

With backlash b, s counts from the contact through which a positive load is carried, and s + T s' becomes
max(s + T s', 0) - max(-s - b - T s', 0): both flanks push and none pulls. Where a load keeps the contact, as a crane's
weight does, that is s + T s' again, and so it is in a proof; where it may open, a proof finds a spring of no stiffness.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from .emla_numbers import LIMITS, STROKE
from .parameter import EFFECTIVENESS, Parameter
from .plant import Efforts, Plant
from .pmsm_emla import (
    EFFORTS,
    OUTPUT_UNITS,
    completed,
    friction_of,
    parameters_of,
    pmsm_emla,
    ratings,
    screw_loss,
    symbols,
    transmission,
)
from .pmsm_emla import defaults as rigid
from .registry import PlantModel

SPRING = {
    "stiffness": Parameter(value=3e8, unit="N/m", tolerance=0.2, meaning="stiffness of screw, nut and bearings"),
    "spring_damping": Parameter(
        loss=True, value=5e-4, unit="s", tolerance=0.2, meaning="damping of screw, nut and bearings over stiffness"
    ),
}
#: What a study may add.
PLAY = {"backlash": Parameter(value=0.0, unit="m", tolerance=0.5, meaning="travel of the rod between both flanks")}
SENSORS = ("motor", "load")
#: Names of the other side's speed, by the side of the sensor.
OTHER = {"motor": "rod_speed", "load": "motor_speed"}


def defaults(level: str) -> dict[str, Parameter]:
    """The parameters with units, tolerances and sources, those included that a study may add."""
    return {**parameters_of(level), **SPRING, **PLAY}


def elastic_emla(
    level: str, parameters: Mapping[str, Parameter] | None = None, rated: Mapping[str, Parameter] | None = None,
    *, sensor: str,
) -> Plant:  # fmt: skip
    """Build the symbolic model.

    Args:
        level: "torque" (u in N m, drive with its own current loop).
        parameters: Replacements for `defaults(level)`.
        rated: Replacements for `ratings(level)` of `pmsm_emla`.
        sensor: "motor" or "load": the side whose position and speed are the first two states.

    Returns:
        The plant: states position and speed at the sensor, torque, stretch, speed of the other side.

    References:
        Heydari Shahna (2025), publication P-2, for motor and screw; Ellis (2012) for feedback at the motor and at
        the load of a drive of two masses; Nordin and Gutman (2002) for backlash with a shaft that yields.

    Not guaranteed: further modes are not modelled; the losses of the screw do not follow the spring's
        force. With the sensor at the motor a proof is about the motor's side: the rod is `stretch` away from it.
    """
    import casadi as ca

    known, motor = completed({**rigid(level), **SPRING}, parameters), {**ratings(level), **(rated or {})}
    x, u, w, p, q = symbols(5, 1, known)
    r, torque, k = transmission(q), q["torque_scale"] * x[2], q["stiffness"]
    turning, rod = (x[1], x[4]) if sensor == "motor" else (x[4], x[1])
    beyond = x[3] - w[0] / k + q["spring_damping"] * (turning - rod)
    if "backlash" in q:
        beyond = _carried(x[3] + q["spring_damping"] * (turning - rod), q["backlash"]) - w[0] / k
    steady = w[0] + friction_of(turning, q)
    lost = r * (screw_loss(steady, turning, q) * steady)
    driving = torque - q["viscous_friction"] * (turning / r) - r * steady - lost - r * (k * beyond)
    sides = {"motor": (q["motor_inertia"] / r, driving), "load": (q["load_mass"] / k, beyond)}
    held = float(f"{known['load_mass'].value / known['stiffness'].value:.3g}")
    other = next(side for side in SENSORS if side != sensor)
    return Plant(
        name="elastic_emla", level=level, efforts=RIGID,
        states=("position", "speed", "torque", "stretch", OTHER[sensor]),
        state_units=("m", "m/s", "N m", "m", "m/s"), inputs=("torque_command",), input_unit="N m",
        disturbances=("load_force",), parameters=known,
        targets=("reference", 0, 1, {"load_force/stiffness": 1.0, "r2": held}, {"r1": 1.0}),
        controlled=(True, True, False, False, False), input_map=(1,), x=x, u=u, w=w, p=p,
        mass=ca.vertcat(1, sides[sensor][0], q["drive_lag"], 1, sides[other][0]),
        force=ca.vertcat(x[1], sides[sensor][1], q[EFFECTIVENESS] * u[0] - x[2], turning - rod, sides[other][1]),
        limits=(
            LIMITS["torque"], LIMITS["speed"],
            replace(LIMITS["speed"], name=OTHER[sensor], signals=(OTHER[sensor],)),
        ),
        stroke=STROKE, ratings=motor,
        outputs={
            "torque": torque, "current": torque / motor["torque_constant"].value,
            "power": torque * turning / r,
        },
        output_units=OUTPUT_UNITS,
    )  # fmt: skip


def _carried(stretch: Any, backlash: Any) -> Any:
    """What the spring carries over its stiffness, m: it pushes with either flank and never pulls."""
    import casadi as ca

    return ca.fmax(stretch, 0) - ca.fmax(-stretch - backlash, 0)


def _effort(plant: Plant, loads: Sequence[float]) -> tuple[Any, Any]:
    """What a motion asks of the motor where the screw is rigid."""
    own = {name: p for name, p in plant.parameters.items() if name not in {**SPRING, **PLAY}}
    return EFFORTS.of(pmsm_emla(plant.level, own, dict(plant.ratings)), loads)


RIGID = Efforts(names=EFFORTS.names, units=EFFORTS.units, limits=EFFORTS.limits, of=_effort)

PLANT = PlantModel(levels=("torque",), defaults=defaults, build=elastic_emla, ratings=ratings, sensors=SENSORS)
