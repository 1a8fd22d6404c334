import math
from dataclasses import replace

import numpy as np
import pytest

from hdmm_opt import gain_file, pipeline, selection, study
from hdmm_opt.errors import DefectError
from hdmm_opt.evaluation import make_evaluator
from hdmm_opt.files import write_text
from hdmm_opt.problem import assemble
from hdmm_opt.proof import certificate, diagnose, longest_period, provable_share, shrunk, violation
from hdmm_opt.selection import Options, Progress
from hdmm_opt.simulation import Engine, Scenario
from stability import Certificate, Failure, Gains, certify, checker


@pytest.mark.parametrize("name", ["emla-p1", "emla-p2", "emla-p4-fast", "emla-p4-ramp"])
def test_the_convex_stage_ends_at_gains_that_the_checker_proves(name):
    problem = assemble(study.load(name))
    chosen = selection.starting_point(problem)
    gains = problem.gains(problem.point(chosen.gains))
    found = certificate(problem, gains)
    assert isinstance(found, Certificate) and violation(problem, found, gains) == 0.0
    shown = {"largest_error_m": 0.0, "requirements": []}
    _, report = gain_file.prove(gain_file.build(problem, gains, found, shown, {}))
    assert report.status == 0, report.message


def test_infeasible_candidates_are_never_simulated(monkeypatch):
    def refuse(*arguments, **named):
        raise AssertionError("simulated")

    monkeypatch.setattr(Engine, "run", refuse)
    evaluate = make_evaluator(study.load("emla-p2"))
    (outcome,) = evaluate([np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])])
    assert not outcome.feasible and outcome.cost == math.inf and outcome.runs == 0
    with pytest.raises(AssertionError, match="simulated"):
        evaluate([np.array([0.45, 0.1, 0.1, 0.5, 0.6, 0.1, 0.1, 0.9])])


def test_points_and_gains_go_round():
    problem = assemble(study.load("emla-p2"))
    random = np.random.default_rng(0)
    for _ in range(20):
        point = random.uniform(0, 1, len(problem.searched))
        gains = problem.gains(point)
        assert problem.gains(problem.point(gains)) == gains
        assert problem.point(gains) == pytest.approx(point, abs=2e-3)


def test_longest_period_has_verdicts_on_both_sides():
    problem = assemble(study.load("emla-refused-rate"))
    gains = problem.gains(np.zeros(0))
    period = longest_period(problem, gains)
    assert 125e-6 < period < 1e-3  # a current loop at 1900 rad/s: fine at 8 kHz, refused at 1 kHz
    assert violation(problem, certificate(problem, gains), gains) > 0.0
    assert violation(problem, certificate(problem, gains, period=0.99 * period), gains) == 0.0
    assert violation(problem, certificate(problem, gains, period=1.05 * period), gains) > 0.0


def test_diagnosis_names_the_cause_before_its_consequences():
    problem = assemble(study.load("emla-p2"))
    crossed = (Gains(beta=60.0), Gains(beta=1500.0))
    assert isinstance(certificate(problem, crossed), Failure)
    first = diagnose(problem, crossed)[0]
    assert first.name == "composition" and first.margin < 0 and first.remedy
    weak = (Gains(beta=8.0), Gains(beta=5000.0))
    accuracy = diagnose(problem, weak)[0]
    assert accuracy.name == "accuracy" and accuracy.verdict == "refuted" and "mm of 2 mm" in accuracy.statement
    witness = Scenario(**accuracy.witness["scenario"])
    error = np.abs(problem.loop.run(weak, problem.reference, witness).error)
    assert error.max() > 2e-3
    strong = (Gains(beta=40.0), Gains(beta=9000.0))
    assert diagnose(problem, strong)[0].name in ("authority", "sampling")


def test_short_rationals_are_short_and_on_the_safe_side():
    for value in (math.pi, 1e-7 / 3, 12345678.9):
        exact = checker.rational(gain_file.short(value, up=True))
        assert value <= float(exact) * (1 + 1e-15) and float(exact) == pytest.approx(value, rel=1e-8)
        assert len(gain_file.short(value)) < 40


def test_writing_is_whole_or_not_at_all(tmp_path, monkeypatch):
    target = tmp_path / "x.json"
    write_text(target, "old")

    def fail(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(Exception, match="No space left"):
        write_text(target, "new")
    assert target.read_text() == "old" and [p.name for p in tmp_path.iterdir()] == ["x.json"]


def test_a_simulation_outside_its_envelope_stops_everything(monkeypatch):
    """A certificate that claims a hundredth of the true box: simulation contradicts it, and that is said."""
    real = pipeline.strongest

    def too_sure(problem, gains, tried):
        found = real(problem, gains, tried)
        return replace(found, radii=0.01 * found.radii)

    monkeypatch.setattr(pipeline, "strongest", too_sure)
    loaded = study.load("emla-p2")
    fixed = {
        name: {"value": value}
        for name, value in (("beta_1", 24.0), ("beta_2", 6000.0), ("epsilon_1", 0.0), ("epsilon_2", 0.0))
    }
    data = loaded.model_dump(exclude_none=True)
    data["controller"]["gains"], data["validation"]["worst_case"] = fixed, False
    chosen = study.validated(data, "test")
    with pytest.raises(DefectError, match="outside the certified"):
        pipeline.design(chosen, Options(), Progress())


def test_a_certificate_does_not_depend_on_what_was_solved_before():
    problem = assemble(study.load("emla-p2"))
    gains = (Gains(beta=24.0), Gains(beta=6000.0))
    answers = []
    for before in ((Gains(beta=9.0), Gains(beta=9000.0)), (Gains(beta=30.0), Gains(beta=7000.0)), gains):
        certificate(problem, before)
        found = certificate(problem, gains)
        composed = certify(problem.model, problem.bounds, gains, problem.box)
        answers.append((found.decay, *found.radii, *found.ball, composed.decay, *composed.weights, *composed.young))
    assert answers[0] == answers[1] == answers[2]


def test_a_tolerance_left_out_is_that_of_the_plant():
    data = study.load("emla-p2").model_dump(exclude_none=True)
    data["plant"]["parameters"]["load_mass"].pop("tolerance")
    assert study.validated(data, "test").plant.resolved()["load_mass"].tolerance == 0.2


def test_the_share_of_uncertainty_that_would_pass_passes():
    """Gains that are too weak for the study's load are proved for the share of it that the diagnosis names."""
    problem = assemble(study.load("emla-p4-fast"))
    weak = (Gains(beta=10.0), Gains(beta=3000.0))
    told = diagnose(problem, weak)[-1]
    assert told.name == "uncertainty" and told.sure and -1 < told.margin < 0
    share = provable_share(problem, weak)
    for factor, good in ((1.0, True), (1.02, False)):
        smaller = replace(problem, bounds=shrunk(problem.bounds, factor * share))
        assert (violation(smaller, certificate(smaller, weak), weak) == 0.0) == good
