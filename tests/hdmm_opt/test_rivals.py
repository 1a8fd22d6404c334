"""The rivals: against an implementation of others, and on a double integrator where closed forms are known."""

import casadi as ca
import numpy as np
import pytest
from pyadrc import StateSpace

from hdmm_opt.control.law import step_function
from hdmm_opt.control.rivals.adrc import Adrc
from hdmm_opt.control.rivals.drive_cascade import DriveCascade
from hdmm_opt.control.rivals.registry import rivals
from hdmm_opt.control.rivals.super_twisting import SuperTwisting
from hdmm_opt.plants import pmsm_emla
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Scenario
from hdmm_opt.study import load

PERIOD, LIMIT = 1e-3, 20.0
WHEEL = assemble(load("wheel-p2"))


def stepped(kind, gains, modelling=()):
    """(x, r, z) -> (acceleration that is given, states), the outer stage alone with its command limited."""
    law = kind(plant=pmsm_emla("torque"), modelling=modelling)
    x, r, z = ca.SX.sym("x", 3), ca.SX.sym("r", 4), ca.SX.sym("z", law.states)

    def command(wanted):
        value = ca.fmin(ca.fmax(wanted, -LIMIT), LIMIT)
        return value, value

    step = ca.Function("step", [x, r, z], [*law.outer(x, r, z, gains, command, PERIOD)])
    return lambda *values: tuple(np.array(v).ravel() for v in step(*values)), law


def followed(kind, gains, load, seconds=4.0, reference=lambda t: (0.1, 0.0, 0.0, 0.0)):
    """Errors of position on x'' = a + load(t) at the samples, exact between them for a load that is held."""
    step, law = stepped(kind, gains)
    x, z, errors = np.zeros(2), np.array(law.start([0.0, 0.0], gains)), []
    for k in range(round(seconds / PERIOD)):
        r = reference(k * PERIOD)
        errors.append(r[0] - x[0])
        (a,), z = step([*x, 0.0], r, z)
        total = a + load(k * PERIOD)
        x = np.array([x[0] + PERIOD * x[1] + PERIOD**2 / 2 * total, x[1] + PERIOD * total])
    return np.array(errors)


@pytest.mark.parametrize(("closed", "ratio"), [(10.0, 5.0), (40.0, 8.0)])
def test_adrc_is_that_of_another_implementation(closed, ratio):
    """The same measurements, limits and constant reference, on a plant whose gain is off by 30 %."""
    other = StateSpace(order=2, delta=PERIOD, b0=1.0, w_cl=closed, k_eso=ratio, m_lim=(-LIMIT, LIMIT))
    step, law = stepped(Adrc, (closed, closed * ratio, 1.0))
    x, z, given = np.zeros(2), np.array(law.start([0.0, 0.0], ())), 0.0
    for k in range(1500):
        (own,), z = step([x[0], 0.0, 0.0], (0.1, 0.0, 0.0, 0.0), z)
        given = other(x[0], given, 0.1)
        assert own == pytest.approx(given, abs=1e-6 * LIMIT), k
        total = 1.3 * own - 5.0
        x = np.array([x[0] + PERIOD * x[1] + PERIOD**2 / 2 * total, x[1] + PERIOD * total])


TUNED = {
    "adrc": (20.0, 100.0, 1.0), "drive-cascade": (20.0, 80.0, 0.05, 1.0), "super-twisting": (20.0, 3.0, 8.0),
    "rise": (15.0, 15.0, 40.0, 5.0), "tde-nftsm": (30.0, 0.5, 3.0, 0.02),
}  # fmt: skip


#: Of rivals for the speed of a wheel behind a valve.
METERED = {
    "valve-pi": (0.04, 1.2e-3), "mfac": (0.1, 2e-3, 0.1, 0.3, 0.75), "valve-adrc": (60.0, 25.0, 50.0),
    "bsmc-tde": (3500.0, 3.5, 90.0, 0.5, 0.03, 0.08), "dvsc": (1e4, 1.2e-3, 9.5), "bac": (720.0, 0.32, 1e7),
}  # fmt: skip


def test_every_rival_is_tested():
    assert set(TUNED) | set(METERED) == set(rivals())


def metered(name, gains=None):
    """A step of a rival on the wheel, as (x, r, z) -> (u, z): states are speed, opening and pressure."""
    law = rivals()[name](plant=WHEEL.members[0].plant, modelling=("flow",))
    step = step_function(law, PERIOD)
    nominal, values = list(law.plant.values().values()), gains or METERED[name]
    return lambda x, r, z: tuple(np.array(v).ravel() for v in step(x, r, z, values, nominal, [0, 0])[:2]), law


