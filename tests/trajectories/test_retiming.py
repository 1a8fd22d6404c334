"""Motion along a path: closed forms, the chain rule, and the spline program against TOPP-RA."""

import casadi as ca
import numpy as np
import pytest
from pushes import push

from hdmm_opt.motions.enclosure import enclosure
from trajectories import (
    LimitViolatedError,
    MotionLimits,
    Quantities,
    along,
    bezier,
    guess_of,
    law_guess,
    path_task,
    retime,
    solve,
    violations,
)
from trajectories.path import composed
from trajectories.task import Task, Waypoint

LIMITS = MotionLimits(
    position=(-3.0, 3.0), speed=[0.5, 0.8], acceleration=[1.0, 1.2], names=("a", "b"), units=("rad", "rad")
)
CURVE = bezier([[0.0, 0.2], [1.5, -0.5], [-0.4, 1.2], [1.0, 0.6]])


def arm_torques(limit):
    """Two links under gravity: torques affine in the accelerations and in the products of speeds."""
    q, v, a, j = (ca.SX.sym(n, 2) for n in "qvaj")
    c, s = ca.cos(q[1]), ca.sin(q[1])
    mass = ca.vertcat(ca.horzcat(3 + 2 * c, 1 + c), ca.horzcat(1 + c, 1))
    torque = mass @ a + ca.vertcat(-s * (2 * v[0] * v[1] + v[1] ** 2), s * v[0] ** 2)
    torque += 9.81 * ca.vertcat(2 * ca.cos(q[0]) + ca.cos(q[0] + q[1]), ca.cos(q[0] + q[1]))
    function = ca.Function("torque", [q, v, a, j], [torque])
    return Quantities(
        function=function, names=("first torque", "second torque"), units=("N m", "N m"), lower=-np.array(limit),
        upper=np.array(limit), enclose=enclosure(function),
    )  # fmt: skip


def test_motion_along_a_path_obeys_the_chain_rule():
    """Against numerical differentiation of the composition."""
    curves = [ca.SX.sym(name) for name in ("s", "ds", "dds", "ddds")]
    motion = ca.Function("motion", curves, composed(CURVE, curves))

    def law(t):
        return 0.5 + 0.3 * np.sin(t)

    t, step = 0.7, 1e-3
    found = [np.array(part).ravel() for part in motion(law(t), 0.3 * np.cos(t), -0.3 * np.sin(t), -0.3 * np.cos(t))]
    near = np.array([CURVE(law(t + k * step))[0] for k in range(-3, 4)])
    stencils = {1: [-1, 9, -45, 0, 45, -9, 1], 2: [2, -27, 270, -490, 270, -27, 2], 3: [1, -8, 13, 0, -13, 8, -1]}
    for order, divisor in ((1, 60), (2, 180), (3, 8)):
        assert np.array(stencils[order]) @ near / divisor / step**order == pytest.approx(
            found[order], rel=1e-5, abs=1e-6
        )


def test_a_straight_line_is_followed_bang_bang():
    """T = d/v + v/a of the slowest coordinate; with little way, 2 sqrt(d/a)."""
    for distance, exact in ((2.0, 2.0 / 0.5 + 0.5 / 1.0), (0.1, 2 * (0.1 / 1.0) ** 0.5)):
        found = retime(bezier([[0.0, 0.0], [distance, 0.0]]), LIMITS, enclosure)
        assert exact * (1 - 1e-9) <= found.duration <= 1.002 * exact


