import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hdmm_opt.control import MODELLING, RAC
from hdmm_opt.control.law import step_function
from hdmm_opt.plants import SOURCES, Limit, Plant, defaults, effort, pmsm_emla
from hdmm_opt.plants import pmsm_emla as build
from hdmm_opt.plants.parameter import Parameter
from hdmm_opt.plants.pmsm_emla import lead_angle_tangent, ratings, transmission


def rate(plant, x, u, w, **changes):
    values = [changes.get(name, p.value) for name, p in plant.parameters.items()]
    function = ca.Function("f", [plant.x, plant.u, plant.w, plant.p], [plant.rate])
    return np.array(function(x, u, w, values)).ravel()


def test_figures_of_the_machine_follow_from_its_table():
    """Torques at rated and peak current, speed at 3000 rpm, EMF against the bus of a 380 V drive (machines.md)."""
    limits = {limit.name: limit.value for limit in build("voltage").limits}
    constant = ratings("torque")["torque_constant"].value
    assert constant * 23.1 * math.sqrt(2) == pytest.approx(37.1, abs=0.1)
    assert constant * limits["current"] == pytest.approx(77.5, abs=0.1)
    values = build("torque").values()
    r = transmission(values)
    assert math.degrees(math.atan(lead_angle_tangent(values))) == pytest.approx(4.55, abs=1e-3)
    assert r == pytest.approx(3.307e-4, rel=1e-4)
    assert 3000 * 2 * math.pi / 60 * r == pytest.approx(0.104, abs=2e-4)
    emf = 4 * 0.134 * math.sqrt(2) * 3000 * 2 * math.pi / 60
    assert emf == pytest.approx(238, abs=1)
    at_top = 4 * 0.134 * math.sqrt(2) * (limits["speed"] / r) * math.sqrt(3)
    assert at_top == pytest.approx(533, abs=2) and limits["voltage"] * math.sqrt(3) == pytest.approx(380 * math.sqrt(2))
    assert 75e3 * r == pytest.approx(24.8, abs=0.05) and 75e3 * r / 0.8 == pytest.approx(31.0, abs=0.05)


@pytest.mark.parametrize(
    ("friction", "driving", "back"), [(0.003, 0.963, 0.962), (0.005, 0.941, 0.937), (0.01, 0.888, 0.874)]
)
def test_screw_efficiency_in_both_directions(friction, driving, back):
    """Steady torque per ideal torque, all other friction off."""
    parameters = {
        name: Parameter(value=value, unit=defaults("torque")[name].unit)
        for name, value in (
            ("screw_friction", friction),
            ("gear_loss", 1e-12),
            ("viscous_friction", 1e-12),
            ("coulomb_friction", 1e-9),
        )
    }
    plant = pmsm_emla("torque", parameters)
    r = transmission(plant.values())
    for speed, efficiency in ((0.05, driving), (-0.05, back)):
        demand = plant.demand(1, 0, x=ca.SX([0.2, speed, 0]), w=ca.SX([50e3]), p=ca.SX(list(plant.values().values())))
        torque = float(ca.evalf(ca.SX(demand)))
        ideal = 50e3 * r
        assert (ideal / torque if speed > 0 else torque / ideal) == pytest.approx(efficiency, abs=1e-3)


def test_energy_balance_of_the_electrical_part():
    """Electrical power = copper loss + rate of magnetic energy + mechanical power."""
    plant = build("voltage")
    q = plant.values()
    x, u = [0.2, 0.06, 21.0, -7.0], [180.0, -35.0]
    change = rate(plant, x, u, [60e3])
    speed = x[1] / transmission(q)
    electrical = 1.5 * (u[0] * x[2] + u[1] * x[3])
    copper = 1.5 * q["resistance"] * (x[2] ** 2 + x[3] ** 2)
    magnetic = 1.5 * q["inductance"] * (x[2] * change[2] + x[3] * change[3])
    mechanical = q["torque_constant"] * x[2] * speed
    assert electrical == pytest.approx(copper + magnetic + mechanical, rel=1e-12)


def test_i_d_couples_against_the_strict_feedback_order():
    plant = build("voltage")
    jacobian = ca.Function("J", [plant.x, plant.u, plant.w, plant.p], [ca.jacobian(plant.rate, plant.x)])
    entries = np.array(jacobian([0.2, 0.06, 20, 5], [0, 0], 5e4, list(plant.values().values())))
    assert entries[2, 3] != 0 and entries[3, 2] != 0


