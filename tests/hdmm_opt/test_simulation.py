from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from machines import emla, quick_arm, serial_study, study_from
from scipy.integrate import solve_ivp

from hdmm_opt import study
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.statistics import clopper_pearson
from hdmm_opt.jobs.certify import certificate
from hdmm_opt.jobs.start import cascade
from hdmm_opt.machines.rigid_body import Payload, inverse_dynamics
from hdmm_opt.machines.urdf import bodies
from hdmm_opt.plants import pmsm_emla
from hdmm_opt.plants.pmsm_emla import lead_angle_tangent, transmission
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Fault, Loop, Run, Scenario, rated, scenarios, within_assumptions
from stability import Failure
from trajectories import Reference, constant, quintic

#: β, ε, δ, σ, γ, Φ, φ̂(0) of two rows.
VALUES = (24.0, 50.0, 2.0, 5.0, 0.0, 0.0, 0.0, 5900.0, 200.0, 1.0, 20.0, 0.0, 0.0, 0.0)
#: The same with a load network that starts a little beside the load.
LEARNING = (*VALUES[:11], 8e4, 77.0, -20.0)
GAINS = {"actuator": VALUES}
MOVE = Reference(segments=(constant(0.1, 0, 0.2), quintic(0.1, 0.2, 0.2, 2.5), constant(0.2, 2.7, 3)))


def loop(period=1e-3, noise=(0.0, 0.0, 0.0), delay=0.0, observer=None, resolution=0.0, jitter=0.0, **more):
    """The EMLA at torque level with its bundled numbers along one move; the nominal load is 70 kN."""
    data = emla("emla-p2")
    data["plant"]["parameters"] = {}
    data["uncertainty"] = {
        "disturbances": {"load_force": {"range": [65e3, 75e3]}},
        "noise": dict(zip(("position", "speed", "torque"), noise, strict=True)),
        "initial": {"position": 1e-3},
    }
    data["uncertainty"]["resolution"] = {"position": resolution}
    data["controller"] |= {"rate_hz": 1 / period, "delay_s": delay, "observer": observer, "jitter_s": jitter}
    data["validation"]["transient_s"], data["requirements"]["tracking_error_m"] = 0.5, 1e-3
    data["requirements"].pop("settling_band_m")
    data["validation"]["scenarios"] = [{"name": "plain"}]
    return Loop(assemble(study.validated(data, "test"), (MOVE,)), **more)


def under(load, **more):
    """A scenario with a load, constant or of a course."""
    return Scenario(name="x", disturbances={"load_force": load if isinstance(load, tuple) else ((0.0, load),)}, **more)


def late(number, ticks):
    """By how many ticks the input of a sample acts late: the mixed digits of its number, for the run of seed 0."""
    mixed = 43758.5453 * np.sin(12.9898 * number)
    return np.floor((mixed - np.floor(mixed)) * (2 * ticks + 1)) - ticks


