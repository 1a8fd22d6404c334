"""The impulse-response certificate against worst cases that are computed without it."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from known_answers import DISTURBANCE, certify_impulse_chain, chain_bounds, claim_of, integrator_chain, verdict

from stability import Bounds, Failure, Gains, Impulse, Interval, LoopModel, Row, certify_impulse, from_casadi
from stability.loops.deviation import deviation_rows


def bound(found):
    assert isinstance(found, Impulse), found
    return 1e3 * float(found.ultimate[0])


def peak(bandwidths, period, disturbance=DISTURBANCE, fine=40, horizon=3.0):
    """Worst case of the sampled double integrator in mm: L1 norm by exact steps of a fraction of the period.

    Each constant piece of the disturbance in each fraction of a period is one input of the lifted system; the largest
    |x_1| over all times is the largest sum of magnitudes of responses, taken at every phase within the period.
    """
    w1, w2 = bandwidths
    h = period / fine
    step = np.array([[1.0, h], [0.0, 1.0]])
    push = np.array([h * h / 2, h])
    gain = -np.array([w1 * w2, w2])
    # state (x, v, u): u changes at the start of a period only
    inner = np.zeros((3, 3))
    inner[:2, :2], inner[:2, 2], inner[2, 2] = step, push, 1.0
    sample = np.eye(3)
    sample[2] = [*gain, 0.0]
    worst = 0.0
    for phase in (0, fine // 2):
        # response at time (n periods + phase) to a push in an earlier fraction, backwards in time
        row, total = np.array([1.0, 0.0, 0.0]), 0.0
        for k in range(round(horizon / h)):
            total += abs(row[:2] @ push)
            row = row @ inner
            if (k + 1 - phase) % fine == 0:
                row = row @ sample
        worst = max(worst, total)
    return 1e3 * disturbance * worst


@pytest.mark.parametrize(("period", "published"), [(1e-3, 0.582), (2e-3, 0.594), (5e-3, 0.632)])
def test_oracle_of_the_sampled_double_integrator(period, published):
    """Theory §3: the exact sampled worst case stays 0.544 mm; the quadratic certificate gives the published figure."""
    exact = peak((15.0, 100.0), period)
    assert exact == pytest.approx(0.544, abs=2e-3)
    found = certify_impulse_chain((15.0, 100.0), period=period)
    assert exact < bound(found) < published
    gains = (Gains(beta=30.0), Gains(beta=200.0))
    assert verdict(claim_of(integrator_chain(2), chain_bounds(2, period=period), gains, found))


@pytest.mark.parametrize(
    ("bandwidths", "spread"),
    # with a gain of 0.8 the poles of (20, 80) are complex, and no positive system is close
    [((15.0, 100.0), 0.0), ((10.0, 60.0), 0.0), ((20.0, 80.0), 0.0), ((15.0, 100.0), 0.2), ((10.0, 60.0), 0.2)],
)
def test_near_the_worst_case_and_never_below(bandwidths, spread):
    exact = peak(bandwidths, 1e-3)
    worst = exact / (1 - spread)  # at the smallest constant gain, the DC gain of an overdamped loop
    found = bound(certify_impulse_chain(bandwidths, period=1e-3, spread=spread))
    assert worst < found < worst * (1.06 if spread == 0 else 1.2)


@pytest.mark.parametrize(
    ("rates", "place", "norm"),
    [
        # (1 - s)/(s² + 0.2 s + 1) from -w to x_0
        (lambda x, w: [-1.2 * x[0] + x[1] - w, -2.2 * x[0] + x[1]], 0, 9.1759),
        (lambda x, w: [-0.2 * x[0] - x[1] + w, x[0], -x[0] + x[1] - x[2]], 2, 6.4886),
    ],
)
def test_known_norms_of_lightly_damped_systems(rates, place, norm):
    """Rutland and Lane (1995): L1 norms of systems that next to nothing controls, poles at 1 rad/s and damping 0.1."""
    order = 2 if place == 0 else 3
    names = (*(f"x{i}" for i in range(order)), "u", "w")
    z = ca.SX.sym("z", len(names))
    moved = rates([z[i] for i in range(order)], z[order + 1])
    plant = ca.vertcat(*[1.0] * order, moved[0] + z[order], *moved[1:])
    rows = tuple(Row(state=n, unit="1", target="zero" if k else "reference", controlled=not k)
                 for k, n in enumerate(names[:order]))  # fmt: skip
    model = LoopModel(
        rows=rows, input_map=(0,), inputs=("u",), plant=from_casadi(ca.Function("plant", [z], [plant]), names),
        law=(from_casadi(ca.Function("term", [ca.SX.sym("r")], [ca.SX(0)]), ("r1",)),),
    )  # fmt: skip
    bounds = Bounds(
        parameters={}, disturbances={"w": Interval(-1.0, 1.0)}, nominal={"w": 0.0}, reference=(Interval(0.0),) * 4,
        noise=(0.0,) * order, initial=(0.0,) * order, period=0.02,
    )  # fmt: skip
    gains = (Gains(beta=1e-9),)
    found = certify_impulse(model, bounds, gains, np.full(order, 1e3))
    assert isinstance(found, Impulse)
    assert norm < found.ultimate[place] < 1.02 * norm
    assert verdict(claim_of(model, bounds, gains, found))
    lower = replace(found, ultimate=np.where(np.arange(order) == place, 0.995 * norm, found.ultimate))
    assert not verdict(claim_of(model, bounds, gains, lower))


def test_unstable_rates_are_refused():
    """At (15, 100) the sampled loop is unstable from 20 ms."""
    assert isinstance(certify_impulse_chain((15.0, 100.0), period=21e-3), Failure)
    assert isinstance(certify_impulse_chain((15.0, 100.0), period=12e-3), Impulse)


@pytest.mark.parametrize(("inner", "stable"), [(300.0, True), (1900.0, True), (2100.0, False)])
def test_three_rows_agree_with_the_poles_of_the_map(inner, stable):
    """x1' = x2, x2' = x3, x3' = u at 1 kHz: the exact map has its fast pole at 0.72, -0.89 and -1.09."""
    bandwidths = (15.0, 100.0, inner)
    model, base, gains = integrator_chain(3), chain_bounds(3, period=1e-3), tuple(Gains(beta=2 * w) for w in bandwidths)
    step = np.array([[1, 1e-3, 5e-7], [0, 1, 1e-3], [0, 0, 1]])
    push = np.array([[1e-9 / 6], [5e-7], [1e-3]])
    poles = np.linalg.eigvals(step - inner * push @ np.array([[15.0 * 100.0, 100.0, 1.0]]))
    assert (np.abs(poles).max() < 1) == stable
    found = certify_impulse(model, base, gains, np.array([0.05, 1.0, 100.0]))
    assert isinstance(found, Impulse) == stable
    assert not stable or verdict(claim_of(model, base, gains, found))


