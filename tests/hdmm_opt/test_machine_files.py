"""Files of machines: what the checker reads from them, and that they cannot be bent."""

import copy
import json
import subprocess
import sys
from fractions import Fraction

import pytest
from click.testing import CliRunner
from forging import forged

from hdmm_opt.cli import main
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.restore import restored
from hdmm_opt.files.seal import seal, to_text
from stability import checker


@pytest.fixture
def document(arm_text):
    return json.loads(arm_text)


@pytest.fixture
def judged(arm_text):
    """The checker's report, with all that the file repeats made right again, as a careful forger would."""
    kept = json.loads(arm_text)["obligations"]
    return lambda document: checker.check_text(forged(document, kept))


def member(d, name):
    return next(entry for entry in d["members"] if entry["name"] == name)


def assumption(d, name, key):
    return next(a for a in member(d, name)["assumptions"] if a["name"] == key)


def by(text, factor):
    return str(Fraction(text) * Fraction(factor))


def test_the_checker_alone_agrees(arm_text, tmp_path):
    path = tmp_path / "arm.gains.json"
    path.write_text(arm_text, encoding="utf-8")
    run = subprocess.run([sys.executable, "-I", "-S", checker.__file__, path], capture_output=True, text=True)
    assert run.returncode == 0 and "all 3 members together" in run.stdout


def _envelope(d):
    d["couplings"][0]["envelope"]["output"] = by(d["couplings"][0]["envelope"]["output"], "0.98")


def _member_envelope(d):
    ultimates = member(d, "lift")["certificate"]["envelope"]["ultimate"]
    ultimates[0] = by(ultimates[0], "0.5")


def _payload(d):
    d["study"]["uncertainty"]["disturbances"]["payload"]["range"] = [0.0, 90.0]


def _guarantee(d):
    for entry in d["members"]:
        entry["certificate"]["guarantee"] = [by(v, "0.9") for v in entry["certificate"]["guarantee"]]


def _wide_guarantee(d):
    for entry in d["members"]:
        entry["certificate"]["guarantee"] = [by(v, 2) for v in entry["certificate"]["guarantee"]]


def _smaller_load(d):
    entry = assumption(d, "lift", "disturbance.load_force")
    entry["upper"] *= 0.8
    entry["lower"] *= 0.8


def _effectiveness(d):
    assumption(d, "tilt", "parameter.effectiveness")["lower"] = 0.5


def _requirement(d):
    d["study"]["requirements"]["tracking_error_m"] = 1e-5


def _member_left_out(d):
    d["members"] = [entry for entry in d["members"] if entry["name"] != "telescope"]


def _member_left_out_everywhere(d):
    _member_left_out(d)
    d["couplings"][0]["members"].remove("telescope")


def _coupling_left_out(d):
    d["couplings"] = []


def _obligation_left_out(d):
    d["obligations"] = [o for o in d["obligations"] if o["name"] != "loads"]


def _faster_reference(d):
    part = member(d, "lift")["reference"]["segments"][1]
    part["knots"] = [v * 0.99 for v in part["knots"]]


def _other_reference(d):
    member(d, "lift")["reference"] = copy.deepcopy(member(d, "tilt")["reference"])


def _noise(d):
    d["study"]["uncertainty"]["noise"]["speed"] = 1.0


def _initial(d):
    d["study"]["uncertainty"]["initial"]["position"] = 1.0


def _rate(d):
    d["study"]["controller"]["rate_hz"] = 100.0


def _other_rate(d):
    d["study"]["controller"]["rates_hz"] = {"tilt": 100.0}


def _modelling(d):
    d["study"]["controller"]["modelling"] = ["mechanics"]


def _stated_effectiveness(d):
    d["study"]["plant"]["joints"]["tilt"]["least_effectiveness"] = 0.05


def _stated_armature(d):
    d["study"]["plant"]["joints"]["lift"]["parameters"]["armature"]["tolerance"] = 0.5


def _stated_torque(d):
    d["study"]["plant"]["joints"]["lift"]["limits"]["torque"]["value"] = 100.0


def _gain(d):
    entry = member(d, "lift")["gains"][0]
    entry["value"] *= 0.7


