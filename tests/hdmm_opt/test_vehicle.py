"""The vehicle on four hydraulic wheels: figures of its data sheet, its body by other hands, and its proof."""

import json
import math
from copy import deepcopy
from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pytest
from forging import forged
from machines import bundled, study_from
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.seal import seal, to_text
from hdmm_opt.jobs import certify
from hdmm_opt.jobs.certify import contracts_of, strongest
from hdmm_opt.jobs.contributions import together
from hdmm_opt.machines.body import ground_at
from hdmm_opt.machines.vehicle import BODY, WHEELS, vehicle_body
from hdmm_opt.problem import assemble
from hdmm_opt.problem.margins import margins
from hdmm_opt.simulation import Loop, Run, Scenario, within_assumptions
from stability import Failure, checker

FILE = Path(__file__).parent.parent.parent / "notebooks" / "gains" / "vehicle-p5-snow.gains.json"
GAINS = {"beta_1": 0.19, "gamma_1": 28.0, "lead_1": 0.022, "smooth_1": 5e-4}
GRAVITY = 9.81
CLIMB = Scenario(name="climb", ground={"slope": ((0.0, 0.122),), "grip": ((0.0, 0.3),)})


@pytest.fixture(scope="module")
def problem():
    return assemble(study_from(bundled("vehicle-p5-snow")))


@pytest.fixture(scope="module")
def gains(problem):
    return {m.name: tuple(GAINS.get(i.name, i.low) for i in m.ranges) for m in problem.members}


@pytest.fixture(scope="module")
def document():
    return json.loads(FILE.read_text(encoding="utf-8"))


def body_of(**numbers):
    return vehicle_body({name: p if name not in numbers else type(p)(value=numbers[name], unit=p.unit)
                         for name, p in BODY.items()})  # fmt: skip


def formula(slip, b, c=2.0, e=1.0):
    return math.sin(c * math.atan(b * slip - e * (b * slip - math.atan(b * slip))))


@pytest.mark.parametrize(
    ("degrees", "grip", "steep", "slip"), [(5, 0.3, 5.0, 0.030), (10, 0.3, 5.0, 0.067), (5, 0.1, 4.0, 0.167)]
)
def test_slips_of_the_data_sheet(degrees, grip, steep, slip):
    """The share of the largest force that holds the slope, by another root finder."""
    slope = math.radians(degrees)
    body = body_of(stiffness_factor=steep)
    start = body.start([0.3] * 4, [slope, *[grip] * 4])
    assert start[6] / 0.3 == pytest.approx(slip, abs=5e-4)
    other = brentq(lambda k: formula(k, steep) - math.tan(slope) / grip, 0, 0.24)
    assert start[6:10] == pytest.approx([0.3 * other] * 4, rel=1e-9)


def test_loads_and_slopes_of_the_data_sheet():
    body = body_of(rolling=1.0, tyre_damping=0.0)
    slope = math.radians(10)
    x = body.start([0.3] * 4, [slope, *[0.3] * 4])
    asked = np.array(body.loads(x, [0.3] * 4, [slope, *[0.3] * 4])).ravel()
    pulled = np.array(body_of(rolling=0.0, tyre_damping=0.0).loads(x, [0.3] * 4, [slope, *[0.3] * 4])).ravel()
    loads = asked - pulled  # rolling resistance of one times the load
    assert loads == pytest.approx([12.7e3, 12.7e3, 19.5e3, 19.5e3], abs=60)
    assert pulled.mean() == pytest.approx(2.83e3, abs=5)
    assert pulled.sum() == pytest.approx(6650 * GRAVITY * math.sin(slope), rel=1e-9)
    for grip, steepest in ((0.1, 5.71), (0.176, 9.98)):
        held = [body.holds([math.radians(steepest + more), *[grip] * 4]) for more in (-0.02, 0.02)]
        assert held[0] == "" and held[1].startswith("holds")


def states_of(random):
    """A state of the body with slip everywhere, speeds of the rims, and a ground of four grips on a slope."""
    x = [*random.uniform(-1, 1, 3), *random.uniform(-0.5, 0.5, 3), *random.uniform(-0.03, 0.03, 8)]
    return (
        np.array(x),
        random.uniform(-0.5, 0.5, 4),
        np.array([random.uniform(-0.2, 0.2), *random.uniform(0.1, 0.6, 4)]),
    )


