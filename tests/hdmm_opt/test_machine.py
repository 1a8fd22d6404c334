"""Machines of several joints: proofs that hold together, files that cannot be bent, and the coupled simulation."""

import copy
import json
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from click.testing import CliRunner
from machines import bundled, quick_arm, serial_study, study_from
from scipy.integrate import solve_ivp

from hdmm_opt import gain_file
from hdmm_opt.cli import main
from hdmm_opt.compare import compare, table
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.machine import crane
from hdmm_opt.machine_again import machine_of
from hdmm_opt.machine_design import design_machine, exchanged, rejected_machine
from hdmm_opt.machine_gains import covered, ladder, machine_scenarios
from hdmm_opt.machine_loop import MachineLoop, MachineScenario
from hdmm_opt.machine_problem import assemble_machine, sliced, tool_errors
from hdmm_opt.plants.crane_dynamics import rod_forces
from hdmm_opt.plants.rigid_body import inverse_dynamics
from hdmm_opt.plants.urdf import bodies
from hdmm_opt.selection import Options, Progress
from stability import Failure, checker


@pytest.fixture(scope="module")
def designed():
    return design_machine(study_from(quick_arm()), Options(), Progress())


def sealed(document):
    """The document with all hashes made anew, as a forger would."""
    data = copy.deepcopy(document)
    data["joints"] = {name: gain_file.seal(own) for name, own in data["joints"].items()}
    return gain_file.seal(data)


def judged(document):
    return checker.check_text(gain_file.to_text(sealed(document)))


def test_an_arm_with_two_degrading_joints_is_proved_and_tracks(designed):
    assert designed.document is not None and designed.report.status == 0, designed.verdicts
    document, problem = designed.document, designed.problem
    bound = float(Fraction(document["certificate"]["envelope"]["tool"]))
    assert designed.shown["two-degraded"].tool_late <= bound <= problem.study.requirements.tool_error_m
    assert document["validation"]["largest_error_after_transient_m"] <= bound
    inside = {s.name: covered(problem, s) for s in machine_scenarios(problem.study)}
    assert inside == {"healthy": True, "two-degraded": True, "one-stuck": False, "excessive": False}
    assert not designed.shown["one-stuck"].tool_late <= bound  # what is not proved need not hold


def test_a_joint_that_may_be_stuck_is_not_proved_but_refuted_by_a_run(tmp_path):
    data = quick_arm(plant__joints__tilt__least_effectiveness=0.0)
    result = design_machine(study_from(data), Options(), Progress())
    assert result.document is None and result.verdicts[0].verdict == "refuted"
    assert "no gain holds a stuck joint" in result.verdicts[0].statement
    left = rejected_machine(result)
    assert left["simulated"]["one-stuck"]["tool_late"] is None or left["simulated"]["one-stuck"]["tool_late"] > 0.02
    assert left["obligations"][0]["witness"]["scenario"]["name"] in left["simulated"]


def test_the_checker_alone_agrees_and_each_joint_is_a_file_of_its_own(designed, tmp_path):
    path = tmp_path / "arm.gains.json"
    path.write_text(gain_file.to_text(designed.document), encoding="utf-8")
    run = subprocess.run([sys.executable, "-I", "-S", checker.__file__, path], capture_output=True, text=True)
    assert run.returncode == 0 and "all joints together" in run.stdout
    for name, own in designed.document["joints"].items():
        report = checker.check_text(gain_file.to_text(own))
        assert report.status == 0, (name, report.message)


def _smaller(text):
    return str(Fraction(text) * Fraction(99, 100))


def _envelope(d):
    d["certificate"]["envelope"]["tool"] = _smaller(_smaller(d["certificate"]["envelope"]["tool"]))


def _payload(d):
    d["study"]["uncertainty"]["payload_kg"] = [0.0, 90.0]


def _promise(d):
    for name in d["certificate"]["promises"]:
        d["certificate"]["promises"][name] = [
            str(Fraction(v) * Fraction(9, 10)) for v in d["certificate"]["promises"][name]
        ]


