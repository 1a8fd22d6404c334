import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trajectories import (
    LimitViolatedError,
    MotionLimits,
    Reference,
    Spline,
    Task,
    constant,
    effort_peaks,
    quintic,
    shortest_duration,
    solve,
    violations,
)
from trajectories.collocation import derivative_matrices
from trajectories.limits import bezier_spans
from trajectories.spline import clamped_knots

LIMITS = MotionLimits(speed=0.1, acceleration=0.5, jerk=1e3, position=(0.0, 0.6))


def free_effort():
    """No effort limit bites; running cost acceleration squared."""
    x, v, a, j = (ca.SX.sym(n) for n in "xvaj")
    return ca.Function("effort", [x, v, a, j], [0 * a, a**2])


def task(**changes):
    given = {
        "start": 0.1, "goal": 0.4, "limits": LIMITS, "effort": free_effort(), "effort_names": ("none",),
        "effort_limits": (1.0,), "enclose": lambda ranges: [0.0],
    }  # fmt: skip
    return Task(**{**given, **changes})


@settings(max_examples=30)
@given(st.floats(0.01, 0.5), st.floats(0.51, 1.0), st.floats(0.5, 20.0))
def test_quintic_is_the_polynomial(start, goal, duration):
    spline = quintic(start, goal, 0.0, duration)
    s = np.linspace(0, 1, 301)
    exact = start + (goal - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)
    assert np.abs(spline(duration * s) - exact).max() < 1e-12
    rate = (goal - start) / duration * 30 * s**2 * (1 - s) ** 2
    assert np.abs(spline(duration * s, 1) - rate).max() < 1e-11 * 24 / duration


def test_quintic_bounds_hold_and_are_tight():
    spline = quintic(0.1, 0.4, 2.0, 6.0)
    t = np.linspace(2.0, 8.0, 20_001)
    for order, room in ((1, 1.01), (2, 1.02), (3, 1.001)):
        peak = np.abs(spline(t, order)).max()
        bound = max(map(abs, spline.bounds(order)))
        assert peak <= bound * (1 + 1e-12) and bound <= room * peak


def test_shortest_duration_touches_one_limit():
    for limits in ((0.05, 9.0, 99.0), (9.0, 0.05, 99.0), (9.0, 9.0, 0.05)):
        duration = shortest_duration(0.3, *limits)
        spline = quintic(0.0, 0.3, 0.0, duration)
        t = np.linspace(0, duration, 50_001)
        shares = [np.abs(spline(t, k)).max() / limit for k, limit in enumerate(limits, 1)]
        assert max(shares) == pytest.approx(1.0, rel=1e-6)


@settings(max_examples=30)
@given(st.lists(st.floats(-1, 1), min_size=17, max_size=17))
def test_control_points_bound_every_derivative(points):
    spline = Spline(knots=clamped_knots(0.0, 3.0, 12), coefficients=np.array(points))
    t = np.linspace(0, 3, 2001)
    for order in range(4):
        low, high = spline.bounds(order)
        values = spline(t, order)
        assert low - 1e-9 * abs(low) - 1e-9 <= values.min() and values.max() <= high + 1e-9 * abs(high) + 1e-9
    matrices = derivative_matrices(12)
    for order in range(4):
        expected = spline.derivative_points(order)[1]
        assert matrices[order] @ np.array(points) / 3.0**order == pytest.approx(expected, abs=1e-9)
    pieces = bezier_spans(spline)
    assert sum(width for _, width in pieces) == pytest.approx(3.0)
    assert [p[0] for p, _ in pieces] == pytest.approx(spline(np.arange(12) / 4), abs=1e-9)


def test_minimum_time_reaches_the_trapezoid_within_a_percent_when_jerk_is_free():
    """Speed and acceleration limits alone: T = d/v + v/a."""
    motion = solve(task(spans=60))
    exact = 0.3 / 0.1 + 0.1 / 0.5
    assert exact * (1 - 1e-9) <= motion.cost <= 1.02 * exact
    assert not violations(motion.spline, LIMITS)


def test_minimum_energy_approaches_the_cubic():
    """Integral of x''² from rest to rest in time T: 12 d²/T³ (Euler-Lagrange)."""
    motion = solve(task(objective="energy", longest=5.0, spans=60))
    exact = 12 * 0.3**2 / 5.0**3
    assert exact * (1 - 1e-6) <= motion.cost <= 1.02 * exact
    assert motion.spline.end == pytest.approx(5.0)


def test_effort_limit_holds_between_the_collocation_points():
    x, v, a, j = (ca.SX.sym(n) for n in "xvaj")
    effort = ca.Function("effort", [x, v, a, j], [ca.vertcat(40 * a + 20, -40 * a - 20), a**2])

    def enclose(ranges):
        low, high = ranges[2]
        return [40 * high + 20, -40 * low - 20]

    motion = solve(
        task(effort=effort, effort_names=("torque", "negative"), effort_limits=(28.0, 28.0), enclose=enclose)
    )
    t = np.linspace(0, motion.spline.end, 20_001)
    dense = (40 * motion.spline(t, 2) + 20).max()
    assert dense <= motion.effort_peaks[0] <= 28.0
    assert dense > 0.97 * 28.0
    assert effort_peaks(motion.spline, enclose, (28.0, 28.0)) == pytest.approx(motion.effort_peaks)


def test_what_cannot_be_reached_says_what_would_do():
    with pytest.raises(LimitViolatedError, match="would do"):
        solve(task(longest=2.0))
    with pytest.raises(LimitViolatedError):
        solve(task(goal=0.7))


def test_references_join_and_hold():
    reference = Reference(segments=(constant(0.1, 0, 1), quintic(0.1, 0.4, 1, 5), constant(0.4, 6, 7)))
    t = np.array([0.0, 0.5, 1.0, 3.5, 6.0, 7.0, 100.0])
    values = reference(t)
    assert values[0] == pytest.approx([0.1, 0.1, 0.1, 0.25, 0.4, 0.4, 0.4])
    assert values[1:, -1] == pytest.approx([0, 0, 0])
    step = 1e-5
    fine = np.arange(0.0, 7.0, step)
    numeric = np.gradient(reference(fine)[0], step)
    assert np.abs(numeric - reference(fine)[1]).max() < 1e-6
    with pytest.raises(ValueError, match="join"):
        Reference(segments=(constant(0.1, 0, 1), quintic(0.2, 0.4, 1, 5)))
