import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hdmm_opt import study
from hdmm_opt.control import RAC
from hdmm_opt.plants import pmsm_emla
from hdmm_opt.problem import assemble
from hdmm_opt.proof import certificate
from hdmm_opt.simulation import ClosedLoop, Scenario, measure, scenarios
from hdmm_opt.validation import clopper_pearson
from stability import Failure, Gains
from trajectories import Reference, constant, quintic

GAINS = (Gains(beta=24.0, epsilon=50.0, delta=2.0, sigma=5.0), Gains(beta=5900.0, epsilon=200.0, delta=1.0, sigma=20.0))
MOVE = Reference(segments=(constant(0.1, 0, 0.2), quintic(0.1, 0.2, 0.2, 2.5), constant(0.2, 2.7, 3)))


def loop(period=1e-3, noise=(0.0, 0.0, 0.0)):
    return ClosedLoop(
        law=RAC(plant=pmsm_emla("torque")), period=period, noise=noise, initial=(1e-3, 0.0, 0.0), nominal_load=70e3
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
    coarse, fine = loop(), loop()
    fine.substeps = lambda: 4 * coarse.substeps()  # type: ignore[method-assign]
    runs = [
        part.run(GAINS, MOVE, Scenario(name="x", load=((0.0, 65e3), (1.0, 65e3), (1.1, 76e3))))
        for part in (coarse, fine)
    ]
    assert np.abs(runs[0].x[0] - runs[1].x[0]).max() < 1e-8


def test_divergence_is_seen_and_ends_the_run():
    wild = (Gains(beta=3000.0), Gains(beta=5e6))
    trace = loop(period=0.02).run(wild, MOVE, Scenario(name="x", load=((0.0, -9e5),)), duration=60.0)
    assert trace.diverged and trace.t[-1] < 59
    figures = measure(trace, 0.5, 1e-3, 3.3e-4)
    assert figures.maximum_error_m == np.inf and figures.diverged


def test_noise_and_start_stay_in_their_assumptions_and_repeat():
    made = Scenario(name="x", load=((0.0, 70e3),), noise=0.5, initial=-1.0, seed=9)
    part = loop(noise=(1e-5, 1e-3, 0.0))
    draws = made.noise_at(5000, np.array(part.noise))
    assert np.abs(draws).max(axis=1) == pytest.approx([5e-6, 5e-4, 0.0], rel=1e-2)
    first, again = (part.run(GAINS, MOVE, made, duration=0.3) for _ in range(2))
    assert (first.x == again.x).all()
    assert first.error[0] == pytest.approx(-1e-3)


def test_metrics_of_a_known_signal():
    part = loop().run(GAINS, MOVE, Scenario(name="x", load=((0.0, 70e3),)), duration=0.5)
    part.x[0] = part.r[0] + 1e-3 * np.sign(np.sin(200 * part.t)) * (part.t < 0.3)
    part.outputs["torque"][:] = 3.0
    figures = measure(part, 0.1, 0.5e-3, 3.3e-4)
    assert figures.maximum_error_m == pytest.approx(1e-3)
    assert figures.settling_time_s == pytest.approx(0.3, abs=2e-3)
    assert figures.rms_torque_nm == pytest.approx(3.0)
    assert figures.rms_error_m == pytest.approx(1e-3 * np.sqrt(0.5), rel=0.02)


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
