"""The closed-loop cost, its derivatives, and what validation makes of runs outside the assumptions."""

import json
from dataclasses import replace

import numpy as np
import pytest
from known_answers import claim_of, verdict
from machines import emla, proportional

from hdmm_opt import study
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.state import State
from hdmm_opt.files.validation import to_data
from hdmm_opt.jobs import polish
from hdmm_opt.jobs.certify import certificate, contracts_of
from hdmm_opt.jobs.condition import condition_lines
from hdmm_opt.jobs.evaluation import evaluate, make_evaluator
from hdmm_opt.jobs.gradient import derivatives, descent
from hdmm_opt.jobs.options import Options, Progress
from hdmm_opt.jobs.search import search
from hdmm_opt.jobs.space import Window
from hdmm_opt.jobs.start import Tuned, starting_point
from hdmm_opt.jobs.tradeoff import tradeoff
from hdmm_opt.jobs.validation import validate
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Run, scenarios, within_assumptions
from tuning import Budget
from tuning.methods.pareto import dominates

GAINS = {"actuator": (24.0, 0.0, 1.0, 1.0, *[0.0] * 3, 6000.0, 0.0, 1.0, 1.0, *[0.0] * 3)}
FAULT = {"share": 0.4, "start_s": 4.0, "rate_1_s": 2.0}
WHOLE = Window(low=np.zeros(8), high=np.ones(8))


@pytest.fixture(scope="module")
def problem():
    return assemble(study.validated(proportional(), "test"))


@pytest.fixture(scope="module")
def loop(problem):
    return Loop(problem)


def changed(**scenario):
    data = proportional()
    data["validation"]["scenarios"] = [*data["validation"]["scenarios"], scenario]
    data["validation"]["monte_carlo"] = 0
    return assemble(study.validated(data, "test"))


def validated(problem):
    return validate(Loop(problem), GAINS, seed=1, monte_carlo=0, jobs=1, progress=lambda part: None)


def test_the_loop_s_derivatives_are_those_of_differences(problem, loop):
    """RMS error and ITAE of two scenarios along every gain, against central differences of the plain loop."""
    point = np.array([0.5, 0.7, 0.4, 0.2, 0.5, 0.8, 0.4, 0.3])
    gains = problem.at(point, digits=15)
    chosen = scenarios(problem)[1:]
    values = np.array(gains["actuator"])
    directions = np.diag(values)
    shown, rms, itae = loop.sensitivities([Run(gains=gains, scenario=s) for s in chosen], directions)
    assert shown == loop.figures([Run(gains=gains, scenario=s) for s in chosen])

    def moved(k, step):
        made = {"actuator": tuple(values + step * directions[k])}
        found = loop.figures([Run(gains=made, scenario=s) for s in chosen])
        return np.array([[m.rms_error_m, m.itae] for m in found])

    for k in (0, 1, 2, 3, 7, 8, 9, 10):
        slope = (moved(k, 1e-4) - moved(k, -1e-4)) / 2e-4
        size = np.abs([rms, itae]).max()
        assert rms[:, k] == pytest.approx(slope[:, 0], rel=1e-3, abs=1e-6 * size)
        assert itae[:, k] == pytest.approx(slope[:, 1], rel=1e-3, abs=1e-6 * size)


def test_the_gradient_of_the_whole_cost(loop):
    point = np.array([0.5, 0.3, 0.3, 0.5, 0.5, 0.3, 0.3, 0.6])
    found = derivatives(loop, point, True)
    assert found.evaluations == 9 and (found.slacks > 0).all()
    for i in (0, 4):
        step = 1e-3 * np.eye(8)[i]
        ends = [derivatives(loop, point + s * step, False) for s in (1, -1)]
        assert found.gradient[i] == pytest.approx((ends[0].cost - ends[1].cost) / 2e-3, rel=0.02)
        assert found.jacobian[:, i] == pytest.approx((ends[0].slacks - ends[1].slacks) / 2e-3, rel=0.05, abs=1e-3)
    slow = proportional()
    slow["controller"]["rate_hz"] = 60
    nowhere = derivatives(Loop(assemble(study.validated(slow, "test"))), np.ones(8), True)
    assert np.isnan(nowhere.cost) and nowhere.evaluations == 1


def test_descent_stays_in_the_proved_set_and_gets_better(problem, loop):
    first = np.array([0.5, 0.3, 0.3, 0.5, 0.5, 0.3, 0.3, 0.6])
    tried, used = descent(loop, [first], Budget(evaluations=60))
    assert used <= 70
    before, after = evaluate(loop, [problem.at(first), problem.at(tried[0])])
    assert after.feasible and after.cost < 0.8 * before.cost


def test_the_outcome_of_a_candidate_does_not_depend_on_its_company():
    judge = make_evaluator(study.validated(proportional(), "test"), WHOLE)
    points = [np.full(8, share) for share in (0.3, 0.4, 0.5, 0.6)]
    together = judge(points)
    assert [judge([p])[0] for p in points] == together
    assert {o.runs for o in together if o.feasible} == {3} and any(o.feasible for o in together)


