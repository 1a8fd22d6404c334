import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trajectories import (
    Cost,
    LimitViolatedError,
    MotionLimits,
    Quantities,
    Reference,
    Spline,
    Task,
    Waypoint,
    constant,
    peaks,
    pieces,
    quintic,
    shortest_duration,
    solve,
    violations,
)
from trajectories.program import derivative_matrices
from trajectories.spline import clamped_knots, joined

LIMITS = MotionLimits(speed=0.1, acceleration=0.5, jerk=1e3, position=(0.0, 0.6))


def at(*values):
    return Waypoint(value=np.array(values, dtype=float))


def task(start=0.1, goal=0.4, **changes):
    return Task(**{"waypoints": (at(start), at(goal)), "limits": LIMITS, **changes})


def squared(order):
    """The running cost of the squared derivative."""
    curves = [ca.SX.sym(n) for n in "xvaj"]
    return ca.Function("squared", curves, [curves[order] ** 2])


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
    matrices = derivative_matrices(12, 5)
    for order in range(4):
        expected = spline.derivative_points(order)[1]
        assert matrices[order] @ np.array(points) / 3.0**order == pytest.approx(expected, abs=1e-9)
    found = pieces(spline)
    assert found.width.sum() == pytest.approx(3.0)
    assert found.curves[0][:, 0, 0] == pytest.approx(spline(np.arange(12) / 4), abs=1e-9)
    low, high = found.halved().ranges()
    for i in range(24):
        inside = found.halved().start[i] + found.halved().width[i] * np.linspace(0.001, 0.999, 40)
        for order in range(5):
            values = spline(inside, order)
            room = 1e-9 * (1 + np.abs(values).max())
            assert (values >= low[order, 0, i] - room).all() and (values <= high[order, 0, i] + room).all()


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_joined_splines_are_both_of_them(degree):
    """The second one's first control points are solved for so that it continues the first one twice smoothly."""
    random = np.random.default_rng(degree)
    knots = clamped_knots(0.0, 2.0, 6, degree), clamped_knots(2.0, 5.0, 4, degree)
    points = [random.normal(size=(len(own) - degree - 1, 3)) for own in knots]
    first = Spline(knots=knots[0], coefficients=points[0])
    unit = Spline(knots=knots[1], coefficients=np.eye(len(points[1])))
    starts = np.stack([unit.derivative_points(order)[1][0] for order in range(3)])
    ends = np.stack([first.derivative_points(order)[1][-1] for order in range(3)])
    points[1][:3] = np.linalg.solve(starts[:, :3], ends)
    second = Spline(knots=knots[1], coefficients=points[1])
    whole = joined(first, second)
    for order in range(4):
        for part, t in ((first, np.linspace(0, 1.999, 50)), (second, np.linspace(2.001, 5, 50))):
            assert whole(t, order) == pytest.approx(part(t, order), rel=1e-9, abs=1e-9)
    assert whole.degree == degree and len(whole.coefficients) == len(points[0]) + len(points[1]) - 3
    with pytest.raises(ValueError, match="follow each other"):
        joined(second, first)


def test_minimum_time_reaches_the_trapezoid_when_jerk_is_free():
    """Speed and acceleration limits alone: T = d/v + v/a; the polygon's distance falls as spans grow."""
    exact = 0.3 / 0.1 + 0.1 / 0.5
    costs = [solve(task(spans=spans)).cost for spans in (30, 60, 120)]
    assert exact * (1 - 1e-9) <= costs[2] < costs[1] < costs[0] and costs[1] <= 1.015 * exact
    assert costs[2] <= 1.006 * exact
    assert not violations(solve(task(spans=60)).spline, LIMITS)


def test_minimum_effort_approaches_the_cubic():
    """Integral of the squared acceleration from rest to rest in time T: 12 d²/T³ (Euler-Lagrange)."""
    cost = Cost(time=0.0, running=squared(2), names=("effort",), weights=(1.0,))
    motion = solve(task(cost=cost, duration=5.0, spans=60))
    exact = 12 * 0.3**2 / 5.0**3
    assert exact * (1 - 1e-6) <= motion.cost <= 1.02 * exact
    assert motion.cost == pytest.approx(motion.parts["effort"]) and motion.spline.end == pytest.approx(5.0)


