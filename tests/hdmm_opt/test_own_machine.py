"""The user's own machine: every number of a proof is the study's; plants of one's own; wrong inputs in one line."""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from hdmm_opt import study
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.plants.own import allow
from hdmm_opt.problem import assemble
from stability import checker

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "docs" / "own_machine"
README = re.search(r"```toml\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)


def run(*arguments, cwd):
    command = [sys.executable, "-m", "hdmm_opt", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture(scope="module")
def direct(tmp_path_factory):
    """The direct drive of the README, designed."""
    folder = tmp_path_factory.mktemp("direct")
    (folder / "mine.toml").write_text(README[1], encoding="utf-8")
    return folder, run("design", "mine.toml", cwd=folder)


def test_the_study_of_the_readme_is_proved_and_every_number_is_its_own(direct):
    folder, done = direct
    assert done.returncode == 0, done.stderr
    data, given = json.loads((folder / "mine.gains.json").read_text(encoding="utf-8")), tomllib.loads(README[1])
    own = data["study"]["plant"]["joints"]["actuator"]
    for kind in ("parameters", "ratings", "limits"):
        for name, entry in given["plant"][kind].items():
            assert own[kind][name] | entry == own[kind][name]
    assert own["stroke_m"] == given["plant"]["stroke_m"]
    left = set(own["bundled"])
    assert left == set(checker.check_file(folder / "mine.gains.json").bundled)
    assert not left & {
        *given["plant"]["parameters"],
        *given["plant"]["ratings"],
        "torque limit",
        "speed limit",
        "stroke",
    }
    assert "still of the bundled pmsm_emla: screw_friction" in done.stderr


def test_a_study_that_gives_every_number_leaves_nothing_to_the_bundled_machine():
    data = tomllib.loads(README[1])
    problem = assemble(study.validated(data, "test"))
    (plant,) = problem.machine.plants
    for name in problem.machine.bundled["actuator"]:
        p = plant.parameters[name]
        data["plant"]["parameters"][name] = {
            "value": 0.0 if p.loss else p.value, "unit": p.unit, "source": "assumed", "tolerance": p.tolerance
        }  # fmt: skip
    whole = assemble(study.validated(data, "test"))
    assert whole.machine.bundled == {"actuator": ()}
    assert whole.machine.plants[0].parameters["coulomb_friction"].value == 0.0


def test_gain_ranges_follow_from_inertia_rate_and_limits():
    """ω = β / (2 M): half the rate for the row of the input, a third of that before it, a fifth of a percent below."""
    (member,) = assemble(study.validated(tomllib.loads(README[1]), "test")).members
    ranges = {gain.name: gain for gain in member.ranges}
    inertia = 0.0025 / (0.005 / 6.283185307179586) + 0.005 / 6.283185307179586 * 500
    assert ranges["beta_2"].high == pytest.approx(2 * inertia * 2000, rel=2e-2)
    assert ranges["beta_1"].high == pytest.approx(2 * 2000 / 3, rel=5e-3)
    assert ranges["beta_1"].high / ranges["beta_1"].low == pytest.approx(500, rel=1e-2)
    data = tomllib.loads(README[1])
    data["uncertainty"]["initial"]["position_m"] = 1e-2  # such a start may ask for no more than the largest speed
    (member,) = assemble(study.validated(data, "test")).members
    assert member.ranges[0].high == pytest.approx(2 * 0.25 / 1e-2)


@pytest.fixture(scope="module")
def cylinder(tmp_path_factory):
    """The worked example, designed; its code is gone before anything else happens."""
    folder = tmp_path_factory.mktemp("cylinder")
    for name in ("cylinder.py", "cylinder.toml"):
        shutil.copy(EXAMPLE / name, folder / name)
    refused = run("design", "cylinder.toml", cwd=folder)
    done = run("design", "cylinder.toml", "--allow-code", "--jobs", 2, "--report", "page", cwd=folder)
    shutil.rmtree(folder / "__pycache__", ignore_errors=True)
    (folder / "cylinder.py").unlink()
    return folder, refused, done


def test_a_plant_file_goes_through_every_verb(cylinder):
    folder, refused, done = cylinder
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1 and "--allow-code" in refused.stderr
    assert done.returncode == 0 and "still the defaults of cylinder.py:cylinder" in done.stderr
    file = folder / "cylinder.gains.json"
    for verb in (("check", file), ("simulate", file), ("falsify", file, "--budget", 20), ("report", file)):
        found = run(*verb, cwd=folder)
        assert found.returncode == 0, found.stderr
    alone = subprocess.run([sys.executable, "-I", "-S", checker.__file__, file], capture_output=True, text=True)
    assert alone.returncode == 0 and "proved" in alone.stdout


def test_a_file_of_such_a_plant_simulates_as_its_code_does(cylinder, tmp_path):
    """The operations of the file and the code that made them: the same runs, but for the figures of its outputs."""
    folder, _, _ = cylinder
    for name in ("cylinder.py", "cylinder.toml"):
        shutil.copy(EXAMPLE / name, tmp_path / name)
    script = (
        "import json, sys, hdmm_opt as h; from pathlib import Path\n"
        "if sys.argv[2] == 'code': h.load_study('cylinder.toml', allow_code=True)\n"
        "s = h.simulate(Path(sys.argv[1])); f = s.figures['load-step']\n"
        "print(json.dumps([f.maximum_error_m, f.rms_error_m, f.limit_use]))"
    )
    shown = [
        json.loads(subprocess.run([sys.executable, "-c", script, folder / "cylinder.gains.json", how], cwd=tmp_path,
                                  capture_output=True, text=True, check=True).stdout)
        for how in ("code", "file")
    ]  # fmt: skip
    assert shown[0] == pytest.approx(shown[1], rel=1e-9)


@pytest.mark.long
def test_the_workers_of_a_search_may_run_the_same_code(tmp_path):
    for name in ("cylinder.py", "cylinder.toml"):
        shutil.copy(EXAMPLE / name, tmp_path / name)
    done = run(
        "sweep", "cylinder.toml", "--allow-code", "--jobs", 2, "--vary", "controller.rate_hz=1000,2000", cwd=tmp_path
    )
    assert done.returncode == 0 and "2 of 2 designs" in done.stderr, done.stderr


PLANTS = {
    "no such file": ("gone.py:drive", "", "no file gone.py"),
    "no such function": ("p.py:drive", "x = 1", 'no function "drive"'),
    "a name that is none": ("p.py:2drive", "", "FILE.py:FUNCTION"),
    "a file that fails": ("p.py:drive", "import nothing_of_that_name", "fails: ModuleNotFoundError"),
    "a function that fails": ("p.py:drive", "def drive():\n    raise ValueError('no idea')", "no idea"),
    "a syntax error": ("p.py:drive", "def drive(:", "SyntaxError"),
    "no plant model": ("p.py:drive", "def drive():\n    return 3", "must return a PlantModel"),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANTS)
def test_a_file_that_is_no_plant_is_one_line(name, tmp_path):
    model, code, words = PLANTS[name]
    (tmp_path / "p.py").write_text(code, encoding="utf-8")
    with pytest.raises(InvalidInputError) as refused:
        allow(model, tmp_path)
    assert words in str(refused.value) and "\n" not in str(refused.value)


#: A change of the example's code, and what is said of it.
BENT = {
    "targets of another length": ('targets=("reference", 0, 1)', 'targets=("reference", 0)', "targets must have 3"),
    "a first row that tracks nothing": ('targets=("reference", 0, 1)', 'targets=("zero", 0, 1)', "first row must track"),
    "a target that comes later": ('targets=("reference", 0, 1)', 'targets=("reference", 2, 1)', "target 2 must be"),
    "an input of a lag": ("input_map=(1,)", "input_map=(2,)", "input_map names controlled rows"),
    "a law that nothing carries out": ("controlled=(True, True, False)", "controlled=(True, True, True)", "nothing follows row 3"),
    "a mass that moves": ('ca.vertcat(1, q["mass"]', 'ca.vertcat(1, q["mass"] + x[0]', "mass may read parameters alone"),
    "a symbol of nowhere": ('q["area"] * pressure - friction', 'q["area"] * pressure - friction * ca.SX.sym("z")', "none of x, u, w, p"),
    "an angle for a position": ('state_units=("m", "m/s", "Pa")', 'state_units=("deg", "m/s", "Pa")', "must be in m or rad"),
    "one name twice": ('inputs=("pressure_command",)', 'inputs=("pressure",)', "different plain identifiers"),
    "a limit on nothing": ('signals=("pressure_command",), value=20e6', 'signals=("flow",), value=20e6', "first limit must be"),
    "no plant": ("return Plant(", "return dict(", "must return a Plant"),
}  # fmt: skip


@pytest.mark.parametrize("name", BENT)
def test_a_plant_that_does_not_fit_is_one_line(name, tmp_path):
    old, new, words = BENT[name]
    code = (EXAMPLE / "cylinder.py").read_text(encoding="utf-8")
    assert old in code
    (tmp_path / "cylinder.py").write_text(code.replace(old, new), encoding="utf-8")
    shutil.copy(EXAMPLE / "cylinder.toml", tmp_path)
    with pytest.raises(InvalidInputError) as refused:
        assemble(study.load(str(tmp_path / "cylinder.toml"), allow_code=True))
    assert words in str(refused.value) and "\n" not in str(refused.value)


#: What is put in the place of what in the study of the README, and the words that must come.
WRONG = {
    "a stroke upside down": ("[0.0, 0.3]", "[0.3, 0.0]", "plant.stroke_m needs lower < upper"),
    "a stroke of an angle": ("stroke_m = ", "stroke_rad = ", "plant.stroke_rad has no place"),
    "a stroke of one number": ("[0.0, 0.3]", "0.3", "plant.stroke_m"),
    "a waypoint outside the stroke": ("[0.05, 0.25, 0.05]", "[0.05, 0.35, 0.05]", "inside the stroke, 0 to 0.3 m"),
    "a parameter misspelt": ("screw_lead", "screw_led", 'did you mean "screw_lead"'),
    "a parameter in millimetres": ('value = 0.005, unit = "m"', 'value = 5.0, unit = "mm"', 'unit must be "m"'),
    "a lead of zero": ("value = 0.005", "value = 0.0", "plant.parameters.screw_lead.value must be positive"),
    "a negative loss": ("value = 0.0, unit", "value = -0.1, unit", "plant.parameters.gear_loss.value must be 0 or more"),
    "a tolerance of one": ("tolerance = 0.1", "tolerance = 1.0", "tolerance"),
    "a negative tolerance": ("tolerance = 0.1", "tolerance = -0.1", "tolerance"),
    "no unit": ('value = 1.0, unit = "1", source', "value = 1.0, source", "plant.parameters.gear_ratio.unit"),
    "no source": (', unit = "1", source = "public" }             # no gear', ', unit = "1" }', "gear_ratio.source"),
    "a source that is none": ('source = "assumed"', 'source = "guess"', "source must be"),
    "a limit misspelt": ("torque = { value = 38.0", "torqe = { value = 38.0", 'did you mean "torque"'),
    "a limit of zero": ("value = 38.0", "value = 0.0", "plant.limits.torque.value"),
    "a limit in another unit": ('value = 38.0, unit = "N m"', 'value = 38.0, unit = "kN m"', 'unit must be "N m"'),
    "a limit of the other level": ("torque = { value = 38.0", "voltage = { value = 38.0", "plant.limits.voltage is not a limit"),
    "a rating of the other level": ("pole_pairs = ", "peak_torque = ", "plant.ratings.peak_torque is not a rating"),
    "a rating among the parameters": ("gear_ratio = ", "pole_pairs = ", "write plant.ratings.pole_pairs"),
    "a parameter among the ratings": ("pole_pairs = ", "gear_ratio = ", "write plant.parameters.gear_ratio"),
    "a limit among the parameters": ("gear_ratio = ", "torque = ", "write plant.limits.torque"),
    "an unknown level": ('level = "torque" ', 'level = "speed" ', "plant.level is one of torque, voltage"),
    "an unknown model": ('model = "pmsm_emla"', 'model = "pmsm"', "plant.model is unknown"),
    "code without permission": ('model = "pmsm_emla"', 'model = "d.py:d"', "--allow-code"),
    "a load upside down": ("[10e3, 30e3] ", "[30e3, 10e3] ", "needs lower <= upper"),
    "a load of one value": ("[10e3, 30e3] ", "[10e3, 10e3] ", "is an empty range"),
    "a load of another name": ("disturbances.load_force]", "disturbances.load]", "is not a disturbance of the study"),
    "a load in another unit": ("range = [10e3, 30e3]", 'unit = "kN"\nrange = [10e3, 30e3]', 'unit must be "N"'),
    "a scenario outside the load": ("[2.001, 30e3]", "[2.001, 31e3]", "validation.scenarios.load-step"),
    "times that go back": ("[2.0, 10e3], [2.001", "[2.0, 10e3], [1.0", "needs increasing times"),
    "noise of nothing": ("speed_m_s = 1e-4", "current_a = 1e-4", 'unknown key "uncertainty.noise.current_a"'),
    "negative noise": ("speed_m_s = 1e-4", "speed_m_s = -1e-4", "uncertainty.noise.speed_m_s"),
    "a move too fast": ("[3.0, 3.0]", "[0.5, 3.0]", "would do"),
    "a duration too few": ("[3.0, 3.0]", "[3.0]", "one duration for each of the 2 moves"),
    "no limits of the motion": ("limits = { speed_m_s = 0.2, acceleration_m_s2 = 1.0, jerk_m_s3 = 10.0 }", "", '"reference.limits" is required'),
    "a rate of zero": ("rate_hz = 4000", "rate_hz = 0", "controller.rate_hz"),
    "an unknown law": ('law = "rac"', 'law = "pid"', "controller.law"),
    "an unknown term": ('["mechanics"]', '["physics"]', "controller.modelling"),
    "an electrical term at torque level": ('["mechanics"]', '["back_emf"]', 'needs plant.level = "voltage"'),
    "a gain upside down": ('law = "rac"', 'gains.beta_1 = { min = 9.0, max = 1.0 }\nlaw = "rac"', "needs lower <= upper"),
    "a gain misspelt": ('law = "rac"', 'gains.beta1 = { value = 9.0 }\nlaw = "rac"', 'did you mean "beta_1"'),
    "no requirement": ("tracking_error_m = 0.003", "", "requirements.tracking_error_m"),
    "a band of zero": ("tracking_error_m = 0.003", "tracking_error_m = 0.003\nsettling_band_m = 0.0", "settling_band_m"),
    "a number beyond all sizes": ("value = 38.0", "value = 1e30", "check the unit"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_study_is_one_line_that_names_file_and_key(name, tmp_path):
    old, new, words = WRONG[name]
    assert old in README[1]
    (tmp_path / "mine.toml").write_text(README[1].replace(old, new, 1), encoding="utf-8")
    from click.testing import CliRunner

    from hdmm_opt.cli import main

    path = tmp_path / "mine.toml"
    done = CliRunner().invoke(main, ["design", str(path), "-o", str(tmp_path / "x.gains.json")])
    said = done.stderr if hasattr(done, "stderr") else done.output
    assert done.exit_code == 2 and said.count("\n") == 1, said
    assert words in said and "mine.toml" in said and sorted(p.name for p in tmp_path.iterdir()) == ["mine.toml"]


def test_a_byte_order_mark_does_no_harm(tmp_path):
    (tmp_path / "mine.toml").write_text(README[1], encoding="utf-8-sig")
    assert study.load(str(tmp_path / "mine.toml")).study.name == "mine"


def test_all_that_is_wrong_with_the_numbers_is_said_at_once(tmp_path):
    """One line for each, so that the next run is not the next refusal."""
    from click.testing import CliRunner

    from hdmm_opt.cli import main

    text = README[1]
    for old, new in (
        ('screw_lead = { value = 0.005, unit = "m"', 'screw_lead = { value = 5, unit = "mm"'),
        ("gear_ratio = ", "gear_ration = "),
        ("torque = { value = 38.0", "force = { value = 38.0"),
        ("tracking_error_m = ", "tracking_error_mm = "),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    done = CliRunner().invoke(main, ["design", str(tmp_path / "mine.toml")])
    said = done.stderr if hasattr(done, "stderr") else done.output
    lines = said.splitlines()
    assert done.exit_code == 2 and len(lines) == 4 and all("mine.toml" in line and ";" in line for line in lines)
    for word in ("screw_lead.unit", "gear_ration", "limits.force", "tracking_error_mm"):
        assert sum(word in line for line in lines) == 1, said