def _wide_promise(d):
    for name in d["certificate"]["promises"]:
        d["certificate"]["promises"][name] = [str(Fraction(v) * 2) for v in d["certificate"]["promises"][name]]


def _nested_load(d):
    own = d["joints"]["lift"]
    for entry in own["assumptions"]:
        if entry["name"] == "disturbance.load_force":
            entry["upper"] *= 0.8
            own["study"]["uncertainty"]["disturbances"]["load_force"][1] *= 0.8


def _effectiveness(d):
    for place in (d["joints"]["tilt"]["study"]["plant"], d["study"]["plant"]["axes"]["tilt"]):
        place["parameters"]["effectiveness"]["tolerance"] *= 1.5


def _requirement(d):
    d["study"]["requirements"]["tool_error_m"] = 1e-4


def _joint_left_out(d):
    del d["joints"]["telescope"]


def _obligation_left_out(d):
    d["obligations"] = [o for o in d["obligations"] if o["name"] != "loads"]


def _faster_reference(d):
    for part in (d["reference"]["joints"]["lift"], d["joints"]["lift"]["reference"]):
        part["segments"][1]["knots"] = [v * 0.99 for v in part["segments"][1]["knots"]]


def _other_reference(d):
    d["reference"]["joints"]["lift"] = copy.deepcopy(d["reference"]["joints"]["tilt"])


def _noise(d):
    d["study"]["uncertainty"]["noise"]["speed"] = 1.0


def _initial(d):
    d["study"]["uncertainty"]["initial"]["position"] = 1.0


def _listed_gain(d):
    d["gains"][0]["value"] *= 2


def _listed_assumptions(d):
    d["assumptions"] = []


def _rate(d):
    d["controller"]["rate_hz"] = 100


def _modelling(d):
    d["controller"]["modelling"] = ["mechanics"]


def _stated_effectiveness(d):
    d["study"]["plant"]["joints"]["tilt"]["least_effectiveness"] = 0.05


def _stated_armature(d):
    d["study"]["plant"]["joints"]["lift"]["armature"]["tolerance"] = 0.5


def _stated_torque(d):
    d["study"]["plant"]["joints"]["lift"]["torque"]["value"] = 100.0


def _gain(d):
    for entry in d["joints"]["lift"]["gains"]:
        entry["value"] *= 0.7


def _transient(d):
    d["study"]["validation"]["transient_s"] = 0.0


def _seen(d):
    d["validation"]["largest_error_m"] = 1.0


def _observer(d):
    d["controller"]["observer"] = {"first": 0.1, "second": 1.0, "largest": 0.0, "period_s": 1e-3, "pole": 0.9}


MUTATIONS = (
    _envelope, _payload, _promise, _wide_promise, _nested_load, _effectiveness, _requirement, _joint_left_out,
    _obligation_left_out, _faster_reference, _other_reference, _noise, _gain, _transient, _seen, _observer, _initial, _listed_gain, _listed_assumptions, _rate, _modelling,
    _stated_effectiveness, _stated_armature, _stated_torque,
)  # fmt: skip


@pytest.mark.parametrize("mutate", MUTATIONS, ids=lambda f: f.__name__)
def test_a_bent_statement_is_refused(designed, mutate):
    document = copy.deepcopy(designed.document)
    assert judged(document).status == 0 or mutate is not MUTATIONS[0]
    mutate(document)
    report = judged(document)
    assert report.status in (1, 2) and "\n" not in report.message


def test_a_heavier_load_program_is_refused(designed):
    """Half as much mass more in the program of the loads: what was proved is another machine."""
    document = copy.deepcopy(designed.document)
    operations = document["certificate"]["loads"]["operations"]
    last = document["certificate"]["loads"]["outputs"]
    operations.append(["const", "1.5"])
    for k, output in enumerate(last):
        operations.append(["mul", output, len(operations) - 1 if k == 0 else len(operations) - 1 - k])
        last[k] = len(operations) - 1
    operations[-len(last) - 1] = ["const", "1.5"]
    for k in range(len(last)):
        operations[-len(last) + k][2] = len(operations) - len(last) - 1
    report = judged(document)
    assert report.status == 1 and ("loads" in report.message or "coupling" in report.message)


