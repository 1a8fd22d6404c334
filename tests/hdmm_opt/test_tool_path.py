"""A tool on its path: the tolerance holds for all t, and wider tolerances are not slower."""

import numpy as np
import pytest

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.machines.crane_geometry import reach, tool
from hdmm_opt.machines.crane_limits import joint_limits
from hdmm_opt.motions.job import Job, Move
from hdmm_opt.motions.tool_path import path_task
from trajectories import bezier, solve, violations

START = np.array([0.3, -1.3, 0.4])
HERE = np.array([float(x) for x in tool(START)])
POINTS = [HERE, HERE + [0.3, 0.15], HERE + [0.6, 0.1]]
PATH = bezier(POINTS)


def along(points, tolerance, **options):
    """A job of one move along a path, and its task and guess."""
    move = Move(path=tuple(map(tuple, points)), tolerance=tolerance, **options)
    job = Job(start=tuple(START), moves=(move,))
    return path_task(job, move, job.at, job.mover.cost(), 24)


def test_the_tool_stays_on_its_path():
    durations = []
    for tolerance in (0.01, 0.05):
        task, guess = along(POINTS[1:], tolerance)
        motion = solve(task, guess=guess)
        places = motion.spline(np.linspace(0.0, motion.spline.end, 2000))
        tools = np.array([[float(x) for x in tool(w)] for w in places[:, :3]])
        assert np.hypot(*(tools - PATH(places[:, 3])).T).max() <= tolerance
        assert motion.peaks.inside and not violations(motion.spline, task.limits)
        assert places[0] == pytest.approx([*START, 0.0], abs=1e-9) and places[-1, 3] == pytest.approx(1.0)
        values = task.quantities.values(motion.spline, np.linspace(0.0, motion.spline.end, 2000))
        assert (values <= task.quantities.upper[:, None]).all() and (values >= task.quantities.lower[:, None]).all()
        durations.append(motion.cost)
    assert durations[1] <= durations[0] * (1 + 1e-6)


def test_the_tool_turns_along_its_path():
    """The angle goes evenly from where it is to the one asked for."""
    end = START[0] + START[1] + 0.2
    task, guess = along(POINTS[1:], 0.02, angle=end, angle_tolerance=0.01)
    motion = solve(task, guess=guess)
    places = motion.spline(np.linspace(0.0, motion.spline.end, 2000))
    wanted = START[0] + START[1] + 0.2 * places[:, 3]
    assert np.abs(places[:, 0] + places[:, 1] - wanted).max() <= 0.01
    tools = np.array([[float(x) for x in tool(w)] for w in places[:, :3]])
    assert np.hypot(*(tools - PATH(places[:, 3])).T).max() <= 0.02


def test_reach_is_the_inverse_of_the_tool():
    random = np.random.default_rng(0)
    low, high = joint_limits().room
    for w in random.uniform(low + 0.1, high - 0.1, (20, 3)):
        place = [float(x) for x in tool(w)]
        found = reach(place, w[2], w + [0.05, -0.05, 0.0])
        assert [float(x) for x in tool(found)] == pytest.approx(place, abs=1e-10)
    assert reach((9.0, 9.0), 0.5, START) is None


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        (POINTS[1:], {"tolerance": 0.0}, "positive tolerance: got 0 m"),
        (POINTS[1:], {"tolerance": 0.01, "angle": 0.0}, "positive tolerance: got 0.01 m and 0 rad"),
        ([HERE + [3.0, 0.0]], {"tolerance": 0.01}, r"it cannot at \(.*% of it"),
    ],
)
def test_what_cannot_be_followed_says_why(points, options, message):
    with pytest.raises(InvalidInputError, match=message):
        along(points, **options)
