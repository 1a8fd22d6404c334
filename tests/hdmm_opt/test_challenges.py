"""What tuned controllers are scored on."""

import pytest
from machines import emla, quick_arm, study_from

from hdmm_opt.jobs.challenges import challenges
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import within_assumptions


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