def test_minimum_jerk_is_the_quintic():
    """Integral of the squared jerk from rest to rest: 720 d²/T⁵, by 10 s³ - 15 s⁴ + 6 s⁵ (Flash and Hogan 1985)."""
    motion = solve(task(cost=Cost(time=0.0, jerk=1.0), duration=10.0))
    assert motion.cost == pytest.approx(720 * 0.3**2 / 10.0**5, rel=1e-6)
    t = np.linspace(0, 10, 101)
    assert motion.spline(t)[:, 0] == pytest.approx(quintic(0.1, 0.4, 0.0, 10.0)(t), abs=1e-6)


def test_a_weighted_sum_lies_between_its_parts():
    """T + w 720 d²/T⁵ is least at T⁶ = 3600 w d², where the limits leave it alone."""
    weight = 2e4
    motion = solve(task(cost=Cost(time=1.0, jerk=weight)))
    best = (3600 * weight * 0.3**2) ** (1 / 6)
    assert motion.parts["time"] == pytest.approx(best, rel=1e-3)
    assert motion.cost == pytest.approx(best + weight * 720 * 0.3**2 / best**5, rel=1e-5)


def affine(limit, bound=None):
    """A torque 40 x'' + 20 with its exact bounds on a piece."""
    x, v, a, j = (ca.SX.sym(n) for n in "xvaj")

    def enclose(found):
        low, high = found.ranges()
        return 40 * low[2] + 20, 40 * high[2] + 20

    return Quantities(
        function=ca.Function("torque", [x, v, a, j], [40 * a + 20]), names=("torque",), units=("N m",),
        lower=np.array([-limit if bound is None else bound]), upper=np.array([limit]), enclose=enclose,
    )  # fmt: skip


def test_a_quantity_stays_inside_its_limits_between_the_collocation_points():
    motion = solve(task(quantities=affine(28.0)))
    t = np.linspace(0, motion.spline.end, 20_001)
    dense = (40 * motion.spline(t, 2) + 20).max()
    assert dense <= motion.peaks.upper[0] <= 28.0 and motion.peaks.inside
    assert dense > 0.98 * 28.0
    again = peaks(motion.spline, affine(28.0))
    assert again.upper == motion.peaks.upper and again.lower == motion.peaks.lower


def test_a_bound_that_cannot_be_shown_is_not_accepted():
    """Bounds that say nothing on a span: the motion is tightened, solved again, and refused in the end."""
    known = affine(28.0)

    def blind(found):
        low, high = known.enclose(found)
        return low, np.where((found.start <= 1.0) & (found.start + found.width > 1.0), 29.0, high)

    with pytest.raises(LimitViolatedError):
        solve(task(quantities=Quantities(**{**vars(known), "enclose": blind})))


def test_too_little_time_says_how_much_would_do():
    with pytest.raises(LimitViolatedError, match=r"speed would be .* m/s over its limit 0\.1 m/s") as caught:
        solve(task(longest=2.0))
    would = float(str(caught.value).split("with the limits as they are, ")[1].split(" s would do")[0])
    assert solve(task(longest=would)).cost <= would


def test_a_place_that_cannot_be_held_says_which_limit():
    with pytest.raises(LimitViolatedError, match=r"at rest at the start, torque is 20 N m, its limit 15 N m"):
        solve(task(quantities=affine(15.0)))
    with pytest.raises(LimitViolatedError, match=r"position 0\.7 m leaves the stroke 0…0\.6 m"):
        solve(task(goal=0.7))


def test_a_limit_that_is_in_the_way_is_named_with_its_place_and_what_would_do():
    """The torque may not fall below 19.9: too little to brake within the time; less would do."""
    with pytest.raises(
        LimitViolatedError, match=r"torque would be .* N m under its limit 19\.9 N m at .* % of the way"
    ) as caught:
        solve(task(quantities=affine(60.0, 19.9), longest=6.0))
    least = float(str(caught.value).split("% of the way: ")[1].split()[0])
    assert least < 19.9 and solve(task(quantities=affine(60.0, least), longest=6.0)).cost <= 6.0


@pytest.mark.parametrize(
    "change", [{"waypoints": (at(0.1),)}, {"degree": 2}, {"spans": 1}, {"rest": 1}, {"longest": 0.0}, {"duration": -1.0},
               {"waypoints": (at(0.1), at(np.nan))}, {"waypoints": (at(0.1, 0.2), at(0.1, 0.3))}],
)  # fmt: skip
def test_a_task_that_is_none_is_refused(change):
    with pytest.raises(ValueError, match="got"):
        task(**change)


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
