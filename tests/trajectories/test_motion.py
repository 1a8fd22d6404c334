"""Motions of several coordinates: derivatives of the program, waypoints, tools, obstacles."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pushes import push

from trajectories import (
    Ball,
    Cost,
    HalfSpace,
    LimitViolatedError,
    MotionLimits,
    Quantities,
    Task,
    Waypoint,
    jerk_limited,
    solve,
    violations,
)
from trajectories.guess import straight
from trajectories.program import build

LIMITS = MotionLimits(
    position=([-2.0, -2.0, 0.0], [2.0, 2.0, 1.0]), speed=[0.5, 0.6, 0.3], acceleration=[1.0, 1.0, 0.8], jerk=[8.0, 8.0, 6.0],
    names=("a", "b", "c"), units=("rad", "rad", "m"),
)  # fmt: skip


def at(*values):
    return Waypoint(value=np.array(values, dtype=float))


def tool():
    w = ca.SX.sym("w", 3)
    reach = 1.5 + w[2]
    return ca.Function(
        "tool",
        [w],
        [ca.vertcat(ca.cos(w[0]) + reach * ca.cos(w[0] + w[1]), ca.sin(w[0]) + reach * ca.sin(w[0] + w[1]))],
    )


def wide(low, high):
    """Bounds that hold for whatever takes part: for tests that look at something else."""
    return lambda found: (np.full((1, len(found.start)), low), np.full((1, len(found.start)), high))


def nonlinear():
    """A quantity and a cost in which everything is coupled."""
    x, v, a, j = curves = [ca.SX.sym(n, 3) for n in "xvaj"]
    value = ca.sin(x[0]) * a[1] + v[0] * v[2] * ca.cos(x[1]) + 0.1 * j[2] * x[2]
    return (
        Quantities(function=ca.Function("q", curves, [ca.vertcat(value, a[0] + x[1] ** 2)]), names=("p", "q"), units=("1", "1"), lower=np.array([-0.7, -np.inf]), upper=np.array([0.9, 3.0]), enclose=wide(0, 0)),
        Cost(time=1.0, jerk=1e-3, running=ca.Function("r", curves, [ca.vertcat(ca.sumsqr(a), v[0] ** 2 * x[2])]), names=("e", "f"), weights=(0.3, 0.2)),
    )  # fmt: skip


@pytest.mark.parametrize("relaxed", [False, True])
@pytest.mark.parametrize("places", [2, 3])
def test_derivatives_of_the_program_are_those_of_its_functions(relaxed, places):
    """By hand and sparse, against CasADi's differentiation of the cost and the rows."""
    quantities, cost = nonlinear()
    middle = Waypoint(value=np.array([1.5, 1.0]), through=tool(), near=np.array([0.5, 0.2, 0.4]))
    task = Task(
        waypoints=(at(0, 0, 0), middle, at(1, 0.5, 0.8))[3 - places if places == 2 else 0 :]
        if places == 3
        else (at(0, 0, 0), at(1, 0.5, 0.8)),
        limits=LIMITS,
        quantities=quantities,
        cost=cost,
        spans=6,
    )
    program = build(task, relaxed=relaxed)
    x, p, f, g = (program.problem["nlp"][name] for name in "xpfg")
    random = np.random.default_rng(1)
    guess = straight(task)
    point = program.shape.packed([p + random.normal(0, 0.05, p.shape) for p in guess.points], guess.durations)
    point[program.shape.size - program.shape.slacks :] = random.uniform(0, 1, program.shape.slacks)
    weight = random.normal(size=g.numel())
    scale = 0.7
    symbol = ca.MX.sym("l", g.numel())
    gradient = ca.Function("d", [x, p], [ca.gradient(f, x)])
    jacobian = ca.Function("j", [x, p], [ca.jacobian(g, x)])
    hessian = ca.Function("h", [x, p, symbol], [ca.triu(ca.hessian(0.4 * f + ca.dot(symbol, g), x)[0])])
    dense = {
        "grad_f": (np.array(program.problem["grad_f"](point, scale)[1]), np.array(gradient(point, scale))),
        "jac_g": (
            np.array(ca.densify(program.problem["jac_g"](point, scale)[1])),
            np.array(ca.densify(jacobian(point, scale))),
        ),
        "hess_lag": (
            np.array(ca.densify(program.problem["hess_lag"](point, scale, 0.4, weight))),
            np.array(ca.densify(hessian(point, scale, weight))),
        ),
    }
    for own, oracle in dense.values():
        assert np.abs(oracle).max() > 0
        assert own == pytest.approx(oracle, rel=1e-9, abs=1e-9 * np.abs(oracle).max())


