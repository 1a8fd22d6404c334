import math
from dataclasses import replace

import numpy as np
import pytest
from machines import emla, proportional

from hdmm_opt import study
from hdmm_opt.errors import DefectError
from hdmm_opt.files.gain_file import build
from hdmm_opt.files.seal import prove
from hdmm_opt.files.sections import outputs_data, short
from hdmm_opt.files.text import write_text
from hdmm_opt.files.validation import to_data
from hdmm_opt.jobs import pipeline
from hdmm_opt.jobs.certify import contracts_of, longest_period, strongest
from hdmm_opt.jobs.evaluation import make_evaluator
from hdmm_opt.jobs.options import Options, Progress
from hdmm_opt.jobs.refusal import diagnose
from hdmm_opt.jobs.shrinking import provable_share, shrunk
from hdmm_opt.jobs.space import Window
from hdmm_opt.jobs.start import starting_point
from hdmm_opt.jobs.validation import validate
from hdmm_opt.problem import assemble
from hdmm_opt.problem.margins import violation
from hdmm_opt.simulation import Loop, Scenario
from hdmm_opt.simulation.engine import Engine
from stability import Failure, certify, checker


def values(first, second):
    """Gains of an EMLA at torque level without adaptation."""
    return {"actuator": (first, 0.0, 1.0, 1.0, *[0.0] * 3, second, 0.0, 1.0, 1.0, *[0.0] * 3)}


def lacking(problem, gains):
    return violation(problem, contracts_of(problem, gains), gains)


@pytest.mark.parametrize("name", ["emla-p2", "emla-p4-fast", "emla-p4-ramp"])
def test_the_first_stage_ends_at_gains_that_the_checker_proves(name):
    problem = assemble(study.load(name))
    gains = starting_point(problem, Progress()).gains
    contracts = contracts_of(problem, gains)
    assert not isinstance(contracts, Failure) and violation(problem, contracts, gains) == 0.0
    loop = Loop(problem)
    shown = validate(loop, gains, seed=1, monte_carlo=0, jobs=1, progress=lambda part: None)
    _, report = prove(build(loop, gains, contracts, to_data(problem, shown)))
    assert report.status == 0, report.message


def test_infeasible_candidates_are_never_simulated(monkeypatch):
    def refuse(*arguments, **named):
        raise AssertionError("simulated")

    monkeypatch.setattr(Engine, "run", refuse)
    evaluate = make_evaluator(study.validated(proportional(), "test"), Window(low=np.zeros(8), high=np.ones(8)))
    (outcome,) = evaluate([np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])])
    assert not outcome.feasible and outcome.cost == math.inf and outcome.runs == 0
    with pytest.raises(AssertionError, match="simulated"):
        evaluate([np.array([0.45, 0.1, 0.1, 0.5, 0.6, 0.1, 0.1, 0.9])])


def test_points_and_gains_go_round():
    problem = assemble(study.load("emla-p2"))
    random = np.random.default_rng(0)
    for _ in range(20):
        point = random.uniform(0, 1, problem.searched)
        gains = problem.at(point)
        assert problem.at(problem.point(gains)) == gains
        assert problem.point(gains) == pytest.approx(point, abs=2e-3)


def test_longest_period_has_verdicts_on_both_sides():
    problem = assemble(study.load("emla-refused-rate"))
    gains = problem.at(np.zeros(0))
    period = longest_period(problem, gains)
    assert 125e-6 < period < 1e-3  # a current loop at 1900 rad/s: fine at 8 kHz, refused at 1 kHz
    assert lacking(problem, gains) > 0.0

    def at(length):
        return replace(problem, members=tuple(m.under(replace(m.bounds, period=length)) for m in problem.members))

    assert lacking(at(0.99 * period), gains) == 0.0 and lacking(at(1.05 * period), gains) > 0.0


def test_diagnosis_names_the_cause_before_its_consequences():
    problem = assemble(study.load("emla-p2"))
    loop = Loop(problem)

    def told(gains):
        return diagnose(problem, loop, gains, strongest(problem, gains).contracts)

    crossed = values(2000.0, 20000.0)
    assert isinstance(contracts_of(problem, crossed), Failure)
    first = told(crossed)[0]
    assert first.name in ("authority", "composition") and first.margin < 0 and first.remedy
    weak = values(8.0, 5000.0)
    accuracy = told(weak)[0]
    assert accuracy.name == "accuracy" and accuracy.verdict == "refuted" and "mm of 2 mm" in accuracy.statement
    witness = Scenario.from_data(accuracy.witness["scenario"])
    assert np.abs(loop.trace(weak, witness).error).max() > 2e-3
    assert told(values(40.0, 9000.0))[0].name in ("authority", "sampling")