@pytest.mark.parametrize("limit", [(60.0, 30.0), (32.0, 11.0)])
def test_the_spline_program_agrees_with_toppra_when_jerk_is_free(limit):
    """Within 1 %, and never beaten by more, with and without torques that bind; both inside every limit for all t."""
    torques = arm_torques(limit)
    quantities = along(CURVE, LIMITS, torques, enclosure)
    retimed = retime(CURVE, LIMITS, enclosure, torques)
    task = path_task(quantities, degree=3, rest=2, spans=80)
    motion = solve(task)
    assert abs(motion.cost / retimed.duration - 1) < 0.01
    assert solve(task, guess=law_guess(retimed, task)).cost == pytest.approx(motion.cost, rel=2e-3)
    for law in (motion.spline, retimed.law):
        t = np.linspace(0, law.end, 10_000)
        values = quantities.values(law, t)
        assert (values <= quantities.upper[:, None]).all() and (values >= quantities.lower[:, None]).all()
    assert retimed.peaks.inside and retimed.share > 0.97
    first = retimed.peaks.upper[-2] / limit[0]
    assert (first > 0.99) == (limit[0] == 32.0)  # the torque binds in one of the cases


def test_jerk_can_be_limited_after_retiming():
    """The spline program started from TOPP-RA's law keeps a jerk limit that TOPP-RA cannot."""
    limits = MotionLimits(**{**vars(LIMITS), "jerk": [8.0, 8.0]})
    retimed = retime(CURVE, limits, enclosure)
    task = path_task(along(CURVE, limits, None, enclosure))
    motion = solve(task, guess=law_guess(retimed, task, 1.2))
    assert motion.cost > retimed.duration
    t = np.linspace(0, motion.spline.end, 5001)
    values = task.quantities.values(motion.spline, t)
    jerks = [i for i, name in enumerate(task.quantities.names) if name.endswith("jerk")]
    assert len(jerks) == 2 and np.abs(values[jerks]).max() <= 8.0
    assert np.abs(values[jerks]).max() > 7.0


def test_a_retimed_path_starts_the_search_for_a_free_motion():
    """The free motion leaves the path and is quicker."""
    limits = MotionLimits(**{**vars(LIMITS), "jerk": [20.0, 20.0]})
    task = Task(waypoints=tuple(Waypoint(value=CURVE([s])[0]) for s in (0.0, 1.0)), limits=limits)
    retimed = retime(CURVE, limits, enclosure)
    motion = solve(task, guess=guess_of(retimed, CURVE, task))
    assert motion.cost < retimed.duration and not violations(motion.spline, limits)


def test_a_path_that_cannot_be_held_says_where_and_what():
    with pytest.raises(LimitViolatedError, match=r"at rest at \d+ % of it first torque is .* N m, its limit 20 N m"):
        retime(CURVE, LIMITS, enclosure, arm_torques((20.0, 30.0)))


def test_curves_are_polynomials_of_their_points():
    points = np.array([[0.0, 0.2], [1.5, -0.5], [-0.4, 1.2], [1.0, 0.6]])
    s = np.linspace(0, 1, 11)
    work = points[None] * np.ones((11, 1, 1))
    while work.shape[1] > 1:
        work = work[:, :-1] * (1 - s)[:, None, None] + work[:, 1:] * s[:, None, None]
    assert CURVE(s) == pytest.approx(work[:, 0], abs=1e-12)
    for wrong in ([[0.0, 1.0]], [[0.0], [np.nan]]):
        with pytest.raises(ValueError, match="two or more finite"):
            bezier(wrong)


def test_what_toppra_cannot_keep_is_refused():
    with pytest.raises(ValueError, match="depends on jerk"):
        retime(CURVE, LIMITS, enclosure, push(lambda x, v, a, j: j[0], -0.01, 0.01, count=2))
    with pytest.raises(LimitViolatedError, match="path_task"):
        retime(CURVE, LIMITS, enclosure, push(lambda x, v, a, j: a[0] + 3 * ca.tanh(v[0] / 0.01), -2.0, 2.0, count=2))
    with pytest.raises(ValueError, match="needs a finite limit"):
        along(CURVE, MotionLimits(position=(-1, 1), names=("a", "b"), units=("rad", "rad")), None, enclosure)


def test_a_lower_limit_above_zero_is_kept():
    found = retime(CURVE, LIMITS, enclosure, push(lambda x, v, a, j: 10 + a[0] - 0.3 * v[0], 9.3, 30.0, count=2))
    assert found.peaks.lower[-1] >= 9.3 and found.peaks.inside
