from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hdmm_opt import study
from hdmm_opt.control import RAC
from hdmm_opt.plants import pmsm_emla
from hdmm_opt.problem import assemble
from hdmm_opt.proof import certificate
from hdmm_opt.simulation import ClosedLoop, Fault, Run, Scenario, Yardstick, scenarios
from hdmm_opt.validation import clopper_pearson
from stability import Failure, Gains
from trajectories import Reference, constant, quintic

GAINS = (Gains(beta=24.0, epsilon=50.0, delta=2.0, sigma=5.0), Gains(beta=5900.0, epsilon=200.0, delta=1.0, sigma=20.0))
MOVE = Reference(segments=(constant(0.1, 0, 0.2), quintic(0.1, 0.2, 0.2, 2.5), constant(0.2, 2.7, 3)))


def loop(period=1e-3, noise=(0.0, 0.0, 0.0), **more):
    return ClosedLoop(
        law=RAC(plant=pmsm_emla("torque")),
        period=period,
        noise=noise,
        initial=(1e-3, 0.0, 0.0),
        nominal_load=70e3,
        yardstick=Yardstick(transient=0.5, band=1e-3, transmission=3.3e-4),
        **more,
    )


def test_agrees_with_an_independent_adaptive_integrator():
    """The same sampled loop, law written by hand, plant written by hand, integrated by SciPy at 1e-10."""
    q = pmsm_emla("torque").values()
    r, load = q["transmission"], 70e3

    def plant(t, x, u):
        force = load + q["coulomb_friction"] * np.tanh(x[1] / q["friction_speed"])
        s = np.tanh(force * x[1] / q["power_scale"])
        loss = s * (q["screw_friction"] / q["lead_angle_tangent"] + q["gear_loss"])
        mass = q["motor_inertia"] / r + r * q["load_mass"]
        driving = q["torque_scale"] * x[2] - q["viscous_friction"] * x[1] / r - r * (1 + loss) * force
        return [x[1], driving / (mass * (1 + loss * r * q["load_mass"] / mass)), (u - x[2]) / q["drive_lag"]]

    x, theta, states = np.array([0.1, 0.0, 0.0]), np.zeros(2), []
    for k in range(1500):
        states.append(x)
        ref = MOVE(1e-3 * k)[:, 0]
        g1, g2 = GAINS
        q1 = x[0] - ref[0]
        q2 = x[1] - ref[1] + 0.5 * (g1.beta + g1.epsilon * theta[0]) * q1
        u = np.clip(-0.5 * (g2.beta + g2.epsilon * theta[1]) * q2, -77, 77)
        for i, (g, e) in enumerate(((g1, q1), (g2, q2))):
            theta[i] += 1e-3 * (-g.delta * g.sigma * theta[i] + 0.5 * g.epsilon * g.delta * e * e)
        x = solve_ivp(plant, (0, 1e-3), x, args=(u,), rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
    trace = loop().run(GAINS, MOVE, Scenario(name="x", load=((0.0, load),)), duration=1.5)
    assert np.abs(trace.x[0] - np.array(states)[:, 0]).max() < 1e-8
    assert np.abs(trace.x[2] - np.array(states)[:, 2]).max() < 2e-3


def test_finer_steps_change_nothing_that_matters():
    coarse, fine = loop(), loop(refinement=4)
    runs = [
        part.run(GAINS, MOVE, Scenario(name="x", load=((0.0, 65e3), (1.0, 65e3), (1.1, 76e3))))
        for part in (coarse, fine)
    ]
    assert np.abs(runs[0].x[0] - runs[1].x[0]).max() < 1e-8


def test_divergence_is_seen_and_ends_the_run():
    wild = (Gains(beta=3000.0), Gains(beta=5e6))
    trace = loop(period=0.02).run(wild, MOVE, Scenario(name="x", load=((0.0, -9e5),)), duration=60.0)
    assert trace.diverged and trace.t[-1] < 59
    run = Run(gains=wild, scenario=Scenario(name="x", load=((0.0, -9e5),)))
    (figures,) = loop(period=0.02).figures([run], MOVE, duration=60.0)
    assert figures.maximum_error_m == np.inf and figures.diverged and np.isfinite(figures.peak_torque_nm)


def test_noise_and_start_stay_in_their_assumptions_and_repeat():
    made = Scenario(name="x", load=((0.0, 70e3),), noise=0.5, initial=-1.0, seed=9)
    part = loop(noise=(1e-5, 1e-3, 0.0))
    clean = part.run(GAINS, MOVE, replace(made, noise=0.0), duration=0.3)
    first, again = (part.run(GAINS, MOVE, made, duration=0.3) for _ in range(2))
    assert (first.x == again.x).all()
    assert first.error[0] == pytest.approx(-1e-3)
    assert 0 < np.abs(first.q - clean.q)[0].max() < 2 * 5e-6


def test_figures_are_those_of_the_trace():
    """The records of the engine against NumPy on the signals of the same run."""
    part = loop(noise=(1e-5, 1e-3, 0.0))
    scenario = Scenario(name="x", load=((0.0, 65e3), (1.0, 65e3), (1.1, 76e3)), noise=1.0, initial=1.0, bias=0.2)
    (found,) = part.figures([Run(gains=GAINS, scenario=scenario)], MOVE)
    trace = part.run(GAINS, MOVE, scenario)
    error, late, torque = np.abs(trace.error), trace.t >= 0.5, trace.outputs["torque"]
    assert found.largest_error_m >= error.max() == pytest.approx(found.largest_error_m, rel=1e-3)
    assert found.maximum_error_m == pytest.approx(error[late].max(), rel=1e-3)
    assert found.rms_error_m == pytest.approx(np.sqrt(np.mean(error[late] ** 2)), rel=1e-12)
    assert found.settling_time_s == pytest.approx(trace.t[np.flatnonzero(error > 1e-3)[-1] + 1])
    assert found.peak_torque_nm == np.abs(torque).max()
    assert found.rms_torque_nm == pytest.approx(np.sqrt(np.mean(torque**2)), rel=1e-12)
    assert found.peak_current_a == trace.outputs["current"].max()
    assert found.peak_input == np.abs(trace.u).max()
    assert found.energy_j == pytest.approx((torque * trace.x[1]).sum() * 1e-3 / 3.3e-4, rel=1e-12)
    assert found.itae == pytest.approx((trace.t * error).sum() * 1e-3, rel=1e-12)
    assert found.limit_use >= np.abs(trace.u).max() / 77.0


def test_a_quantised_position_stays_inside_its_bound_and_a_fault_outside_the_assumptions():
    part = loop(noise=(1e-4, 1e-3, 0.0))
    coarse = Scenario(name="x", load=((0.0, 70e3),), quantisation=1.0)
    trace = part.run(GAINS, MOVE, coarse, duration=1.0)
    measured = trace.q[0] + trace.r[0]
    assert np.abs(measured - trace.x[0]).max() <= 1e-4 * (1 + 1e-9)
    assert measured / 2e-4 == pytest.approx(np.round(measured / 2e-4), abs=1e-6)
    assert np.unique(np.round(measured / 2e-4)).size > 3

    weak = Scenario(name="x", load=((0.0, 70e3),), fault=Fault(share=0.2, start_s=0.5, rate_1_s=50.0))
    healthy = part.run(GAINS, MOVE, replace(weak, fault=None), duration=1.0)
    faulty = part.run(GAINS, MOVE, weak, duration=1.0)
    assert (faulty.x[:, :500] == healthy.x[:, :500]).all()
    # the same load asks for the same torque: the command rises by what is lost
    assert faulty.u[0, -1] == pytest.approx(healthy.u[0, -1] / 0.8, rel=1e-2)
    assert not weak.covered and coarse.covered


def test_clopper_pearson_closed_form():
    """All of n succeed: the lower end is (α/2)^(1/n)."""
    found = clopper_pearson(20, 20)
    assert found["lower"] == pytest.approx(0.025 ** (1 / 20)) and found["upper"] == 1.0
    assert clopper_pearson(0, 20)["upper"] == pytest.approx(1 - 0.025 ** (1 / 20))


@pytest.mark.parametrize("seed", range(4))
def test_no_run_inside_the_assumptions_leaves_the_certified_box(seed):
    """Random proved gains, random corners, switching loads: simulation never contradicts the proof."""
    problem = assemble(study.load("emla-p2"))
    random = np.random.default_rng(seed)
    tried = 0
    while tried < 3:
        gains = problem.gains(random.uniform(0.1, 0.6, len(problem.searched)))
        found = certificate(problem, gains)
        if isinstance(found, Failure):
            continue
        tried += 1
        times = np.sort(random.uniform(0, 4, 12))
        loads = random.choice([65e3, 76e3], 12)
        hard = Scenario(
            name="x",
            load=(
                (0.0, 65e3),
                *((float(t) + 1e-3 * k, float(f)) for k, (t, f) in enumerate(zip(times, loads, strict=True))),
            ),
            parameters={name: float(random.choice([-1, 1])) for name in problem.plant.parameters},
            noise=1.0,
            initial=float(random.choice([-1, 1])),
            seed=seed,
        )
        trace = problem.loop.run(gains, problem.reference, hard, duration=5.0)
        assert np.abs(trace.error).max() <= found.radii[0]
        assert np.abs(trace.x).max(axis=1) == pytest.approx(np.minimum(np.abs(trace.x).max(axis=1), found.states))
        assert np.abs(trace.u).max() <= found.effort[0]


def test_scenarios_come_from_the_study():
    made = scenarios(study.load("emla-p2"))
    assert [s.name for s in made] == ["heavy", "load-steps", "light-noisy-start"]
    assert made[1].load_at(np.array([0.0, 4.0005, 8.0])) == pytest.approx([65e3, 70.5e3, 76e3])
