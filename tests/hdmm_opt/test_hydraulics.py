"""Hydraulic drives: figures that follow from their data sheets, energy, and an independent integration."""

import math
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from known_answers import claim_of, verdict
from machines import bundled, study_from
from scipy.integrate import solve_ivp

from hdmm_opt.control.rivals.registry import rivals
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.seal import to_text
from hdmm_opt.jobs.certify import certificate
from hdmm_opt.jobs.compare import compare
from hdmm_opt.jobs.options import Options, Progress
from hdmm_opt.jobs.pipeline import design
from hdmm_opt.plants.hydraulic_wheel import area, defaults, drive_force, hydraulic_wheel
from hdmm_opt.plants.hydraulics import SENSORS, compliance, friction, valve_flow
from hdmm_opt.plants.registry import plant_model
from hdmm_opt.plants.sound import check_plant
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Run, Scenario
from stability import Failure, checker

GRAVITY, MACHINE = 9.81, 6650.0


@pytest.fixture(scope="module")
def q():
    """The nominal wheel, with the oil of its data sheet."""
    return {name: p.value for name, p in defaults("valve").items()} | {"bulk_modulus": 1e9, "leakage": 3.3e-12}


def litres_per_minute(flow):
    return 6e4 * flow


def test_flows_of_the_data_sheet(q):
    assert litres_per_minute(area(q) * 0.3) == pytest.approx(11.9, abs=0.05)
    assert 63 / 6e4 / 4 / area(q) == pytest.approx(0.398, abs=5e-4)  # all wheels share the pump
    assert (63 / 6e4 / 4 - q["leakage"] * 3e6) / area(q) == pytest.approx(0.383, abs=5e-4)
    assert 40 / 6e4 / area(q) == pytest.approx(1.01, abs=5e-3)  # the rated flow of one valve
    edge = 40 / 6e4 / math.sqrt(3.5e6)
    assert q["rated_flow"] / math.sqrt(2 * q["rated_pressure"]) == pytest.approx(edge / math.sqrt(2), rel=1e-9)
    assert edge / math.sqrt(2) == pytest.approx(2.52e-7, rel=1e-3)
    whole = [float(valve_flow(1.0, 20e6 - drop, q)) for drop in (20e6, 15e6)]
    assert whole[1] / whole[0] - 1 == pytest.approx(-0.134, abs=5e-4)
    assert q["leakage"] * 5e6 / area(q) == pytest.approx(0.025, abs=5e-4)


def test_torques_of_the_data_sheet(q):
    assert q["displacement"] * 20e6 == pytest.approx(318, abs=0.5)
    assert q["reduction"] * q["displacement"] * 20e6 == pytest.approx(5634, abs=1)
    assert float(drive_force(0.5, 20e6, q)) == pytest.approx(12.0e3, abs=50)
    assert float(drive_force(-0.5, 20e6, q)) == pytest.approx(12.0e3 / q["efficiency"] ** 2, abs=60)  # it brakes
    climbing = MACHINE * GRAVITY * math.sin(math.radians(10)) / 4
    assert climbing == pytest.approx(2.83e3, abs=5)
    assert climbing / (q["efficiency"] * area(q)) == pytest.approx(4.72e6, abs=1e4)


@pytest.mark.parametrize(("mass", "hertz", "ratio"), [(110.0, 27.0, 0.080), (1772.5, 6.73, 0.313)])
def test_the_mode_of_oil_and_mass(q, mass, hertz, ratio):
    plant = hydraulic_wheel("valve", sensor="pressure")
    values = list((q | {"wheel_mass": mass}).values())
    jacobian = ca.Function("a", [plant.x, plant.u, plant.w, plant.p], [ca.jacobian(plant.rate, plant.x)])
    poles = np.linalg.eigvals(np.array(jacobian([0.5, 5e6, 0], 0, [0] * plant.w.numel(), values)))
    light = poles[poles.imag > 1][0]
    assert abs(light) / (2 * math.pi) == pytest.approx(hertz, rel=3e-3)
    assert -light.real / abs(light) == pytest.approx(ratio, rel=0.02)


