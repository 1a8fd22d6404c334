"""A screw that is a spring: its equations, its simulation, its proof."""

import json
import re
import tomllib
from dataclasses import replace
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from known_answers import claim_of, verdict
from machines import study_from
from scipy.integrate import solve_ivp

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.jobs import reserve
from hdmm_opt.jobs.certify import certificate, contracts_of
from hdmm_opt.plants.elastic_emla import elastic_emla
from hdmm_opt.plants.pmsm_emla import lead_angle_tangent, pmsm_emla, transmission
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Run, Scenario
from hdmm_opt.study.read import bundled_text
from stability import Failure, Interval, checker, first_box
from stability.checking.arithmetic import WORK
from stability.checking.limits import NotProvedError, UnreadableError
from stability.checking.loop import Loop as CheckedLoop
from stability.loops.box import UnboundedError

#: β_1, β_2, γ_2 of a loop that is proved at the motor, and of one at the load.
MOTOR, LOAD = (40.0, 12000.0, 2e5), (20.0, 6000.0, 5e4)


def screw(sensor="motor", **parameters):
    """The bundled study with its sensor on a side, and other numbers of the spring."""
    data = tomllib.loads(bundled_text("emla-p2-screw"))
    data["plant"]["sensor"] = sensor
    for name, value in parameters.items():
        data["plant"]["parameters"][name] |= value if isinstance(value, dict) else {"value": value}
    return data


def problem_of(**changes):
    return assemble(study_from(screw(**changes)))


def gains_of(problem, beta_1, beta_2, gamma_2):
    (member,) = problem.members
    given = {"beta_1": beta_1, "beta_2": beta_2, "gamma_2": gamma_2}
    return tuple(given.get(item.name, item.low) for item in member.ranges)


#: Friction that is larger at standstill, as a study gives it.
STRIBECK = {
    "stribeck_friction": {"value": 400.0, "unit": "N", "source": "assumed"},
    "stribeck_speed": {"value": 0.01, "unit": "m/s", "source": "assumed"},
}


def played(size):
    """Backlash as a study gives it."""
    return {"backlash": {"value": size, "unit": "m", "source": "assumed"}} if size else {}


#: A load that stays, and one that turns and takes the contact to the other flank and back.
HELD, TURNING = ((0.0, 70e3),), ((0.0, 20e3), (0.3, 20e3), (0.7, -10e3), (1.1, -10e3), (1.5, 20e3))


@pytest.mark.parametrize(
    ("sensor", "values", "size", "course"),
    [
        ("motor", MOTOR, 0.0, HELD),
        ("load", LOAD, 0.0, HELD),
        ("motor", MOTOR, 8e-5, TURNING),
        ("load", LOAD, 8e-5, TURNING),
    ],
)
def test_agrees_with_an_independent_adaptive_integrator(sensor, values, size, course):
    """Two masses, a spring, its backlash and a law by hand in the positions of both sides, by SciPy at 1e-10."""
    data = screw(sensor)
    data["plant"]["parameters"] |= STRIBECK | played(size)
    problem = assemble(study_from(data))
    (member,) = problem.members
    gains, q = gains_of(problem, *values), member.plant.values()
    r, k, flanks = transmission(q), q["stiffness"], set()

    def rates(t, x, u, load):
        x_m, v_m, x_l, v_l, torque = x
        carried = k * (x_m - x_l + q["spring_damping"] * (v_m - v_l))
        if size:
            carried = carried if carried > 0 else min(0.0, carried + k * size)
            flanks.add(np.sign(carried))
        rubbing = q["coulomb_friction"] + 400.0 / (1 + (v_m / 0.01) ** 2)
        steady = load + rubbing * np.tanh(v_m / q["friction_speed"])
        share = q["screw_friction"] / lead_angle_tangent(q) + q["gear_loss"]
        lost = np.tanh(steady * v_m / q["power_scale"]) * share * steady
        pushed = torque - q["viscous_friction"] * v_m / r - r * (carried + steady - load + lost)
        return [
            v_m,
            pushed * r / q["motor_inertia"],
            v_l,
            (carried - load) / q["load_mass"],
            (u - torque) / q["drive_lag"],
        ]

    scenario = Scenario(name="still", disturbances={"load_force": course}, initial=1.0)
    trace = Loop(problem).trace({member.name: gains}, scenario, duration=1.8).members[member.name]
    seen = trace.x[:2, 0]
    stretch = course[0][1] / k  # the spring carries the load at first
    x = np.array([seen[0], seen[1], seen[0] - stretch, trace.x[4, 0], trace.x[2, 0]])
    if sensor == "load":
        x = np.array([seen[0] + stretch, trace.x[4, 0], seen[0], seen[1], trace.x[2, 0]])
    g = dict(zip((item.name for item in member.ranges), gains, strict=True))
    theta, phi, commands, errors = np.zeros(2), g["preload_2"], [], []
    side = slice(0, 2) if sensor == "motor" else slice(2, 4)
    for step in range(1800):
        errors.append(x[side][0] - trace.x[0, step])
        wanted = member.reference(1e-3 * step)[:, 0]
        q1 = x[side][0] - wanted[0]
        q2 = x[side][1] - wanted[1] + 0.5 * (g["beta_1"] + g["epsilon_1"] * theta[0]) * q1
        u = np.clip(-0.5 * (g["beta_2"] + g["epsilon_2"] * theta[1]) * q2 - phi, -74.7, 74.7)
        for i, e in enumerate((q1, q2)):
            epsilon, sigma = g[f"epsilon_{i + 1}"], g[f"sigma_{i + 1}"]
            theta[i] += 1e-3 * (-sigma * theta[i] + 0.5 * epsilon * e * e)
        phi += 1e-3 * g["gamma_2"] * q2
        commands.append(u)
        acting = commands[max(0, step - 1)]  # one period of delay
        load = np.interp(1e-3 * step, *zip(*course, strict=True))  # loads change with the periods
        x = solve_ivp(rates, (0, 1e-3), x, args=(acting, load), rtol=1e-10, atol=1e-13, method="DOP853").y[:, -1]
    assert np.abs(errors).max() < (2e-7 if size else 2e-8)
    assert not size or flanks == {-1.0, 0.0, 1.0}
    assert trace.x[0].std() > 1e-4  # it moves