def first_order(product, **changed):
    """x' = u + w, u = -κ x(t_k) with κ = 10."""
    base = chain_bounds(1, period=product / 10.0, disturbance=0.1)
    base = Bounds(**{**base.__dict__, **changed})
    gains = (Gains(beta=20.0),)
    return integrator_chain(1), base, gains, certify_impulse(integrator_chain(1), base, gains, np.array([1e6]))


@pytest.mark.parametrize("product", [0.05, 0.2, 0.5, 0.9])
def test_sampled_integrator_has_its_exact_bound(product):
    """For κT <= 1, x(t + T) = (1 - κT) x + T w is positive: the bound is D/κ, and T D/2 more between samples."""
    model, base, gains, found = first_order(product)
    exact = 1e3 * 0.1 / 10.0
    assert exact < bound(found) < exact * (1 + 1.05 * product + 0.01)
    assert verdict(claim_of(model, base, gains, found))


@pytest.mark.parametrize("product", [2.0, 2.5, 10.0])
def test_sampled_integrator_is_refused_from_the_stability_limit(product):
    assert isinstance(first_order(product)[3], Failure)


@pytest.mark.parametrize("unit", [1e-8, 1e-3, 1.0, 1e3, 1e8])
def test_bound_scales_with_the_unit(unit):
    found = certify_impulse_chain((15.0, 100.0), unit=unit, period=1e-3)
    assert bound(found) / unit == pytest.approx(bound(certify_impulse_chain((15.0, 100.0), period=1e-3)), rel=1e-3)
    model, base = integrator_chain(2, unit=unit), chain_bounds(2, period=1e-3)
    assert verdict(claim_of(model, base, (Gains(beta=30.0), Gains(beta=200.0)), found, accuracy=1e9, limit=1e20))


def test_noise_costs_what_it_moves():
    """A constant measurement error n moves x' = u to x = -n, and no more."""
    quiet = bound(first_order(0.2)[3])
    noisy = bound(first_order(0.2, noise=(1e-3,))[3])
    assert 1.0 <= noisy - quiet < 1.5


