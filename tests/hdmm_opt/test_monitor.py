"""What shuts a machine down: a monitor by hand, what it sees of faults, and what of it the checker decides."""

import json

import numpy as np
import pytest
from forging import forged
from machines import bundled, emla, study_from
from scipy.integrate import solve_ivp

from hdmm_opt.errors import InvalidInputError
from hdmm_opt.plants.hydraulics import RELIEF
from hdmm_opt.plants.registry import plant_model
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Run, Scenario, within_assumptions
from hdmm_opt.simulation.scenario import Fault
from stability import checker

GAINS = {"beta_1": 0.19, "gamma_1": 28.0, "lead_1": 0.022, "smooth_1": 5e-4}
LIMITS = {"valve": [-0.9, 0.9], "pressure": [-2e6, 15e6]}
START = 1.5


def wheel(speed=0.25, *, watched=True, more=0.25):
    """The wheel that is bundled at other speeds, with a monitor."""
    data = bundled("wheel-p2")
    data["reference"]["waypoints"] = [speed, speed + more, speed]
    if watched:
        data["controller"]["monitor"] = {"error": 0.15, "limits": LIMITS}
    return assemble(study_from(data))


def gains_of(problem):
    return {m.name: tuple(GAINS.get(i.name, i.low) for i in m.ranges) for m in problem.members}


def fault(**what):
    return Fault(**({"share": 0.0, "rate_1_s": 1e3, "start_s": START} | what))


def run(problem, fault, **more):
    scenario = Scenario(name="s", faults={"actuator": fault} if fault else {}, **more)
    loop, gains = Loop(problem), gains_of(problem)
    (figures,) = loop.figures([Run(gains=gains, scenario=scenario)])
    return figures, loop.trace(gains, scenario)


@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_a_blocked_wheel_is_shut_down_at_the_first_monitored_bound(speed):
    """The monitor by hand: what it measures, and the pressure that SciPy makes of speed and commands of the run."""
    problem = wheel(speed, more=0.05)
    figures, trace = run(problem, fault(kind="blocked", size=5e-3))
    (own,) = trace.members.values()
    q = problem.members[0].plant.values()
    area, soft = q["reduction"] * q["displacement"] / q["wheel_radius"], q["line_volume"] / (4 * q["bulk_modulus"])
    estimate, first = np.array([own.x[1, 0], own.x[2, 0]]), None
    for k in range(len(trace.t)):
        if k:
            v, u = float(own.x[0, k - 1]), float(own.u[0, k - 1 - 1]) if k > 1 else float(own.u[0, 0])

            def rates(_, z, v=v, u=u):
                return [(u - z[0]) / q["valve_lag"], (q["rated_flow"] * z[0] - area * v - q["leakage"] * z[1]) / soft]

            estimate = solve_ivp(rates, (0, 1e-3), estimate, rtol=1e-10, atol=1e-9, method="DOP853").y[:, -1]
        apart, opening = abs(own.x[0, k] - own.r[0, k]), own.u[0, k]
        if first is None and (apart > 0.15 or not -2e6 < estimate[1] < 15e6):
            first = k
        if first is None and k > START * 1e3 and opening == 0:
            first = k  # the command would have left its range
    assert figures.stopped_s == pytest.approx(1e-3 * first, abs=1.5e-3)
    assert START < figures.stopped_s < START + 0.03
    assert np.all(own.u[0, round(figures.stopped_s * 1e3) :] == 0)
    assert own.x[2].max() < 17e6  # the relief valve stays shut
    assert figures.members["actuator"].peaks["line_pressure"] < 17e6


def test_without_a_monitor_the_relief_valve_opens():
    """A blocked wheel at a speed that winds the law up: the pressure passes its limit, no further than the valve lets."""
    problem = wheel(0.3, watched=False, more=0.05)
    figures, trace = run(problem, fault(kind="blocked", size=5e-3))
    (own,) = trace.members.values()
    q = problem.members[0].plant.values()
    assert figures.stopped_s is None
    assert 17e6 < own.x[2].max() < 17e6 + q["rated_flow"] / RELIEF
    assert abs(own.x[0, -1]) < 1e-9  # it stands


def test_faults_of_a_sensor_are_what_they_say():
    """A bias moves the speed by as much; a frozen sensor leaves the law what it said last; noise is of its size."""
    problem = wheel(watched=False)
    for size in (0.02, -0.02):
        _, trace = run(problem, fault(kind="bias", size=size))
        assert np.mean(trace.members["actuator"].error[-500:]) == pytest.approx(-size, abs=1e-3)
    _, trace = run(problem, fault(kind="frozen"), noise=1.0)
    (own,) = trace.members.values()
    seen = own.q[0] + own.r[0]
    k = round(START * 1e3)
    assert np.ptp(seen[k:]) < 1e-12 < np.ptp(seen[k - 100 : k])
    assert seen[k] == pytest.approx(seen[k - 1], abs=1e-15)
    (figures, noisy) = run(problem, fault(kind="noise", size=0.05), noise=1.0)
    (own,) = noisy.members.values()
    wrong = own.q[0] + own.r[0] - own.x[0]
    assert 0.045 < np.abs(wrong[k:]).max() <= 0.052 and np.abs(wrong[:k]).max() <= 0.002
    assert np.isinf(figures.diverged_s)