def by_hand(p, x, v, ground):
    """The tyres' forces and the body's rates by numpy, wheel by wheel."""
    heading, ahead, aside, turn = x[2:6]
    slope, grips = ground[0], ground[1:]
    places = [(p["wheelbase"] / 2 * a, p["track"] / 2 * b) for a, b in WHEELS.values()]
    gravity = p["mass"] * GRAVITY * math.sin(slope) * np.array([-math.cos(heading), math.sin(heading)])

    def pressed(driven, steered):
        moments = p["height"] * driven / p["wheelbase"] / 2, p["height"] * steered / p["track"] / 2
        whole = p["mass"] * GRAVITY * math.cos(slope) / 4
        return [max(whole - a * moments[0] - b * moments[1], 0) for a, b in WHEELS.values()]

    def forces(loads):
        found = []
        for i, load in enumerate(loads):
            strain = np.array([x[6 + i], x[10 + i]])
            slip = math.sqrt(strain @ strain / p["relaxation"] ** 2 + 1e-12)
            b, c, e = p["stiffness_factor"], p["shape_factor"], p["curvature_factor"]
            found.append(grips[i] * load * formula(slip, b, c, e) / slip * strain / p["relaxation"])
        return np.array(found)

    rates = []
    for i, (d, y) in enumerate(places):
        ground_speed = np.array([ahead - turn * y, aside + turn * d])
        rim = np.array([v[i], 0.0])
        rates.append(rim - ground_speed - abs(v[i]) / p["relaxation"] * np.array([x[6 + i], x[10 + i]]))
    first = forces(pressed(*-gravity))
    total = forces(pressed(*first.sum(axis=0))) + p["tyre_damping"] * np.array(rates)
    return total, np.array(rates), gravity, places


def test_the_bodys_accelerations_are_those_of_mujoco():
    """A free body in the plane pushed at its wheels: MuJoCo's accelerations, turned into the body's own axes."""
    p = {name: q.value for name, q in BODY.items()}
    body, random = vehicle_body(BODY), np.random.default_rng(5)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler inertiafromgeom="false"/><option gravity="0 0 0"/><worldbody><body name="b"><inertial pos="0 0 0" mass="{p["mass"]}" diaginertia="5000 5000 {p["yaw_inertia"]}"/>'
        '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    for _ in range(40):
        x, v, ground = states_of(random)
        forces, strained, gravity, places = by_hand(p, x, v, ground)
        heading, turn = x[2], x[5]
        axes = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
        data.qpos[:], data.qvel[:] = x[:3], [*axes @ x[3:5], turn]
        mujoco.mj_forward(model, data)
        total = np.zeros(model.nv)
        pushes = [(f, at) for f, at in zip(forces, places, strict=True)] + [(gravity, (0.0, 0.0))]
        for force, at in pushes:
            point = np.array([*x[:2] + axes @ np.array(at), 0.0])
            mujoco.mj_applyFT(model, data, np.array([*axes @ force, 0.0]), np.zeros(3), point, 1, total)
        data.qfrc_applied[:] = total
        mujoco.mj_forward(model, data)
        inertial = axes.T @ data.qacc[:2]
        made = np.array(body.rate(x, v, ground)).ravel()
        assert made[:2] == pytest.approx(data.qvel[:2], rel=1e-9)
        assert made[3] - x[4] * turn == pytest.approx(inertial[0], rel=1e-9, abs=1e-9)
        assert made[4] + x[3] * turn == pytest.approx(inertial[1], rel=1e-9, abs=1e-9)
        assert made[5] == pytest.approx(data.qacc[2], rel=1e-9, abs=1e-9)
        assert made[6:] == pytest.approx([*strained[:, 0], *strained[:, 1]], rel=1e-9, abs=1e-12)