def test_a_file_simulates_as_it_was_validated(designed):
    problem, gains = machine_of(json.loads(gain_file.to_text(designed.document)))
    (again,) = MachineLoop(problem).figures([(gains, machine_scenarios(problem.study)[0])])
    assert again.tool_late == pytest.approx(designed.shown["healthy"].tool_late, rel=1e-9)


def _weak_load(d):
    """The load enters a joint's plant with a hundredth of its size."""
    program = d["joints"]["lift"]["certificate"]["model"]["plant"]
    operations, outputs = program["operations"], program["outputs"]
    operator, rest, load = operations[outputs[3]]
    assert operator == "sub" and operations[load] == ["input", "load_force"]
    count = len(operations)
    operations += [["const", "0.01"], ["mul", load, count], ["sub", rest, count + 1]]
    outputs[3] = count + 2


def test_a_load_that_hardly_enters_a_plant_is_refused(designed):
    document = copy.deepcopy(designed.document)
    _weak_load(document)
    report = judged(document)
    assert report.status == 2 and "does not enter the plant as its part of the machine's inertia" in report.message


def test_a_load_that_reads_no_acceleration_still_answers_for_the_own_inertia(designed):
    document = copy.deepcopy(designed.document)
    loads = document["certificate"]["loads"]
    own = document["joints"]["telescope"]["study"]["uncertainty"]["disturbances"]["load_force"]
    loads["operations"].append(["const", repr(own[0] + 10.0)])
    loads["outputs"][2] = len(loads["operations"]) - 1
    report = judged(document)
    assert report.status == 1 and "loads" in report.message


def _another_tool(d):
    d["certificate"]["tool"]["operations"][0] = ["const", "0.5"]


def _lighter_plant(d):
    for operation in d["joints"]["lift"]["certificate"]["model"]["plant"]["operations"]:
        if operation[0] == "const":
            operation[1] = "0.25"


@pytest.mark.parametrize("mutate", [_another_tool, _lighter_plant])
def test_a_file_about_another_machine_is_not_simulated(designed, mutate):
    """The checker takes the machine as given; what runs it compares."""
    document = json.loads(gain_file.to_text(designed.document))
    mutate(document)
    with pytest.raises(InvalidInputError, match="not what this release makes of its study"):
        machine_of(document)


def test_an_exchanged_actuator_leaves_the_other_proofs_as_they_are(designed):
    data = quick_arm(plant__joints__tilt__armature={
        "value": 13000.0, "unit": "kg m^2", "tolerance": 0.05, "source": "assumed"})  # fmt: skip
    result = exchanged(designed.document, study_from(data), "tilt", Options(), Progress())
    assert result.document is not None, result.verdicts
    for name, own in designed.document["joints"].items():
        same = gain_file.to_text(own) == gain_file.to_text(result.document["joints"][name])
        assert same == (name != "tilt")
    laws = [
        {name: own["certificate"]["model"]["law"] for name, own in d["joints"].items()}
        for d in (designed.document, result.document)
    ]
    assert laws[0] == laws[1]


def test_an_actuator_that_breaks_its_promise_is_not_taken(designed):
    data = quick_arm(plant__joints__tilt__armature={
        "value": 4000.0, "unit": "kg m^2", "tolerance": 0.3, "source": "assumed"})  # fmt: skip
    result = exchanged(designed.document, study_from(data), "tilt", Options(), Progress())
    assert result.document is None and "tilt" in result.verdicts[0].statement
    with pytest.raises(InvalidInputError, match="differ in lift too"):
        exchanged(
            designed.document,
            study_from(quick_arm(plant__joints__lift__speed_limit=0.5)),
            "tilt",
            Options(),
            Progress(),
        )


@pytest.mark.parametrize(
    "joints", [2, 3, pytest.param(6, marks=pytest.mark.long), pytest.param(7, marks=pytest.mark.long)]
)
def test_arms_of_any_number_of_joints_are_proved_and_keep_their_bounds(joints, tmp_path):
    result = design_machine(study_from(serial_study(joints, tmp_path)), Options(), Progress())
    assert result.document is not None, result.verdicts
    assert result.report.status == 0


