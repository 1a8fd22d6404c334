"""Motions from study files alone, on 10,000 points by Pinocchio's kinematics and dynamics; what studies cannot ask."""

import json

import casadi as ca
import numpy as np
import pinocchio
import pytest
from click.testing import CliRunner
from test_crane_dynamics import Closed

from hdmm_opt.cli import main
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.machines.crane_limits import ACCELERATION, JERK, SPEED, joint_limits
from hdmm_opt.plants.pmsm_emla import defaults, pmsm_emla, shaft_torque, transmission
from hdmm_opt.study.read import parse
from trajectories import Spline

ERRAND = """
[study]
name = "errand"
[plant]
model = "crane"
[reference]
kind = "bspline"
start = [0.2, -1.2, 0.2]
start_speed = [0.1, 0.05, 0.02]
start_acceleration = [0.1, 0.0, 0.0]
longest_s = 40.0
spans = 16
[reference.limits]
speed = [0.3, 0.4, 0.1]
current_a = 55.0
tool_speed_m_s = 0.7
[[reference.moves]]
tool_m = [3.0, 2.0]
tolerance_m = 0.02
via = [{ joints = [0.35, -1.0, 0.3] }, { tool_m = [3.2, 1.4], tolerance_m = 0.05 }]
payload_kg = 60.0
[[reference.moves]]
path_m = [[3.1, 1.8], [3.2, 1.6]]
tolerance_m = 0.01
angle_rad = -0.3
angle_tolerance_rad = 0.05
payload_kg = 60.0
[[reference.moves]]
joints = [0.3, -1.1, 0.3]
speed = [-0.05, 0.0, 0.0]
"""

ARM = """
[study]
name = "arm-errand"
[plant]
model = "arm"
urdf = "crane"
damping = 50.0
[plant.joints.lift]
parameters.armature = { value = 20000.0, unit = "kg m^2", source = "assumed" }
limits.torque = { value = 40000.0, unit = "N m", source = "assumed" }
limits.speed = { value = 0.6, unit = "rad/s", source = "assumed" }
[plant.joints.tilt]
parameters.armature = { value = 12000.0, unit = "kg m^2", source = "assumed" }
limits.torque = { value = 30000.0, unit = "N m", source = "assumed" }
limits.speed = { value = 0.7, unit = "rad/s", source = "assumed" }
[plant.joints.telescope]
parameters.armature = { value = 100000.0, unit = "kg", source = "assumed" }
limits.torque = { value = 75000.0, unit = "N", source = "assumed" }
limits.speed = { value = 0.2, unit = "m/s", source = "assumed" }
[reference]
kind = "bspline"
start = [0.05, -2.0, 0.05]
[reference.limits]
acceleration = [0.5, 0.5, 0.5]
jerk = [5.0, 5.0, 5.0]
[[reference.moves]]
tool_m = [2.2, 0.0, 0.6]
payload_kg = 50
"""

POINTS = 10_000


def written(text, folder, ending="json"):
    """What `trajectory` writes for a study."""
    path, output = folder / "mine.toml", folder / f"mine.{ending}"
    path.write_text(text)
    result = CliRunner().invoke(main, ["trajectory", str(path), "-o", str(output)])
    assert result.exit_code == 0, result.output
    return json.loads(output.read_text()) if ending == "json" else output.read_text()


def spline_of(move):
    return Spline(knots=np.array(move["knots_s"]), coefficients=np.array(move["control_points"]))


