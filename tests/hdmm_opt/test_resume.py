"""SIGKILL at any moment, then --resume: the same result as without."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from importlib import resources

import pytest

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.state import Journal, State


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """emla-p2 with a short search, few draws, and an attack."""
    text = (resources.files("hdmm_opt") / "studies" / "emla-p2.toml").read_text(encoding="utf-8")
    for pattern, new in (
        (r"population = \d+", "population = 8"), (r"iterations = \d+", "iterations = 20"),
        (r"monte_carlo = \d+", "monte_carlo = 64\nfalsify = 1000"),
    ):  # fmt: skip
        text, count = re.subn(pattern, new, text)
        assert count == 1
    path = tmp_path_factory.mktemp("study") / "small.toml"
    path.write_text(text, encoding="utf-8")
    return path


def hdmm(folder, *arguments):
    command = [sys.executable, "-m", "hdmm_opt", *map(str, arguments)]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def finish(process):
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors


def killed_until_done(folder, kills, longest, *arguments):
    """Run and kill at random moments, each time going on with --resume; the last run is left to end."""
    chance = random.Random(5)
    done = 0
    for _ in range(kills):
        process = hdmm(folder, *arguments, "--resume")
        try:
            process.wait(chance.uniform(0.05, longest))
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
            done += 1
        process.communicate()
    finish(hdmm(folder, *arguments, "--resume"))
    return done


def content(path):
    data = json.loads(path.read_text(encoding="utf-8"))
    data.pop("provenance", None)
    return data


@pytest.mark.long
@pytest.mark.parametrize("kills", [2, 20])
def test_a_design_that_is_killed_again_and_again_ends_with_the_same_file(kills, small, tmp_path):
    begun = time.monotonic()
    finish(hdmm(tmp_path, "design", small, "-o", "whole.gains.json"))
    alone = time.monotonic() - begun
    done = killed_until_done(tmp_path, kills, min(0.6 * alone, 5.0), "design", small, "-o", "killed.gains.json")
    assert done >= kills // 2
    assert content(tmp_path / "killed.gains.json") == content(tmp_path / "whole.gains.json")
    assert sorted(p.name for p in tmp_path.glob("*.json")) == ["killed.gains.json", "whole.gains.json"]
    assert not list(tmp_path.glob(".*state"))


def test_a_falsification_killed_on_the_way_ends_with_the_same_file(gain_text, tmp_path):
    for name in ("whole", "killed"):
        (tmp_path / f"{name}.gains.json").write_text(gain_text, encoding="utf-8")
    finish(hdmm(tmp_path, "falsify", "whole.gains.json", "--budget", 1500))
    killed = hdmm(tmp_path, "falsify", "killed.gains.json", "--budget", 1500)
    state = tmp_path / ".killed.gains.json.falsify.state"
    while not state.exists() and killed.poll() is None:
        time.sleep(0.02)
    os.kill(killed.pid, signal.SIGKILL)
    killed.communicate()
    assert json.loads(state.read_text(encoding="utf-8"))["parts"]["falsify"]
    finish(hdmm(tmp_path, "falsify", "killed.gains.json", "--budget", 1500, "--resume", "--jobs", 2))
    assert content(tmp_path / "killed.gains.json") == content(tmp_path / "whole.gains.json")
    assert not state.exists()


def test_a_state_belongs_to_its_job(tmp_path):
    path = tmp_path / "s.state"
    State(path, {"job": 1}, resume=False).put("part", [1, 2])
    assert State(path, {"job": 1}, resume=True).get("part") == [1, 2]
    assert State(path, {"job": 1}, resume=False).get("part") is None
    with pytest.raises(InvalidInputError, match="another study, seed, budget or release"):
        State(path, {"job": 2}, resume=True)
    path.write_text("{", encoding="utf-8")
    with pytest.raises(InvalidInputError, match="not a state"):
        State(path, {"job": 1}, resume=True)
    often = State(tmp_path / "often.state", {}, resume=False)
    for k in range(100):
        often.put("count", k, often=True)
    assert json.loads((tmp_path / "often.state").read_text(encoding="utf-8"))["parts"]["count"] == 0
    often.put("count", 100)
    assert State(tmp_path / "often.state", {}, resume=True).get("count") == 100


def test_a_journal_grows_by_lines_and_drops_one_that_was_cut(tmp_path):
    path = tmp_path / "j.state"
    journal = Journal(path, {"job": 1}, resume=False)
    for k in range(3):
        journal.add([k, {"x": k}])
    size = path.stat().st_size
    journal.add([3, {"x": 3}])
    assert path.stat().st_size - size < size / 2  # appended, not written anew
    path.write_text(path.read_text(encoding="utf-8")[:-5], encoding="utf-8")
    assert Journal(path, {"job": 1}, resume=True).entries == [[k, {"x": k}] for k in range(3)]
    with pytest.raises(InvalidInputError, match="another study, seed, budget or release"):
        Journal(path, {"job": 2}, resume=True)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('"x": 1', '"x": 7'), encoding="utf-8")
    with pytest.raises(InvalidInputError, match="line 3 was changed"):
        Journal(path, {"job": 1}, resume=True)