@pytest.mark.parametrize(
    ("values", "delay", "observer", "resolution", "jitter"),
    [
        (VALUES, 0.0, None, 0.0, 0.0), (LEARNING, 0.0, None, 0.0, 0.0), (LEARNING, 1e-3, None, 0.0, 0.0),
        (LEARNING, 1.25e-3, None, 0.0, 0.0), (LEARNING, 1e-3, {}, 0.0, 0.0), (LEARNING, 1e-3, {}, 1e-5, 0.0),
        (LEARNING, 0.0, {"bandwidth_rad_s": 400.0}, 0.0, 0.0), (LEARNING, 1e-3, {}, 0.0, 1e-4),
        (LEARNING, 0.5e-3, None, 0.0, 2e-4),
    ],
)  # fmt: skip
def test_agrees_with_an_independent_adaptive_integrator(values, delay, observer, resolution, jitter):
    """The same sampled loop, law written by hand, plant written by hand, integrated by SciPy at 1e-10."""
    q = pmsm_emla("torque").values()
    r, load = transmission(q), 70e3

    def plant(t, x, u):
        force = load + q["coulomb_friction"] * np.tanh(x[1] / q["friction_speed"])
        s = np.tanh(force * x[1] / q["power_scale"])
        loss = s * (q["screw_friction"] / lead_angle_tangent(q) + q["gear_loss"])
        mass = q["motor_inertia"] / r + r * q["load_mass"]
        driving = q["torque_scale"] * x[2] - q["viscous_friction"] * x[1] / r - r * (1 + loss) * force
        return [x[1], driving / (mass * (1 + loss * r * q["load_mass"] / mass)), (u - x[2]) / q["drive_lag"]]

    made = loop(delay=delay, observer=observer, resolution=resolution, jitter=jitter)
    trace = made.trace({"actuator": values}, under(load), duration=1.5).members["actuator"]
    x, theta, phi, states, commands = trace.x[:, 0], np.zeros(2), [values[6], values[13]], [], []
    pole = np.exp(-1e-3 * observer["bandwidth_rad_s"]) if observer else 0.0
    before, speed_error = None, 0.0
    limits = {"rtol": 1e-10, "atol": 1e-12, "method": "DOP853"}
    for k in range(1500):
        states.append(x)
        ref = MOVE(1e-3 * k)[:, 0]
        (b1, e1, d1, s1, *_), (b2, e2, d2, s2, gamma, *_) = values[:7], values[7:]
        q1 = (np.round(x[0] / resolution) * resolution if resolution else x[0]) - ref[0]
        if observer is None:
            speed_error = x[1] - ref[1]
        else:  # what was foreseen, corrected so that errors of both die as p^k
            missed = 0.0 if before is None else q1 - before
            speed_error += (1 - pole) ** 2 / 1e-3 * missed
            q1 -= pole**2 * missed
            before = q1 + 1e-3 * speed_error
        q2 = speed_error + 0.5 * (b1 + e1 * theta[0]) * q1 + phi[0]
        u = np.clip(-0.5 * (b2 + e2 * theta[1]) * q2 - phi[1], -77, 77)
        for i, (epsilon, delta, sigma, e) in enumerate(((e1, d1, s1, q1), (e2, d2, s2, q2))):
            theta[i] += 1e-3 * (-delta * sigma * theta[i] + 0.5 * epsilon * delta * e * e)
        phi[1] += 1e-3 * gamma * q2
        # what was computed at t_j acts from t_j + delay on, earlier or later; the first of all from the beginning
        commands.append(u)
        begins = [1e-3 * j + delay + late(j, round(jitter / made.period)) * made.period for j in range(k + 3)]
        times = [1e-3 * k, *(b for b in begins if 1e-3 * k + 1e-9 < b < 1e-3 * (k + 1) - 1e-9), 1e-3 * (k + 1)]
        for begin, end in pairwise(times):
            acting = max((j for j, b in enumerate(begins) if b < begin + 1e-9), default=0)
            x = solve_ivp(plant, (0, end - begin), x, args=(commands[acting],), **limits).y[:, -1]
    every = round(1e-3 / made.period)
    steps = 1.0 if resolution else 0.0  # where rounding turns on the last digit, the runs part by a step for a while
    assert np.abs(trace.x[0, ::every] - np.array(states)[:, 0]).max() < 1e-8 + steps * resolution
    assert np.abs(trace.x[2, ::every] - np.array(states)[:, 2]).max() < 2e-3 + steps * 5.0


def test_the_coupled_loop_is_that_of_an_independent_integration(tmp_path):
    """Two joints, one period after the other by an adaptive method on a mass matrix of its own."""
    problem = assemble(study_from(serial_study(2, tmp_path)))
    gains = cascade(problem, 10.0, (8.0,))
    scenario = Scenario(name="plain", disturbances={"payload": ((0.0, 0.3),)})
    trace = Loop(problem).trace(gains, scenario)
    x, wanted = (np.array([getattr(m, key)[:2] for m in trace.members.values()]) for key in "xr")
    tree = bodies((tmp_path / "arm2.urdf").read_text())
    q, v, a = (ca.SX.sym(name, 2) for name in "qva")
    load = Payload(body=1, mass=0.3, position=(0.1, 0.05, 0.2))
    torque = ca.Function("torque", [q, v, a], [inverse_dynamics(tree, q, v, a, payloads=(load,))])
    armature = np.array([p.parameters["armature"].value for p in problem.machine.plants])
    damping = np.array([p.parameters["damping"].value for p in problem.machine.plants])

    def rate(_, state, u):
        still = np.array(torque(state[:2], state[2:], [0, 0])).ravel()
        mass = np.column_stack([np.array(torque(state[:2], state[2:], e)).ravel() - still for e in np.eye(2)])
        push = u - damping * state[2:] - still
        return np.concatenate([state[2:], np.linalg.solve(mass + np.diag(armature), push)])

    theta, worst = np.zeros((2, 2)), 0.0
    state = np.array([*(member.reference(0.0)[0, 0] for member in problem.members), 0, 0])
    for k in range(400):
        worst = max(worst, np.abs(state[:2] - x[:, 0, k]).max())
        u = np.zeros(2)
        for i, (name, member) in enumerate(zip(problem.machine.members, problem.members, strict=True)):
            r = member.reference(k * problem.period)[:, 0]
            first, second = member.gains(gains[name])
            e1 = state[i] - r[0]
            k1 = -(first.beta + first.epsilon * theta[i, 0]) * e1 / 2 + r[1]
            e2 = state[2 + i] - k1
            u[i] = -(second.beta + second.epsilon * theta[i, 1]) * e2 / 2
            for j, (g, e) in enumerate(((first, e1), (second, e2))):
                theta[i, j] += problem.period * (g.epsilon * g.delta * e**2 / 2 - g.delta * g.sigma * theta[i, j])
        state = solve_ivp(rate, (0, problem.period), state, args=(u,), rtol=1e-10, atol=1e-12).y[:, -1]
    assert np.abs(x[:, 0, :400] - wanted[:, 0, :400]).max() > 1e-4
    assert worst < 1e-8


