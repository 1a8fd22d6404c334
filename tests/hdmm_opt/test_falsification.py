import json
from dataclasses import replace

import pytest
from machines import proportional

from hdmm_opt import study
from hdmm_opt.cli import falsify as verb
from hdmm_opt.cli import simulate, statuses
from hdmm_opt.errors import DefectError
from hdmm_opt.files.read import read
from hdmm_opt.files.result import Witness
from hdmm_opt.jobs import attack, falsification
from hdmm_opt.jobs.falsification import falsify
from hdmm_opt.plants.pmsm_emla import lead_angle_tangent, transmission
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, scenarios
from stability import checker

GAINS = {"actuator": (24.0, 0.0, 1.0, 1.0, *[0.0] * 3, 6000.0, 0.0, 1.0, 1.0, *[0.0] * 3)}


def quiet(share, text):
    pass


@pytest.fixture(scope="module")
def loop():
    return Loop(assemble(study.validated(proportional(), "test")))


def test_finds_the_static_worst_case_of_an_overdamped_loop(loop):
    """The error under a constant load is torque / (gain · M ω_1 ω_2); no load inside the range does worse by much."""
    found = falsify(loop, GAINS, [], 60, 1, quiet)
    assert found.runs <= 60
    (member,) = loop.problem.members
    p = member.plant.parameters
    values = {name: entry.value for name, entry in p.items()}
    r = transmission(values)
    loss = p["screw_friction"].value * 1.54 / lead_angle_tangent(values) + p["gear_loss"].value * 1.5
    torque = r * (1 + loss) * (76e3 + 1.5 * p["coulomb_friction"].value)
    torque += 1.3 * p["viscous_friction"].value * member.reference.bounds()[1][1] / r
    static = torque / (0.97 * 0.5 * 6000.0 * 0.5 * 24.0)
    assert found.figures.maximum_error_m == pytest.approx(static, rel=0.05)
    assert found.scenario.parameters["torque_scale"] == -1.0


def test_repeats_and_keeps_to_its_budget(loop):
    given = scenarios(loop.problem)
    first, again = (falsify(loop, GAINS, given, 25, 7, quiet) for _ in range(2))
    assert first == again and first.runs <= 25
    assert falsify(loop, GAINS, given, 1, 7, quiet).runs <= 2


def test_loads_stay_inside_their_range(loop, monkeypatch):
    seen = []
    real = Loop.figures

    def watch(self, runs, **named):
        seen.extend(run.scenario for run in runs)
        return real(self, runs, duration=0.05)

    monkeypatch.setattr(Loop, "figures", watch)
    falsify(loop, GAINS, [], 120, 3, quiet)
    span = loop.problem.disturbance("load_force")
    for scenario in seen:
        course = scenario.disturbances["load_force"]
        times = [t for t, _ in course]
        assert all(span.low <= f <= span.high for _, f in course) and times == sorted(set(times))
        assert all(-1 <= v <= 1 for v in scenario.parameters.values()) and -1 <= scenario.initial <= 1


def test_the_verb_keeps_the_worst_and_the_proof(tmp_path, gain_text):
    path = tmp_path / "x.gains.json"
    path.write_text(gain_text, encoding="utf-8")
    before = json.loads(gain_text)["validation"]["largest_error_after_transient_m"]
    assert verb.run(path, 30, 1) == statuses.PROVED
    data = read(path)
    assert checker.check_file(path).status == 0
    assert data["validation"]["largest_error_after_transient_m"] >= before
    assert simulate.run(path, "worst-case", None, True) == statuses.PROVED


def test_a_witness_outside_the_envelope_is_a_defect(tmp_path, gain_text, monkeypatch):
    path = tmp_path / "x.gains.json"
    path.write_text(gain_text, encoding="utf-8")
    real = falsification.falsify

    def lie(*arguments, **named):
        found = real(*arguments[:3], 2, *arguments[4:], **named)
        return replace(found, largest_error=0.01, largest_errors={"actuator": 0.01})

    monkeypatch.setattr(attack, "falsify", lie)
    with pytest.raises(DefectError, match="please report"):
        verb.run(path, 5, 1)
    assert path.read_text(encoding="utf-8") == gain_text
    assert Witness.__doc__