def test_the_mode_is_that_of_two_masses_on_a_spring():
    plant = elastic_emla("torque", sensor="motor")
    q = plant.values() | {"spring_damping": 0.0, "viscous_friction": 0.0, "coulomb_friction": 0.0, "screw_friction": 0.0,
                          "gear_loss": 0.0}  # fmt: skip
    jacobian = ca.Function("a", [plant.x, plant.u, plant.w, plant.p], [ca.jacobian(plant.rate, plant.x)])
    poles = np.linalg.eigvals(np.array(jacobian(np.zeros(5), 0, 0, list(q.values()))))
    carried = q["motor_inertia"] / transmission(q) ** 2
    wanted = np.sqrt(q["stiffness"] * (1 / q["load_mass"] + 1 / carried))
    assert np.abs(poles.imag).max() == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("sensor", ["motor", "load"])
def test_a_stiff_screw_is_the_rigid_one(sensor):
    """At rest under a load, and as the acceleration of both masses together."""
    rigid, soft = pmsm_emla("torque"), elastic_emla("torque", sensor=sensor)
    assert soft.inertia_over_gain(1) == pytest.approx(rigid.inertia_over_gain(1), rel=0.03)
    held = []
    for plant, rest in ((rigid, [0.3, 0, 0]), (soft, soft.standing([7e4]))):
        p, w = ca.SX(list(plant.values().values())), ca.SX([7e4])
        held.append(float(ca.evalf(plant.demand(1, 0.0, x=ca.SX(rest), w=w, p=p))))
    assert held[0] == pytest.approx(held[1], rel=1e-12) and held[0] > 20


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"plant": {"sensor": "middle"}}, "sensor is one of motor, load: got 'middle'"),
        ({"plant": {"sensor": None}}, "sensor is one of motor, load: got None"),
        ({"plant": {"model": "pmsm_emla"}}, "sensor"),
        ({"plant": {"level": "voltage"}}, "level is one of torque: got 'voltage'"),
        ({"controller": {"modelling": ["mechanics"]}}, "all measured"),
    ],
)
def test_what_does_not_fit_is_one_line(change, words):
    data = screw()
    for section, values in change.items():
        data[section] |= values
    with pytest.raises(InvalidInputError) as refusal:
        assemble(study_from(data))
    assert words in str(refusal.value)