@pytest.mark.parametrize("level", ["torque", "voltage"])
def test_every_parameter_says_what_it_is(level):
    for name, parameter in defaults(level).items():
        assert parameter.meaning and parameter.unit and parameter.source in SOURCES, name
        assert 0 <= parameter.tolerance < 1


def hand_written(x, r, theta, phi, gains, period, limit):
    """An independent RAC of two subsystems without modelling terms: input, θ̂ and φ̂ afterwards."""
    q1 = x[0] - r[0]
    k1 = -0.5 * (gains[0][0] + gains[0][1] * theta[0]) * q1 + r[1] - phi[0]
    q2 = x[1] - k1
    asked = -0.5 * (gains[1][0] + gains[1][1] * theta[1]) * q2 - phi[1]
    adapted, learned = [], []
    for t, p, g, q in zip(theta, phi, gains, (q1, q2), strict=True):
        adapted.append(t + period * (-g[2] * g[3] * t + 0.5 * g[1] * g[2] * q * q))
        held = abs(asked) > limit and -q * asked > 0  # more of φ̂ would push the input further out
        learned.append(max(-g[5], min(g[5], p if held else p + period * g[4] * q)))
    return max(-limit, min(limit, asked)), adapted, learned


positive = st.floats(0.01, 100)


@settings(max_examples=60)
@given(
    st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3),
    st.lists(st.floats(-0.1, 0.1), min_size=4, max_size=4),
    st.lists(st.floats(0, 5), min_size=2, max_size=2),
    st.lists(st.floats(-60, 60), min_size=2, max_size=2),
    st.lists(st.lists(positive, min_size=7, max_size=7), min_size=2, max_size=2),
)
def test_the_step_is_the_law(x, r, theta, phi, gains):
    law = RAC(plant=build("torque"))
    step = step_function(law, 1e-4)
    nominal = list(law.plant.values().values())
    u, after, _ = step(x, r, [*theta, *phi], np.array(gains).ravel(), nominal, 0.0)
    expected, adapted, learned = hand_written(x, r, theta, phi, gains, 1e-4, 77.0)
    assert float(u) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert np.array(after).ravel() == pytest.approx([*adapted, *learned], rel=1e-12, abs=1e-15)
    if all(1e-4 * g[2] * g[3] <= 1 for g in gains):
        assert (np.array(after)[:2] >= 0).all()


def test_without_its_gain_a_network_changes_no_bit():
    law = RAC(plant=build("torque"))
    step, nominal = step_function(law, 1e-4), list(law.plant.values().values())
    random = np.random.default_rng(3)
    for _ in range(20):
        x, r, theta = random.normal(size=3), random.normal(size=4), random.uniform(size=2)
        gains = random.uniform(0.1, 100, (2, 7))
        gains[:, 4:] = 0.0
        u, after, _ = step(x, r, [*theta, 0.0, 0.0], gains.ravel(), nominal, 0.0)
        q1 = x[0] - r[0]
        q2 = x[1] - (-(gains[0, 0] + gains[0, 1] * theta[0]) * q1 / 2 + r[1])
        asked = -(gains[1, 0] + gains[1, 1] * theta[1]) * q2 / 2
        assert float(u) == asked * (77.0 / max(abs(asked), 77.0)) and (np.array(after)[2:] == 0).all()


def test_the_amplitude_limit_scales_the_vector():
    law = RAC(plant=build("voltage"))
    step = step_function(law, 1e-4)
    gains = np.array([[b, 0, 1, 1, 0, 0, 0] for b in (30, 6000, 90, 90)], dtype=float)
    x = [0.21, 0.0, 10.0, 30.0]
    u = np.array(step(x, [0.2, 0, 0, 0], [0] * 8, gains.ravel(), list(law.plant.values().values()), 0.0)[0]).ravel()
    assert np.linalg.norm(u) == pytest.approx(law.plant.limits[0].value) and u[0] * u[1] != 0