def searched(problem, method, budget):
    first = starting_point(problem, Progress())
    return first, search(problem, first, method, budget, 1, Options(), State(None, {}, resume=False), Progress())


def test_the_winner_s_gains_are_short_and_proved(problem, loop):
    first, found = searched(problem, "jaya", (4, 1))
    assert found.evaluations == 8 + 2
    ours, start = evaluate(loop, [found.gains, first.gains])
    assert ours.feasible and ours.cost <= 1.005 * start.cost
    (member,) = problem.members
    assert all(float(f"{found.gains['actuator'][i]:.3g}") == found.gains["actuator"][i] for i in member.searched)


def emla_p2(**gains):
    """The bundled study with some gains, and those gains."""
    problem = assemble(study.load("emla-p2"))
    (member,) = problem.members
    return problem, {member.name: tuple(gains.get(item.name, item.low) for item in member.ranges)}


def test_the_last_stage_moves_pairs_of_gains_and_never_for_the_worse(monkeypatch):
    problem, gains = emla_p2(beta_1=60.0, beta_2=16000.0, gamma_2=3e5)
    ways = polish.directions(problem)
    assert len(ways) == 2 * (3 + 2 * 3) and all(np.linalg.norm(way) == pytest.approx(1.0) for way in ways)
    monkeypatch.setattr(polish, "MOST", 20)
    contracts = contracts_of(problem, gains, refine=True)
    first = Tuned(gains=gains, contracts=contracts, evaluations=7, runs=0)
    found = polish.polished(problem, first, Options(), Progress())
    before, after = evaluate(Loop(problem), [gains, found.gains], refine=True)
    assert found.gains != gains and after.rank() < before.rank()
    assert found.evaluations > 7 + len(ways)


def test_a_drive_of_up_to_a_millisecond_is_proved():
    """emla-p2 a period late with a drive of 0.3 to 1 ms, decided by the checker."""
    data = emla("emla-p2")
    data["plant"]["parameters"]["drive_lag"] = {"value": 6.5e-4, "unit": "s", "tolerance": 0.54, "source": "assumed"}
    (member,) = assemble(study.validated(data, "test")).members
    _, gains = emla_p2(beta_1=69.3, beta_2=17360.0, gamma_2=3.85e5)
    values = gains[member.name]
    assert member.bounds.parameters["drive_lag"].low <= 3e-4 and member.bounds.parameters["drive_lag"].high >= 1e-3
    found = certificate(member, values, refine=True)
    claim = claim_of(member.model, member.bounds, member.gains(values), found, limit=74.7, accuracy=2.5e-5)
    assert verdict(claim)
    assert not verdict(replace(claim, accuracy=claim.accuracy / 2))


def test_the_gain_condition_is_told(problem):
    (told,) = condition_lines(problem, GAINS, contracts_of(problem, GAINS))
    assert "decays at" in told and "(position)" in told and "(torque)" in told
    fast, gains = emla_p2(beta_1=69.3, beta_2=17360.0, gamma_2=3.85e5)
    (told,) = condition_lines(fast, gains, contracts_of(fast, gains, refine=True))
    assert told.endswith("none found")


def test_a_fault_is_shown_and_counts_for_nothing_else():
    """A load that a weak actuator still carries: its larger error is neither a defect nor a missed requirement."""
    plain = assemble(study.validated(proportional(), "test"))
    faulty = changed(name="weak-motor", disturbances={"load_force": 76e3}, faults={"actuator": FAULT})
    shown = [validated(p) for p in (plain, faulty)]
    scenario, figures = shown[1].runs[-1]
    assert scenario.name == "weak-motor" and not within_assumptions(faulty, scenario)
    # the static error grows by what is lost, and passes that of every run inside the assumptions
    ends = [abs(Loop(faulty).trace(GAINS, s).error[-1]) for s in (replace(scenario, faults={}), scenario)]
    assert ends[1] == pytest.approx(ends[0] / 0.6, rel=1e-3)
    assert figures.maximum_error_m > shown[1].largest_late_error
    assert shown[0].largest_error == shown[1].largest_error and shown[0].missed == shown[1].missed == ()


def test_a_fault_that_loses_the_loop_is_written_as_no_number():
    lost = {"actuator": {"share": 1.0, "start_s": 3.0, "rate_1_s": 1.0}}
    faulty = changed(name="lost", disturbances={"load_force": 70e3}, faults=lost)
    shown = validated(faulty)
    assert shown.runs[-1][1].diverged and shown.missed == ()
    data = to_data(faulty, shown)
    json.dumps(data, allow_nan=False)
    figures = data["scenarios"][-1]["figures"]
    assert figures["maximum_error_m"] is None and figures["diverged_s"] > 3.0