def test_a_load_that_jumps_is_not_proved_on_a_spring():
    data = screw()
    del data["uncertainty"]["disturbances"]["load_force"]["rate"]
    problem = assemble(study_from(data))
    found = certificate(problem.members[0], gains_of(problem, *MOTOR))
    assert isinstance(found, Failure) and "needs a bound on the rate of load_force" in found.reason


@pytest.fixture(scope="module", params=["motor", "load"])
def proved(request):
    """A loop over a spring of small tolerances, with its certificate."""
    tight = {"stiffness": {"tolerance": 0.03}, "load_mass": {"tolerance": 0.03}, "spring_damping": {"tolerance": 0.05}}
    problem = problem_of(sensor=request.param, **tight)
    values = gains_of(problem, *(MOTOR if request.param == "motor" else LOAD))
    found = certificate(problem.members[0], values)
    assert not isinstance(found, Failure), found.reason
    return problem, values, found


def test_the_checker_decides_a_loop_over_a_spring(proved):
    problem, values, found = proved
    (member,) = problem.members
    claim = claim_of(member.model, member.bounds, member.gains(values), found, limit=1e30, accuracy=1e30)
    assert verdict(claim)
    softer = {**claim.parameters, "stiffness": tuple(v * Fraction(9, 10) for v in claim.parameters["stiffness"])}
    assert not verdict(replace(claim, parameters=softer))
    assert not verdict(
        replace(
            claim, half_widths=[*claim.half_widths[:3], claim.half_widths[3] * Fraction(9, 10), claim.half_widths[4]]
        )
    )


@pytest.mark.parametrize(
    ("target", "words"),
    [({"load_force/drive_lag/2": 1}, "divides a disturbance"), ({"load_force/effectiveness": 1}, "divides a disturbance"),
     *[({name: 1}, "made of r0, r1, r2, constant and disturbances")
       for name in ("r3", "position", "speed", "torque", "stretch", "drive_lag", "torque_command")]],
)  # fmt: skip
def test_the_checker_refuses_what_a_state_cannot_follow(proved, target, words):
    """Of a state the middle would be taken for its value, and its own rate for the rate of that."""
    problem, values, found = proved
    (member,) = problem.members
    claim = claim_of(member.model, member.bounds, member.gains(values), found, limit=1e30, accuracy=1e30)
    WORK.begin(10**6)
    CheckedLoop(claim, Fraction(0))
    rows = [dict(row) for row in claim.rows]
    rows[3]["target"] = {name: Fraction(share) for name, share in target.items()}
    with pytest.raises((NotProvedError, UnreadableError), match=words):
        CheckedLoop(replace(claim, rows=rows), Fraction(0))
    model = replace(member.model, rows=tuple(
        replace(row, target={name: float(v) for name, v in target.items()}) if k == 3 else row
        for k, row in enumerate(member.model.rows)
    ))  # fmt: skip
    with pytest.raises((UnboundedError, KeyError, ValueError)):
        first_box(model, member.bounds, member.gains(values), found.half_widths)


def test_runs_stay_inside_what_is_proved(proved):
    """Corners of the spring with loads that change in step with its mode, as fast as they may."""
    problem, values, found = proved
    (member,) = problem.members
    q = member.plant.values()
    half = np.pi / np.sqrt(q["stiffness"] / q["load_mass"])
    times = np.arange(1.0, 4.0, half)
    course = tuple((float(t), 70e3 + 0.5 * 49e3 * half * (-1) ** k) for k, t in enumerate(times))
    runs = [
        Run(gains={member.name: values},
            scenario=Scenario(name="mode", disturbances={"load_force": course}, noise=1.0, initial=sign, bias=bias,
                              parameters={"stiffness": stiff, "load_mass": -stiff, "spring_damping": -1.0}))
        for sign in (-1.0, 1.0) for bias in (0.0, 1.0) for stiff in (-1.0, 0.0, 1.0)
    ]  # fmt: skip
    for figures in Loop(problem).figures(runs):
        assert figures.largest_error_m <= found.half_widths[0]
        assert figures.maximum_error_m <= found.ultimate[0]


def loose(low):
    """The study with little that is uncertain, 0.1 mm of backlash, and a load from so much on."""
    data = screw(stiffness={"tolerance": 0.03}, load_mass={"tolerance": 0.03}, spring_damping={"tolerance": 0.05})
    data["plant"]["parameters"] |= played(1e-4)
    data["uncertainty"]["disturbances"]["load_force"]["range"] = [low, 76e3]
    return data