def test_the_slowest_coordinate_sets_the_time():
    """With jerk nearly free, the time is the largest d/v + v/a."""
    limits = MotionLimits(**{**vars(LIMITS), "jerk": [1e3] * 3})
    motion = solve(Task(waypoints=(at(0, 0, 0), at(1.0, 0.5, 0.9)), limits=limits, spans=60))
    exact = 0.9 / 0.3 + 0.3 / 0.8
    assert exact * (1 - 1e-9) <= motion.cost <= 1.01 * exact
    assert not violations(motion.spline, limits)


def test_it_passes_every_waypoint_and_is_smooth_there():
    places = [(0, 0, 0), (1.0, 0.5, 0.8), (1.5, 1.0, 0.2), (0, 0, 0.5)]
    motion = solve(Task(waypoints=tuple(at(*p) for p in places), limits=LIMITS))
    times = (0.0, *motion.arrivals)
    for t, place in zip(times, places, strict=True):
        assert motion.spline([t])[0] == pytest.approx(place, abs=1e-7)
    for t in motion.arrivals[:-1]:
        for order in range(3):
            before, after = motion.spline([t - 1e-9, t + 1e-9], order)
            assert before == pytest.approx(after, abs=1e-6)
        assert np.abs(motion.spline([t], 1)).max() > 0.05  # it does not stop
    for t in (0.0, motion.arrivals[-1]):
        assert np.abs(motion.spline([t], 1)).max() < 1e-9 and np.abs(motion.spline([t], 2)).max() < 1e-7
    assert not violations(motion.spline, LIMITS)
    stops = sum(solve(Task(waypoints=(at(*a), at(*b)), limits=LIMITS)).cost for a, b in pairwise(places))
    assert motion.cost < stops


def test_a_tool_reaches_its_goal_with_the_joints_it_likes():
    goal = np.array([0.4, 2.0])
    through = Waypoint(value=goal, through=tool(), near=np.array([1.0, 0.5, 0.3]))
    motion = solve(Task(waypoints=(at(0, 0, 0), through), limits=LIMITS))
    assert np.array(tool()(motion.spline.coefficients[-1])).ravel() == pytest.approx(goal, abs=1e-7)
    assert not violations(motion.spline, LIMITS)
    fixed = solve(Task(waypoints=(at(0, 0, 0), at(*motion.spline.coefficients[-1] + [0.0, 0.0, 1e-9])), limits=LIMITS))
    assert motion.cost <= fixed.cost * (1 + 1e-4)


def test_a_free_coordinate_is_chosen():
    motion = solve(
        Task(
            waypoints=(at(0, 0, 0), Waypoint(value=np.array([1.0, np.nan, 0.1]), near=np.array([0, 1.5, 0]))),
            limits=LIMITS,
        )
    )
    alone = solve(Task(waypoints=(at(0, 0, 0), at(1.0, 0.0, 0.1)), limits=LIMITS))
    assert motion.cost == pytest.approx(alone.cost, rel=1e-5)
    assert np.abs(motion.spline([motion.spline.end], 1)).max() < 1e-9


def around(obstacle):
    """Clearance of a point (x0, x1), with bounds from the ranges of its coordinates."""
    x, v, a, j = (ca.SX.sym(n, 3) for n in "xvaj")

    def enclose(found):
        low, high = found.ranges()
        low, high = low[0], high[0]
        centre = np.array(obstacle.centre)[:, None]
        far = np.maximum(np.abs(low[:2] - centre), np.abs(high[:2] - centre))
        near = np.maximum(0.0, np.maximum(low[:2] - centre, centre - high[:2]))
        return tuple(((part**2).sum(axis=0) - obstacle.radius**2)[None] / (2 * obstacle.radius) for part in (near, far))

    return Quantities(function=ca.Function("clear", [x, v, a, j], [obstacle.clearance(x)]), names=("clearance",), units=("m",), lower=np.zeros(1), upper=np.array([np.inf]), enclose=enclose)  # fmt: skip


def test_it_goes_round_an_obstacle_for_all_t():
    post = Ball(name="post", centre=(0.5, 0.05), radius=0.3)
    motion = solve(Task(waypoints=(at(0, 0, 0), at(1.0, 0.1, 0.3)), limits=LIMITS, quantities=around(post)))
    free = solve(Task(waypoints=(at(0, 0, 0), at(1.0, 0.1, 0.3)), limits=LIMITS))

    def nearest(found):
        return np.hypot(*(found.spline(np.linspace(0, found.spline.end, 20_001))[:, :2] - post.centre).T).min()

    assert nearest(free) < 0.1 < post.radius <= nearest(motion) and motion.peaks.lower[0] >= 0.0
    assert free.cost <= motion.cost * (1 + 1e-6)