def test_the_whole_vehicle_agrees_with_an_independent_integrator(problem, gains):
    """Four wheels and the body by hand, SciPy at 1e-10, with the inputs of the run held over each period."""
    scenario = Scenario(name="s", ground={"slope": ((0.0, 0.122),), "front_left.grip": ((0.0, 0.3), (0.1, 0.15))})
    trace = Loop(problem, refinement=8).trace(gains, scenario, duration=0.5)
    p, q = {name: b.value for name, b in BODY.items()}, problem.members[0].plant.values()
    area = q["reduction"] * q["displacement"] / q["wheel_radius"]
    names, body = list(WHEELS), problem.machine.body
    x = np.array([*(trace.members[n].x[k, 0] for n in names for k in range(3)),
                  *(trace.body[s][0] for s in body.states)])  # fmt: skip
    waiting, apart = [float(trace.members[n].u[0, 0]) for n in names], []

    def rates(_, z, u, ground):
        v = z[0:12:3]
        forces, strained, gravity, places = by_hand(p, z[12:], v, ground)
        whole = p["mass"] * GRAVITY * math.cos(ground[0]) / 4
        # rolling resistance at the loads under the forces at the slope's loads, as the model says
        made = []
        still = slope_forces(p, z[12:], ground)
        for i, (a, b) in enumerate(WHEELS.values()):
            load = max(
                whole - a * p["height"] * still[0] / p["wheelbase"] / 2 - b * p["height"] * still[1] / p["track"] / 2, 0
            )
            speed, opening, pressure = z[3 * i : 3 * i + 3]
            side = math.tanh(pressure * speed * area / 5.0)
            eta = q["efficiency"]
            push = area * pressure * ((eta + 1 / eta) / 2 - side * (1 / eta - eta) / 2)
            rub = (
                q["coulomb_friction"] + q["stribeck_friction"] / (1 + (speed / q["stribeck_speed"]) ** 2)
            ) * math.tanh(speed / 0.005)
            asked = forces[i, 0] + p["rolling"] * load * math.tanh(speed / 0.02)
            made += [(push - rub - q["viscous_friction"] * speed - asked) / q["wheel_mass"],
                     (u[i] - opening) / q["valve_lag"],
                     4 * q["bulk_modulus"] / q["line_volume"] * (q["rated_flow"] * opening - area * speed - q["leakage"] * pressure)]  # fmt: skip
        heading, ahead, aside, turn = z[14:18]
        total = forces.sum(axis=0) + gravity
        moment = sum(d * f[1] - y * f[0] for f, (d, y) in zip(forces, places, strict=True))
        made += [ahead * math.cos(heading) - aside * math.sin(heading), ahead * math.sin(heading) + aside * math.cos(heading), turn,
                 total[0] / p["mass"] + aside * turn, total[1] / p["mass"] - ahead * turn, moment / p["yaw_inertia"],
                 *strained[:, 0], *strained[:, 1]]  # fmt: skip
        return made

    for k in range(200):
        own = np.array(
            [*(trace.members[n].x[i, k] for n in names for i in range(3)), *(trace.body[s][k] for s in body.states)]
        )
        scale = np.array([*[1.0, 1.0, 1e7] * 4, *[1.0] * 14])
        apart.append(np.abs(own - x) / scale)
        ground = ground_at(body, scenario.ground, np.array([1e-3 * k]))[:, 0]
        x = solve_ivp(rates, (0, 1e-3), x, args=(waiting, ground), rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
        waiting = [float(trace.members[n].u[0, k]) for n in names]
    assert np.max(apart) < 2e-6


def slope_forces(p, x, ground):
    """Forces of all tyres at the loads of the slope alone, without damping."""
    gravity = p["mass"] * GRAVITY * math.sin(ground[0]) * np.array([math.cos(x[2]), -math.sin(x[2])])
    total = np.zeros(2)
    for i, (a, b) in enumerate(WHEELS.values()):
        load = max(p["mass"] * GRAVITY * math.cos(ground[0]) / 4 - a * p["height"] * gravity[0] / p["wheelbase"] / 2
                   - b * p["height"] * gravity[1] / p["track"] / 2, 0)  # fmt: skip
        strain = np.array([x[6 + i], x[10 + i]])
        slip = math.sqrt(strain @ strain / p["relaxation"] ** 2 + 1e-12)
        total += ground[1 + i] * load * formula(slip, p["stiffness_factor"]) / slip * strain / p["relaxation"]
    return total


def test_what_the_ground_gives_is_what_the_body_gains(gains):
    """Work of the tyres at the ground is kinetic energy and height; what the rims do besides is lost in slip."""
    data = bundled("vehicle-p5-snow")
    data["reference"]["waypoints"] = [[0.25] * 4, [0.15, 0.3, 0.15, 0.3], [0.25] * 4]  # a bend
    bend = assemble(study_from(data))
    trace = Loop(bend).trace(gains, CLIMB)
    p, body = {name: q.value for name, q in BODY.items()}, bend.machine.body
    rows = np.array([trace.body[s] for s in body.states])
    speeds = np.array([trace.members[n].x[0] for n in WHEELS])
    at_ground, at_rim = [], []
    for k in range(rows.shape[1]):
        ground = ground_at(body, CLIMB.ground, trace.t[k : k + 1])[:, 0]
        forces, _, _, places = by_hand(p, rows[:, k], speeds[:, k], ground)
        ahead, aside, turn = rows[3:6, k]
        at_ground.append(
            sum(f @ [ahead - turn * y, aside + turn * d] for f, (d, y) in zip(forces, places, strict=True))
        )
        at_rim.append(float(forces[:, 0] @ speeds[:, k]))
    kinetic = p["mass"] / 2 * (rows[3] ** 2 + rows[4] ** 2) + p["yaw_inertia"] / 2 * rows[5] ** 2
    height = p["mass"] * GRAVITY * math.sin(0.122) * rows[0]
    gained = (kinetic + height)[-1] - (kinetic + height)[0]
    assert np.trapezoid(at_ground, trace.t) == pytest.approx(gained, rel=1e-5)
    assert np.trapezoid(at_rim, trace.t) > 1.02 * gained
    assert np.abs(rows[2]).max() > 0.05  # it turned


def test_a_run_that_asks_for_more_is_outside_the_assumptions(problem, gains):
    """The traction of a body is seen, with its rate; a bend on snow asks the outer wheels for more than is covered."""
    (quiet,) = Loop(problem).figures([Run(gains=gains, scenario=CLIMB)])
    trace = Loop(problem).trace(gains, CLIMB)
    span, rate = problem.disturbance("front_left.traction"), problem.rate_of("front_left.traction")
    met = np.array([trace.disturbances[f"{n}.traction"] for n in WHEELS])
    middle = (span.low + span.high) / 2
    wanted = max(np.abs(met - middle).max() / (span.high - middle), np.abs(np.diff(met)).max() / (rate * 1e-3))
    assert quiet.met_use == pytest.approx(wanted, rel=1e-6)
    assert within_assumptions(problem, CLIMB, quiet)
    data = bundled("vehicle-p5-snow")
    data["reference"]["waypoints"] = [[0.25] * 4, [0.2, 0.25, 0.2, 0.25], [0.25] * 4]
    bend = assemble(study_from(data))
    (turned,) = Loop(bend).figures([Run(gains=gains, scenario=CLIMB)])
    assert turned.met_use > 1 and not within_assumptions(bend, CLIMB, turned)
    slipping = Scenario(name="s", ground={"slope": ((0.0, 0.122),), "grip": ((2.0, 0.6), (2.005, 0.15))})
    (jolted,) = Loop(problem).figures([Run(gains=gains, scenario=slipping)])
    assert jolted.met_use > quiet.met_use


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda d: d["validation"]["scenarios"][0]["ground"].update(slope=0.3), "at 0 s the ground holds 16.7 degrees of slope: got 17.2"),
        (lambda d: d["validation"]["scenarios"][0]["ground"].update(grip=[[0.0, 0.3], [1.0, 0.1]]), "at 1 s the ground holds 5.71"),
        (lambda d: d["validation"]["scenarios"][0]["ground"].update(slop=0.1), "ground.slop is unknown"),
        (lambda d: d["validation"]["scenarios"][0]["ground"].update(grip=3.0), "ground.grip is from 0.02 to 1.5: got 3"),
        (lambda d: d["validation"]["scenarios"][0].update(disturbances={"traction": 3000.0}), "makes traction itself"),
        (lambda d: d["validation"]["scenarios"][0].update(disturbances={"middle.roughness": 0.0}), "middle.roughness is unknown"),
        (lambda d: d["plant"].update(body={"mas": {"value": 1.0, "unit": "kg", "source": "assumed"}}), "body.mas"),
        (lambda d: d["plant"].update(body={"mass": {"value": 1.0, "unit": "t", "source": "assumed"}}), 'must be "kg"'),
        (lambda d: d["plant"].update(shared={"oil": {"value": 1.0, "unit": "m^3/s", "source": "assumed"}}), "shared.oil"),
        (lambda d: d["plant"].update(joints={"third": {}}), "joints.third"),
        (lambda d: d["reference"].update(kind="bspline", durations_s=[]), 'reference.kind is "quintic"'),
    ],
)  # fmt: skip
def test_what_a_vehicle_cannot_be(change, told):
    data = bundled("vehicle-p5-snow")
    change(data)
    with pytest.raises(InvalidInputError) as error:
        assemble(study_from(data))
    assert told in str(error.value)