def test_oil_and_motor_lose_energy_and_never_make_it(q):
    random = np.random.default_rng(4)
    for _ in range(200):
        v, p, x = random.uniform(-1, 1), random.uniform(-15e6, 15e6), random.uniform(-1, 1)
        given, moved = p * area(q) * v, float(drive_force(v, p, q)) * v
        assert moved <= given + 2 * 5.0  # the direction of the loss is smoothed over a small power
        assert float(friction(v, q)) * v >= 0
        metered = q["supply_pressure"] * float(valve_flow(x, p, q)) * np.sign(x)
        assert p * float(valve_flow(x, p, q)) <= metered + 1e-3 * abs(metered) + 40  # the valve only throttles


def test_a_line_takes_what_its_bulk_modulus_says(q):
    assert compliance(q) == pytest.approx(0.5e-3 / 4e9)
    assert compliance(q | {"bulk_modulus": 2e9}) == pytest.approx(compliance(q) / 2)


def by_hand(name, x, u, w, q):
    """Rates of the states, written without the toolkit's parts."""

    def rubbing(v):
        held = q["coulomb_friction"] + q["stribeck_friction"] / (1 + (v / q["stribeck_speed"]) ** 2)
        return q["viscous_friction"] * v + held * np.tanh(v / 0.005)

    def oil(y, p):
        if "supply_pressure" not in q:
            return q["rated_flow"] * y
        drop = (q["supply_pressure"] - np.tanh(y / 0.02) * p) / 2
        return q["rated_flow"] * y * np.sqrt(drop / q["rated_pressure"])

    if name == "pneumatic_cylinder":
        _, v, p = x
        stiff = 2 * q["exponent"] * q["mean_pressure"] / q["chamber"]
        return [v, (q["area"] * p - rubbing(v) - w[0]) / q["load_mass"],
                stiff * (q["flow_gain"] * u - q["area"] * v - q["leakage"] * p)]  # fmt: skip
    stiff = 4 * q["bulk_modulus"] / q["line_volume"]
    if name == "hydraulic_cylinder":
        *place, v, p, y = x
        return [*(v for _ in place), (q["area"] * p - rubbing(v) - w[0]) / q["load_mass"],
                stiff * (oil(y, p) - q["area"] * v - q["leakage"] * p), (u - y) / q["valve_lag"]]  # fmt: skip
    v, p, y = x
    a, eta = q["reduction"] * q["displacement"] / q["wheel_radius"], q["efficiency"]
    share = eta ** np.sign(p * v) if abs(a * p * v) > 40 * 5.0 else math.nan
    return [(share * a * p - rubbing(v) - w[0] - w[1]) / q["wheel_mass"],
            stiff * (oil(y, p) - a * v - q["leakage"] * p), (u - y) / q["valve_lag"]]  # fmt: skip


@pytest.mark.parametrize(
    ("model", "level", "sensor"),
    [("hydraulic_wheel", "valve", "pressure"), ("hydraulic_wheel", "flow", "pressure"),
     ("hydraulic_wheel", "flow", "speed"), ("hydraulic_cylinder", "valve", "pressure"),
     ("hydraulic_cylinder", "flow", "pressure"), ("hydraulic_cylinder", "valve", "speed"),
     ("hydraulic_cylinder", "flow", "speed"), ("pneumatic_cylinder", "valve", None)],
)  # fmt: skip
def test_rates_are_those_of_the_equations(model, level, sensor):
    kind, random = plant_model(model), np.random.default_rng(7)
    plant = kind.build(level, {}, {}, **({"sensor": sensor} if sensor else {}))
    check_plant(plant)
    rate = ca.Function("rate", [plant.x, plant.u, plant.w, plant.p], [plant.rate])
    high = 1e7 if model.startswith("hydraulic") else 2e5
    for _ in range(50):
        at = {"position": random.uniform(0, 0.3), "speed": random.choice((-1, 1)) * random.uniform(0.1, 0.5),
              "pressure": random.choice((-1, 1)) * random.uniform(0.3, 1) * high, "opening": random.uniform(-1, 1)}  # fmt: skip
        u, w = random.uniform(-1, 1), random.uniform(-500, 500, plant.w.numel())
        made = np.array(rate([at[s] for s in plant.states], u, w, list(plant.values().values()))).ravel()
        order = [s for s in ("position", "speed", "pressure", "opening") if s in plant.states]
        wanted = dict(zip(order, by_hand(model, [at[s] for s in order], u, w, plant.values()), strict=True))
        assert made == pytest.approx([wanted[s] for s in plant.states], rel=1e-9)


