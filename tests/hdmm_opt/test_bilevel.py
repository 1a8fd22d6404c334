"""Leader and follower, and motions from study files: energy balances, the one-level bound, limits, messages."""

import json

import numpy as np
import pinocchio
import pytest
from click.testing import CliRunner
from test_crane_dynamics import Closed

from hdmm_opt.cli import main
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.motions import document
from hdmm_opt.machines.crane_geometry import tool as place
from hdmm_opt.motions.crane_task import crane_cost, drive_quantities, tool_function
from hdmm_opt.motions.from_study import job_of
from hdmm_opt.motions.job import Job, Move, Place
from hdmm_opt.motions.sequence import carried_out
from hdmm_opt.motions.two_level import bilevel
from hdmm_opt.study import read as study
from hdmm_opt.study.motion import MotionStudy
from trajectories import Ball, LimitViolatedError, Spline, violations

START, PLACE = (0.2, -1.2, 0.2), (3.0, 2.2)
JOB = Job(start=START, moves=(Move(tool=PLACE, payload=60.0),), longest=40.0)


@pytest.fixture(scope="module")
def found():
    return bilevel(JOB, evaluations=8)


@pytest.mark.slow
def test_every_motion_is_inside_its_limits_and_reaches_its_place(found):
    assert [m.name for m in found.ways] == [
        "time-optimal",
        "effort-optimal",
        "energy-optimal",
        "leader and follower",
    ]
    quantities = drive_quantities(60.0)
    for motions in found.ways:
        (motion,) = motions.motions
        assert not violations(motion.spline, JOB.limits)
        values = quantities.values(motion.spline, np.linspace(0, motion.spline.end, 4001))
        assert (values <= quantities.upper[:, None]).all() and (values >= quantities.lower[:, None]).all()
        assert np.array(tool_function()(motion.spline.coefficients[-1])).ravel() == pytest.approx(PLACE, abs=1e-6)
        assert motion.spline.coefficients[0] == pytest.approx(START)


def test_energy_is_what_is_lost_and_what_is_lifted(found):
    """Electrical energy less the losses is the change of potential energy, by the heights of the bodies."""
    for motions in found.ways:
        ends = motions.motions[0].spline.coefficients[[0, -1]]
        gained = motions.totals["energy"] - motions.totals["loss"]
        lifted = [potential(w, 60.0) for w in ends]
        # friction of the joints, 0.1 N m s/rad, is neither; it takes less than a joule here
        assert gained == pytest.approx(lifted[1] - lifted[0], rel=2e-3, abs=1.0)


def potential(w, payload):
    """Of chain, cylinders, rods and payload, from Pinocchio's kinematics of the same file."""
    closed = Closed(payload)
    q, _ = closed.state(np.array(w), np.zeros(3))
    return pinocchio.computePotentialEnergy(closed.model, closed.data, q)


def test_one_level_bounds_two_and_speed_costs_energy(found):
    quick, easy, frugal, led = (m.totals["loss"] for m in found.ways)
    assert frugal <= led * (1 + 1e-6) < quick
    assert led < 1.25 * frugal and easy > frugal
    times = {m.name: m.duration for m in found.ways}
    assert times["time-optimal"] <= min(times.values()) * (1 + 1e-6)
    assert all(0.0 < m.efficiency < 1.0 for m in found.ways)
    assert max(found.ways, key=lambda m: m.efficiency).name == "energy-optimal"
    assert 4 <= len(found.history) <= 9 and list(found.history) == sorted(found.history, reverse=True)


def test_the_study_is_of_a_motion_alone(found):
    chosen = study.load_any("crane-p14")
    assert isinstance(chosen, MotionStudy) and [move.payload for move in job_of(chosen).moves] == [60.0, 0.0]
    with pytest.raises(InvalidInputError, match='use "hdmm-opt trajectory crane-p14"'):
        study.load("crane-p14")
    data = json.loads(json.dumps(document(chosen, found.ways), allow_nan=False))
    assert data["schema"] == "hdmm-opt/motions/1" and "motor inertia" in data["assumed"]
    for way in data["ways"]:
        for move in way["moves"]:
            assert len(move["knots_s"]) == len(move["control_points"]) + move["degree"] + 1
            for bound in move["bounds"]:
                assert bound["lower_limit"] <= bound["lower"] <= bound["upper"] <= bound["upper_limit"]