def test_a_wheel_by_itself_has_no_ground():
    data = bundled("wheel-p2")
    data["validation"]["scenarios"][0]["ground"] = {"slope": 0.1}
    with pytest.raises(InvalidInputError, match="no body that moves over it"):
        assemble(study_from(data))


def test_alike_wheels_share_what_is_searched_and_are_proved_once(problem, gains, monkeypatch):
    """One proof for four alike wheels; a wheel with another friction has its own, and all bounds are those alone."""
    assert problem.searched == 4 and len(problem.groups) == 1
    point = np.full(4, 0.4)
    shared = problem.at(point)
    assert len({values[:2] for values in shared.values()}) == 1 and problem.point(shared) == pytest.approx(
        point, abs=1e-3
    )
    calls, true = [], certify.certificate

    def counted(member, values, **more):
        calls.append(member.name)
        return true(member, values, **more)

    monkeypatch.setattr(certify, "certificate", counted)
    same = contracts_of(problem, gains, refine=True)
    assert calls == ["front_left"] and not isinstance(same, Failure)
    data = bundled("vehicle-p5-snow")
    data["plant"]["joints"] = {"rear_left": {"parameters": {"coulomb_friction": {
        "value": 360.0, "unit": "N", "tolerance": 0.2, "source": "assumed"}}}}  # fmt: skip
    other = assemble(study_from(data))
    values = {m.name: tuple(GAINS.get(i.name, i.low) for i in m.ranges) for m in other.members}
    calls.clear()
    found = contracts_of(other, values, refine=True)
    assert calls == ["front_left", "rear_left"] and not isinstance(found, Failure)
    sizes = {name: c.certificate.ultimate[0] for name, c in found.items()}
    assert sizes["front_left"] == same["front_left"].certificate.ultimate[0] != sizes["rear_left"]
    last = margins(other, found)[-1]
    assert last.certified == max(sizes.values()) and last.limit == 0.08 and last.unit == "m/s"