def _transient(d):
    d["study"]["validation"]["transient_s"] = -1.0


def _seen(d):
    d["validation"]["largest_error_m"] = 1.0


def _observer(d):
    member(d, "lift")["observer"] = {"first": 0.1, "second": 1.0}


def _noise_of_nothing(d):
    d["study"]["uncertainty"]["noise"] = {"positon": 1e-6, "speed": 1e-4}


def _noise_left_out(d):
    del d["study"]["uncertainty"]["noise"]["speed"]


def _negative_noise(d):
    d["study"]["uncertainty"]["noise"]["position"] = -1e-6


def _parameter_of_nobody(d):
    d["study"]["plant"]["parameters"] = {"payload_mass": {"value": 1e9, "tolerance": 0.9}}


def _rate_of_nobody(d):
    d["study"]["controller"]["rates_hz"] = {"elbow": 50.0}


def _requirement_of_nobody(d):
    d["study"]["requirements"]["member_error"]["elbow"] = 1e-9


def _constant_output(d):
    d["couplings"][0]["place"] = {"inputs": [], "operations": [["const", "1.0"]], "outputs": [0]}
    d["couplings"][0]["envelope"]["output"] = "1/1000000000"
    d["validation"]["largest_error_m"] = 0.0


def _unit_with_a_claim(d):
    member(d, "lift")["model"]["rows"][0]["unit"] = "rad (third party verified)"


def _inertia_that_fades(d):
    plant = member(d, "lift")["model"]["plant"]
    effectiveness = next(k for k, o in enumerate(plant["operations"]) if o == ["input", "effectiveness"])
    plant["operations"] += [["mul", plant["outputs"][1], effectiveness]]
    plant["outputs"][1] = len(plant["operations"]) - 1


def _weak_load(d):
    """The load enters a member's plant with a hundredth of its size."""
    program = member(d, "lift")["model"]["plant"]
    operations, outputs = program["operations"], program["outputs"]
    operator, rest, load = operations[outputs[3]]
    assert operator == "sub" and operations[load] == ["input", "load_force"]
    count = len(operations)
    operations += [["const", "0.01"], ["mul", load, count], ["sub", rest, count + 1]]
    outputs[3] = count + 2


def _heavier_loads(d):
    """Half as much mass more in the program of the loads: what was proved is another machine."""
    program = d["couplings"][0]["loads"]
    factor = len(program["operations"])
    program["operations"].append(["const", "1.5"])
    for k, output in enumerate(program["outputs"]):
        program["operations"].append(["mul", output, factor])
        program["outputs"][k] = len(program["operations"]) - 1


def _load_without_acceleration(d):
    """A load that reads no acceleration still answers for the inertia that the plant carries itself."""
    program = d["couplings"][0]["loads"]
    program["operations"].append(["const", repr(assumption(d, "telescope", "disturbance.load_force")["lower"] + 10.0)])
    program["outputs"][2] = len(program["operations"]) - 1


MUTATIONS = {
    _envelope: (1, ""), _member_envelope: (1, ""), _payload: (1, ""), _guarantee: (1, ""), _wide_guarantee: (1, ""),
    _smaller_load: (1, ""), _effectiveness: (2, "is not the study's"), _requirement: (1, ""), _member_left_out: (2, ""),
    _member_left_out_everywhere: (2, ""), _coupling_left_out: (2, ""), _obligation_left_out: (1, ""),
    _faster_reference: (2, ""), _other_reference: (2, "must rest at"), _noise: (2, ""), _initial: (2, ""), _rate: (1, ""),
    _other_rate: (1, ""), _modelling: (2, ""), _stated_effectiveness: (2, ""), _stated_armature: (2, ""),
    _stated_torque: (1, ""), _gain: (1, ""), _transient: (2, ""), _seen: (1, ""), _observer: (2, ""),
    _weak_load: (1, "invariance"), _heavier_loads: (1, "load"),
    _load_without_acceleration: (1, "loads"),
    _noise_of_nothing: (2, "names something that the file does not have"),
    _noise_left_out: (2, "does not say noise of speed"), _negative_noise: (2, "must not be negative"),
    _parameter_of_nobody: (2, "plant.parameters"), _rate_of_nobody: (2, "controller.rates_hz names something"),
    _requirement_of_nobody: (2, "member_error names something"), _constant_output: (2, "must read a position"),
    _unit_with_a_claim: (2, "unit"), _inertia_that_fades: (2, "an inertia depends on more"),
}  # fmt: skip