def test_joints_without_inertia_of_their_own_are_not_proved_together(tmp_path):
    """The static promises need the actuators' inertia: a light arm on weightless drives stays undecided."""
    data = serial_study(3, tmp_path, armature=1e-3)
    result = design_machine(study_from(data), Options(), Progress())
    assert result.document is None and result.verdicts[0].verdict in ("undecided", "refuted")


def test_the_coupled_loop_is_that_of_an_independent_integration(tmp_path):
    """Two joints, one period after the other by an adaptive method on a mass matrix of its own."""
    problem = assemble_machine(study_from(serial_study(2, tmp_path)))
    gains = ladder(problem, 10.0, (8.0,))
    loop = MachineLoop(problem)
    scenario = MachineScenario(name="plain", payload=0.3)
    trace = loop.trace(gains, scenario)
    tree = bodies((tmp_path / "arm2.urdf").read_text())
    import casadi as ca

    from hdmm_opt.plants.rigid_body import Payload

    q, v, a = (ca.SX.sym(name, 2) for name in "qva")
    load = Payload(body=1, mass=0.3, position=(0.1, 0.05, 0.2))
    torque = ca.Function("torque", [q, v, a], [inverse_dynamics(tree, q, v, a, payloads=(load,))])
    armature = np.array([p.parameters["armature"].value for p in problem.machine.plants])
    damping = np.array([p.parameters["damping"].value for p in problem.machine.plants])

    def rate(_, state, u):
        still = np.array(torque(state[:2], state[2:], [0, 0])).ravel()
        mass = np.column_stack([np.array(torque(state[:2], state[2:], e)).ravel() - still for e in np.eye(2)])
        push = u - damping * state[2:] - still
        return np.concatenate([state[2:], np.linalg.solve(mass + np.diag(armature), push)])

    theta, state = np.zeros((2, 2)), np.concatenate([[axis.reference(0.0)[0, 0] for axis in problem.axes], [0, 0]])
    worst = 0.0
    for k in range(400):
        worst = max(worst, np.abs(state[:2] - trace.x[:, k]).max())
        u = np.zeros(2)
        for i, (name, axis) in enumerate(zip(problem.machine.joints, problem.axes, strict=True)):
            r = axis.reference(k * problem.period)[:, 0]
            first, second = gains[name]
            e1 = state[i] - r[0]
            k1 = -(first.beta + first.epsilon * theta[i, 0]) * e1 / 2 + r[1]
            e2 = state[2 + i] - k1
            u[i] = -(second.beta + second.epsilon * theta[i, 1]) * e2 / 2
            for j, (g, e) in enumerate(((first, e1), (second, e2))):
                theta[i, j] += problem.period * (g.epsilon * g.delta * e**2 / 2 - g.delta * g.sigma * theta[i, j])
        state = solve_ivp(rate, (0, problem.period), state, args=(u,), rtol=1e-10, atol=1e-12).y[:, -1]
    assert np.abs(trace.x[:, :400] - trace.r[:, :400]).max() > 1e-4
    assert worst < 1e-8


def test_observers_hold_from_every_start(tmp_path):
    """A joint that starts off its reference moves at once: the observer's start must allow for it."""
    data = serial_study(2, tmp_path)
    data["controller"]["observer"] = {"bandwidth_rad_s": 400.0, "largest": 0.05, "epsilon": 1.0, "sigma": 10.0}
    data["uncertainty"] |= {"noise": {"position": 1e-7}, "initial": {"position": 1e-4, "speed": 1e-5}}
    data["validation"]["scenarios"] = [
        {"name": "off", "initial": 1.0},
        {"name": "other", "initial": -1.0, "noise": 1.0},
    ]
    result = design_machine(study_from(data), Options(), Progress())
    assert result.document is not None, result.verdicts
    for name, figures in result.shown.items():
        for k, joint in enumerate(result.problem.machine.joints):
            noise = result.document["joints"][joint]["study"]["uncertainty"]["noise"]
            position, speed = figures.estimates[k]
            assert position <= noise["position"] and speed <= noise["speed"], name
            assert figures.joints_ever[k] >= 0.99e-4


