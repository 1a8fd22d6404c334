"""A hydraulic cylinder behind a pressure-controlled valve, as a plant of one's own.

x' = v,    m v' = A p - b v - F_c tanh(v / v_c) - F,    T p' = u - p
"""

import casadi as ca

from hdmm_opt.plants import Limit, Parameter, Plant
from hdmm_opt.plants.registry import PlantModel


def parameters(level):
    """What a study may replace; the tolerance is the relative half width that the proof covers."""
    return {
        "mass": Parameter(value=800.0, unit="kg", tolerance=0.1, meaning="mass that moves with the rod"),
        "area": Parameter(value=2e-3, unit="m^2", source="public", meaning="area of the piston"),
        "damping": Parameter(value=2000.0, unit="N s/m", tolerance=0.3, loss=True, meaning="viscous friction"),
        "coulomb_friction": Parameter(value=200.0, unit="N", tolerance=0.5, loss=True, meaning="friction of the seals"),
        "friction_speed": Parameter(value=0.005, unit="m/s", meaning="speed over which that friction builds up"),
        "valve_lag": Parameter(value=0.002, unit="s", tolerance=0.2, meaning="time constant of the pressure"),
    }


def build(level, given, ratings):
    """The plant: rows M_i x_i' = h_i(x, u, w, p), what each row tracks, limits."""
    known = {**parameters(level), **given}
    x, u, w = ca.SX.sym("x", 3), ca.SX.sym("u"), ca.SX.sym("w")
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    q = {name: p[k] for k, name in enumerate(known)}
    speed, pressure = x[1], x[2]
    friction = q["damping"] * speed + q["coulomb_friction"] * ca.tanh(speed / q["friction_speed"])
    return Plant(
        name="cylinder",
        level=level,
        states=("position", "speed", "pressure"),
        state_units=("m", "m/s", "Pa"),
        inputs=("pressure_command",),
        input_unit="Pa",
        disturbances=("load_force",),
        parameters=known,
        targets=("reference", 0, 1),  # speed follows the law of row 0, pressure that of row 1
        controlled=(True, True, False),  # the law acts in rows 0 and 1; the valve is a lag
        input_map=(1,),  # the input is the law of row 1
        x=x, u=u, w=w, p=p,
        mass=ca.vertcat(1, q["mass"], q["valve_lag"]),
        force=ca.vertcat(speed, q["area"] * pressure - friction - w[0], u[0] - pressure),
        limits=(  # the first is the amplitude limit of the input
            Limit(name="pressure", signals=("pressure_command",), value=20e6, unit="Pa", source="assumed"),
            Limit(name="speed", signals=("speed",), value=0.4, unit="m/s", source="assumed"),
        ),
        stroke=(0.0, 0.8),
        outputs={"pressure": pressure, "power": q["area"] * pressure * speed},
        output_units={"pressure": "Pa", "power": "W"},
    )  # fmt: skip


def cylinder():
    """What plant.model = "cylinder.py:cylinder" calls."""
    return PlantModel(levels=("pressure",), defaults=parameters, build=build)