@pytest.mark.parametrize("name", METERED)
def test_a_wheel_comes_to_its_speed_under_another_load(name):
    """A kilonewton more, without noise: integrals leave no error, the learned bound one of a millimetre a second."""
    member, gains = WHEEL.members[0], {"actuator": METERED[name]}
    law = rivals()[name](plant=member.plant, modelling=("flow",))
    course = ((0.0, 3000.0), (2.0, 3000.0), (2.1, 4000.0))
    trace = Loop(WHEEL, laws=[law]).trace(gains, Scenario(name="s", disturbances={"traction": course}))
    (own,) = trace.members.values()
    assert np.abs(own.error[-300:]).max() < (5e-3 if name == "bac" else 2e-4)
    assert 1e-3 < np.abs(own.error[2000:2500]).max() < 0.05


def test_no_integral_of_a_valve_winds_up():
    """Half a second of a speed that no opening gives, then none: the command leaves its limit at once."""
    for name in set(METERED) - {"bac", "mfac"}:
        step, law = metered(name)
        z = np.array(law.start([0.4, 0.4, 6e6], METERED[name]))
        for _ in range(500):
            (u,), z = step([0.4, 0.4, 6e6], (1.5, 0.0, 0.0, 0.0), z)
        assert u == 1.0
        (u,), z = step([0.4, 0.4, 6e6], (0.4, 0.0, 0.0, 0.0), z)
        assert u < 1.0, name


@pytest.mark.parametrize(("closed", "ratio"), [(10.0, 5.0), (20.0, 3.0)])
def test_adrc_of_a_speed_is_that_of_another_implementation(closed, ratio):
    """The same measurements, limits and constant reference, on a first-order plant whose gain is off by 30 %."""
    gain, wanted = 5.0, 0.3
    step, _ = metered("valve-adrc", (closed, closed * ratio, gain))
    (flow,), _ = step([wanted, 0, 0], (wanted, 0, 0, 0), [wanted, 0.0])
    other = StateSpace(order=1, delta=PERIOD, b0=gain, w_cl=closed, k_eso=ratio, m_lim=(-1.0 - flow, 1.0 - flow))
    v, z, given = 0.0, np.array([0.0, 0.0]), 0.0
    for k in range(1500):
        (own,), z = step([v, 0.0, 0.0], (wanted, 0.0, 0.0, 0.0), z)
        given = other(v, given, wanted)
        assert own - flow == pytest.approx(given, abs=1e-6), k
        v += PERIOD * (1.3 * gain * (own - flow) - 2.0 * v)


def test_mfac_is_the_textbooks_compact_form():
    """Estimate, reset and control law written out as in the paper, on a plant of first order."""
    first, eta, mu, rho, lam = gains = (0.5, 0.5, 0.01, 0.6, 1.0)
    step, law = metered("mfac", gains)
    z, v, before, phi, w, u, du = np.array(law.start([0.1, 0, 0], gains)), 0.1, 0.1, first, 0.0, None, 0.0
    term = WHEEL.members[0].plant.values()
    per = term["reduction"] * term["displacement"] / term["wheel_radius"] / term["rated_flow"]
    for k in range(400):
        wanted = 0.3 + 0.1 * np.sin(0.02 * k)
        (own,), z = step([v, 0.0, 0.0], (wanted, 0.0, 0.0, 0.0), z)
        phi += eta * du * (v - before - phi * du) / (mu + du**2)
        if phi < 1e-5 or abs(du) < 1e-5:
            phi = first
        total = np.clip(per * wanted + w + rho * phi * (wanted - v) / (lam + phi**2), -1, 1)
        du, u, w = 0.0 if u is None else total - u, total, total - per * wanted
        assert own == pytest.approx(total, abs=1e-12), k
        before, v = v, v + PERIOD * 20 * (total - v)


@pytest.mark.parametrize("name", TUNED)
def test_a_constant_load_leaves_no_error(name):
    errors = followed(rivals()[name], TUNED[name], lambda t: -5.0)
    assert np.abs(errors[-500:]).max() < 2e-5


def test_the_stiffness_of_the_cascade_is_that_of_its_gains():
    """A load that rises by 1 m/s³ leaves T_i / (ω_s K_v) of error: the integral must move at its rate."""
    position, speed, time = 20.0, 80.0, 0.05
    errors = followed(DriveCascade, (position, speed, time, 1.0), lambda t: -t)
    assert errors[-1] == pytest.approx(time / (speed * position), rel=0.02)


def test_no_integral_winds_up_at_the_limit():
    """A fifth of a second of a load over the limit, then none: the error is gone in the end."""
    for name, gains in TUNED.items():
        errors = followed(rivals()[name], gains, lambda t: -25.0 if 1.0 < t < 1.2 else 0.0, seconds=6.0)
        assert np.abs(errors[-500:]).max() < 1e-3, name


def test_super_twisting_keeps_its_surface_in_a_ball_of_the_order_of_the_period_squared():
    """|d'| <= 2, k_1 = 1.5 √2, k_2 = 2.2, a reference from the start: sampled once a millisecond."""
    errors = followed(SuperTwisting, (20.0, 1.5 * 2**0.5, 2.2), lambda t: np.sin(2 * t), reference=lambda t: (0.0,) * 4)
    assert np.abs(errors[1000:]).max() < 2e-5
