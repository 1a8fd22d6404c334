"""The command line as a user meets it: files, streams, exit statuses."""

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree

import click
import jsonschema
import pytest

from hdmm_opt import cli, study
from hdmm_opt.cli.group import VERBS
from hdmm_opt.files.read import certified_of, read
from hdmm_opt.files.restore import restored
from hdmm_opt.files.seal import to_text
from hdmm_opt.problem import assemble
from hdmm_opt.problem.resolved import resolved
from stability import checker

GAINS = Path(__file__).parents[2] / "notebooks" / "gains"


def run(*arguments, cwd=None):
    command = [sys.executable, "-m", "hdmm_opt", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def interruptible():
    """In a child before it starts: it reacts to an interrupt also where the parent of the tests ignores it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A study that takes seconds: the search and the draws cut down."""
    folder = tmp_path_factory.mktemp("small")
    text = (resources.files("hdmm_opt") / "studies" / "emla-p2.toml").read_text(encoding="utf-8")
    text = text.replace("population = 10", "population = 4").replace("iterations = 8", "iterations = 2")
    text = text.replace("monte_carlo = 20", "monte_carlo = 2").replace("worst_case = true", "worst_case = false")
    (folder / "small.toml").write_text(text.replace('name = "emla-p2"', 'name = "small"'), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def designed(small):
    done = run("design", "small.toml", "--seed", 3, "--report", "report", cwd=small)
    assert done.returncode == 0, done.stderr
    return small, done


def test_design_writes_a_proved_file_and_says_so(designed):
    folder, done = designed
    assert done.stdout.strip() == "small.gains.json"
    assert "proved" in done.stderr and "assumed, to be replaced by yours" in done.stderr
    assert checker.check_file(folder / "small.gains.json").status == 0
    assert run("check", "small.gains.json", cwd=folder).returncode == 0
    assert not list(folder.glob(".*")), "no temporary or state file stays behind"
    page = (folder / "report" / "report.html").read_text(encoding="utf-8")
    assert "assumed" in page and "certified bound" in page


def test_same_study_and_seed_give_the_same_bytes(designed):
    """Also with two processes instead of one."""
    folder, _ = designed
    assert run("design", "small.toml", "--seed", 3, "--jobs", 2, "-o", "again.gains.json", cwd=folder).returncode == 0
    first, again = (
        json.loads((folder / n).read_text(encoding="utf-8")) for n in ("small.gains.json", "again.gains.json")
    )
    assert first.pop("provenance")["threads"] == 1 and again.pop("provenance")["threads"] == 2
    assert to_text(first) == to_text(again)


@pytest.mark.parametrize("path", sorted(GAINS.glob("*.json")), ids=lambda p: p.name)
def test_gain_files_match_their_published_schema(path):
    data = json.loads(path.read_text(encoding="utf-8"))
    schema = json.loads((resources.files("hdmm_opt") / "schema" / "gains-2.schema.json").read_text(encoding="utf-8"))
    validator = jsonschema.Draft202012Validator(schema)
    validator.validate(data)
    for key in list(schema["required"]):
        assert not validator.is_valid({k: v for k, v in data.items() if k != key})


@pytest.mark.parametrize("path", sorted(GAINS.glob("*.json")), ids=lambda p: p.name)
def test_committed_files_are_about_the_plants_of_this_release(path):
    """The checker takes the model as given; here it is compared with the symbolic one."""
    problem, _ = restored(read(path))  # refuses what is not of this release
    loaded = study.load(path.name.removesuffix(".gains.json"))
    made = assemble(loaded, tuple(m.reference for m in problem.members))
    assert resolved(made) == resolved(problem)


def test_committed_files_meet_what_their_studies_ask():
    """Bounds, requirements, and how far the proof is from what simulation finds (issue of the EMLA)."""
    for name, error in (("emla-p2", 2e-3), ("emla-p4-ramp", 1.5e-3), ("emla-p4-fast", 1.5e-3), ("emla-p1", 1e-3)):
        data = read(GAINS / f"{name}.gains.json")
        rows = {row["name"]: row for row in data["validation"]["requirements"]}
        assert rows["tracking_error_m"]["certified"] <= error
        assert all(row["simulated"] <= row["required"] for row in rows.values())
    data = read(GAINS / "emla-p2.gains.json")
    assert 1.0 <= certified_of(data) / data["validation"]["largest_error_after_transient_m"] <= 3.0


@pytest.mark.parametrize(
    ("name", "obligation", "advice"),
    [
        ("emla-refused", "refuted: authority", "in controller.modelling"),
        ("emla-refused-rate", "undecided: sampling", "us ("),
    ],
)
def test_what_cannot_be_proved_is_refused_with_advice(tmp_path, name, obligation, advice):
    done = run("design", name, cwd=tmp_path)
    assert done.returncode == 1 and not done.stdout
    first = done.stderr.splitlines()[1]
    assert obligation in first and "margin -" in first
    assert re.search("would (pass|help): ", done.stderr) and advice in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == [f"{name}.rejected.json"]
    left = json.loads((tmp_path / f"{name}.rejected.json").read_text(encoding="utf-8"))
    assert left["obligations"][0]["verdict"] != "proved"
    assert run("check", f"{name}.rejected.json", cwd=tmp_path).returncode == 2


def test_the_witness_of_a_refutation_replays(tmp_path):
    run("design", "emla-refused", cwd=tmp_path)
    done = run("simulate", "emla-refused.rejected.json", "--scenario", "witness", "--json", cwd=tmp_path)
    assert done.returncode == 1
    assert json.loads(done.stdout)["witness"]["members"]["actuator"]["peak_input"] > 310


def test_the_period_that_would_do_does(tmp_path):
    """The advice of a sampling refusal, taken: proved at that rate."""
    run("design", "emla-refused-rate", cwd=tmp_path)
    left = json.loads((tmp_path / "emla-refused-rate.rejected.json").read_text(encoding="utf-8"))
    rate = float(left["obligations"][0]["remedy"].split("(")[1].split(" Hz")[0])
    text = (resources.files("hdmm_opt") / "studies" / "emla-refused-rate.toml").read_text(encoding="utf-8")
    text = text.replace("monte_carlo = 0", "monte_carlo = 0\nworst_case = false")
    (tmp_path / "faster.toml").write_text(text.replace("rate_hz = 1000", f"rate_hz = {1.002 * rate}"), encoding="utf-8")
    assert run("design", "faster.toml", cwd=tmp_path).returncode == 0
    (tmp_path / "slower.toml").write_text(text.replace("rate_hz = 1000", f"rate_hz = {0.9 * rate}"), encoding="utf-8")
    assert run("design", "slower.toml", cwd=tmp_path).returncode == 1


def test_simulate_prints_figures_and_writes_signals(tmp_path):
    source = GAINS / "emla-p2.gains.json"
    done = run("simulate", source, "--scenario", "heavy", "--csv", "out.csv", "--json", cwd=tmp_path)
    assert done.returncode == 0
    figures = json.loads(done.stdout)["heavy"]
    assert 0 < figures["maximum_error_m"] < 2e-3
    rows = list(csv.DictReader(io.StringIO((tmp_path / "out.csv").read_text(encoding="utf-8"))))
    late = [abs(float(row["error [m]"])) for row in rows if float(row["time [s]"]) >= 1.0]
    assert max(late) == pytest.approx(figures["maximum_error_m"], abs=5e-12)  # twelve digits are written
    assert run("simulate", source, "--scenario", "heavvy").stderr.count("\n") == 1
    assert run("simulate", source, "--csv", tmp_path / "x.csv").returncode == 2
    assert run("simulate", source, "--scenario", "worst-case").returncode == 0


def test_trajectory_shows_peaks_beside_limits(tmp_path):
    done = run("trajectory", "emla-p4-fast", "-o", "reference.json", cwd=tmp_path)
    assert done.returncode == 0 and "voltage" in done.stdout
    data = json.loads((tmp_path / "reference.json").read_text(encoding="utf-8"))
    assert len(data["members"][0]["reference"]["segments"]) == 5


def test_studies_lists_what_is_bundled():
    rows = json.loads(run("studies", "--json").stdout)
    assert [row["name"] for row in rows] == study.bundled()
    assert all(row["shows"] and row["law"] for row in rows)


@pytest.mark.parametrize(
    "arguments",
    [
        ("design", "nowhere.toml"), ("design", "emla-p9"), ("design", "emla-p2", "-o", "/proc/x.json"),
        ("design", "emla-p2", "-o", "missing/folder/x.json"), ("design", "emla-p2", "-o", "."),
        ("design", "emla-p2", "--report", "/proc/report"), ("design", "emla-p2", "--jobs", "0"),
        ("design", "emla-p2", "--budget", "huge"), ("design",), ("check",), ("check", "nowhere.json"),
        ("simulate", "nowhere.json"), ("report", "nowhere.json"), ("trajectory", "emla-p2", "-o", "/proc/x.json"), ("fly",), ("studies", "--all"),
    ],
)  # fmt: skip
def test_misuse_is_status_2_and_leaves_nothing(arguments, tmp_path):
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("share", [0.3, 0.98])
def test_truncated_and_tampered_files_are_one_line(share, tmp_path, gain_text):
    (tmp_path / "cut.json").write_text(gain_text[: int(share * len(gain_text))], encoding="utf-8")
    (tmp_path / "touched.json").write_text(gain_text.replace('"rate_hz": 1000', '"rate_hz": 1001', 1), encoding="utf-8")
    (tmp_path / "later.json").write_text(gain_text.replace("gains/2", "gains/3", 1), encoding="utf-8")
    for name in ("cut.json", "touched.json", "later.json"):
        for verb in ("check", "simulate"):
            done = run(verb, name, cwd=tmp_path)
            assert done.returncode == 2, (verb, name)
            assert (done.stdout + done.stderr).count("\n") == 1 and "Traceback" not in done.stderr


@pytest.mark.slow
def test_interrupted_design_keeps_its_state_and_resumes_to_the_same_file(designed):
    folder, _ = designed
    text = (folder / "small.toml").read_text(encoding="utf-8").replace("iterations = 2", "iterations = 6")
    (folder / "longer.toml").write_text(text.replace('"small"', '"longer"'), encoding="utf-8")
    assert run("design", "longer.toml", "-o", "whole.gains.json", cwd=folder).returncode == 0
    command = [sys.executable, "-m", "hdmm_opt", "design", "longer.toml", "-o", "parts.gains.json"]
    state = folder / ".parts.gains.json.state"
    process = subprocess.Popen(
        command, cwd=folder, stderr=subprocess.PIPE, text=True, env={**os.environ}, preexec_fn=interruptible
    )
    deadline = time.monotonic() + 120
    while not state.exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130 and "Traceback" not in errors and "interrupted" in errors
    assert not (folder / "parts.gains.json").exists() and not list(folder.glob(".*.part"))
    json.loads(state.read_text(encoding="utf-8"))
    assert run("design", "longer.toml", "-o", "parts.gains.json", "--resume", "--seed", 9, cwd=folder).returncode == 2
    assert run("design", "longer.toml", "-o", "parts.gains.json", "--resume", cwd=folder).returncode == 0
    whole, parts = (json.loads((folder / f"{n}.gains.json").read_text(encoding="utf-8")) for n in ("whole", "parts"))
    assert whole["sha256"] == parts["sha256"]
    assert not state.exists()


@pytest.mark.parametrize("pause", [1.5, 5.0])
def test_ctrl_c_ends_all_processes(designed, pause):
    """A terminal sends the interrupt to the whole group, also while the processes are starting."""
    folder, _ = designed
    command = [
        sys.executable,
        "-m",
        "hdmm_opt",
        "design",
        "small.toml",
        "-o",
        "cut.gains.json",
        "--jobs",
        "2",
        "--budget",
        "full",
    ]
    process = subprocess.Popen(
        command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=interruptible
    )
    time.sleep(pause)
    os.killpg(process.pid, signal.SIGINT)
    try:
        _, errors = process.communicate(timeout=60)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    assert process.returncode == 130 and "Traceback" not in errors
    with pytest.raises(ProcessLookupError):
        for _ in range(100):
            os.killpg(process.pid, 0)
            time.sleep(0.1)
    assert not (folder / "cut.gains.json").exists()


def test_help_loads_no_heavy_library():
    code = "import sys; import hdmm_opt.cli; print([m for m in ('numpy', 'casadi', 'pydantic', 'cvxpy', 'scipy', 'rich') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_verb_explains_itself():
    from click.testing import CliRunner

    for name in VERBS:
        command = cli.main.get_command(None, name)
        shown = " ".join(CliRunner().invoke(cli.main, [name, "--help"]).output.split())
        assert command.help
        assert " ".join(command.help.split()) in shown
        for parameter in command.params:
            assert isinstance(parameter, click.Argument) or parameter.help


def test_junit_lists_every_obligation(tmp_path, gain_text):
    (tmp_path / "good.json").write_text(gain_text, encoding="utf-8")
    (tmp_path / "cut.json").write_text(gain_text[:500], encoding="utf-8")
    assert run("check", "good.json", "cut.json", "--junit", "out.xml", cwd=tmp_path).returncode == 2
    suites = {s.get("name"): s for s in ElementTree.parse(tmp_path / "out.xml").getroot()}
    assert int(suites["good.json"].get("tests")) == 1 + len(checker.REQUIRED["rac"]["impulse"])
    assert suites["good.json"].get("failures") == suites["good.json"].get("errors") == "0"
    assert suites["cut.json"].get("errors") == "1" and suites["cut.json"].find("testcase/error") is not None


pytest_plugins = ["pytester"]


def test_pytest_collects_gain_files(pytester, document, resealed):
    pytester.makefile(".gains.json", good=resealed(document))
    document["study"]["requirements"]["tracking_error_m"] = 1e-5
    pytester.makefile(".gains.json", bad=resealed(document))
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-n0")
    count = len(checker.REQUIRED["rac"]["impulse"])
    result.assert_outcomes(passed=count + 1 + count - 1, failed=2)
    result.stdout.fnmatch_lines(["*undecided: actuator: accuracy*"])