def test_short_rationals_are_short_and_on_the_safe_side():
    for value in (math.pi, 1e-7 / 3, 12345678.9):
        exact = checker.rational(short(value, up=True))
        assert value <= float(exact) * (1 + 1e-15) and float(exact) == pytest.approx(value, rel=1e-8)
        assert len(short(value)) < 40


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

    def too_sure(problem, gains):
        found = real(problem, gains)
        contract = found.contracts["actuator"]
        sure = replace(contract.certificate, half_widths=0.01 * contract.certificate.half_widths)
        return replace(found, contracts={"actuator": replace(contract, certificate=sure)})

    monkeypatch.setattr(pipeline, "strongest", too_sure)
    monkeypatch.setattr(pipeline, "violation", lambda *arguments: 0.0)
    data = emla("emla-p2")
    data["controller"]["gains"] = {name: {"value": value} for name, value in (("beta_1", 24.0), ("beta_2", 6000.0))}
    data["validation"]["worst_case"] = False
    with pytest.raises(DefectError, match="outside the certified"):
        pipeline.design(study.validated(data, "test"), Options(), Progress())


def test_a_certificate_does_not_depend_on_what_was_solved_before():
    problem = assemble(study.validated(proportional(), "test"))
    (member,) = problem.members
    gains = values(24.0, 6000.0)
    answers = []
    for before in (values(9.0, 9000.0), values(30.0, 7000.0), gains):
        contracts_of(problem, before)
        found = contracts_of(problem, gains)["actuator"].certificate
        composed = certify(member.model, member.bounds, member.gains(gains["actuator"]), member.box)
        answers.append(
            (found.decay, *found.half_widths, *found.ultimate, composed.decay, *composed.weights, *composed.young)
        )
    assert answers[0] == answers[1] == answers[2]


def test_a_tolerance_left_out_is_that_of_the_plant():
    data = emla("emla-p2")
    data["plant"]["parameters"]["load_mass"].pop("tolerance")
    (member,) = assemble(study.validated(data, "test")).members
    assert member.plant.parameters["load_mass"].tolerance == 0.2


def test_the_share_of_uncertainty_that_would_pass_passes():
    """Gains that are too weak for the study's load are proved for the share of it that the diagnosis names."""
    problem = assemble(study.load("emla-p4-fast"))
    weak = values(10.0, 3000.0)
    told = diagnose(problem, Loop(problem), weak, strongest(problem, weak).contracts)[-1]
    assert told.name == "uncertainty" and told.sure and -1 < told.margin < 0
    share = provable_share(problem, weak)
    for factor, good in ((1.0, True), (1.02, False)):
        assert (lacking(shrunk(problem, factor * share), weak) == 0.0) == good


def test_a_file_is_checked_once(monkeypatch):
    """The exact check of a design is one run of the checker."""
    count, real = [], checker.check_text
    monkeypatch.setattr(checker, "check_text", lambda *given, **named: count.append(1) or real(*given, **named))
    data = emla("emla-p2")
    data["controller"]["gains"] = {name: {"value": value} for name, value in (("beta_1", 24.0), ("beta_2", 6000.0))}
    data["validation"] |= {"monte_carlo": 0, "worst_case": False}
    data["requirements"].pop("settling_band_m")
    found = pipeline.design(study.validated(data, "test"), Options(), Progress())
    assert found.document is not None and len(count) == 1


def test_an_output_that_a_file_cannot_hold_is_left_out():
    """Operations that are not known, those that nobody bounds, and what a load moves: simulated only."""
    import casadi as ca

    (member,) = assemble(study.load("emla-p2")).members
    plant = member.plant
    for value in (ca.erf(plant.x[2]), ca.exp(plant.x[2]), plant.w[0]):
        other = replace(member, plant=replace(plant, outputs={**plant.outputs, "torque": value}))
        assert set(outputs_data(other)) == {"current"}
    assert set(outputs_data(member)) == {"torque", "current"}