def test_an_initial_error_fades_with_the_transient():
    early = bound(first_order(0.2, initial=(0.1,))[3])
    late = bound(first_order(0.2, initial=(0.1,), transient=2.0)[3])
    assert early >= 100.0 and bound(first_order(0.2)[3]) <= late < 15.0  # the motion in a period is bounded coarsely


def test_cells_and_coordinates_only_help():
    plain = certify_impulse_chain((15.0, 100.0), period=1e-3, spread=0.2)
    refined = certify_impulse_chain((15.0, 100.0), period=1e-3, spread=0.2, refine=True)
    assert bound(refined) <= bound(plain)
    gains = (Gains(beta=30.0), Gains(beta=200.0))
    assert verdict(claim_of(integrator_chain(2), chain_bounds(2, period=1e-3, spread=0.2), gains, refined))


def test_a_delay_of_many_periods_is_refused_at_once():
    found = certify_impulse_chain((15.0, 100.0), period=1e-6, delay=1e-3)
    assert isinstance(found, Failure)
    assert "1e+03 periods, 8 is the limit" in found.reason


def test_a_continuous_law_is_no_business_of_this_certificate():
    assert isinstance(certify_impulse_chain((15.0, 100.0)), Failure)


def test_what_others_do_is_not_there_while_they_rest():
    """A load of bounded rate, and beside it what members that move do: a network starts as if that were not there."""
    model, gains = integrator_chain(2), (Gains(beta=30.0), Gains(beta=200.0, gamma=2e3, capacity=10.0))
    quiet = replace(
        chain_bounds(2, period=1e-3), nominal={}, disturbances={"w": Interval(0.0)},
        feedforward={"w": (Interval.symmetric(0.5), Interval.symmetric(5.0))},
    )  # fmt: skip
    loud = replace(quiet, disturbances={"w": Interval.symmetric(0.4)})
    found = []
    for bounds in (quiet, loud):
        certified = certify_impulse(model, bounds, gains, np.array([1.0, 10.0]))
        assert isinstance(certified, Impulse)
        rows = deviation_rows(model, bounds, gains, certified.box)
        claim = claim_of(model, bounds, gains, certified)
        assert verdict(claim)
        assert not verdict(replace(claim, ultimate=[0.9 * v for v in claim.ultimate]))
        found.append((rows.settled, rows.disturbance, certified.ultimate))
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-9)
    assert found[0][1][1] < 1e-9 < 0.39 < found[1][1][1]
    assert found[0][2][0] < found[1][2][0]


def near_a_wall(noise):
    """x' = u + c / (U - u): harmless unless the input, with its noise, comes near U."""
    z, y = ca.SX.sym("z", 3), ca.SX.sym("y", 2)
    force = z[1] + z[2] + 1e-6 / (0.16 - z[1])
    plant = from_casadi(ca.Function("plant", [z], [ca.vertcat(1.0, force)]), ("x", "u", "w"))
    term = from_casadi(ca.Function("term", [y], [ca.SX(0)]), ("x", "r1"))
    row = Row(state="x", unit="m", target="reference", controlled=True)
    model = LoopModel(rows=(row,), input_map=(0,), inputs=("u",), plant=plant, law=(term,))
    bounds = Bounds(
        parameters={}, disturbances={"w": Interval(0.0)}, nominal={}, reference=(Interval(0.0),) * 4, noise=(noise,),
        initial=(0.0,), period=1e-3,
    )  # fmt: skip
    gains = (Gains(beta=20.0),)
    return model, bounds, gains, certify_impulse(model, bounds, gains, np.array([1.0]))


def test_the_input_is_bounded_with_its_noise():
    """With noise of 0.01 an adversary can bring the input to the wall, where no bound holds; with 0.004 it cannot."""
    model, bounds, gains, found = near_a_wall(0.004)
    assert verdict(claim_of(model, bounds, gains, found))
    assert isinstance(near_a_wall(0.01)[3], Failure)
    forged = replace(
        found, input_bound=np.array([0.1005]), half_widths=np.array([0.010152]), ultimate=np.array([0.010112])
    )
    louder = replace(bounds, noise=(0.01,))
    assert not verdict(claim_of(model, louder, gains, forged))


def test_a_stuck_actuator_is_never_proved():
    """An effectiveness that may be zero leaves no gain to prove anything with; one of a tenth is another matter."""
    for spread in (1.0, 1.5):
        assert isinstance(certify_impulse_chain((15.0, 100.0), period=1e-3, spread=spread), Failure)
    assert isinstance(certify_impulse_chain((1.0, 50.0), period=1e-3, spread=0.5), Impulse)