FILE = """
[study]
name = "mine"
[plant]
model = "crane"
[reference]
kind = "bspline"
start = [0.2, -1.2, 0.2]
longest_s = 40.0
[reference.cost]
time = 1.0
effort = 0.5
[[reference.moves]]
tool_m = [3.0, 2.2]
via = [{ tool_m = [3.1, 1.2] }]
payload_kg = 60.0
[[reference.moves]]
joints = [0.2, -1.2, 0.2]
[[reference.obstacles]]
name = "post"
centre_m = [2.3, 1.4]
radius_m = 0.3
[[reference.obstacles]]
name = "ground"
normal = [0.0, -1.0]
offset_m = 1.0
"""


def test_a_study_of_moves_makes_motions_past_obstacles(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    job = job_of(study.load_any(str(path)))
    result = CliRunner().invoke(main, ["trajectory", str(path), "-o", str(tmp_path / "mine.json")])
    assert result.exit_code == 0 and "spline program" in result.output and "assumed" in result.output
    data = json.loads((tmp_path / "mine.json").read_text())
    (way,) = data["ways"]
    assert len(way["moves"]) == 2 and len(way["moves"][0]["arrivals_s"]) == 2
    clear = {bound["name"]: bound for bound in way["moves"][0]["bounds"] if bound["name"].startswith("clearance")}
    assert set(clear) == {"clearance of post", "clearance of ground"}
    assert all(bound["lower"] >= 0.0 and bound["upper_limit"] is None for bound in clear.values())
    ends = np.array(way["moves"][0]["control_points"])[-1], np.array(way["moves"][1]["control_points"])[-1]
    assert np.array(tool_function()(ends[0])).ravel() == pytest.approx(PLACE, abs=1e-6)
    assert ends[1] == pytest.approx(START) and len(job.obstacles) == 2


LIMITED = """
[study]
name = "own-limits"
[plant]
model = "crane"
[reference]
kind = "bspline"
start = [0.2, -1.2, 0.2]
longest_s = 40.0
spans = 12
[reference.limits]
speed = [0.3, 0.4, 0.1]
current_a = 50.0
tool_speed_m_s = 0.7
[[reference.moves]]
tool_m = [3.0, 2.2]
via = [{ joints = [0.35, -1.0, 0.3] }, { tool_m = [3.1, 1.2] }]
payload_kg = 60.0
"""


@pytest.mark.slow
def test_a_motion_keeps_the_limits_of_its_study_and_says_when_it_passes_its_waypoints(tmp_path):
    """Joint vias, own limits of joints, drives and tool, from the file alone; on 10,000 points by differences."""
    path = tmp_path / "mine.toml"
    path.write_text(LIMITED)
    for ending in ("json", "csv"):
        result = CliRunner().invoke(main, ["trajectory", str(path), "-o", str(tmp_path / f"mine.{ending}")])
        assert result.exit_code == 0, result.output
    (move,) = json.loads((tmp_path / "mine.json").read_text())["ways"][0]["moves"]
    passed = {p["waypoint"]: p for p in move["points"] if p["waypoint"] is not None}
    assert sorted(passed) == [0, 1, 2, 3] and [passed[k]["time_from_start_s"] for k in (1, 2, 3)] == move["arrivals_s"]
    assert passed[1]["positions"] == pytest.approx([0.35, -1.0, 0.3], abs=1e-6)
    assert np.array(tool_function()(passed[2]["positions"])).ravel() == pytest.approx((3.1, 1.2), abs=1e-6)
    spline = Spline(knots=np.array(move["knots_s"]), coefficients=np.array(move["control_points"]))
    t = np.linspace(0.0, spline.end, 10_000)
    places = np.array(tool_function().map(t.size)(spline(t).T))
    speed = np.linalg.norm(np.diff(places, axis=1), axis=0) / (t[1] - t[0])
    assert speed.max() <= 0.7 * (1 + 1e-6) and speed.max() > 0.65  # the limit binds
    assert (np.abs(np.diff(spline(t), axis=0) / (t[1] - t[0])).max(axis=0) <= [0.3, 0.4, 0.1]).all()
    currents = [b for b in move["bounds"] if b["name"].endswith("current")]
    assert all(b["upper_limit"] == 50.0 and b["upper"] <= 50.0 for b in currents) and len(currents) == 3
    rows = (tmp_path / "mine.csv").read_text().splitlines()
    assert (
        rows[0].startswith("motion,move,time [s],waypoint,lift position [rad]") and len(rows) == len(move["points"]) + 1
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("start = [0.2", "start = [2.5", "must keep the lift between"),
        ("joints = [0.2", "joints = [2.5", r"reference\.moves\.1\.joints must keep the lift"),
        ("longest_s = 40.0", "longest = 40.0", 'did you mean "longest_s"'),
        ("longest_s = 40.0", "evaluations = 4", "evaluations has no place"),
        ('kind = "bspline"', 'kind = "bilevel"', "has no cost, no via"),
        ("time = 1.0\neffort = 0.5", "time = 0.0", "needs one weight above zero"),
        ("radius_m = 0.3\n", "", "needs either centre_m and radius_m"),
        ("normal = [0.0, -1.0]", "normal = [0.0, -2.0]", "must have length 1"),
        ("tool_m = [3.0, 2.2]", "", "needs tool_m, joints or path_m"),
    ],
)  # fmt: skip
def test_wrong_studies_say_what_would_do(old, new, message):
    assert old in FILE
    with pytest.raises(InvalidInputError, match=message):
        study.parse(FILE.replace(old, new, 1), "mine.toml")