def test_modelling_terms_cancel_the_plant_at_nominal_values():
    """With all electrical terms, L i' = -½β Q exactly; with mechanics, x'' equals the reference's at zero error."""
    law = RAC(plant=build("voltage"), modelling=("mechanics", "friction", "resistance", "back_emf", "decoupling"))
    nominal = ca.DM(list(law.plant.values().values()))
    x, r, load = ca.DM([0.2, 0.05, 22.0, -3.0]), ca.DM([0.2, 0.05, 0.1, 0.3]), ca.DM([60e3])
    terms = [float(ca.evalf(ca.SX(t))) for t in law.terms(ca.SX(x), ca.SX(r), ca.SX(nominal), ca.SX(load))]
    electrical = rate(law.plant, x, [terms[2], terms[3]], load)[2:]
    assert electrical == pytest.approx([0, 0], abs=1e-9)
    mechanical = rate(law.plant, ca.DM([0.2, 0.05, terms[1], 0.0]), [0, 0], load)[1]
    assert mechanical == pytest.approx(0.1, rel=1e-12)
    assert terms[0] == pytest.approx(0.05)
    plain = replace(law, modelling=("mechanics",)).terms(ca.SX(x), ca.SX(r), ca.SX(nominal), ca.SX(load))[1]
    screw = transmission(law.plant.values()) * 60e3 / law.plant.parameters["torque_constant"].value
    assert screw < float(ca.evalf(ca.SX(plain))) < terms[1]  # acceleration and viscous friction, but no loss


def test_terms_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="knows mechanics"):
        RAC(plant=build("torque"), modelling=("thermal",))
    with pytest.raises(ValueError, match="leave the term out"):
        RAC(plant=build("torque"), modelling=("back_emf",))
    with pytest.raises(ValueError, match='put "mechanics" beside it'):
        RAC(plant=build("torque"), modelling=("friction",))
    with pytest.raises(ValueError, match="needs an input that meters oil"):
        RAC(plant=build("torque"), modelling=("flow",))
    assert set(MODELLING) == {"mechanics", "friction", "resistance", "back_emf", "decoupling", "flow"}


def test_effort_is_the_inverse_of_the_plant():
    plant = build("torque")
    torque = np.array(effort(plant, [60e3])[0](0.2, 0.05, 0.2, 0.0)).ravel()[0]
    assert rate(plant, [0.2, 0.05, torque], [0], [60e3])[1] == pytest.approx(0.2, rel=1e-12)


def chain_plant(order):
    """x_i' = x_{i+1}, x_n' = u, for any number of subsystems."""
    x, u, w, p = (ca.SX.sym(n, k) for n, k in (("x", order), ("u", 1), ("w", 1), ("p", 1)))
    force = ca.vertcat(*(x[i + 1] for i in range(order - 1)), u[0] + w[0] * p[0])
    return Plant(
        name="chain", level="torque", states=tuple(f"x{i}" for i in range(order)), state_units=("m",) * order,
        inputs=("u",), input_unit="m", disturbances=("load_force",),
        parameters={"gain": Parameter(value=1.0, unit="1", meaning="of the disturbance")},
        targets=("reference", *range(order - 1)), controlled=(True,) * order, input_map=(order - 1,),
        x=x, u=u, w=w, p=p, mass=ca.SX.ones(order), force=force,
        limits=(Limit(name="u", signals=("u",), value=1e9, unit="m", source="assumed"),), stroke=(-1.0, 1.0), outputs={},
        output_units={},
    )  # fmt: skip


@pytest.mark.parametrize("order", [1, 2, 5, 9])
def test_one_law_for_any_number_of_subsystems(order):
    law = RAC(plant=chain_plant(order))
    random = np.random.default_rng(order)
    x, r, theta = random.normal(size=order), random.normal(size=4), random.uniform(size=order)
    phi, gains = random.normal(size=order), random.uniform(0.5, 2.0, (order, 7))
    step = step_function(law, 1e-3)
    u, after, errors = (
        np.array(v).ravel() for v in step(x, r, [*theta, *phi], gains.ravel(), [1.0], [0.0])
    )  # fmt: skip
    goal = r[0]
    for i in range(order):
        q = x[i] - goal
        assert errors[i] == pytest.approx(q)
        assert after[i] == pytest.approx(
            theta[i] + 1e-3 * (0.5 * gains[i, 1] * gains[i, 2] * q * q - gains[i, 2] * gains[i, 3] * theta[i])
        )
        learned = np.clip(phi[i] + 1e-3 * gains[i, 4] * q, -gains[i, 5], gains[i, 5])
        assert after[order + i] == pytest.approx(learned)
        goal = -0.5 * (gains[i, 0] + gains[i, 1] * theta[i]) * q + (r[1] if i == 0 and order > 1 else 0.0) - phi[i]
    assert u[0] == pytest.approx(goal + (r[1] if order == 1 else 0.0))
    assert len(law.loop_model().rows) == order