def test_finer_steps_change_nothing_that_matters():
    coarse, fine = loop(), loop(refinement=4)
    runs = [
        part.trace(GAINS, under(((0.0, 65e3), (1.0, 65e3), (1.1, 76e3)))).members["actuator"] for part in (coarse, fine)
    ]
    assert np.abs(runs[0].x[0] - runs[1].x[0]).max() < 1e-8


def test_divergence_is_seen_and_ends_the_run():
    wild = {"actuator": (3000.0, 0.0, 1.0, 1.0, *[0.0] * 3, 5e6, 0.0, 1.0, 1.0, *[0.0] * 3)}
    part, load = loop(period=0.02), under(-9e5)
    trace = part.trace(wild, load)
    assert np.isfinite(trace.diverged_s) and trace.t[-1] < 2.5
    (figures,) = part.figures([Run(gains=wild, scenario=load)])
    assert figures.maximum_error_m == np.inf and figures.diverged
    assert np.isfinite(figures.members["actuator"].peaks["torque"])


def test_noise_and_start_stay_in_their_assumptions_and_repeat():
    made = under(70e3, noise=0.5, initial=-1.0, seed=9)
    part = loop(noise=(1e-5, 1e-3, 0.0))
    clean = part.trace(GAINS, replace(made, noise=0.0), duration=0.3).members["actuator"]
    first, again = (part.trace(GAINS, made, duration=0.3).members["actuator"] for _ in range(2))
    assert (first.x == again.x).all()
    assert first.error[0] == pytest.approx(-1e-3)
    assert 0 < np.abs(first.q - clean.q)[0].max() < 2 * 5e-6


def test_figures_are_those_of_the_trace():
    """The records of the engine against NumPy on the signals of the same run."""
    part = loop(noise=(1e-5, 1e-3, 0.0))
    scenario = under(((0.0, 65e3), (1.0, 65e3), (1.1, 76e3)), noise=1.0, initial=1.0, bias=0.2)
    (found,) = part.figures([Run(gains=GAINS, scenario=scenario)])
    trace, own = part.trace(GAINS, scenario), found.members["actuator"]
    signals = trace.members["actuator"]
    error, late, torque = np.abs(trace.error), trace.t >= 0.5, signals.outputs["torque"]
    assert error == pytest.approx(np.abs(signals.error))
    assert found.largest_error_m >= error.max() == pytest.approx(found.largest_error_m, rel=1e-3)
    assert found.maximum_error_m == pytest.approx(error[late].max(), rel=1e-3)
    assert found.rms_error_m == pytest.approx(np.sqrt(np.mean(error[late] ** 2)), rel=1e-12)
    assert found.settling_time_s == pytest.approx(trace.t[np.flatnonzero(error > 1e-3)[-1] + 1])
    assert own.peaks["torque"] == np.abs(torque).max()
    assert own.rms["torque"] == pytest.approx(np.sqrt(np.mean(torque**2)), rel=1e-12)
    assert own.peaks["current"] == np.abs(signals.outputs["current"]).max()
    assert own.peak_input == np.abs(signals.u).max()
    assert own.largest_error == found.largest_error_m and own.maximum_error == found.maximum_error_m
    ratio = transmission(pmsm_emla("torque").values())
    assert own.energy_j == pytest.approx((torque * signals.x[1]).sum() * 1e-3 / ratio, rel=1e-12)
    assert found.itae == pytest.approx((trace.t * error).sum() * 1e-3, rel=1e-12)
    assert found.limit_use >= np.abs(signals.u).max() / 77.0


def test_a_quantised_position_stays_inside_its_bound_and_a_fault_outside_the_assumptions():
    part = loop(noise=(1e-4, 1e-3, 0.0))
    coarse = under(70e3, quantisation=1.0)
    trace = part.trace(GAINS, coarse, duration=1.0).members["actuator"]
    measured = trace.q[0] + trace.r[0]
    assert np.abs(measured - trace.x[0]).max() <= 1e-4 * (1 + 1e-9)
    assert measured / 2e-4 == pytest.approx(np.round(measured / 2e-4), abs=1e-6)
    assert np.unique(np.round(measured / 2e-4)).size > 3

    weak = under(70e3, faults={"actuator": Fault(share=0.2, start_s=0.5, rate_1_s=50.0)})
    healthy = part.trace(GAINS, replace(weak, faults={}), duration=1.0).members["actuator"]
    faulty = part.trace(GAINS, weak, duration=1.0).members["actuator"]
    assert (faulty.x[:, :500] == healthy.x[:, :500]).all()
    # the same load asks for the same torque: the command rises by what is lost
    assert faulty.u[0, -1] == pytest.approx(healthy.u[0, -1] / 0.8, rel=1e-2)
    assert not within_assumptions(part.problem, weak) and within_assumptions(part.problem, coarse)


