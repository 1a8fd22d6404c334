"""A wheel hub at torque level whose first state is a speed: J v' = e u - b v - w."""

import casadi as ca

from hdmm_opt.plants import EFFECTIVENESS, Limit, Parameter, Plant, effectiveness
from hdmm_opt.plants.registry import PlantModel


def known(level):
    return {
        "inertia": Parameter(value=2.0, unit="kg m^2", tolerance=0.1, source="assumed", meaning="hub and wheel"),
        "damping": Parameter(value=0.5, unit="N m s/rad", tolerance=0.2, source="assumed", meaning="bearing"),
        EFFECTIVENESS: effectiveness(1.0),
    }


def hub(level, parameters, ratings):
    values = {**known(level), **parameters}
    x, u, w = ca.SX.sym("x"), ca.SX.sym("u"), ca.SX.sym("w")
    p = ca.vertcat(*(ca.SX.sym(name) for name in values))
    q = {name: p[k] for k, name in enumerate(values)}
    torque = q[EFFECTIVENESS] * u
    return Plant(
        name="hub", level=level, states=("speed",), state_units=("rad/s",), inputs=("torque",), input_unit="N m",
        disturbances=("drag",), parameters=values, targets=("reference",), controlled=(True,), input_map=(0,),
        x=x, u=u, w=w, p=p, mass=q["inertia"], force=torque - q["damping"] * x - w,
        limits=(Limit(name="torque", signals=("torque",), value=60.0, unit="N m", source="assumed"),),
        stroke=(-30.0, 30.0), outputs={"torque": torque, "power": torque * x},
        output_units={"torque": "N m", "power": "W"}, load_unit="N m", first="speed",
    )  # fmt: skip


PLANT = PlantModel(levels=("torque",), defaults=known, build=hub)

STUDY = """
[study]
name = "hub"

[plant]
model = "hub"
level = "torque"

[uncertainty.disturbances.drag]
range = [0.0, 10.0]

[uncertainty.noise]
speed = 1e-3

[uncertainty.initial]
speed = 0.05

[reference]
kind = "quintic"
waypoints = [0.0, 10.0, 2.0]
durations_s = [2.0, 2.0]
dwell_s = 0.5
limits = { speed_m_s = 20.0, acceleration_m_s2 = 20.0, jerk_m_s3 = 100.0 }

[controller]
law = "rac"
rate_hz = 1000
gains = { beta_1 = { min = 10.0, max = 2000.0 }, epsilon_1 = { min = 1.0, max = 500.0 } }

[requirements]
tracking_error_m = 0.5

[tuning]
method = "jaya"
population = 4
iterations = 2
seed = 1

[validation]
transient_s = 0.5
monte_carlo = 8
worst_case = true
scenarios = [{ name = "steps", disturbances = { drag = [[0.0, 0.0], [1.0, 0.0], [1.001, 10.0]] }, noise = 1.0 }]
"""