@pytest.mark.parametrize("level", ["valve", "flow"])
@pytest.mark.parametrize("model", ["hydraulic_wheel", "hydraulic_cylinder"])
def test_a_drive_is_one_model_whatever_is_measured(model, level):
    """A law in speed and one in what is measured beside it: the same rates of the same states, the same outputs."""
    forms, random = [plant_model(model).build(level, {}, {}, sensor=s) for s in SENSORS], np.random.default_rng(11)
    assert forms[0].first == "speed" and forms[0].states == ("speed", "opening", "pressure")
    assert set(forms[0].states) <= set(forms[1].states) and forms[0].parameters == forms[1].parameters
    for _ in range(50):
        at = {"position": random.uniform(0, 0.8), "speed": random.uniform(-0.3, 0.3), "opening": random.uniform(-1, 1),
              "pressure": random.uniform(-1e7, 1e7)}  # fmt: skip
        u, w, found = random.uniform(-1, 1), random.uniform(-5e3, 5e3, forms[0].w.numel()), []
        for plant in forms:
            shown = ca.vertcat(plant.rate, *plant.outputs.values())
            values = ca.Function("rate", [plant.x, plant.u, plant.w, plant.p], [shown])(
                [at[s] for s in plant.states], u, w, list(plant.values().values()))  # fmt: skip
            found.append(dict(zip((*plant.states, *plant.outputs), np.array(values).ravel(), strict=True)))
        assert found[0] == {name: found[1][name] for name in found[0]}


def wheel(sensor="speed", level="flow", **parameters):
    """A wheel that climbs: a study as data."""
    rows = 2 if sensor == "pressure" else 1
    largest = {"phi_1": 17e6 if rows == 2 else 1.0, "phi_2": 1.0}
    gains = {f"{kind}_{i}": {"min": 1e-12, "max": 1e12} for i in range(1, rows + 1) for kind in ("beta", "gamma")}
    measured = {"pressure_pa": 2e4} if rows == 2 else {}
    return {
        "study": {"name": "wheel"},
        "plant": {"model": "hydraulic_wheel", "level": level, "sensor": sensor, "parameters": {
            name: {**entry, "source": "assumed"} for name, entry in parameters.items()}},
        "uncertainty": {
            "disturbances": {"traction": {"range": [3000.0, 5000.0], "rate": 15e3}, "roughness": {"range": [-25.0, 25.0]}},
            "noise": {"speed_m_s": 5e-3, "opening": 1e-3, **measured},
            "initial": {"speed_m_s": 0.005, "pressure_pa": 2e5, "opening": 0.02},
        },
        "reference": {"kind": "quintic", "waypoints": [0.25, 0.5, 0.25], "durations_s": [2.0, 2.0], "dwell_s": 1.0,
                      "limits": {"speed_m_s": 1.0, "acceleration_m_s2": 0.5, "jerk_m_s3": 5.0}},
        "controller": {"law": "rac", "modelling": ["flow"], "rate_hz": 1000, "delay_s": 1e-3,
                       "gains": gains | {f"phi_{i}": {"value": largest[f"phi_{i}"]} for i in range(1, rows + 1)}},
        "requirements": {"tracking_error_m": 0.1},
        "tuning": {"method": "jaya", "population": 4, "iterations": 1, "seed": 1},
        "validation": {"transient_s": 1.0, "monte_carlo": 8, "worst_case": True, "scenarios": [
            {"name": "grip", "disturbances": {"traction": [[0.0, 3000.0], [2.0, 3000.0], [2.15, 5000.0]]}}]},
    }  # fmt: skip


def exactly(**tolerances):
    """Numbers of a wheel without tolerances but these."""
    known = {name: p for name, p in defaults("flow").items() if p.tolerance}
    return {n: {"value": p.value, "unit": p.unit, "tolerance": tolerances.get(n, 0.0)} for n, p in known.items()}


def gains_of(problem, **given):
    (member,) = problem.members
    return tuple(given.get(i.name, 0.0 if i.name.startswith("gamma") else i.low) for i in member.ranges)