def test_what_sits_on_a_link_goes_with_it():
    """Joints that a study does not name stand still; their bodies stay in the arm."""
    whole = assemble_machine(study_from(quick_arm()))
    data = quick_arm()
    for section in (data["plant"]["joints"], data["controller"]["joints"], data["requirements"]["joint_error"]):
        section.pop("telescope")
    data["reference"]["waypoints"] = [place[:2] for place in data["reference"]["waypoints"]]
    fewer = assemble_machine(study_from(data))
    at = [0.3, -1.8]
    three = np.array(whole.machine.forces([*at, 0.0], [0] * 3, [0] * 3, 10.0)).ravel()
    two = np.array(fewer.machine.forces(at, [0] * 2, [0] * 2, 0.0)).ravel()
    assert two[0] > 0.9 * three[0] > 5e3


def test_a_locked_joint_leaves_the_law_of_the_others_as_it_is():
    """One joint fewer: the same operations of plant and law, other loads."""
    data = bundled("crane-p4")
    data["plant"]["locked"] = {"telescope": 0.1}
    data["reference"] |= {"waypoints": [[0.05, -2.0], [0.15, -1.9]]}
    data["requirements"]["joint_error"].pop("telescope")
    fewer = assemble_machine(study_from(data))
    assert fewer.machine.joints == ("lift", "tilt")
    whole = crane({})
    assert fewer.axes[0].law.plant.parameters.keys() == whole.plants[0].parameters.keys()
    from hdmm_opt.control import RAC

    law = RAC(plant=whole.plants[0], modelling=tuple(data["controller"]["modelling"]))
    found, wanted = fewer.axes[0].model, law.loop_model()
    assert found.plant == wanted.plant and found.rows == wanted.rows
    found_contracts = fewer.composed(ladder(fewer, 10.0, (10.0, 20.0)))
    assert not isinstance(found_contracts, Failure), found_contracts


def test_rod_forces_are_the_joints_torques_over_their_levers():
    """Power is the same in both coordinates."""
    from hdmm_opt.plants.crane_dynamics import joint_torques, levers, strokes

    random = np.random.default_rng(3)
    import casadi as ca

    w, v, a = (ca.SX.sym(name, 3) for name in "wva")
    lever = levers(w)
    gain = lever * a + ca.jtimes(lever, w, v) * v
    both = ca.Function(
        "both", [w, v, a], [rod_forces(strokes(w), lever * v, gain, 7.0), joint_torques(w, v, a, 7.0), lever]
    )
    for _ in range(20):
        at = np.array([0.4, -1.5, 0.5]) + random.uniform(-0.3, 0.3, 3)
        force, torque, arm = (
            np.array(part).ravel() for part in both(at, random.normal(size=3) * 0.2, random.normal(size=3))
        )
        np.testing.assert_allclose(force * arm, torque, rtol=1e-9, atol=1e-6)


def test_rivals_are_tuned_on_equal_terms_and_track(designed):
    found = compare(designed.problem, (4, 1), 1, Options(), Progress())
    assert [c.name for c in found] == ["rac, jaya", "rac, tlbo", "rise, jaya", "tde-nftsm, jaya"]
    assert all(c.figures["two-degraded"].tool_late < 0.02 for c in found)
    assert {c.evaluations for c in found} <= {4, 8}
    assert [c.certified is None for c in found] == [False, False, True, True]
    lines = []
    table(found, ["healthy", "two-degraded"], lines.append)
    assert len(lines) == 1 + 4 * len(found) and sum("*" in line for line in lines) >= 3
    assert not any("one-stuck" in line and f"{1e3 * found[0].certified:.4g}" in line for line in lines)