def test_a_goal_inside_an_obstacle_is_refused():
    post = Ball(name="post", centre=(1.0, 0.1), radius=0.3)
    with pytest.raises(LimitViolatedError, match=r"at rest at the goal, clearance is -0\.299999 m"):
        solve(Task(waypoints=(at(0, 0, 0), at(1.0, 0.1, 0.3)), limits=LIMITS, quantities=around(post)))
    with pytest.raises(ValueError, match="positive radius"):
        Ball(name="post", centre=(0.0, 0.0), radius=0.0)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.1, 2), st.floats(0, 6.2))
def test_clearance_is_a_distance(x, y, radius, angle):
    ball = Ball(name="b", centre=(x, y), radius=radius)
    near = (x + (radius + 1e-6) * np.cos(angle), y + (radius + 1e-6) * np.sin(angle))
    assert ball.clearance(near) == pytest.approx(1e-6, rel=1e-3)
    assert ball.clearance((x, y)) < 0
    far = (x + (radius + 2.5) * np.cos(angle), y + (radius + 2.5) * np.sin(angle))
    assert ball.clearance(far) == pytest.approx(2.5, rel=1e-9)
    wall = HalfSpace(name="w", normal=(np.cos(angle), np.sin(angle)), offset=radius)
    assert wall.clearance((x, y)) == pytest.approx(radius - x * np.cos(angle) - y * np.sin(angle))


@settings(max_examples=15)
@given(st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6))
def test_never_faster_than_the_jerk_limited_optimum_of_the_coordinates(values):
    """Ruckig's time is the exact optimum without efforts; control points cost little."""
    start, goal = np.array(values[:3]), np.array(values[3:])
    limits = MotionLimits(**{**vars(LIMITS), "position": (-2.0, 2.0)})
    if np.abs(goal - start).max() < 1e-3:
        return
    try:
        best = jerk_limited(start, goal, limits)
    except LimitViolatedError as error:  # control points lose their jerk in rounding where a phase takes no time
        assert "phases of the move are too short" in str(error)
        return
    assert violations(best, limits) == [] and best([best.end])[0] == pytest.approx(goal)
    if np.abs(goal - start).max() > 0.05:
        motion = solve(Task(waypoints=(at(*start), at(*goal)), limits=limits, spans=40))
        assert best.end * (1 - 1e-6) <= motion.cost <= 1.06 * best.end


def test_a_waypoint_may_lie_on_a_limit():
    """The polygon of the joined spline passes the limit there, the hulls of its pieces do not."""
    places = [(0, 0, 0.5), (0.5, 0.4, 0.0), (1.0, 0.0, 1.0), (0.2, 0.3, 0.4)]
    motion = solve(Task(waypoints=tuple(at(*p) for p in places), limits=LIMITS))
    t = np.linspace(0, motion.spline.end, 20_001)
    assert motion.spline(t)[:, 2].min() >= -1e-9 and motion.spline(t)[:, 2].max() <= 1 + 1e-9
    assert motion.spline([motion.arrivals[0]])[0] == pytest.approx(places[1], abs=1e-7)


def test_bounds_that_are_infinite_are_refused_and_not_followed():
    x, v, a, j = (ca.SX.sym(n, 3) for n in "xvaj")
    nothing = Quantities(
        function=ca.Function("q", [x, v, a, j], [v[0]]), names=("speed",), units=("rad/s",), lower=np.array([-np.inf]),
        upper=np.array([1.0]), enclose=wide(-np.inf, np.inf),
    )  # fmt: skip
    with pytest.raises(LimitViolatedError, match="within 60 s"):
        solve(Task(waypoints=(at(0, 0, 0), at(1.0, 0.1, 0.3)), limits=LIMITS, quantities=nothing))


