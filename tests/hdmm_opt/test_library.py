"""The verbs as functions: records that show themselves, and nothing that the command line does otherwise."""

import subprocess
import sys

import pytest
from conftest import GAINS

import hdmm_opt as h
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.study import validated


def small():
    data = h.load_study("emla-p2").model_dump(mode="json", exclude_none=True)
    data["controller"]["gains"] = {"beta_1": {"value": 55.0}, "beta_2": {"value": 14000.0}}
    data["validation"] |= {"monte_carlo": 4, "worst_case": False}
    data["requirements"].pop("settling_band_m")
    return validated(data, "small")


@pytest.fixture(scope="module")
def designed():
    return h.design(small(), quiet=True)


def test_importing_costs_nothing():
    script = "import time; t = time.perf_counter(); import hdmm_opt; print(time.perf_counter() - t)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 0.1
    with pytest.raises(AttributeError, match="nothing_of_that_name"):
        _ = h.nothing_of_that_name
    assert set(h.VERBS) <= set(dir(h))


def test_a_design_is_a_record_that_shows_itself(designed, tmp_path):
    assert designed.proved and designed.certified_m < 1e-3 and designed.gains["beta_1"] == 55.0
    shown = designed._repr_html_()
    assert "<table>" in shown and "tracking_error_m" in shown and "proved" in shown
    file = designed.save(tmp_path / "x.gains.json")
    assert h.check(file).proved and h.check(designed).proved
    assert (tmp_path / "page").exists() is False
    assert designed.report(tmp_path / "page").name == "report.html"
    assert len(designed.plot().data) >= 3
    assert "emla-p2: proved" in str(designed)


def test_a_refused_design_says_what_failed_and_is_no_gain_file(tmp_path):
    data = small().model_dump(mode="json", exclude_none=True)
    data["requirements"]["tracking_error_m"] = 1e-5
    found = h.design(validated(data, "small"), quiet=True)
    assert not found.proved and found.certified_m is None and found.requirements == []
    assert "accuracy" in str(found) and "what would do" in found._repr_html_()
    with pytest.raises(InvalidInputError, match=r"name it \.rejected\.json"):
        found.save(tmp_path / "x.gains.json")
    assert found.save(tmp_path / "x.rejected.json").exists()


def test_simulate_and_falsify_take_designs_and_files(designed):
    runs = h.simulate(designed)
    assert not runs.missed and set(runs.figures) >= {"heavy", "load-steps"} and "<table>" in runs._repr_html_()
    assert len(runs.plot().data) == len(runs.figures)
    attacked = h.falsify(GAINS / "emla-p2.gains.json", budget=8, quiet=True)
    assert attacked.rows[0][1] < attacked.rows[0][2]
    with pytest.raises(InvalidInputError, match="no scenario"):
        h.simulate(designed, "no such")


def test_a_check_shows_limits_and_obligations():
    found = h.check(GAINS / "arm-p3.gains.json")
    assert found.proved and "lift torque" in found.limits and max(found.limits.values()) < 1
    assert "tilt contraction" in found._repr_html_()
    assert h.check("no such file.json").verdict.status == 2


def test_sweep_and_tradeoff_are_tables():
    swept = h.sweep(small(), {"controller.rate_hz": [1000.0, 2000.0]}, quiet=True)
    assert swept.column("verdict") == ["proved", "proved"] and "<table>" in swept._repr_html_()
    assert len(swept.plot().data[0].x) == 2
    study = h.load_study("emla-p2")
    front = h.tradeoff(study, population=4, iterations=1, quiet=True)
    assert front.rows and front.heads[:3] == ("rms error", "certified bound", "effort")
    with pytest.raises(ValueError, match="not in tuple"):
        front.column("nothing")


def test_linear_algebra_runs_on_one_thread_inside_and_is_given_back():
    """A certificate in a process that imported the library costs what it does from the command line."""
    import numpy as np
    from threadpoolctl import threadpool_info

    from hdmm_opt.library.threads import alone

    _ = np.eye(2) @ np.eye(2)
    before = [pool["num_threads"] for pool in threadpool_info()]
    inside = alone(lambda: [pool["num_threads"] for pool in threadpool_info()])()
    assert all(count == 1 for count in inside) and [p["num_threads"] for p in threadpool_info()] == before


def test_what_is_no_study_is_one_line():
    with pytest.raises(InvalidInputError, match="use load_study"):
        h.design(3)
    with pytest.raises(InvalidInputError, match="did you mean"):
        h.load_study("emla-p3")