def test_slices_cover_the_references(designed):
    problem = designed.problem
    references = tuple(axis.reference for axis in problem.axes)
    slices = sliced(references)
    t = np.linspace(0, references[0].duration, 5001)
    for j, reference in enumerate(references):
        values = reference(t)
        for order in range(4):
            held = (slices.low[order, j][:, None] <= values[order]) & (values[order] <= slices.high[order, j][:, None])
            assert held.any(axis=0).all()


def test_the_tools_bound_holds_at_corners(designed):
    problem, random = designed.problem, np.random.default_rng(0)
    radii = np.array([1e-3, 2e-3, 1e-3])
    bound = tool_errors(problem, radii)
    t = np.linspace(0, problem.axes[0].reference.duration, 40)
    r = np.stack([axis.reference(t)[0] for axis in problem.axes])
    worst = 0.0
    for k in range(t.size):
        for _ in range(8):
            moved = r[:, k] + radii * random.choice((-1, 1), 3)
            away = np.array(problem.machine.tool(moved)) - np.array(problem.machine.tool(r[:, k]))
            worst = max(worst, float(np.linalg.norm(away)))
    assert 0.5 * bound < worst <= bound


BAD = {
    "plant__joints__lift__torque__unit": ("lbf", 'unit must be "N m"'),
    "plant__joints__lift__armature__unit": ("furlong", 'unit must be "kg m^2"'),
    "validation__scenarios": ([{"name": "odd", "parameters": {"dampng": 1.0}}], "parameters.dampng is unknown"),
    "plant__joints__tilt__torque": (None, "plant.joints.tilt.torque is required"),
    "uncertainty__payload_kg": ([5.0, 1.0], "0 <= lower <= upper"),
    "reference__waypoints": ([[0.1, 0.2], [0.2, 0.3], [0.1, 0.2]], "one entry for each of lift, tilt, telescope"),
    "reference__kind": ("bspline", "durations_s has no place in a minimum-time motion"),
    "requirements__joint_error": ({"lift": 0.1}, "joint_error.tilt is required"),
    "controller__joints": ({"elbow": {}}, "is not a joint of this machine"),
    "plant__urdf": ("nowhere", "cannot read nowhere"),
}


@pytest.mark.parametrize("key", BAD)
def test_bad_studies_are_one_line(key):
    value, words = BAD[key]
    data = quick_arm(**{key: value})
    if value is None:
        del data["plant"]["joints"]["tilt"]["torque"]
    with pytest.raises(InvalidInputError) as caught:
        assemble_machine(study_from(data))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_verbs_of_machines(designed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = CliRunner()
    path = tmp_path / "arm.gains.json"
    path.write_text(gain_file.to_text(designed.document), encoding="utf-8")
    assert run.invoke(main, ["check", str(path)]).exit_code == 0
    shown = run.invoke(main, ["simulate", str(path), "--scenario", "two-degraded", "--csv", "a.csv", "--json"])
    assert shown.exit_code == 0 and json.loads(shown.stdout)["two-degraded"]["tool_late"] < 0.02
    assert (tmp_path / "a.csv").read_text().startswith("time [s],lift [rad],lift reference [rad]")
    stuck = run.invoke(main, ["simulate", str(path), "--scenario", "one-stuck"])
    assert stuck.exit_code == 0 and "outside the assumptions" in stuck.stderr
    told = run.invoke(main, ["trajectory", "arm-p3"])
    assert told.exit_code == 0 and "beside an inertia of" in told.stdout
    for arguments, words in (
        (["simulate", str(path), "--scenario", "none"], 'no scenario "none"'),
        (["falsify", str(path)], "got a machine"),
        (["compare", "emla-p2"], "rivals are built for machines"),
        (["sweep", "arm-p3", "--vary", "controller.rate_hz=1,2"], "a machine of several joints"),
        (["design", "arm-p3", "--exchange", "none.json", "lift"], "none.json: unreadable"),
        (["design", "arm-p3", "--exchange", str(path), "elbow"], "names one of the joints"),
        (["design", "arm-p3", "--report", "r"], "--report is made for one actuator"),
    ):
        found = run.invoke(main, arguments)
        assert found.exit_code == 2 and words in found.stderr and len(found.stderr.strip().splitlines()) == 1
