"""Leader and follower: energy balances, the one-level bound, and the study that shows them."""

import json

import numpy as np
import pytest

from hdmm_opt import study
from hdmm_opt.bilevel import Job, bilevel
from hdmm_opt.crane_task import drive_quantities, joint_limits, tool_function
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.motion_file import document
from hdmm_opt.motion_study import MotionStudy
from trajectories import LimitViolatedError, violations

JOB = Job(start=(0.2, -1.2, 0.2), places=((3.0, 2.2),), payloads=(60.0,), longest=40.0, least_lever=0.08)


@pytest.fixture(scope="module")
def found():
    return bilevel(JOB, evaluations=8)


def test_every_motion_is_inside_its_limits_and_reaches_its_place(found):
    assert [m.name for m in found.references] == [
        "time-optimal",
        "effort-optimal",
        "energy-optimal",
        "leader and follower",
    ]
    quantities = drive_quantities(60.0)
    for motions in found.references:
        (motion,) = motions.motions
        assert not violations(motion.spline, joint_limits(JOB.least_lever))
        values = quantities.values(motion.spline, np.linspace(0, motion.spline.end, 4001))
        assert (values <= quantities.upper[:, None]).all() and (values >= quantities.lower[:, None]).all()
        assert np.array(tool_function()(motion.spline.coefficients[-1])).ravel() == pytest.approx(
            JOB.places[0], abs=1e-6
        )
        assert motion.spline.coefficients[0] == pytest.approx(JOB.start)


def test_energy_is_what_is_lost_and_what_is_lifted(found):
    """Electrical energy less the losses is the change of potential energy, by the heights of the bodies."""
    for motions in found.references:
        ends = motions.motions[0].spline.coefficients[[0, -1]]
        gained = motions.totals["energy"] - motions.totals["loss"]
        lifted = [potential(w, 60.0) for w in ends]
        # friction of the joints, 0.1 N m s/rad, is neither; it takes less than a joule here
        assert gained == pytest.approx(lifted[1] - lifted[0], rel=2e-3, abs=1.0)


def potential(w, payload):
    """Of chain, cylinders, rods and payload, from Pinocchio's kinematics of the same file."""
    import pinocchio
    from test_crane_dynamics import Closed

    closed = Closed(payload)
    q, _ = closed.state(np.array(w), np.zeros(3))
    return pinocchio.computePotentialEnergy(closed.model, closed.data, q)


def test_one_level_bounds_two_and_speed_costs_energy(found):
    quick, easy, frugal, led = (m.totals["loss"] for m in found.references)
    assert frugal <= led * (1 + 1e-6) < quick
    assert led < 1.25 * frugal and easy > frugal
    times = {m.name: m.duration for m in found.references}
    assert times["time-optimal"] <= min(times.values()) * (1 + 1e-6)
    assert all(0.0 < m.efficiency < 1.0 for m in found.references)
    assert max(found.references, key=lambda m: m.efficiency).name == "energy-optimal"
    assert found.evaluations == len(found.history) <= 9 and list(found.history) == sorted(found.history, reverse=True)


def test_the_study_is_of_a_motion_alone(found):
    chosen = study.load_any("crane-p14")
    assert isinstance(chosen, MotionStudy) and chosen.job().payloads == (60.0, 0.0)
    with pytest.raises(InvalidInputError, match='use "hdmm-opt trajectory crane-p14"'):
        study.load("crane-p14")
    text = json.dumps(document(chosen, found), allow_nan=False)
    data = json.loads(text)
    assert data["schema"] == "hdmm-opt/motions/1" and "motor inertia" in data["assumed"]
    for row in data["references"]:
        for move in row["moves"]:
            assert len(move["knots_s"]) == len(move["control_points"]) + move["degree"] + 1
            assert all(bound["lower"] <= bound["upper"] <= bound["limit"] for bound in move["bounds"])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_rad_rad_m": [2.5, -1.2, 0.2]}, "must keep the lift between"),
        ({"moves": []}, "at least 1 entries"),
        ({"evaluation": 3}, 'did you mean "evaluations"'),
    ],
)
def test_wrong_studies_say_what_would_do(tmp_path, change, message):
    data = study.load_any("crane-p14").model_dump(mode="json", exclude_none=True)
    data["reference"] |= change
    lines = ["[study]", 'name = "x"', "[plant]", 'model = "crane"', "[reference]"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in data["reference"].items() if key != "moves"]
    lines += ["moves = []"] if not data["reference"]["moves"] else ["[[reference.moves]]", "tool_m = [3.0, 2.2]"]
    path = tmp_path / "x.toml"
    path.write_text("\n".join(lines))
    with pytest.raises(InvalidInputError, match=message):
        study.load_any(str(path))


def test_a_place_out_of_reach_is_refused():
    with pytest.raises(LimitViolatedError, match=r"cannot reach \(9, 9\) m"):
        bilevel(Job(start=(0.2, -1.2, 0.2), places=((9.0, 9.0),), payloads=(0.0,), longest=40.0, least_lever=0.08), 2)
    with pytest.raises(InvalidInputError, match="a payload for each place"):
        Job(start=(0.2, -1.2, 0.2), places=((3.0, 2.2),), payloads=(), longest=40.0, least_lever=0.08)