FAULTS = {
    "stuck": {"share": 1.0, "stuck": (0.5,)}, "no signal": {"share": 1.0}, "bias": {"kind": "bias", "size": 0.05},
    "the other way": {"kind": "bias", "size": -0.05}, "noise": {"kind": "noise", "size": 0.05}, "frozen": {"kind": "frozen"},
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_is_seen(name):
    """Within a fifth of a second, while the reference moves."""
    figures, trace = run(wheel(), fault(**FAULTS[name]), noise=1.0)
    assert START <= figures.stopped_s <= START + 0.2
    assert trace.members["actuator"].x[2].max() < 17e6


def test_a_frozen_sensor_shows_when_the_reference_moves():
    """At rest it is hidden, and harmless: a kilonewton more moves the speed by what leaks. Then the flow gives it away."""
    problem, rest = wheel(), 3.2  # a move from 1 s to 3 s, a rest until 4 s
    hidden = fault(kind="frozen", start_s=rest)
    course = {"traction": ((0.0, 2500.0), (rest + 0.1, 2500.0), (rest + 0.3, 3500.0))}
    figures, trace = run(problem, hidden, noise=1.0, disturbances=course)
    (own,) = trace.members.values()
    assert 4.0 < figures.stopped_s < 4.5  # it rests until 4 s
    assert 2e-3 < np.abs(own.error[round(1e3 * rest) : 4000]).max() < 0.03
    assert np.abs(own.error[round(1e3 * rest) : round(1e3 * figures.stopped_s)]).max() < 0.055


def test_it_does_not_act_without_a_fault():
    problem = wheel()
    for noise in (0.0, 1.0):
        figures, _ = run(problem, None, noise=noise)
        assert np.isinf(figures.stopped_s)
        assert figures.to_data()["stopped_s"] is None
    assert "stopped_s" not in run(wheel(watched=False), None)[0].to_data()


def test_one_wheel_stops_all():
    problem = assemble(study_from(bundled("vehicle-p12")))
    gains = {m.name: tuple(i.low for i in m.ranges) for m in problem.members}
    scenario = Scenario(name="s", faults={"rear_right": fault(share=1.0)}, ground={"slope": ((0.0, 0.1),)}, noise=1.0)
    trace = Loop(problem).trace(gains, scenario)
    ends = {name: int(np.flatnonzero(own.u[0] != 0)[-1]) for name, own in trace.members.items()}
    assert max(ends.values()) - min(ends.values()) <= 1 and min(ends, key=ends.get) == "rear_right"
    assert START * 1e3 < max(ends.values()) < START * 1e3 + 100


def test_faults_beside_the_actuators_are_outside_the_assumptions():
    problem = wheel()
    for what in ({"kind": "bias", "size": 1e-9}, {"kind": "frozen"}, {"kind": "blocked", "size": 0.1}):
        assert not within_assumptions(problem, Scenario(name="s", faults={"actuator": fault(**what)}))
    again = Scenario.from_data(
        json.loads(json.dumps(Scenario(name="s", faults={"a": fault(kind="bias", size=0.1)}).to_data()))
    )
    assert again.faults["a"] == fault(kind="bias", size=0.1)
    assert set(fault().to_data()) == {"share", "start_s", "rate_1_s", "stuck"}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda d: d["controller"]["monitor"]["limits"].update(presure=[0, 1]), "controller.monitor.limits.presure is unknown"),
        (lambda d: d["controller"]["monitor"]["limits"].update(valve=[1, -1]), "needs lower < upper: got [1, -1]"),
        (lambda d: d["validation"]["scenarios"][0].update(faults={"actuator": {"kind": "bias", "start_s": 1.0}}), "says how much: got 0"),
        (lambda d: d["validation"]["scenarios"][0].update(faults={"actuator": {"kind": "noise", "start_s": 1.0, "size": -1.0}}), "says how much: got -1"),
        (lambda d: d["validation"]["scenarios"][0].update(faults={"actuator": {"kind": "gone", "start_s": 1.0}}), "kind"),
    ],
)  # fmt: skip
def test_what_a_monitor_cannot_be(change, told):
    data = bundled("wheel-p2")
    data["controller"]["monitor"] = {"error": 0.15, "limits": dict(LIMITS)}
    change(data)
    with pytest.raises(InvalidInputError) as error:
        assemble(study_from(data))
    assert told in str(error.value)


def test_a_state_that_a_load_moves_is_not_estimated():
    """The speed of a spring's load is: the flow of a line is not. Beside an observer there is no monitor."""
    plant = plant_model("hydraulic_wheel").build("flow", {}, {}, sensor="speed")
    assert not plant.feels("pressure") and not plant.feels("opening") and plant.measured == [0]
    chain = plant_model("pmsm_emla").build("torque", {}, {})
    assert not chain.feels("speed") and 1 in chain.measured
    data = emla("emla-p2-encoder")
    data["controller"]["monitor"] = {"error": 1e-3}
    with pytest.raises(InvalidInputError, match=r"no place beside controller\.observer"):
        assemble(study_from(data))


def test_the_checker_decides_that_a_monitor_stays_quiet(gain_text):
    """With room it is an obligation more; with less error or torque than is certified it is none that is proved."""
    data = json.loads(gain_text)
    limits = data["study"]["plant"]["joints"]["actuator"]["limits"]
    torque = float(limits["torque"]["value"])
    speed = next(name for name in limits if name == "speed")

    def told(error, **ranges):
        data["study"]["controller"]["monitor"] = {"error": error, "limits": ranges}
        return checker.check_text(forged(data))

    good = told(1e-3, torque=[-torque, torque], **{speed: [-1e3, 1e3]})
    (made,) = [o for o in good.obligations if o.name == "monitor"]
    assert good.status == 0 and made.verdict == "proved" and "an error of" in made.statement
    for wrong in (told(1e-6), told(1e-3, torque=[-0.1, torque]), told(1e-3, **{speed: [-1e-4, 1e3]})):
        assert wrong.status == 1 and "monitor" in wrong.message
    assert "no limit on one signal" in told(1e-3, stiffness=[-1, 1]).message