class Motion:
    """A move of the crane on 10,000 points, everything from Pinocchio but the law of the EMLA itself."""

    def __init__(self, move):
        self.t = np.linspace(0.0, move["knots_s"][-1], POINTS)
        spline = spline_of(move)
        self.joints = [spline(self.t, order) for order in range(4)]
        closed, w, v, a = Closed(move["payload_kg"]), *self.joints[:3]
        telescope = closed.model.getJointId("telescope")
        rows = [self._at(closed, telescope, *state) for state in zip(w, v, a, strict=True)]
        self.force, self.rate, self.tool, self.tool_speed = (np.array(part) for part in zip(*rows, strict=True))
        known = {name: p.value for name, p in defaults("voltage").items()}
        gain = np.gradient(self.rate, self.t, axis=0, edge_order=2)
        f, s, g = (ca.SX.sym(name) for name in "fsg")
        torque = ca.Function("torque", [f, s, g], [shaft_torque(f, s, g, known)])
        every = (part.reshape(1, -1) for part in (self.force, self.rate, gain))
        self.torque = np.array(torque.map(self.force.size)(*every)).reshape(self.force.shape)
        self.current = self.torque / known["torque_constant"]
        self.speed = self.rate / transmission(known)
        slope = np.gradient(self.current, self.t, axis=0, edge_order=2)
        across = known["resistance"] * self.current + known["inductance"] * slope
        across += known["torque_constant"] * self.speed / 1.5
        along = known["inductance"] * known["pole_pairs"] * self.speed * self.current
        self.voltage = np.hypot(across, along)

    @staticmethod
    def _at(closed, telescope, w, v, a):
        """Forces that give the accelerations, rates of the strokes, place and speed of the tool."""
        none = closed.accelerations(w, v, np.zeros(3))
        gains = np.stack([closed.accelerations(w, v, column) - none for column in 1e4 * np.eye(3)], axis=1) / 1e4
        force = np.linalg.solve(gains, a - none)
        q, rate = closed.state(w, v)
        pinocchio.forwardKinematics(closed.model, closed.data, q, rate)
        frame = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        tool = closed.data.oMi[telescope].translation.copy()
        moved = pinocchio.getVelocity(closed.model, closed.data, telescope, frame).linear
        return (
            force,
            rate[[closed.column(n) for n in ("lift_rod", "tilt_rod", "telescope")]],
            tool,
            np.hypot(*moved[[0, 2]]),
        )

    def inside(self, *, speed=SPEED, acceleration=ACCELERATION, jerk=JERK, current=None):
        """Whether every limit of the crane holds on every point."""
        limits = {limit.name: limit.value for limit in pmsm_emla("voltage").limits}
        low, high = joint_limits().room
        close = 1 + 1e-6
        assert (self.joints[0] >= low - 1e-6).all() and (self.joints[0] <= high + 1e-6).all()
        for curve, most in zip(self.joints[1:], (speed, acceleration, jerk), strict=True):
            assert (np.abs(curve).max(axis=0) <= np.array(most) * close).all()
        assert np.abs(self.force).max() <= 75e3 * close and np.abs(self.rate).max() <= limits["speed"] * close
        assert np.abs(self.torque).max() <= pmsm_emla("voltage").ratings["peak_torque"].value * close
        assert np.abs(self.current).max() <= (current or limits["current"]) * close
        assert np.abs(self.voltage).max() <= limits["voltage"] * close
        return True


@pytest.fixture(scope="module")
def errand(tmp_path_factory):
    (way,) = written(ERRAND, tmp_path_factory.mktemp("errand"))["ways"]
    return way["moves"], [Motion(move) for move in way["moves"]]


@pytest.mark.long
def test_an_errand_keeps_every_limit_by_pinocchio(errand):
    """Vias of joints and tool, own limits, a moving start, a path of the tool with its angle, an end that moves."""
    moves, motions = errand
    for motion in motions:
        assert motion.inside(speed=(0.3, 0.4, 0.1), current=55.0)
        assert motion.tool_speed.max() <= 0.7 * (1 + 1e-6)
    assert max(motion.tool_speed.max() for motion in motions) > 0.65  # the limit binds
    first, second, third = motions
    start = [curve[0] for curve in first.joints[:3]]
    for got, asked in zip(start, ([0.2, -1.2, 0.2], [0.1, 0.05, 0.02], [0.1, 0.0, 0.0]), strict=True):
        assert got == pytest.approx(asked, abs=1e-6)
    assert np.hypot(*(first.tool[-1][[0, 2]] - (3.0, 2.0))) <= 0.02
    passed = {p["waypoint"]: p for p in moves[0]["points"] if p["waypoint"] is not None}
    assert passed[1]["positions"] == pytest.approx([0.35, -1.0, 0.3], abs=1e-6)
    index = int(np.argmin(np.abs(first.t - passed[2]["time_from_start_s"])))
    assert np.hypot(*(first.tool[index][[0, 2]] - (3.2, 1.4))) <= 0.05 + 1e-3
    assert third.joints[1][-1] == pytest.approx([-0.05, 0.0, 0.0], abs=1e-6)
    s = np.linspace(0.0, 1.0, 5001)[:, None]
    here = second.tool[0][[0, 2]]
    path = (1 - s) ** 2 * here + 2 * s * (1 - s) * np.array([3.1, 1.8]) + s**2 * np.array([3.2, 1.6])
    away = [np.hypot(*(path - place[[0, 2]]).T).min() for place in second.tool[::10]]
    assert max(away) <= 0.01
    assert second.joints[0][-1][:2].sum() == pytest.approx(-0.3, abs=0.05)