def test_several_limits_that_are_in_the_way_would_do_together():
    places = [(0, 0, 0), (1.0, 0.5, 0.8), (1.5, 1.0, 0.2)]
    task = Task(waypoints=tuple(at(*p) for p in places), limits=LIMITS, longest=4.0)
    with pytest.raises(LimitViolatedError, match="together with") as caught:
        solve(task)
    wider = {name: np.array(getattr(LIMITS, name), dtype=float) for name in ("speed", "acceleration", "jerk")}
    for part in str(caught.value).split("the limits: ")[1].split("; ")[0].split(", together with "):
        coordinate, kind = part.split()[:2]
        wider[kind][LIMITS.names.index(coordinate)] = float(part.split(": ")[1].split()[0])
    assert solve(Task(**{**vars(task), "limits": MotionLimits(**{**vars(LIMITS), **wider})})).cost <= 4.0
    longer = float(str(caught.value).split("with the limits as they are, ")[1].split()[0])
    assert solve(Task(**{**vars(task), "longest": longer})).cost <= longer


AXIS = MotionLimits(position=(-10.0, 10.0), speed=1.0, acceleration=2.0, jerk=20.0, names=("a",))


@pytest.mark.parametrize("share", [0.97, 0.8])
@pytest.mark.parametrize("spans", [8, 24])
def test_a_wider_limit_of_a_quantity_that_would_do_does(share, spans):
    """Between the collocation points as well: it was tried before it was said."""
    given = {"waypoints": (at(0.0), at(1.0)), "limits": AXIS, "spans": spans}
    best = solve(Task(**given, quantities=push(lambda x, v, a, j: a, -1.5, 3.0))).cost
    with pytest.raises(LimitViolatedError, match="push would be") as caught:
        solve(Task(**given, quantities=push(lambda x, v, a, j: a, -1.5, 3.0), longest=share * best))
    found = str(caught.value)
    assert " would do" in found
    wider = {"lower": -1.5, "jerk": 20.0, "acceleration": 2.0, "speed": 1.0, "upper": 3.0}
    for part in found.split("the limits: ")[1].split("; ")[0].split(", together with "):
        value = float(part.split(": ")[1].split()[0])
        key = next(
            (k for k in ("jerk", "acceleration", "speed") if part.startswith(f"a {k}")),
            "upper" if " over " in part else "lower",
        )
        wider[key] = value
    again = MotionLimits(**{**vars(AXIS), **{k: wider[k] for k in ("jerk", "acceleration", "speed")}})
    task = Task(
        **{**given, "limits": again},
        quantities=push(lambda x, v, a, j: a, wider["lower"], wider["upper"]),
        longest=share * best,
    )
    assert solve(task).cost <= share * best


def test_a_limit_is_not_said_to_do_where_it_is_the_one_that_there_is():
    limits = MotionLimits(position=(-10, 10), speed=1.0, acceleration=1e3, jerk=1e6, names=("a",))
    with pytest.raises(LimitViolatedError) as caught:
        solve(Task(waypoints=(at(0.0), at(1.0)), limits=limits, duration=1.05))
    assert float(str(caught.value).split("% of the way: ")[1].split()[0]) > 1.0


def test_the_quickest_motion_is_found_however_short():
    """The guess is far longer, and so is the admissible time."""
    tiny = Task(
        waypoints=(at(0.0), at(1e-3)),
        limits=MotionLimits(position=(-1, 1), names=("a",)),
        quantities=push(lambda x, v, a, j: a, -2.0, 2.0),
        rest=2,
    )
    found = [solve(Task(**{**vars(tiny), "longest": longest})).cost for longest in (1.0, 600.0)]
    assert found[0] == pytest.approx(2 * (1e-3 / 2) ** 0.5, rel=0.06) and found[1] == pytest.approx(found[0], rel=1e-4)


def test_a_later_begin_moves_the_knots_alone():
    task = Task(
        waypoints=(at(0.0), at(1e-4)),
        limits=MotionLimits(position=(-1, 1), speed=1.0, acceleration=200.0, jerk=2e4, names=("a",)),
    )
    early, late = solve(task), solve(task, 1e6)
    assert (early.spline.coefficients == late.spline.coefficients).all() and late.cost == early.cost
    assert late.spline.start == 1e6 and late.arrivals[0] == pytest.approx(1e6 + early.arrivals[0])