def test_a_wheel_agrees_with_an_independent_adaptive_integrator():
    """The model-free law on the valve's opening, held over each period and a period late, by SciPy at 1e-10."""
    data = wheel("pressure", "valve")
    data["controller"]["modelling"] = []
    problem = assemble(study_from(data))
    (member,) = problem.members
    g = {"beta_1": 2e8, "beta_2": 1e-8, "gamma_2": 2e-8, "gamma_1": 1e7}
    gains, q = gains_of(problem, **g), member.plant.values()
    scenario = Scenario(name="grip", disturbances={"traction": ((0.0, 3000.0), (0.5, 3000.0), (0.6, 4500.0))})
    own = Loop(problem, refinement=8).trace({member.name: gains}, scenario, duration=1.2).members[member.name]
    named = dict(zip((i.name for i in member.ranges), gains, strict=True))
    x, phi, commands, apart = own.x[:, 0].copy(), [named["preload_1"], named["preload_2"]], [], []
    for k in range(1200):
        apart.append(np.abs(x - own.x[:, k]) / (1.0, 1e7, 1.0))
        r = member.reference(1e-3 * k)[:, 0]
        q1 = x[0] - r[0]
        q2 = x[1] + g["beta_1"] / 2 * q1 + phi[0]
        commands.append(np.clip(-g["beta_2"] / 2 * q2 - phi[1], -1, 1))
        phi = [phi[0] + 1e-3 * g["gamma_1"] * q1, phi[1] + 1e-3 * g["gamma_2"] * q2]
        load = float(np.interp(1e-3 * k, *zip(*scenario.disturbances["traction"], strict=True)))

        def rates(_, z, u, load):
            p, v = z[1], z[0]
            moved = by_hand("hydraulic_wheel", z, u, (load, 0.0), q)
            a, eta = q["reduction"] * q["displacement"] / q["wheel_radius"], q["efficiency"]
            side = np.tanh(a * p * v / 5.0)
            share = (eta + 1 / eta) / 2 - side * (1 / eta - eta) / 2
            held = q["coulomb_friction"] + q["stribeck_friction"] / (1 + (v / q["stribeck_speed"]) ** 2)
            rub = q["viscous_friction"] * v + held * np.tanh(v / 0.005)
            return [(share * a * p - rub - load) / q["wheel_mass"], *moved[1:]]

        x = solve_ivp(
            rates, (0, 1e-3), x, args=(commands[max(0, k - 1)], load), rtol=1e-10, atol=1e-12, method="DOP853"
        ).y[:, -1]
    assert np.max(apart) < 1e-7
    usual = Loop(problem).trace({member.name: gains}, scenario, duration=1.2).members[member.name]
    assert np.abs(usual.x[0] - own.x[0]).max() < 2e-5  # one step a period: 250 times less than the sensor's error
    assert np.ptp(own.x[1]) > 1e6  # the pressure follows the load


def test_a_wheel_without_a_sensor_of_pressure_is_proved_where_little_is_uncertain():
    """At the level of flow, uphill; the checker decides it, and refuses softer oil. A run stays inside."""
    problem = assemble(study_from(wheel(**exactly(bulk_modulus=0.05))))
    (member,) = problem.members
    values = gains_of(problem, beta_1=0.02, gamma_1=10.0)
    found = certificate(member, values, refine=True)
    assert not isinstance(found, Failure), found.reason
    assert 0.05 < found.ultimate[0] < 0.1
    claim = claim_of(member.model, member.bounds, member.gains(values), found, limit=1e30, accuracy=1e30)
    claim = replace(claim, first="speed")
    assert verdict(claim)
    softer = {**claim.parameters, "bulk_modulus": tuple(v * Fraction(8, 10) for v in claim.parameters["bulk_modulus"])}
    assert not verdict(replace(claim, parameters=softer))
    half = math.pi / (2 * math.pi * 27)
    course = tuple((1.0 + half * k, 4000.0 + 7.5e3 * half * (-1) ** k) for k in range(150))
    runs = [Run(gains={member.name: values}, scenario=Scenario(name="s", disturbances={"traction": course}, noise=1.0,
            parameters={"bulk_modulus": share})) for share in (-1.0, 1.0)]  # fmt: skip
    for figures in Loop(problem).figures(runs):
        assert 0.002 < figures.maximum_error_m <= found.ultimate[0]