def test_clopper_pearson_closed_form():
    """All of n succeed: the lower end is (α/2)^(1/n)."""
    found = clopper_pearson(20, 20)
    assert found["lower"] == pytest.approx(0.025 ** (1 / 20)) and found["upper"] == 1.0
    assert clopper_pearson(0, 20)["upper"] == pytest.approx(1 - 0.025 ** (1 / 20))


@pytest.mark.parametrize("seed", range(4))
def test_no_run_inside_the_assumptions_leaves_the_certified_box(seed):
    """Random proved gains, random corners, switching loads: simulation never contradicts the proof."""
    problem = assemble(study.load("emla-p2"))
    part, (member,) = Loop(problem), problem.members
    random = np.random.default_rng(seed)
    tried = 0
    while tried < 3:
        gains = problem.at(random.uniform(0.1, 0.6, problem.searched))
        found = certificate(member, gains["actuator"])
        if isinstance(found, Failure):
            continue
        tried += 1
        times = np.sort(random.uniform(0, 4, 12))
        loads = random.choice([65e3, 76e3], 12)
        course = (
            (0.0, 65e3),
            *((float(t) + 1e-3 * k, float(f)) for k, (t, f) in enumerate(zip(times, loads, strict=True))),
        )
        hard = under(
            course, parameters={name: float(random.choice([-1, 1])) for name in member.plant.parameters}, noise=1.0,
            initial=float(random.choice([-1, 1])), seed=seed,
        )  # fmt: skip
        trace = part.trace(gains, rated(problem, hard), duration=5.0).members["actuator"]
        assert np.abs(trace.error).max() <= found.half_widths[0]
        assert np.abs(trace.x).max(axis=1) == pytest.approx(np.minimum(np.abs(trace.x).max(axis=1), found.states))
        assert np.abs(trace.u).max() <= found.effort[0]


def test_scenarios_come_from_the_study_and_go_round_as_data():
    made = scenarios(assemble(study.load("emla-p2")))
    assert [s.name for s in made] == ["heavy", "load-steps", "light-noisy-start"]
    assert made[1].disturbances["load_force"][2] == (4.22, 76e3)
    weak = replace(made[0], faults={"actuator": Fault(share=0.2, start_s=0.5, rate_1_s=50.0, stuck=(1.0,))})
    assert Scenario.from_data(weak.to_data()) == weak


def test_loops_run_at_several_rates():
    """Two joints, one at half the rate: the loop is the one whose slower law is asked at every second tick."""
    from machines import study_from

    data = quick_arm()
    data["controller"]["rates_hz"] = {"tilt": 500}
    problem = assemble(study_from(data))
    part = Loop(problem)
    assert [p.every for p in part.parts] == [1, 2, 1] and part.period == 1e-3
    gains = {m.name: m.values(np.full(len(m.searched), 0.5)) for m in problem.members}
    trace = part.trace(gains, scenarios(problem)[0], duration=0.5)
    held, fast = trace.members["tilt"].u[0], trace.members["lift"].u[0]
    assert (held[:-1:2] == held[1::2]).all() and (fast[300:-1:2] != fast[301::2]).any()
    data["controller"]["rates_hz"] = {"tilt": 300}
    with pytest.raises(InvalidInputError, match=r"must divide the fastest rate, 1000 Hz: got 300; 333\.333 would do"):
        assemble(study_from(data))


def test_missed_requirements_are_one_line_each(monkeypatch):
    """The worst run, and how many more."""
    from types import SimpleNamespace

    from hdmm_opt.simulation import requirements

    runs = [(name, SimpleNamespace(diverged=False, value=v)) for name, v in (("a", 1.0), ("b", 3.0), ("c", 2.5))]
    monkeypatch.setattr(requirements, "required", lambda problem: {"peak_torque_nm": 2.0, "rms_torque_nm": 9.0})
    monkeypatch.setattr(requirements, "figure_of", lambda problem, name, figures: figures.value)
    assert requirements.missed_in(None, runs) == ["peak_torque_nm = 2 is missed in scenario b: 3, and in 1 more"]
    runs.append(("d", SimpleNamespace(diverged=True, diverged_s=0.5, value=float("nan"))))
    lines = requirements.missed_in(None, runs)
    assert lines[0] == "lost at 0.5 s in scenario d" and lines[1].endswith("scenario d: nan, and in 2 more")
