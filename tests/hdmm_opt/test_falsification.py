import json
from dataclasses import replace

import pytest

from hdmm_opt import cli, commands, gain_file, study
from hdmm_opt.errors import DefectError
from hdmm_opt.falsification import Witness, falsify
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import scenarios
from stability import Gains, checker

GAINS = (Gains(beta=24.0), Gains(beta=6000.0))


def quiet(share, text):
    pass


@pytest.fixture(scope="module")
def problem():
    return assemble(study.load("emla-p2"))


def test_finds_the_static_worst_case_of_an_overdamped_loop(problem):
    """The error under a constant load is torque / (gain · M ω_1 ω_2); no load inside the range does worse by much."""
    found = falsify(problem, GAINS, [], 60, 1, quiet)
    assert found.runs <= 60
    p = problem.plant.parameters
    r = p["transmission"].value
    loss = p["screw_friction"].value * 1.54 / p["lead_angle_tangent"].value + p["gear_loss"].value * 1.5
    torque = r * (1 + loss) * (76e3 + 1.5 * p["coulomb_friction"].value)
    torque += 1.3 * p["viscous_friction"].value * problem.reference.bounds()[1][1] / r
    static = torque / (0.97 * 0.5 * GAINS[1].beta * 0.5 * GAINS[0].beta)
    assert found.metrics.maximum_error_m == pytest.approx(static, rel=0.05)
    assert found.scenario.parameters["torque_scale"] == -1.0


def test_repeats_and_keeps_to_its_budget(problem):
    first, again = (falsify(problem, GAINS, scenarios(problem.study), 25, 7, quiet) for _ in range(2))
    assert first == again and first.runs <= 25
    assert falsify(problem, GAINS, scenarios(problem.study), 1, 7, quiet).runs <= 2


def test_loads_stay_inside_their_range(problem, monkeypatch):
    seen = []
    real = type(problem.loop).figures

    def watch(self, runs, reference, **named):
        seen.extend(run.scenario for run in runs)
        return real(self, runs, reference, duration=0.05)

    monkeypatch.setattr(type(problem.loop), "figures", watch)
    falsify(problem, GAINS, [], 120, 3, quiet)
    low, high = problem.study.uncertainty.load_force_n
    for scenario in seen:
        times = [t for t, _ in scenario.load]
        assert all(low <= f <= high for _, f in scenario.load) and times == sorted(set(times))
        assert all(-1 <= v <= 1 for v in scenario.parameters.values()) and -1 <= scenario.initial <= 1


def test_the_verb_keeps_the_worst_and_the_proof(tmp_path, gain_text):
    path = tmp_path / "x.gains.json"
    path.write_text(gain_text, encoding="utf-8")
    before = json.loads(gain_text)["validation"]["largest_error_after_transient_m"]
    assert commands.run_falsify(path, 30, 1) == cli.PROVED
    data = gain_file.read(path)
    assert checker.check_file(path).status == 0
    assert data["validation"]["largest_error_after_transient_m"] >= before
    assert commands.run_simulate(path, "worst-case", None, True) == cli.PROVED


def test_a_witness_outside_the_envelope_is_a_defect(tmp_path, gain_text, monkeypatch):
    path = tmp_path / "x.gains.json"
    path.write_text(gain_text, encoding="utf-8")

    def lie(*arguments, **named):
        found = falsify(*arguments[:3], 2, *arguments[4:], **named)
        return replace(found, metrics=replace(found.metrics, maximum_error_m=0.01), largest_error=0.01)

    monkeypatch.setattr("hdmm_opt.falsification.falsify", lie)
    with pytest.raises(DefectError, match="please report"):
        commands.run_falsify(path, 5, 1)
    assert path.read_text(encoding="utf-8") == gain_text
    assert Witness.__doc__