def test_a_wheel_goes_through_a_file():
    """Fixed gains through the whole pipeline, decided by the checker from the text."""
    data = wheel(**exactly())
    fixed = {"beta_1": 0.02, "gamma_1": 10.0, "phi_1": 1.0}
    data["controller"]["gains"] = {name: {"value": value} for name, value in fixed.items()}
    result = design(study_from(data), Options(), Progress())
    assert result.document is not None, result.verdicts
    told = checker.check_text(to_text(result.document))
    assert told.status == 0 and "mm/s" in told.message


def test_a_rod_that_is_driven_in_speed_is_proved():
    """By a speed sensor alone, against a load; the checker decides it, and refuses a slower valve. Runs stay inside."""
    problem = assemble(study_from(bundled("cylinder")))
    (member,) = problem.members
    values = gains_of(problem, beta_1=0.52, gamma_1=68.0, lead_1=0.02)
    found = certificate(member, values)
    assert not isinstance(found, Failure), found.reason
    assert 0.005 < found.ultimate[0] < 0.012  # the reference is 0.05 m/s at least
    claim = claim_of(member.model, member.bounds, member.gains(values), found, limit=1e30, accuracy=1e30)
    claim = replace(claim, first="speed")
    assert verdict(claim)
    slower = {**claim.parameters, "valve_lag": tuple(v * Fraction(12, 10) for v in claim.parameters["valve_lag"])}
    assert not verdict(replace(claim, parameters=slower))
    q, runs = member.plant.values(), []
    hertz = q["area"] * math.sqrt(1 / (compliance(q) * q["load_mass"])) / (2 * math.pi)
    assert hertz == pytest.approx(33.4, abs=0.1)
    half = 1 / (2 * hertz)
    for width in (half, 0.7 * half, 1.4 * half):
        course = tuple((1.0 + width * k, 5000.0 + 1e4 * width * (-1) ** k) for k in range(120))
        for share in (-1.0, 1.0):
            parameters = dict.fromkeys(("load_mass", "bulk_modulus", "leakage"), share) | {"valve_lag": -share}
            runs.append(Run(gains={member.name: values}, scenario=Scenario(
                name="s", disturbances={"load_force": course}, noise=1.0, initial=1.0, parameters=parameters)))  # fmt: skip
    errors = [figures.maximum_error_m for figures in Loop(problem).figures(runs)]
    assert 0.1 * found.ultimate[0] < max(errors) <= found.ultimate[0]


def test_the_air_of_two_chambers_is_a_spring():
    """Both chambers balanced by hand, p_i V_i^n constant: the force that a small travel makes."""
    plant = plant_model("pneumatic_cylinder").build("valve", {}, {})
    q = plant.values() | {"leakage": 0.0}
    travel = 1e-6
    pressures = [q["mean_pressure"] * (q["chamber"] / (q["chamber"] + sign * q["area"] * travel)) ** q["exponent"]
                 for sign in (1, -1)]  # fmt: skip
    stiffness = -(pressures[0] - pressures[1]) / travel
    rate = ca.Function("rate", [plant.x, plant.u, plant.w, plant.p], [plant.rate])
    made = np.array(rate([0.2, 0.1, 0.0], 0, 0, list(q.values()))).ravel()
    assert -made[2] / 0.1 == pytest.approx(stiffness, rel=1e-6)


def test_rivals_of_force_are_not_made_for_a_valve():
    for model, form in (("hydraulic_cylinder", {"sensor": "pressure"}), ("pneumatic_cylinder", {})):
        plant = plant_model(model).build("valve", {}, {}, **form)
        for kind in rivals().values():
            with pytest.raises(ValueError, match="it needs a"):
                kind(plant=plant)


def test_a_machine_without_rivals_says_what_they_need():
    problem = assemble(study_from(bundled("pneumatic")))
    with pytest.raises(
        InvalidInputError, match=r"no rival is made for this machine: .* it needs a first state that is a"
    ):
        compare(problem, (3, 0), 1, Options(), Progress(), seeds=1)
