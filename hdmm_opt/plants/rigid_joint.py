"""A joint of a rigid arm driven by a torque: what a torque-level law sees of it (P-3).

    q' = v,    (J_a + J) v' = e u - b v - w

J_a is the inertia of the actuator as the joint feels it, J the part of the arm's inertia that the axis carries in its
own model, e the effectiveness of the actuator (1 healthy, less where degraded), w what the rest of the arm asks.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .parameter import EFFECTIVENESS, Parameter, effectiveness
from .plant import Limit, Plant

#: Units of a joint by its kind: position, torque, inertia, damping.
UNITS = {"revolute": ("rad", "N m", "kg m^2", "N m s/rad"), "prismatic": ("m", "N", "kg", "N s/m")}


def rigid_joint(
    kind: str, parameters: Mapping[str, Parameter], *, torque: Limit, speed: float, travel: tuple[float, float]
) -> Plant:
    """Build the symbolic model.

    Args:
        kind: "revolute" or "prismatic".
        parameters: "armature" J_a, "load_inertia" J, "effectiveness" e, "damping" b.
        torque: Amplitude limit of the input.
        speed: Largest rate, rad/s or m/s.
        travel: Range of the joint, rad or m.

    Returns:
        The plant: states position and speed, input the torque or force at the joint.

    Not guaranteed: elasticity, backlash and Coulomb friction are not modelled; the torque is there at once.
    """
    import casadi as ca

    position, effort, _, _ = UNITS[kind]
    x, u, w = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("w")
    p = ca.vertcat(*(ca.SX.sym(name) for name in parameters))
    value = {name: p[k] for k, name in enumerate(parameters)}
    return Plant(
        name="rigid_joint", level="torque", states=("position", "speed"), state_units=(position, f"{position}/s"),
        inputs=("torque_command",), input_unit=effort, disturbances=("load_force",), parameters=parameters,
        targets=("reference", 0), controlled=(True, True), input_map=(1,), x=x, u=u, w=w, p=p,
        mass=ca.vertcat(1, value["armature"] + value["load_inertia"]),
        force=ca.vertcat(x[1], value["effectiveness"] * u - value["damping"] * x[1] - w),
        limits=(torque, Limit(name="speed", signals=("speed",), value=speed, unit=f"{position}/s", source="assumed")),
        stroke=travel, outputs={"torque": value["effectiveness"] * u, "power": value["effectiveness"] * u * x[1]},
        output_units={"torque": effort, "power": "W"}, load_unit=effort,
        carried="load_inertia",
    )  # fmt: skip


def joint_parameters(kind: str, **values: Any) -> dict[str, Parameter]:
    """The parameters with their units and meanings.

    Args:
        kind: "revolute" or "prismatic".
        values: A `(value, tolerance, source)` for each of "armature", "load_inertia", "damping".
    """
    _, _, inertia, damping = UNITS[kind]
    known = {
        "armature": (inertia, "inertia of the actuator at the joint"),
        "load_inertia": (inertia, "part of the arm's inertia in the axis' own model"),
        "damping": (damping, "viscous friction of the joint"),
    }
    found = {
        name: Parameter(value=values[name][0], unit=unit, tolerance=values[name][1], source=values[name][2],
                        meaning=meaning)
        for name, (unit, meaning) in known.items()
    }  # fmt: skip
    return {**found, EFFECTIVENESS: effectiveness(1.0)}