def test_an_absolute_value_is_bounded_without_its_slope():
    task = Task(
        waypoints=(at(0.0), at(1.0)),
        limits=AXIS,
        quantities=push(lambda x, v, a, j: ca.fabs(a) + 0.1 * ca.fabs(v), -1.0, 1.5),
    )
    motion = solve(task)
    values = task.quantities.values(motion.spline, np.linspace(0, motion.spline.end, 5000))
    assert values.max() <= motion.peaks.upper[0] <= 1.5 and values.max() > 1.4


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: push(lambda x, v, a, j: a, 1.0, 1.0), "lower limit below"),
        (lambda: MotionLimits(position=(0, 1), speed=0.0), "a limit of speed is positive"),
        (lambda: Cost(running=ca.Function("r", [ca.SX.sym(n) for n in "xvaj"], [1.0])), "a name and a weight"),
        (lambda: Waypoint(value=np.zeros(2), through=tool()), "needs coordinates near it"),
        (lambda: HalfSpace(name="w", normal=(0.0, 2.0), offset=1.0), "a normal has length 1"),
        (lambda: Task(waypoints=(at(1.0), at(1.0)), limits=AXIS), "not to the same one"),
        (lambda: Task(waypoints=(at(0.0), at(1.0)), limits=AXIS, duration=0.0), "duration is positive"),
        (lambda: Task(waypoints=(at(0.0), at(1.0)), limits=AXIS, longest=np.inf), "finite time"),
        (lambda: Task(waypoints=(at(0.0), at(1.0)), limits=AXIS, degree=3, spans=2), "control points for its rest"),
        (lambda: jerk_limited([0.0], [0.0], AXIS), "two places"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_limits_of_quantities_cannot_be_changed_behind_a_cache():
    with pytest.raises(ValueError, match="read-only"):
        push(lambda x, v, a, j: a, 0.0, 1.0).upper[0] = 2.0


def test_a_kept_program_gives_the_same_motion():
    """Tasks that differ in places alone share a program, and leave no trace in each other's motions."""
    from trajectories import program
    from trajectories.solver import solver_of

    first, other = (
        Task(waypoints=(at(0, 0, 0), at(*goal)), limits=LIMITS) for goal in ((1.0, 0.5, 0.8), (0.4, 0.9, 0.1))
    )
    program._built.cache_clear()
    solver_of.cache_clear()
    found = [solve(task).spline.coefficients for task in (first, other, first)]
    assert program._built.cache_info().misses == 1 and program._built.cache_info().hits >= 2
    assert np.array_equal(found[0], found[2]) and not np.allclose(found[0], found[1])


def test_a_motion_starts_and_ends_moving_and_keeps_to_its_tolerance():
    speed, acceleration = np.array([0.05, -0.02, 0.1]), np.array([0.1, 0.0, -0.05])
    start = Waypoint(value=np.zeros(3), speed=speed, acceleration=acceleration)
    via = Waypoint(value=np.array([0.5, 0.4, 0.3]), tolerance=np.array([0.02, 0.0, 0.02]))
    goal = Waypoint(value=np.array([1.0, 0.5, 0.8]), speed=-speed)
    motion = solve(Task(waypoints=(start, via, goal), limits=LIMITS))
    for got, wanted in zip(
        (motion.spline([0.0], k)[0] for k in range(3)), (np.zeros(3), speed, acceleration), strict=True
    ):
        assert got == pytest.approx(wanted, abs=1e-7)
    assert motion.spline([motion.spline.end], 1)[0] == pytest.approx(-speed, abs=1e-7)
    off = np.abs(motion.spline([motion.arrivals[0]])[0] - via.value)
    assert off[1] < 1e-7 and (off <= 0.02 + 1e-9).all() and off.max() > 0.01  # the room is used
    assert not violations(motion.spline, LIMITS)
    exact = solve(Task(waypoints=(start, Waypoint(value=via.value), goal), limits=LIMITS))
    assert motion.cost < exact.cost
    with pytest.raises(LimitViolatedError, match=r"at the start, .* speed is 9 "):
        fast = Waypoint(value=np.zeros(3), speed=np.array([9.0, 0.0, 0.0]))
        solve(Task(waypoints=(fast, goal), limits=LIMITS))
    with pytest.raises(ValueError, match="give the speed too"):
        Waypoint(value=np.zeros(3), acceleration=speed)


def test_a_jerk_limited_move_starts_and_ends_moving():
    speed, acceleration = np.array([0.05, -0.02, 0.1]), np.array([0.1, 0.0, -0.05])
    spline = jerk_limited(
        np.zeros(3), [1.0, 0.5, 0.8], LIMITS, speeds=(speed, -speed / 2), acceleration=acceleration
    )  # fmt: skip
    for order, wanted in enumerate((np.zeros(3), speed, acceleration)):
        assert spline([0.0], order)[0] == pytest.approx(wanted, abs=1e-9)
    assert spline([spline.end])[0] == pytest.approx([1.0, 0.5, 0.8])
    assert spline([spline.end], 1)[0] == pytest.approx(-speed / 2, abs=1e-6)
