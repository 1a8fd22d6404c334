"""What tuned controllers are scored on."""

import numpy as np
import pytest
from machines import emla, quick_arm, study_from

from hdmm_opt import study
from hdmm_opt.control.fitted import fitted
from hdmm_opt.files.comparison import write_comparison
from hdmm_opt.jobs.certify import strongest
from hdmm_opt.jobs.challenges import assumed_of, challenges, grounds
from hdmm_opt.jobs.compare import _bound, compare
from hdmm_opt.jobs.options import Options, Progress
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Run, Scenario, within_assumptions
from stability import Failure


def test_one_actuator_has_them_all_and_what_leaves_the_assumptions_is_told():
    problem = assemble(study_from(emla("emla-p2")))
    found = {s.name: s for s in challenges(problem, 1)}
    assert list(found)[-5:] == ["held-load", "far-start", "half-gain", "double-gain", "slow-drive"]
    inside = {name for name, s in found.items() if within_assumptions(problem, s)}
    assert inside == {"heavy", "load-steps", "light-noisy-start", "held-load"}
    (member,) = problem.members
    scale, lag = (member.plant.parameters[name] for name in ("torque_scale", "drive_lag"))
    assert found["half-gain"].parameter(member.name, "torque_scale", scale) == pytest.approx(0.5 * scale.value)
    assert found["double-gain"].parameter(member.name, "torque_scale", scale) == pytest.approx(2 * scale.value)
    assert found["slow-drive"].parameter(member.name, "drive_lag", lag) == pytest.approx(1e-3)


def test_what_a_machine_does_not_have_is_left_out():
    problem = assemble(study_from(quick_arm()))
    names = [s.name for s in challenges(problem, 1)]
    assert "far-start" in names and "slow-drive" not in names


def test_seeds_of_the_noise_are_those_asked_for():
    problem = assemble(study_from(emla("emla-p2")))
    first, again, other = (challenges(problem, seed)[-1] for seed in (1, 1, 7))
    assert first == again and first.seed != other.seed


def test_a_period_more_and_a_rest_are_grounds_of_their_own():
    problem = assemble(study_from(emla("emla-p2")))
    (_, whole), (late, (later,)), (still, (noisy,)), *sprung = grounds(problem, 1)
    (member,), (slow,), (resting,) = problem.members, late.members, still.members
    assert [s.name for s in whole] == [s.name for s in challenges(problem, 1)]
    assert slow.bounds.delay == member.bounds.delay + member.bounds.period and later.name == "late"
    ends = resting.reference.bounds()
    assert noisy.name == "noise-only" and ends[0][0] == ends[0][1] == member.reference(0.0)[0, 0]
    assert ends[1][0] == ends[1][1] == 0 and still.duration == problem.duration
    assert [(p.study.plant.sensor, run.name) for p, (run,) in sprung] == [
        ("motor", "spring-at-motor"), ("load", "spring-at-load")
    ]  # fmt: skip
    assert len(grounds(assemble(study_from(quick_arm())), 1)) == 3  # no joint of a rigid arm


@pytest.mark.parametrize("name", ["emla-p2", "emla-p4-ramp"])
def test_a_law_keeps_what_it_knows_on_a_plant_with_more_states(name):
    """On a screw that hardly yields, the law of the rigid one does what it does on the rigid one."""
    data = emla(name)
    problem = assemble(study_from(data))
    stiff = {"value": 1e12, "unit": "N/m", "tolerance": 0.0, "source": "assumed"}
    damped = {"value": 1e-3, "unit": "s", "tolerance": 0.0, "source": "assumed"}
    data["plant"] |= {"model": "elastic_emla", "sensor": "load"}
    data["plant"]["parameters"] |= {"stiffness": stiff, "spring_damping": damped}
    data["controller"]["modelling"] = []
    yielding = assemble(study_from(data))
    (member,), (soft,) = problem.members, yielding.members
    given = {"beta_1": 40.0, "beta_2": 12000.0, "gamma_2": 2e5}
    run = Run(gains={member.name: tuple(given.get(i.name, i.low) for i in member.ranges)}, scenario=Scenario(name="x"))
    rigid = Loop(problem).trace(run.gains, run.scenario, duration=3.0).members[member.name]
    moved = Loop(yielding, laws=[fitted(member.law, soft.plant)]).trace(run.gains, run.scenario, duration=3.0)
    own = moved.members[member.name]
    assert own.x[0, -1] - own.x[0, 0] > 1e-3
    assert np.abs(own.x[0] - rigid.x[0]).max() < 2e-6
    assert fitted(member.law, member.plant) is member.law
    with pytest.raises(ValueError, match="does not begin with the states"):
        fitted(soft.law, assemble(study_from(quick_arm())).members[0].plant)


def test_a_comparison_is_the_same_twice_and_its_page_stands_by_itself(tmp_path):
    problem = assemble(study_from(emla("emla-p2")))
    found, again = (compare(problem, (3, 1), 1, Options(), Progress(), seeds=1) for _ in range(2))
    told = [
        [(t.gains, {k: m.to_data() for k, m in t.figures.items()}) for c in f for t in c.trials] for f in (found, again)
    ]
    assert told[0] == told[1]
    page = write_comparison(problem, found, "Tuned a little", ["heavy"], assumed_of(problem), tmp_path).read_text(
        encoding="utf-8"
    )
    assert all(f"<h2>{name}</h2>" in page for name in found[0].trials[0].figures)
    assert page.count('class="best"') == len(found[0].trials[0].figures)
    assert (
        "http" not in page
        and "src=" not in page
        and "load_mass" in page
        and "stiffness 3e+08 N/m, spring_damping" in page
    )  # nothing from elsewhere; what is assumed
    assert "inside the assumptions" in page and "{{" not in page


def test_a_bound_that_passes_a_limit_is_none():
    """High gains on emla-p2: there is a certificate, and its set asks for more torque than there is."""
    problem = assemble(study.load("emla-p2"))
    (member,) = problem.members
    for own, there in (((60.0, 18000.0, 4e5), True), ((100.0, 25000.0, 1.5e6), False)):
        given = dict(zip(("beta_1", "beta_2", "gamma_2"), own, strict=True))
        gains = {member.name: tuple(given.get(item.name, item.low) for item in member.ranges)}
        assert not isinstance(strongest(problem, gains).contracts, Failure)
        assert (_bound(problem, gains) is not None) == there
