"""The closed-loop cost, its derivatives, and what validation makes of runs outside the assumptions."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hdmm_opt import selection, study, validation
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.evaluation import evaluate, find, make_evaluator
from hdmm_opt.gradient import derivatives, descent
from hdmm_opt.problem import assemble
from hdmm_opt.selection import Options, Progress
from hdmm_opt.simulation import Run, scenarios
from hdmm_opt.state import State
from hdmm_opt.tradeoff import tradeoff
from stability import Gains
from tuning import Budget
from tuning.pareto import dominates

GAINS = (Gains(beta=24.0), Gains(beta=6000.0))
FAULT = {"share": 0.4, "start_s": 4.0, "rate_1_s": 2.0}


@pytest.fixture(scope="module")
def problem():
    return assemble(study.load("emla-p2"))


def changed(**scenario):
    data = study.load("emla-p2").model_dump(exclude_none=True)
    data["validation"]["scenarios"] = [*data["validation"]["scenarios"], scenario]
    data["validation"]["monte_carlo"] = 0
    return assemble(study.validated(data, "test"))


def test_the_loop_s_derivatives_are_those_of_differences(problem):
    """RMS error and ITAE of two scenarios along every gain, against central differences of the plain loop."""
    point = np.array([0.5, 0.7, 0.4, 0.2, 0.5, 0.8, 0.4, 0.3])
    gains = problem.gains(point, digits=15)
    chosen = scenarios(problem.study)[1:]
    values = np.array([[getattr(g, kind) for g in gains] for kind in ("beta", "epsilon", "delta", "sigma")]).ravel()
    directions = np.diag(values)
    shown, rms, itae = problem.loop.sensitivities(
        [Run(gains=gains, scenario=s) for s in chosen], directions, problem.reference
    )
    assert shown == problem.loop.figures([Run(gains=gains, scenario=s) for s in chosen], problem.reference)

    def moved(k, step):
        v = (values + step * directions[k]).reshape(4, 2)
        made = tuple(Gains(beta=c[0], epsilon=c[1], delta=c[2], sigma=c[3]) for c in v.T)
        found = problem.loop.figures([Run(gains=made, scenario=s) for s in chosen], problem.reference)
        return np.array([[m.rms_error_m, m.itae] for m in found])

    for k in range(8):
        slope = (moved(k, 1e-4) - moved(k, -1e-4)) / 2e-4
        size = np.abs([rms, itae]).max()
        assert rms[:, k] == pytest.approx(slope[:, 0], rel=1e-3, abs=1e-6 * size)
        assert itae[:, k] == pytest.approx(slope[:, 1], rel=1e-3, abs=1e-6 * size)


def test_the_gradient_of_the_whole_cost(problem):
    point = np.array([0.5, 0.3, 0.3, 0.5, 0.5, 0.3, 0.3, 0.6])
    found = derivatives(problem, point, True)
    assert found.evaluations == 9 and (found.slacks > 0).all()
    for i in (0, 4):
        step = 1e-3 * np.eye(8)[i]
        ends = [derivatives(problem, point + s * step, False) for s in (1, -1)]
        assert found.gradient[i] == pytest.approx((ends[0].cost - ends[1].cost) / 2e-3, rel=0.02)
        assert found.jacobian[:, i] == pytest.approx((ends[0].slacks - ends[1].slacks) / 2e-3, rel=0.05, abs=1e-3)
    nowhere = derivatives(problem, np.array([1.0, 0, 0, 1, 0, 0, 0, 1]), True)
    assert np.isnan(nowhere.cost) and nowhere.evaluations == 1


def test_descent_stays_in_the_proved_set_and_gets_better(problem):
    first = np.array([0.5, 0.3, 0.3, 0.5, 0.5, 0.3, 0.3, 0.6])
    tried, used = descent(problem, [first], Budget(evaluations=60))
    assert used <= 70
    before, after = evaluate(problem, [problem.gains(first), problem.gains(tried[0])])
    assert after.feasible and after.cost < 0.8 * before.cost


def test_the_outcome_of_a_candidate_does_not_depend_on_its_company():
    judge = make_evaluator(study.load("emla-p2"))
    points = [np.full(8, share) for share in (0.3, 0.4, 0.5, 0.6)]
    together = judge(points)
    assert [judge([p])[0] for p in points] == together
    assert {o.runs for o in together if o.feasible} == {3} and any(o.feasible for o in together)


def test_the_winner_s_gains_are_short_and_proved(problem):
    data = study.load("emla-p2").model_dump(exclude_none=True)
    data["tuning"] |= {"population": 4, "iterations": 1}
    small = assemble(study.validated(data, "test"))
    first = selection.starting_point(small)
    found = selection.search(small, first, (4, 1), 1, Options(), State(None, {}, resume=False), Progress())
    assert found.best is not None and found.evaluations == 8 + 2
    (again,) = evaluate(small, [found.gains])
    assert again == found.best.outcome
    assert all(float(f"{v:.3g}") == v for g in found.gains for v in (g.beta, g.epsilon, g.delta, g.sigma))


def test_a_fault_is_shown_and_counts_for_nothing_else():
    """A load that a weak actuator still carries: its larger error is neither a defect nor a missed requirement."""
    plain, faulty = assemble(study.load("emla-p2")), changed(name="weak-motor", load_n=[[0.0, 76e3]], fault=FAULT)
    shown = [
        validation.validate(p, GAINS, seed=1, monte_carlo=0, jobs=1, progress=lambda part: None)
        for p in (plain, faulty)
    ]
    scenario, figures = shown[1].runs[-1]
    assert scenario.name == "weak-motor" and not scenario.covered
    # the static error grows by what is lost, and passes that of every run inside the assumptions
    ends = [
        abs(faulty.loop.run(GAINS, faulty.reference, s).error[-1]) for s in (replace(scenario, fault=None), scenario)
    ]
    assert ends[1] == pytest.approx(ends[0] / 0.6, rel=1e-3)
    assert figures.maximum_error_m > shown[1].largest_late_error
    assert shown[0].largest_error == shown[1].largest_error and shown[0].missed == shown[1].missed == ()


def test_a_fault_that_loses_the_loop_is_written_as_no_number():
    faulty = changed(name="lost", load_n=[[0.0, 70e3]], fault={"share": 1.0, "start_s": 3.0, "rate_1_s": 1.0})
    shown = validation.validate(faulty, GAINS, seed=1, monte_carlo=0, jobs=1, progress=lambda part: None)
    assert shown.runs[-1][1].diverged and shown.missed == ()
    data = validation.to_data(faulty, shown, find(faulty, GAINS))
    json.dumps(data, allow_nan=False)
    assert data["nominal"][-1]["metrics"]["maximum_error_m"] is None and data["nominal"][-1]["metrics"]["diverged"]


def test_faults_do_not_enter_the_cost_and_must_fit_the_inputs():
    plain = assemble(study.load("emla-p2"))
    data = plain.study.model_dump(exclude_none=True)
    lost = {"name": "lost", "load_n": [[0.0, 70e3]], "fault": {"share": 1.0, "start_s": 0.0, "rate_1_s": 9.0}}
    data["validation"]["scenarios"] = [lost, *data["validation"]["scenarios"]]
    faulty = assemble(study.validated(data, "test"))
    ours, theirs = (evaluate(p, [GAINS])[0] for p in (plain, faulty))
    assert ours.feasible and ours.runs == theirs.runs == 3 and theirs.cost == pytest.approx(ours.cost, rel=0.01)
    lost["fault"]["stuck"] = [1.0, 2.0]
    with pytest.raises(InvalidInputError, match="at most one entry for each of torque_command: got 2"):
        assemble(study.validated(data, "test"))
    with pytest.raises(ValueError, match="without faults"):
        run = Run(gains=GAINS, scenario=scenarios(faulty.study)[0])
        faulty.loop.sensitivities([run], np.eye(8), faulty.reference)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["validation"]["scenarios"][1].update(name="heavy"), "names of its own: got twice"),
        (lambda d: d["validation"]["scenarios"][1].update(name="worst-case"), "hdmm-opt uses itself"),
        (lambda d: d["validation"]["scenarios"][0].update(load_n=[[-1.0, 70e3]]), "times from 0 on"),
        (
            lambda d: d["tuning"].update(weights={"rms_error": 0, "certified_bound": 0, "itae": 0, "effort": 0}),
            "one weight",
        ),
        (lambda d: d["tuning"].update(method="genius"), "'jaya', 'tlbo', 'random' or 'gradient'"),
        (
            lambda d: d["validation"]["scenarios"][0].update(fault={"share": 2, "start_s": 0, "rate_1_s": 1}),
            "less than or equal to 1",
        ),
        (lambda d: d["validation"]["scenarios"][0].update(quantisation=-0.1), "greater than or equal to 0"),
    ],
)
def test_bad_scenarios_and_tunings_are_one_line(change, said):
    data = study.load("emla-p2").model_dump(mode="json", exclude_none=True)
    change(data)
    with pytest.raises(InvalidInputError, match=said) as caught:
        study.validated(data, "test")
    assert "\n" not in str(caught.value)


def test_the_integration_error_is_estimated(problem):
    scenario = scenarios(problem.study)[0]
    fine = problem.loop.integration_error(GAINS, problem.reference, scenario)
    reference = replace(problem.loop, refinement=16).run(GAINS, problem.reference, scenario)
    true = np.abs(problem.loop.run(GAINS, problem.reference, scenario).x[0] - reference.x[0]).max()
    assert fine == pytest.approx(true, rel=0.1) and fine < 1e-10


def test_descent_is_a_method_of_a_design():
    data = study.load("emla-p4-fast").model_dump(exclude_none=True)
    data["tuning"] |= {"method": "gradient", "population": 10, "iterations": 3}
    small = assemble(study.validated(data, "test"))
    first = selection.starting_point(small)
    found = selection.search(small, first, (10, 3), 1, Options(), State(None, {}, resume=False), Progress())
    (before,) = evaluate(small, [small.gains(small.point(first.gains))])
    assert found.best is not None and found.best.outcome.cost < before.cost and found.evaluations <= 40 + 10


def test_a_tradeoff_is_a_set_of_proved_designs_that_none_beats(tmp_path):
    kept = tmp_path / "t.state"
    chosen = study.load("emla-p2")
    found, state = tradeoff(chosen, Options(state=kept), Progress(), (10, 4))
    again, _ = tradeoff(chosen, Options(state=kept, resume=True), Progress(), (10, 4))
    assert found == again and kept.exists()
    state.remove()
    goals = [o.objectives for o in found.outcomes]
    assert found.evaluations == 50 and len(goals) >= 2 and goals == sorted(goals)
    assert not any(dominates(a, b) for a in goals for b in goals)
    assert [o.objectives for o in evaluate(assemble(chosen), found.gains)] == goals