def test_faults_do_not_enter_the_cost_and_must_fit_the_inputs(loop):
    data = proportional()
    fault = {"share": 1.0, "start_s": 0.0, "rate_1_s": 9.0}
    lost = {"name": "lost", "disturbances": {"load_force": 70e3}, "faults": {"actuator": fault}}
    data["validation"]["scenarios"] = [lost, *data["validation"]["scenarios"]]
    faulty = Loop(assemble(study.validated(data, "test")))
    ours, theirs = (evaluate(p, [GAINS])[0] for p in (loop, faulty))
    assert ours.feasible and ours.runs == theirs.runs == 3 and theirs.cost == pytest.approx(ours.cost, rel=0.01)
    fault["stuck"] = [1.0, 2.0]
    with pytest.raises(InvalidInputError, match="at most one entry for each of torque_command: got 2"):
        assemble(study.validated(data, "test"))
    with pytest.raises(ValueError, match="without faults"):
        run = Run(gains=GAINS, scenario=scenarios(faulty.problem)[0])
        faulty.sensitivities([run], np.eye(14))


def test_an_actuator_may_lose_what_its_study_allows():
    """A degraded actuator inside `least_effectiveness` is inside the proof: its run counts, and its bound holds."""
    data = proportional()
    data["plant"]["joints"] = {"actuator": {"least_effectiveness": 0.9}}
    weak = {"share": 0.08, "start_s": 3.0, "rate_1_s": 2.0}
    data["validation"]["scenarios"].append({"name": "weak", "faults": {"actuator": weak}})
    problem = assemble(study.validated(data, "test"))
    assert within_assumptions(problem, scenarios(problem)[-1])
    gains = {"actuator": (24.0, 0.0, 1.0, 1.0, *[0.0] * 3, 6000.0, 0.0, 1.0, 1.0, *[0.0] * 3)}
    found, sound = contracts_of(problem, gains), contracts_of(assemble(study.validated(proportional(), "test")), gains)
    (figures,) = Loop(problem).figures([Run(gains=gains, scenario=scenarios(problem)[-1])])
    bound = found["actuator"].certificate.ultimate[0]
    assert figures.maximum_error_m <= bound and bound > 1.1 * sound["actuator"].certificate.ultimate[0]
    data["plant"]["joints"]["actuator"]["least_effectiveness"] = 0.95
    assert not within_assumptions(assemble(study.validated(data, "test")), scenarios(problem)[-1])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["validation"]["scenarios"][1].update(name="heavy"), "names of its own: got [a-z-]+ twice"),
        (lambda d: d["validation"]["scenarios"][1].update(name="worst-case"), "hdmm-opt uses itself"),
        (
            lambda d: d["validation"]["scenarios"][0].update(disturbances={"load_force": [[-1.0, 70e3]]}),
            "times from 0 on",
        ),
        (
            lambda d: d["tuning"].update(weights={"rms_error": 0, "certified_bound": 0, "itae": 0, "effort": 0}),
            "one weight",
        ),
        (lambda d: d["tuning"].update(method="genius"), "'jaya', 'tlbo', 'random' or 'gradient'"),
        (
            lambda d: d["validation"]["scenarios"][0].update(
                faults={"actuator": {"share": 2, "start_s": 0, "rate_1_s": 1}}
            ),
            "less than or equal to 1",
        ),
        (lambda d: d["validation"]["scenarios"][0].update(quantisation=-0.1), "greater than or equal to 0"),
    ],
)
def test_bad_scenarios_and_tunings_are_one_line(change, said):
    data = proportional()
    change(data)
    with pytest.raises(InvalidInputError, match=said) as caught:
        study.validated(data, "test")
    assert "\n" not in str(caught.value)


def test_the_integration_error_is_estimated(problem, loop):
    scenario = scenarios(problem)[0]
    fine = loop.integration_error(GAINS, scenario)
    reference = Loop(problem, refinement=16).trace(GAINS, scenario)
    true = np.abs(loop.trace(GAINS, scenario).place[0] - reference.place[0]).max()
    assert fine == pytest.approx(true, rel=0.1) and fine < 1e-10


def test_descent_is_a_method_of_a_design():
    data = proportional()
    data["tuning"] |= {"method": "gradient"}
    small = assemble(study.validated(data, "test"))
    first, found = searched(small, "gradient", (10, 3))
    before, after = evaluate(Loop(small), [first.gains, found.gains])
    assert after.feasible and after.cost < before.cost and found.evaluations <= 40 + 10


def test_a_tradeoff_is_a_set_of_proved_designs_that_none_beats(tmp_path):
    kept = tmp_path / "t.state"
    chosen = study.validated(proportional(), "test")
    found, state = tradeoff(chosen, Options(state=kept), Progress(), (10, 4))
    again, _ = tradeoff(chosen, Options(state=kept, resume=True), Progress(), (10, 4))
    assert (found.gains, found.outcomes) == (again.gains, again.outcomes) and kept.exists()
    state.remove()
    goals = [o.objectives for o in found.outcomes]
    assert found.evaluations == 50 and len(goals) >= 2 and goals == sorted(goals)
    assert not any(dominates(a, b) for a in goals for b in goals)
    assert [o.objectives for o in evaluate(Loop(assemble(chosen)), found.gains)] == goals
