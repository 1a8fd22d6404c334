"""A plant whose first state is a speed goes the same way as the others: reference, proof, simulation, file."""

import json
import tomllib

import numpy as np
import pytest
from click.testing import CliRunner
from hubs import PLANT, STUDY
from scipy.integrate import solve_ivp

from hdmm_opt.cli import main
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.files.restore import restored
from hdmm_opt.files.seal import to_text
from hdmm_opt.jobs.options import Options, Progress
from hdmm_opt.jobs.pipeline import design
from hdmm_opt.machines import registry
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Scenario
from hdmm_opt.study import validated
from stability import checker


@pytest.fixture(autouse=True)
def _hub(monkeypatch):
    known = registry.plant_model
    monkeypatch.setattr(registry, "plant_model", lambda name: PLANT if name == "hub" else known(name))


def study():
    return validated(tomllib.loads(STUDY), "test")


def test_it_is_designed_proved_and_checked(tmp_path):
    result = design(study(), Options(), Progress())
    assert result.document is not None, result.verdicts
    (entry,) = result.document["members"]
    assert entry["model"]["first"] == "speed"
    assert [b["unit"] for b in entry["reference"]["derivative_bounds"]] == ["rad/s", "rad/s^2", "rad/s^3", "rad/s^4"]
    bound = result.document["validation"]["requirements"][0]["certified"]
    assert 0 < result.shown.largest_late_error <= bound < 0.5
    told = checker.check_text(to_text(result.document))
    assert told.status == 0 and "mrad/s" in told.message
    path = tmp_path / "hub.gains.json"
    path.write_text(to_text(result.document), encoding="utf-8")
    told = CliRunner().invoke(main, ["falsify", str(path), "--budget", "20"])
    assert told.exit_code == 0 and " mrad/s, certified " in told.stdout, told.output
    document = json.loads(path.read_text(encoding="utf-8"))
    document["members"][0]["model"]["first"] = "position"
    with pytest.raises(InvalidInputError, match="not what this release makes"):
        restored(document)


def test_its_loop_is_that_of_an_independent_integration():
    """One row: u = -(β + ε θ̂)(v - r) / 2, held over a period; the modelling term of a first row that is a speed is 0."""
    problem = assemble(study())
    beta, epsilon, delta, sigma = (400.0, 20.0, 1.0, 5.0)
    trace = Loop(problem).trace(
        {"actuator": (beta, epsilon, delta, sigma, 0.0, 0.0, 0.0)},
        Scenario(name="s", disturbances={"drag": ((0.0, 8.0),)}),
    )
    own, (member,) = trace.members["actuator"], problem.members
    v, theta = member.reference(0.0)[0, 0], 0.0
    for k in range(1500):
        assert own.x[0, k] == pytest.approx(v, abs=1e-8)
        e = v - member.reference(k * 1e-3)[0, 0]
        u = float(np.clip(-(beta + epsilon * theta) * e / 2, -60, 60))
        theta += 1e-3 * (epsilon * delta * e * e / 2 - delta * sigma * theta)
        v = solve_ivp(lambda _, x, u=u: (u - 0.5 * x - 8.0) / 2.0, (0, 1e-3), [v], rtol=1e-10, atol=1e-12).y[0, -1]
    assert np.abs(own.x[0, :1500] - own.r[0, :1500]).max() > 1e-3


def test_its_motion_is_limited_in_its_own_derivatives():
    data = tomllib.loads(STUDY)
    data["reference"]["durations_s"] = [0.5, 2.0]
    with pytest.raises(InvalidInputError, match="s would do"):
        assemble(validated(data, "test"))
    data = tomllib.loads(STUDY)
    data["reference"] |= {"kind": "bspline", "objective": "energy"}
    with pytest.raises(InvalidInputError, match="does not say what a motion spends"):
        assemble(validated(data, "test"))