def test_what_cannot_be_done_names_the_move(tmp_path):
    far = Job(start=START, moves=(Move(tool=PLACE), Move(tool=(9.0, 9.0))))
    with pytest.raises(LimitViolatedError, match=r"move 2: no posture with the tool at \(9, 9\) m was found"):
        bilevel(far, 2)
    with pytest.raises(InvalidInputError, match="one of the three"):
        Move()
    with pytest.raises(InvalidInputError, match="no places to pass"):
        bilevel(Job(start=START, moves=(Move(tool=PLACE, via=(Place(tool=(3.0, 1.0)),)),)), 2)
    with pytest.raises(InvalidInputError, match="move 1: the joints go from one place to another"):
        bilevel(Job(start=START, moves=(Move(joints=START),)), 2)
    here = (float(place(START)[0]), float(place(START)[1]))
    with pytest.raises(InvalidInputError, match="move 1: the tool goes from one place to another"):
        bilevel(Job(start=START, moves=(Move(tool=here),)), 2)
    path = tmp_path / "mine.toml"
    path.write_text(FILE.replace("tool_m = [3.0, 2.2]", "tool_m = [9.0, 9.0]"))
    result = CliRunner().invoke(main, ["trajectory", str(path)])
    assert (
        result.exit_code == 2
        and "mine: move 1: no posture with the tool at (9, 9) m was found; move the place" in result.output
    )


def test_a_move_to_nowhere_or_into_an_obstacle_is_refused_at_once():
    post = Ball(name="post", centre=(3.0, 1.0), radius=0.2)
    start = (0.3, -1.2, 0.3)
    here = tuple(float(v) for v in tool_function()(start).full().ravel())
    for move, words in (
        (Move(joints=(0.3, -1.2, 0.3 + 1e-15)), "they are at"),
        (Move(tool=(3.0, 1.1)), "keeps clear of post"),
        (Move(tool=(3.2, 1.5), via=(Place(tool=here),)), "it is at"),
        (Move(tool=(3.2, 1.5), via=(Place(tool=(3.1, 1.0)),)), "keeps clear of post"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            carried_out(Job(start=start, moves=(move,), obstacles=(post,)), lambda payload: crane_cost(), "none")


def test_postures_of_reachable_places_are_found():
    """Places of the tool at random joint coordinates are reachable; from one start all are found."""
    random = np.random.default_rng(5)
    job = Job(start=(0.3, -1.2, 0.3), moves=())
    low, high = job.limits.room
    for _ in range(60):
        w = low + (high - low) * random.uniform(0.02, 0.98, 3)
        place = tool_function()(w).full().ravel()
        found = job.near(place, np.array(job.start))
        assert job.limits.holds(found)
        np.testing.assert_allclose(tool_function()(found).full().ravel(), place, atol=1e-9)