@pytest.mark.parametrize("mutate", MUTATIONS, ids=lambda f: f.__name__)
def test_a_bent_statement_is_refused(document, judged, mutate):
    mutate(document)
    report = judged(document)
    status, words = MUTATIONS[mutate]
    assert report.status == status and words in report.message and "\n" not in report.message, report.message


def test_a_sealed_file_is_still_proved(document, judged):
    """What makes the mutations above be refused is their mutation."""
    assert judged(document).status == 0


def _another_output(d):
    d["couplings"][0]["place"]["operations"][0] = ["const", "0.5"]


def _lighter_plant(d):
    for operation in member(d, "lift")["model"]["plant"]["operations"]:
        if operation[0] == "const":
            operation[1] = "0.25"


@pytest.mark.parametrize("mutate", [_another_output, _lighter_plant])
def test_a_file_about_another_machine_is_not_simulated(document, mutate):
    """The checker takes the machine as given; what runs it compares."""
    mutate(document)
    with pytest.raises(InvalidInputError, match="not what this release makes of its study"):
        restored(document)


def test_verbs_of_machines(arm_text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = CliRunner()
    path = tmp_path / "arm.gains.json"
    path.write_text(arm_text, encoding="utf-8")
    assert run.invoke(main, ["check", str(path)]).exit_code == 0
    shown = run.invoke(main, ["simulate", str(path), "--scenario", "two-degraded", "--csv", "a.csv", "--json"])
    assert shown.exit_code == 0 and json.loads(shown.stdout)["two-degraded"]["maximum_error_m"] < 0.02
    assert (tmp_path / "a.csv").read_text().startswith("time [s],")
    stuck = run.invoke(main, ["simulate", str(path), "--scenario", "one-stuck"])
    assert stuck.exit_code == 0 and "outside the assumptions" in stuck.stderr
    told = run.invoke(main, ["trajectory", "arm-p3"])
    assert told.exit_code == 0 and "beside an inertia of" in told.stdout
    for arguments, words in (
        (["simulate", str(path), "--scenario", "none"], 'no scenario "none"'),
        (["design", "arm-p3", "--exchange", "none.json", "lift"], "none.json: cannot read the gain file"),
        (["design", "arm-p3", "--exchange", str(path), "elbow"], "names one of the members"),
        (["design", "emla-p2", "--exchange", str(path), "lift"], ""),
    ):
        found = run.invoke(main, arguments)
        assert found.exit_code == 2 and words in found.stderr and len(found.stderr.strip().splitlines()) == 1, words


@pytest.mark.parametrize("verb", ["simulate", "report"])
@pytest.mark.parametrize(
    "mutate",
    [
        lambda d: d["members"][0]["gains"][0].update(value="x"),
        lambda d: d["members"][0]["gains"].pop(),
        lambda d: d["members"][0].pop("nominal"),
        lambda d: d["members"][0].update(name="elbow"),
        lambda d: d["members"][0]["reference"].update(segments=5),
        lambda d: d.update(obligations=None),
        lambda d: d.update(members=[]),
    ],
)
def test_a_malformed_file_is_refused_in_one_line(document, tmp_path, monkeypatch, verb, mutate):
    monkeypatch.chdir(tmp_path)
    mutate(document)
    path = tmp_path / "bent.gains.json"
    path.write_text(to_text(seal(document)), encoding="utf-8")
    found = CliRunner().invoke(main, [verb, str(path)])
    assert found.exit_code == 2 and len(found.stderr.strip().splitlines()) == 1, found.output


@pytest.mark.parametrize("verb", ["simulate", "report"])
def test_an_empty_refusal_is_refused(tmp_path, monkeypatch, verb):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "x.rejected.json"
    path.write_text('{"schema": "hdmm-opt/rejected/2"}', encoding="utf-8")
    found = CliRunner().invoke(main, [verb, str(path)])
    assert found.exit_code == 2 and "a part of it is missing" in found.stderr