def test_wheels_draw_on_one_pump(problem, gains):
    """The margin is the sum of four largest flows; faster wheels ask for more than there is."""
    found = strongest(problem, gains).contracts
    (pump,) = [m for m in margins(problem, found) if m.name == "flow of all members"]
    opening = float(found["front_left"].certificate.states[1])
    assert pump.certified == pytest.approx(4 * 6.6667e-4 * 1.01 * opening, rel=1e-9) and pump.limit == 63 / 6e4
    assert 0.9 < pump.share < 1
    data = bundled("vehicle-p5-snow")
    data["reference"]["waypoints"] = [[v] * 4 for v in (0.2, 0.32, 0.2)]
    faster = assemble(study_from(data))
    more = strongest(faster, {m.name: tuple(GAINS.get(i.name, i.low) for i in m.ranges) for m in faster.members})
    assert max(margins(faster, more.contracts), key=lambda m: m.share).name == "flow of all members"


def test_lines_that_say_the_same_stand_once(problem):
    lines = [*(f"{n}: much" for n in list(WHEELS)[:3]), "rear_right: little", "all: else"]
    assert together(problem, lines) == ["front_left, front_right, rear_left: much", "rear_right: little", "all: else"]


@pytest.mark.long
def test_the_bundled_vehicle_is_decided_by_the_checker_and_forgeries_are_not(document):
    """What is drawn on together, what each guarantees, and what runs on the ground record."""
    assert checker.check_text(json.dumps(document)).status == 0

    def less(d):
        d["study"]["plant"]["shared"]["flow"]["value"] = 1.0e-3

    def untold(d):
        del d["members"][2]["model"]["outputs"]["flow"]

    def another(d):
        d["study"]["plant"]["shared"]["flow"]["unit"] = "N"

    def bolder(d):
        row = next(r for r in d["validation"]["requirements"] if r["name"] == "tracking_error_m")
        row["certified"] = 0.9 * row["certified"]

    for change, told in ((less, "supply"), (untold, "does not tell its flow"), (another, "must be in N"),
                         (bolder, "states another bound than is proved")):  # fmt: skip
        changed = deepcopy(document)
        change(changed)
        text = to_text(seal(changed)) if change is bolder else forged(changed)
        report = checker.check_text(text)
        assert report.status and told in report.message, report.message


def test_a_body_is_a_function_of_what_it_says():
    """Nothing moves a vehicle at rest on the level; the ground's four grips act on their own wheels alone."""
    body = vehicle_body(BODY)
    level = [0.0, *[0.3] * 4]
    assert np.array(body.rate(body.start([0.0] * 4, level), [0.0] * 4, level)).ravel() == pytest.approx([0.0] * 14)
    x, v, ground = states_of(np.random.default_rng(2))
    jacobian = ca.Function("j", [s := ca.SX.sym("s", 5)], [ca.jacobian(body.outputs(x, v, s), s)])
    assert np.array(jacobian(ground)).max() == 0  # slip is a state
    before = np.array(body.loads(x, v, ground)).ravel()
    ground[2] *= 1.1
    moved = np.abs(np.array(body.loads(x, v, ground)).ravel() - before)
    assert moved[1] == max(moved) > 0