def test_a_load_that_keeps_the_contact_is_proved_through_backlash():
    """As if there were none; the checker decides that the contact stays, and refuses a load that lets go of it."""
    data = loose(30e3)
    (member,) = (problem := assemble(study_from(data))).members
    values = gains_of(problem, *MOTOR)
    found = certificate(member, values)
    assert not isinstance(found, Failure), found.reason
    claim = claim_of(member.model, member.bounds, member.gains(values), found, limit=1e30, accuracy=1e30)
    assert verdict(claim)
    told = next(o for o in checker.obligations(claim)[0] if o.name == "plant").statement
    assert told.endswith("backlash where the certified set does not reach")
    renamed = json.loads(json.dumps(claim.plant).replace('"backlash"', '"play"'))
    hidden = {{"backlash": "play"}.get(name, name): ends for name, ends in claim.parameters.items()}
    assert not verdict(replace(claim, plant=renamed, parameters=hidden))
    lighter = {
        **claim.feedforward,
        "load_force": ((Fraction(5000), Fraction(76000)), claim.feedforward["load_force"][1]),
    }
    assert not verdict(replace(claim, feedforward=lighter))
    del data["plant"]["parameters"]["backlash"]
    (rigid,) = (same := assemble(study_from(data))).members
    without = certificate(rigid, gains_of(same, *MOTOR))
    assert not isinstance(without, Failure)
    assert (found.ultimate == without.ultimate).all() and (found.half_widths == without.half_widths).all()


def test_a_contact_that_may_open_is_not_proved():
    problem = assemble(study_from(loose(5e3)))
    found = certificate(problem.members[0], gains_of(problem, *MOTOR))
    assert isinstance(found, Failure) and "small gain" in found.reason


def test_the_bundled_file_says_what_the_spring_does():
    from conftest import GAINS

    document = json.loads((GAINS / "emla-p2-screw.gains.json").read_text(encoding="utf-8"))
    rows = document["members"][0]["model"]["rows"]
    assert rows[3]["target"] == {"load_force/stiffness": 1.0, "r2": pytest.approx(4e-6)}
    assert document["study"]["plant"]["sensor"] == "motor"


def test_friction_at_standstill_is_larger_only_where_a_study_says_so():
    """Hess and Soom's curve; without it the plant has no such parameter, as in files of before."""
    data = tomllib.loads(bundled_text("emla-p2"))
    assert "stribeck_friction" not in assemble(study_from(data)).members[0].plant.parameters
    data["plant"]["parameters"] |= STRIBECK
    problem = assemble(study_from(data))
    plant = problem.members[0].plant
    force = ca.Function("h", [plant.x, plant.u, plant.w, plant.p], [plant.force])
    without = plant.values() | {"stribeck_friction": 0.0}
    r = transmission(plant.values())
    for speed in (0.002, 0.01, 0.05):
        h = [float(force([0, speed, 20], 0, 0, list(v.values()))[1]) for v in (plant.values(), without)]
        wanted = 400.0 / (1 + (speed / 0.01) ** 2) * np.tanh(speed / plant.values()["friction_speed"])
        assert (h[1] - h[0]) / r == pytest.approx(wanted, rel=0.2)  # with what the screw loses of it besides
        assert (h[1] - h[0]) / r > wanted
    rubbing, smooth = (
        certificate(p.members[0], gains_of(p, 60.0, 18000.0, 4e5))
        for p in (problem, assemble(study_from(tomllib.loads(bundled_text("emla-p2")))))
    )
    assert not isinstance(rubbing, Failure) and not isinstance(smooth, Failure)
    assert smooth.ultimate[0] < rubbing.ultimate[0] < 2 * smooth.ultimate[0]


def test_the_stiffness_that_is_told_is_certified(proved, monkeypatch):
    problem, values, _ = proved
    (member,) = problem.members
    monkeypatch.setattr(reserve, "STEPS", 2)
    gains = {member.name: values}
    told, _ = reserve.reserve_lines(problem, gains, contracts_of(problem, gains))
    share = float(re.search(r"stiffness down to ([0-9.]+) % of what is assumed", told)[1]) / 100
    assert 0.1 <= share <= 1
    known = member.bounds.parameters
    softer = replace(member.bounds, parameters={**known, "stiffness": known["stiffness"] * Interval(share * 1.001)})
    assert not isinstance(certificate(member.under(softer), values, refine=True), Failure)