@pytest.mark.long
def test_the_motions_of_p14_keep_every_limit_by_pinocchio(tmp_path):
    """All four ways of the bundled study."""
    output = tmp_path / "p14.json"
    result = CliRunner().invoke(main, ["trajectory", "crane-p14", "-o", str(output)])
    assert result.exit_code == 0, result.output
    ways = json.loads(output.read_text())["ways"]
    assert len(ways) == 4
    for way in ways:
        for move in way["moves"]:
            assert Motion(move).inside()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["bspline", "toppra", "ruckig"])
def test_an_arm_of_a_urdf_moves_inside_its_limits_by_pinocchio(kind, tmp_path):
    """Torques by Pinocchio's inverse dynamics of the same file."""
    text = ARM.replace('"bspline"', f'"{kind}"').replace("\nlimits", "\nlimits")
    (way,) = written(text, tmp_path)["ways"]
    (move,) = way["moves"]
    spline, closed = spline_of(move), Closed(50.0)
    t = np.linspace(0.0, spline.end, POINTS)
    model = pinocchio.buildReducedModel(
        closed.model,
        [closed.model.getJointId(f"{name}_{part}") for name in ("lift", "tilt") for part in ("cylinder", "rod")],
        pinocchio.neutral(closed.model),
    )
    data = model.createData()
    armature, damping = np.array([20000.0, 12000.0, 100000.0]), 50.0
    worst = np.zeros(3)
    for w, v, a in zip(*(spline(t, order) for order in range(3)), strict=True):
        torque = pinocchio.rnea(model, data, w, v, a) + armature * a + damping * v
        worst = np.maximum(worst, np.abs(torque))
        assert (np.abs(v) <= np.array([0.6, 0.7, 0.2]) * (1 + 1e-6)).all()
        assert (np.abs(a) <= 0.5 * (1 + 1e-6)).all()
    assert (worst <= np.array([40000.0, 30000.0, 75000.0]) * (1 + 1e-6)).all() and worst.max() > 1e4
    pinocchio.forwardKinematics(model, data, spline([spline.end])[0])
    assert data.oMi[model.getJointId("telescope")].translation == pytest.approx([2.2, 0.0, 0.6], abs=1e-6)


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (ERRAND, "start_speed = [0.1, 0.05, 0.02]\n", "", "start_acceleration stands beside start_speed"),
        (ERRAND, "start_speed = [0.1, 0.05, 0.02]", "start_speed = [0.1]", r"start_speed must have one entry for each"),
        (ERRAND, "path_m = [[3.1, 1.8], [3.2, 1.6]]", "path_m = [[3.1, 1.8, 0.0]]", "path_m has 2 coordinates"),
        (ERRAND, "tolerance_m = 0.01\n", "", "tolerance_m is required with path_m"),
        (ERRAND, "angle_tolerance_rad = 0.05\n", "", "angle_tolerance_rad is required with path_m and angle_rad"),
        (ERRAND, "speed = [-0.05, 0.0, 0.0]", "angle_rad = 0.1", "angle_rad stands beside tool_m or path_m"),
        (ERRAND, "current_a = 55.0", "current_a = 0.0", r"current_a must be greater than or equal to 0\.0001"),
        (ERRAND, 'kind = "bspline"', 'kind = "toppra"', "has no cost, no via and no path_m"),
        (ERRAND, 'model = "crane"', 'model = "pmsm_emla"', 'plant.model of a motion alone is "crane" or "arm"'),
        (ERRAND, 'model = "crane"', 'model = "crane"\nlocked = { lift = 0.1 }', "plant.locked has no place"),
        (ARM, "tool_m = [2.2, 0.0, 0.6]", "tool_m = [2.2, 0.0]", "tool_m has 3 coordinates"),
        (ARM, "payload_kg = 50", "angle_rad = 0.1", "angle_rad has no place with an arm"),
        (ARM, 'kind = "bspline"', 'kind = "bilevel"', '"bilevel" is for the crane'),
        (ARM, "jerk = [5.0, 5.0, 5.0]", "current_a = 5.0", "current_a has no place with an arm"),
    ],
)  # fmt: skip
def test_what_a_study_cannot_ask_is_said_with_its_key(text, old, new, message):
    assert old in text
    with pytest.raises(InvalidInputError, match=message) as caught:
        parse(text.replace(old, new, 1), "mine.toml")
    assert "\n" not in str(caught.value) and str(caught.value).startswith("mine.toml: ")
