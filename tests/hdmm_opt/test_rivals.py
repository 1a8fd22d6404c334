"""The rivals: against an implementation of others, and on a double integrator where closed forms are known."""

import casadi as ca
import numpy as np
import pytest
from pyadrc import StateSpace

from hdmm_opt.control.rivals.adrc import Adrc
from hdmm_opt.control.rivals.drive_cascade import DriveCascade
from hdmm_opt.control.rivals.registry import rivals
from hdmm_opt.control.rivals.super_twisting import SuperTwisting
from hdmm_opt.plants import pmsm_emla

PERIOD, LIMIT = 1e-3, 20.0


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


def test_every_rival_is_tested():
    assert set(TUNED) == set(rivals())


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
