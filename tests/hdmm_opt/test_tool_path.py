"""A tool on its path: the tolerance holds for all t, and wider tolerances are not slower."""

import numpy as np
import pytest

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.machines.crane_geometry import reach, tool
from hdmm_opt.machines.crane_limits import joint_limits
from hdmm_opt.motions.tool_path import tool_path_task
from trajectories import bezier, solve, violations

START = np.array([0.3, -1.3, 0.4])
HERE = np.array([float(x) for x in tool(START)])
PATH = bezier([HERE, HERE + [0.3, 0.15], HERE + [0.6, 0.1]])


def test_the_tool_stays_on_its_path():
    durations = []
    for tolerance in (0.01, 0.05):
        task, guess = tool_path_task(PATH, START, tolerance=tolerance)
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


def test_reach_is_the_inverse_of_the_tool():
    random = np.random.default_rng(0)
    low, high = joint_limits().room
    for w in random.uniform(low + 0.1, high - 0.1, (20, 3)):
        place = [float(x) for x in tool(w)]
        found = reach(place, w[2], w + [0.05, -0.05, 0.0])
        assert [float(x) for x in tool(found)] == pytest.approx(place, abs=1e-10)
    assert reach((9.0, 9.0), 0.5, START) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tolerance": 0.0}, "positive tolerance: got 0 m"),
        ({"start": START + [0.1, 0.0, 0.0]}, r"got 0\.\d+ m beside it"),
        ({"path": bezier([HERE, HERE + [3.0, 0.0]])}, r"it cannot at \(.*% of it"),
    ],
)
def test_what_cannot_be_followed_says_why(change, message):
    given = {"path": PATH, "start": START, "tolerance": 0.01, **change}
    with pytest.raises(InvalidInputError, match=message):
        tool_path_task(given.pop("path"), given.pop("start"), **given)
