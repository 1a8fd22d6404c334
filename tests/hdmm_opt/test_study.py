"""Bad input: one line that says the rule, what came, and what would do."""

import re

import pytest

from hdmm_opt import study
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.problem import assemble
from hdmm_opt.problem.resolved import resolved
from hdmm_opt.study.read import load_any

from importlib import resources  # isort: skip


def text(name="emla-p2"):
    return (resources.files("hdmm_opt") / "studies" / f"{name}.toml").read_text(encoding="utf-8")


def refusal(changed):
    with pytest.raises(InvalidInputError) as caught:
        assemble(study.parse(changed, "mine.toml"))
    message = str(caught.value)
    assert "\n" not in message
    return message


def swapped(old, new, name="emla-p2"):
    assert old in text(name)
    return text(name).replace(old, new, 1)


@pytest.mark.parametrize("name", [n for n in study.bundled() if isinstance(load_any(n), study.Study)])
def test_bundled_studies_are_valid_and_survive_the_round_trip(name):
    """A resolved study is a study, and it is resolved to itself."""
    loaded = study.load(name)
    assert loaded.study.name == name and loaded.study.summary
    problem = assemble(loaded)
    again = assemble(study.validated(resolved(problem), name), tuple(m.reference for m in problem.members))
    assert resolved(again) == resolved(problem)
    assert [m.bounds for m in again.members] == [m.bounds for m in problem.members]
    assert [m.model for m in again.members] == [m.model for m in problem.members]


