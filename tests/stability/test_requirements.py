"""What a file proves of its requirements beside the error: never less than a run reaches, and what it refuses."""

import copy
import json
from fractions import Fraction

import pytest
from conftest import GAINS
from hypothesis import given
from hypothesis import strategies as st

from hdmm_opt.files.seal import seal, to_text
from stability import checker

FILES = ("emla-p1", "emla-p2", "emla-p4-fast", "emla-p4-ramp")


def read(name):
    return json.loads((GAINS / f"{name}.gains.json").read_text(encoding="utf-8"))


def rows(document):
    return {row["name"]: row for row in document["validation"]["requirements"]}


def told(document, name, value):
    """The file with another bound on a requirement, hashes made right."""
    bent = copy.deepcopy(document)
    rows(bent)[name]["certified"] = value
    return checker.check_text(to_text(seal(bent)))


@pytest.mark.parametrize("name", FILES)
def test_runs_are_inside_what_is_proved(name):
    """Settling and peaks are proved of every bundled actuator; no recorded run passes them."""
    found = rows(read(name))
    proved = {key for key, row in found.items() if row["certified"] is not None}
    assert {"tracking_error_m", "settling_time_s", "peak_torque_nm"} <= proved
    for key in proved:
        assert found[key]["simulated"] <= found[key]["certified"] <= found[key]["required"], key
    assert found["settling_time_s"]["certified"] > 0, "a band that no start leaves says nothing"


@pytest.mark.parametrize("key", ["settling_time_s", "peak_torque_nm"])
def test_a_smaller_bound_is_refused(document, key):
    certified = rows(document)[key]["certified"]
    report = told(document, key, certified * 0.99)
    assert report.status == 2 and f"{key} states another bound than is proved" in report.message
    assert told(document, key, None).status == 2
    assert told(document, key, certified * (1 + 1e-6)).status == 0


def test_what_is_simulated_only_is_not_stated_as_proved(document):
    row = rows(document)["rms_torque_nm"]
    assert row["certified"] is None
    report = told(document, "rms_torque_nm", row["required"])
    assert report.status == 2 and "is stated as proved, and is not" in report.message


def test_an_output_that_is_left_out_proves_nothing(document, resealed):
    """Without the operations of the torque a file may not state a bound on it."""
    del document["members"][0]["model"]["outputs"]["torque"]
    report = checker.check_text(resealed(document))
    assert report.status == 0 and report.required["peak_torque_nm"][1] is None


def test_a_torque_in_another_unit_proves_nothing(document, resealed):
    document["members"][0]["model"]["outputs"]["torque"]["unit"] = "N"
    report = checker.check_text(resealed(document))
    assert report.status == 0 and report.required["peak_torque_nm"][1] is None


def member_of(document):
    checker.WORK.begin(checker.MAX_PRODUCTS)
    return checker.check_member(checker.parse(json.dumps(document)), 0, False)


def test_a_lag_never_passes_what_it_is_told(document):
    """|x| of drive_lag x' = u - x is at most sup|u|, however fast; of what feeds itself nothing is known."""
    member = member_of(document)
    largest = pytest.approx(float(member.verdict.largest("torque_command")), rel=1e-12)
    assert float(checker._followed(member, 2)) == largest
    assert checker._followed(member, 0) is checker._followed(member, 1) is None
    plant = member.claim.plant
    place = plant["outputs"][5]
    twice = [*plant["operations"], ["add", place, place]]
    member.claim.plant.update(operations=twice, outputs=[*plant["outputs"][:5], len(twice) - 1])
    assert float(checker._followed(member, 2)) == largest  # twice as fast, to the same end
    turned = [*plant["operations"], ["neg", len(plant["operations"]) - 1]]
    member.claim.plant.update(operations=turned, outputs=[*plant["outputs"][:5], len(turned) - 1])
    assert checker._followed(member, 2) is None


def test_settling_is_the_first_time_inside_the_band(document):
    """At the time found the bound is inside the band, two steps of the bisection earlier it is not."""
    member, band = member_of(document), Fraction(document["study"]["requirements"]["settling_band_m"])
    time = Fraction(rows(document)["settling_time_s"]["certified"])
    step = Fraction(document["study"]["requirements"]["settling_time_s"]) / 2**checker.HALVINGS
    assert member.verdict.sizes(time)[0] <= band < member.verdict.sizes(time - 2 * step)[0]


def test_a_motion_of_too_many_slices_is_simulated_only(document, monkeypatch):
    monkeypatch.setattr(checker, "MOST_SLICES", 10)
    report = checker.check_text(json.dumps(document), recorded=False)
    assert report.status == 0
    assert report.required["peak_torque_nm"][1] is None and report.required["settling_time_s"][1] is not None


def test_the_rms_of_a_constant_is_its_size(document):
    """A machine that rests at a known torque: the RMS over slices is its peak."""
    data, member = checker.parse(json.dumps(document)), member_of(document)
    program = {"operations": [["input", "torque_scale"]], "outputs": [0]}
    parts = list(checker._slices(data["members"][0]["reference"]["segments"], member, program))
    high = member.claim.parameters["torque_scale"][1]
    assert all(high**2 <= square <= high**2 * (1 + Fraction(1, 10**9)) for _, square in parts)
    assert abs(sum(lasted for lasted, _ in parts) - 17) < Fraction(1, 10**6)


@given(st.fractions(min_value=0, max_value=10**6))
def test_a_written_bound_is_not_below_what_is_proved(bound):
    """A file holds the shortest decimal of a float, which may lie below the float."""
    assert bound <= Fraction(repr(checker.above(bound))) <= bound * (1 + Fraction(1, 10**15)) + Fraction(1, 10**300)
