import json
import os
import re
import signal
import subprocess
import sys
import time
from importlib import resources

import pytest

from hdmm_opt import study
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.jobs.sweep import axis, grid, varied


@pytest.fixture(scope="module")
def base():
    return study.load("emla-p2")


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """emla-p2 with a short search and no draws: a design of a few seconds."""
    text = (resources.files("hdmm_opt") / "studies" / "emla-p2.toml").read_text(encoding="utf-8")
    text = re.sub(r"monte_carlo = \d+", "monte_carlo = 0", text).replace("worst_case = true", "worst_case = false")
    text = re.sub(r"settling_band_m = .*\n", "", text)
    text = re.sub(r"iterations = \d+", "iterations = 2", re.sub(r"population = \d+", "population = 6", text))
    path = tmp_path_factory.mktemp("study") / "quick.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_axes_and_grids(base):
    assert axis("controller.rate_hz=500:2000:4").values == (500.0, 1000.0, 1500.0, 2000.0)
    assert axis("a.b=1,2.5").values == (1.0, 2.5)
    points = grid(
        base, [axis("controller.rate_hz=500,1000"), axis("plant.parameters.motor_inertia.value=0.01,0.02,0.03")]
    )
    assert [tuple(values.values()) for values, _ in points] == [(r, j) for r in (500, 1000) for j in (0.01, 0.02, 0.03)]
    for values, made in points:
        assert made.controller.rate_hz == values["controller.rate_hz"]
        assert made.plant.parameters["motor_inertia"].value == values["plant.parameters.motor_inertia.value"]
    assert varied(base, {"uncertainty.disturbances.load_force.range.1": 80e3}).uncertainty.disturbances[
        "load_force"
    ].range == (65e3, 80e3)
    assert varied(base, {"tuning.population": 12.0}).tuning.population == 12


def test_a_parameter_that_the_file_leaves_out_can_be_varied(base):
    made = varied(base, {"plant.parameters.viscous_friction.value": 0.02})
    assert made.plant.parameters["viscous_friction"].value == 0.02
    assert made.plant.parameters["viscous_friction"].source == "assumed"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("controller.rat_hz=1:2:3", 'did you mean "rate_hz"'),
        ("controller.rate_hz=1:2", "needs key=a:b:n"),
        ("controller.rate_hz=nan,1", "finite"),
        ("controller.rate_hz=", "needs key=a:b:n"),
        ("=1,2", "needs key=a:b:n"),
        ("controller.rate_hz=0,1000", "greater than 0"),
        ("study.name=1,2", "not a number"),
        ("validation.worst_case=0,1", "not a number"),
        ("controller.rate_hz.deep=1,2", "single value"),
        ("uncertainty.disturbances.load_force.range.7=1,2", "gives no"),
        ("controller.modelling.0=1,2", "it is empty"),
        ("tuning.seconds=1,2", "give it a value in the file first"),
        ("plant.parameters.gear_los.value=1,2", 'did you mean "gear_loss"'),
        ("controller.rate_hz=1000,1000", "differ"),
        ("controller.rate_hz=1e999:2:2", "within"),
        ("controller.rate_hz=500:2000:100000000000", "at most 10000"),
        ("controller.rate_hz=1:2:20000", "at most 10000"),
    ],
)
def test_bad_axes_are_refused_in_one_line(base, text, said):
    with pytest.raises(InvalidInputError, match=re.escape(said)) as caught:
        grid(base, [axis(text)])
    assert "\n" not in str(caught.value)


def test_a_key_is_varied_once(base):
    with pytest.raises(InvalidInputError, match="twice"):
        grid(base, [axis("controller.rate_hz=1000,2000"), axis("controller.rate_hz=500,600")])


def lines(path):
    return path.read_text(encoding="utf-8").splitlines()


def run(folder, *arguments):
    command = [sys.executable, "-m", "hdmm_opt", "sweep", *map(str, arguments)]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.long
def test_a_sweep_on_a_cluster_that_loses_a_worker_gives_the_same_table(quick, tmp_path):
    """In process, killed and resumed, and on a Dask cluster of two workers of which one is killed on the way."""
    vary = ["--vary", "controller.rate_hz=500:2000:3"]
    table, errors = (alone := run(tmp_path, quick, *vary, "-o", "alone.json")).communicate(timeout=300)
    assert alone.returncode == 0, errors
    assert len(table.splitlines()) == 4 and {"proved", "not proved"} >= {
        line.split(",")[1] for line in table.splitlines()[1:]
    }

    killed = run(tmp_path, quick, *vary, "-o", "killed.json")
    state = tmp_path / ".killed.json.state"
    while (not state.exists() or len(lines(state)) < 2) and killed.poll() is None:
        time.sleep(0.02)
    os.kill(killed.pid, signal.SIGKILL)
    killed.communicate()
    assert 1 <= len(lines(state)) - 1 < 3  # a head, then a line a design
    again = run(tmp_path, quick, *vary, "-o", "killed.json", "--resume").communicate(timeout=300)
    assert (tmp_path / "killed.json").read_bytes() == (tmp_path / "alone.json").read_bytes(), again

    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
         "--scheduler-file", "cluster.json"], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    workers = []
    try:
        while not (tmp_path / "cluster.json").exists():
            time.sleep(0.05)
        address = json.loads((tmp_path / "cluster.json").read_text(encoding="utf-8"))["address"]
        workers += [
            subprocess.Popen(
                [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny",
                 "--no-dashboard", "--local-directory", str(tmp_path / f"worker{k}")],
                cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )
            for k in range(2)
        ]  # fmt: skip
        spread = run(tmp_path, quick, *vary, "-o", "cluster.json.table.json", "--cluster", address)
        state = tmp_path / ".cluster.json.table.json.state"
        while (not state.exists() or len(lines(state)) < 2) and spread.poll() is None:
            time.sleep(0.02)
        os.kill(workers[0].pid, signal.SIGKILL)
        _, errors = spread.communicate(timeout=300)
        assert spread.returncode == 0, errors
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()
    assert (tmp_path / "cluster.json.table.json").read_bytes() == (tmp_path / "alone.json").read_bytes()


def test_a_wrong_address_is_one_line(quick, tmp_path):
    process = run(tmp_path, quick, "--vary", "controller.rate_hz=1000", "--cluster", "127.0.0.1:1")
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 2
    assert "--cluster needs the address" in errors and "Traceback" not in errors