CASES = {
    "broken TOML": (lambda: text() + "\n[oops", "not valid TOML"),
    "unknown key": (lambda: swapped("rate_hz", "rate_hs"), 'unknown key "controller.rate_hs"; did you mean "rate_hz"?'),
    "unknown section": (lambda: swapped("[tuning]", "[tunning]"), 'did you mean "tuning"?'),
    "unknown parameter": (lambda: swapped("parameters.motor_inertia", "parameters.motor_inertja"), 'did you mean "motor_inertia"?'),
    "unknown gain": (lambda: swapped("beta_2", "beta_3"), 'did you mean "beta_'),
    "unknown noise": (lambda: swapped("position_m = 1e-6", "position_mm = 1e-3"), 'did you mean "position_m"?'),
    "wrong unit": (lambda: swapped('unit = "kg m^2"', 'unit = "g cm^2"'), 'must be "kg m^2": got "g cm^2"; convert the value'),
    "NaN": (lambda: swapped("value = 0.012", "value = nan"), "must be a finite number: got nan"),
    "infinity": (lambda: swapped("speed_m_s = 0.104", "speed_m_s = inf"), "must be a finite number: got inf"),
    "lower over upper": (lambda: swapped("[65e3, 76e3]", "[76e3, 65e3]"), "needs lower <= upper: got [76000, 65000]"),
    "empty range": (lambda: swapped("[65e3, 76e3]", "[65e3, 65e3]"), "empty range"),
    "empty gain range": (lambda: swapped("min = 8.0, max = 200.0", "min = 8.0, max = 8.0"), "empty range"),
    "negative mass": (lambda: swapped("value = 2000.0", "value = -2000.0"), "must be positive: got -2000"),
    "rate of zero": (lambda: swapped("rate_hz = 1000", "rate_hz = 0"), "must be greater than 0: got 0"),
    "negative tolerance": (lambda: swapped("tolerance = 0.1", "tolerance = -0.1"), "greater than or equal to 0"),
    "unknown source": (lambda: swapped('source = "assumed"', 'source = "internet"'), "must be 'table', 'derived', 'public' or 'assumed'"),
    "missing key": (lambda: swapped("rate_hz = 1000\n", ""), '"controller.rate_hz" is required and missing'),
    "a number in another section": (lambda: swapped("[tuning]", "[plant.limits.motor_inertia]\nvalue = 1.0\nunit = 'kg m^2'\nsource = 'assumed'\n[tuning]"), "plant.parameters.motor_inertia"),
    "a rating of nothing": (lambda: swapped("[tuning]", "[plant.ratings.pole_pair]\nvalue = 4.0\nunit = '1'\nsource = 'assumed'\n[tuning]"), 'did you mean "pole_pairs"'),
    "a stroke in another unit": (lambda: swapped("[tuning]", "[plant.joints.actuator]\nstroke_rad = [0.0, 0.5]\n[tuning]"), "give stroke_m"),
    "a negative loss": (lambda: swapped("[tuning]", "[plant.parameters.gear_loss]\nvalue = -0.1\nunit = '1'\nsource = 'assumed'\n[tuning]"), "must be 0 or more"),
    "a load in another unit": (lambda: swapped("range = [65e3, 76e3]", "range = [65e3, 76e3]\nunit = 'kN'"), "convert the range"),
    "code of one's own": (lambda: swapped('model = "pmsm_emla"', 'model = "drive.py:drive"'), "--allow-code"),
    "gain both ways": (lambda: swapped("min = 8.0, max = 200.0", "min = 8.0, max = 200.0, value = 9.0"), "either value, or min and max"),
    "wrong type": (lambda: swapped("rate_hz = 1000", 'rate_hz = "fast"'), "valid number"),
    "unreachable speed": (lambda: swapped("durations_s = [7.0, 7.0]", "durations_s = [4.0, 7.0]"), "s would do"),
    "unreachable stroke": (lambda: swapped("[0.1, 0.4, 0.1]", "[0.1, 0.9, 0.1]"), "with room for the"),
    "unknown model": (lambda: swapped('model = "pmsm_emla"', 'model = "pmsm_emly"'), 'did you mean "pmsm_emla"?'),
    "unknown level": (lambda: swapped('level = "torque"', 'level = "force"'), "is one of torque, voltage: got 'force'"),
    "unknown disturbance": (lambda: swapped("disturbances.load_force", "disturbances.wind"), "disturbance"),
    "unknown member": (lambda: swapped("[tuning]", "[plant.joints.lift]\n[tuning]"), "is not a member of this machine"),
    "limit in another unit": (lambda: swapped("[tuning]", '[plant.joints.actuator.limits.torque]\nvalue = 9.0\nunit = "lbf"\nsource = "assumed"\n[tuning]'), 'must be "N m": got "lbf"'),
    "stroke upside down": (lambda: swapped("[tuning]", "[plant.joints.actuator]\nstroke_m = [0.5, 0.1]\n[tuning]"), "needs lower < upper"),
    "effectiveness as a parameter": (lambda: swapped("parameters.motor_inertia]\nvalue = 0.012\nunit = \"kg m^2\"", "parameters.effectiveness]\nvalue = 1.0\nunit = \"1\""), "is not a parameter of pmsm_emla"),
    "a rate that does not divide": (lambda: swapped("rate_hz = 1000", "rate_hz = 1000\nrates_hz = { other = 500 }"), "is not a member of this machine"),
    "a delay of many periods": (lambda: swapped("delay_s = 1e-3", "delay_s = 0.02"), "a rate of 400 Hz"),
    "a section that has no place": (lambda: swapped('level = "torque"', 'level = "torque"\nurdf = "crane"'), 'has no place with model = "pmsm_emla"'),
    "unreachable torque": (lambda: swapped("torque_nm = 37.0", "torque_nm = 20.0"), "the limit is 20"),
    "truth for a number": (lambda: swapped("rate_hz = 1000", "rate_hz = true"), "must be a number or text: got true"),
    "absurd number": (lambda: swapped("value = 2000.0", "value = 1e300"), "must be within"),
    "absurd rate": (lambda: swapped("rate_hz = 1000", "rate_hz = 1e6"), "100000: got 1000000"),
    "no waypoints": (lambda: swapped("[0.1, 0.4, 0.1]", "[]"), "at least 2 entries: got []"),
    "transient without an end": (lambda: swapped("transient_s = 1.0", "transient_s = 30.0"), "validation.transient_s ends before"),
    "waypoint on the edge": (lambda: swapped("[0.1, 0.4, 0.1]", "[0.0, 0.25, 0.0]"), "with room for the"),
    "text for a list": (lambda: swapped("modelling = []", 'modelling = "mechanics"'), "must be a list"),
    "missing duration": (lambda: swapped("durations_s = [7.0, 7.0]", "durations_s = [7.0]"), "each of the 2 moves: got 1"),
    "same waypoint": (lambda: swapped("[0.1, 0.4, 0.1]", "[0.1, 0.1, 0.4]"), "differ"),
    "load outside": (lambda: swapped("[[0.0, 76e3]]", "[[0.0, 80e3]]"), "got 80000"),
    "times out of order": (lambda: swapped("[4.22, 76e3]", "[3.0, 76e3]"), "increasing times"),
    "term of another level": (lambda: swapped("modelling = []", 'modelling = ["back_emf"]'), "leave the term out"),
    "bad name": (lambda: swapped('name = "emla-p2"', 'name = "../evil"'), "study.name"),
    "unreachable spline": (lambda: swapped("longest_s = 20.0", "longest_s = 2.0", "emla-p4-fast"), "s would do"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_one_helpful_line(case):
    make, expected = CASES[case]
    message = refusal(make())
    assert expected in message, message
    assert re.match(r'(mine\.toml|reference|controller|validation|uncertainty|unknown key|"controller)', message), (
        message
    )


def test_a_missing_file_or_name():
    for name in ("emla-p3", "nowhere.toml"):
        with pytest.raises(InvalidInputError) as caught:
            study.load(name)
        assert "\n" not in str(caught.value)
    with pytest.raises(InvalidInputError, match='did you mean "emla-p2"'):
        study.load("emlap2")
