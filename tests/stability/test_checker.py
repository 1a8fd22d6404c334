"""The checker refuses: every change to a proved file, careless or careful, loses the verdict."""

import json
import shutil
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from stability import checker
from stability.certificates.definite import positive_definite


def status(text):
    return checker.check_text(text).status


def test_the_committed_file_is_proved_by_the_checker_alone(tmp_path, gain_text):
    """A bare interpreter, an empty folder, the checker and nothing else."""
    shutil.copy(Path(checker.__file__), tmp_path / "checker.py")
    good, bad = tmp_path / "good.json", tmp_path / "bad.json"
    good.write_text(gain_text, encoding="utf-8")
    bad.write_text(gain_text.replace("0.012", "0.013", 1), encoding="utf-8")

    def alone(*files):
        command = [sys.executable, "-I", "-S", "checker.py", *files]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    proved = alone("good.json")
    assert proved.returncode == 0 and "proved" in proved.stdout and not proved.stderr
    assert alone("bad.json").returncode == 2
    assert alone("missing.json").returncode == 2
    rows = json.loads(alone("good.json", "--json").stdout)
    assert sorted(o["name"] for o in rows[0]["obligations"]) == sorted(checker.REQUIRED["rac"]["impulse"])


def walk(node, path=()):
    if isinstance(node, dict):
        for key, value in node.items():
            yield from walk(value, (*path, key))
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from walk(value, (*path, index))
    else:
        yield path, node


def put(node, path, value):
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value


def one_digit(value):
    """The same number or text with its last significant digit changed."""
    text = repr(value) if isinstance(value, float | int) else value
    for place in range(len(text) - 1, -1, -1):
        if text[place].isdigit():
            changed = text[:place] + str((int(text[place]) + 1) % 10) + text[place + 1 :]
            return type(value)(changed) if isinstance(value, float | int) else changed
    return None


def own(data):
    """The only member of a file."""
    return data["members"][0]


@pytest.mark.parametrize(
    "section", ["study", "gains", "assumptions", "certificate", "model", "nominal", "golden", "reference"]
)
def test_one_changed_digit_is_refused(section, document):
    """Every number of the file, a few hundred in the long lists thinned out."""
    start = (section,) if section in document else ("members", 0, section)
    part = document[section] if section in document else own(document)[section]
    places = [(p, v) for p, v in walk(part, start) if not isinstance(v, bool) and one_digit(v) is not None]
    assert places
    for path, value in places[:: max(1, len(places) // 40)]:
        changed = one_digit(value)
        if changed == value:
            continue
        put(document, path, changed)
        assert status(json.dumps(document)) == 2, path
        put(document, path, value)


def gain(name, factor):
    def change(data):
        entry = next(g for g in own(data)["gains"] if g["name"] == name)
        entry["value"] *= factor

    return change


def assumption(name, lower=1.0, upper=1.0):
    def change(data):
        entry = next(a for a in own(data)["assumptions"] if a["name"] == name)
        entry["lower"], entry["upper"] = entry["lower"] * lower, entry["upper"] * upper

    return change


def rational(key, factor, index=None):
    def change(data):
        holder = own(data)["certificate"]
        if index is None:
            holder[key] = str(Fraction(holder[key]) * factor)
        else:
            holder[key][index] = str(Fraction(holder[key][index]) * factor)

    return change


def scaled(*path, factor):
    """Scale a number of the certificate."""

    def change(data):
        holder = own(data)["certificate"]
        for key in path[:-1]:
            holder = holder[key]
        value = holder[path[-1]]
        holder[path[-1]] = str(Fraction(value) * factor) if isinstance(value, str) else value * factor

    return change


def moved(*path, by):
    """Add to a number of the certificate."""

    def change(data):
        holder = own(data)["certificate"]
        for key in path[:-1]:
            holder = holder[key]
        holder[path[-1]] = str(Fraction(holder[path[-1]]) + Fraction(by))

    return change


def every_cell(change):
    """The same change of every cell."""

    def whole(data):
        for cell in own(data)["certificate"]["cells"]:
            change(cell)

    return whole


def without_last(part):
    def change(cell):
        cell["groups"] = cell["groups"][:part]

    return change


def merged(cell):
    """Blocks of one, whatever the poles are."""
    cell["blocks"] = [1] * len(cell["columns"])
    cell["columns"] = [row[1:] + row[:1] for row in cell["columns"]]


def coupled_columns(cell):
    """A combination of all coordinates in place of the first."""
    cell["columns"] = [[str(sum(map(Fraction, row), Fraction(0))), *row[1:]] for row in cell["columns"]]
    cell["columns"] = [[str(Fraction(row[0]) + 3 * Fraction(row[-1])), *row[1:]] for row in cell["columns"]]


def one_load_rate(factor):
    """A load that changes faster, in the study and in the assumptions."""

    def change(data):
        data["study"]["uncertainty"]["disturbances"]["load_force"]["rate"] *= factor
        entry = next(a for a in own(data)["assumptions"] if a["name"] == "feedforward_rate.load_force")
        entry["lower"], entry["upper"] = entry["lower"] * factor, entry["upper"] * factor

    return change


def in_study_and_gain(name, value):
    """Another value of a fixed gain, everywhere."""

    def change(data):
        data["study"]["controller"]["members"]["actuator"][name] = {"value": value}
        entry = next(g for g in own(data)["gains"] if g["name"] == name)
        entry["value"] = entry["min"] = entry["max"] = value

    return change


def delay(value):
    return lambda data: data["study"]["controller"].update(delay_s=value)


def operation(where, old, new):
    def change(data):
        model = own(data)["model"]
        program = model["plant"] if where == "plant" else model["law"][where]
        entry = next(o for o in program["operations"] if o[0] == old)
        entry[0] = new

    return change


def set_at(*path, value):
    """Set a place of the only member."""
    return lambda data: put(own(data), path, value)


def drive(data):
    """The numbers of the only member in the study."""
    return data["study"]["plant"]["joints"]["actuator"]


def in_drive(*path, value):
    return lambda data: put(drive(data), path, value)


def in_gains(name, value):
    return lambda data: put(data["study"]["controller"]["members"]["actuator"], (name,), value)


def at_top(*path, value):
    return lambda data: put(data, path, value)


def drop_obligation(name):
    def change(data):
        data["obligations"] = [o for o in data["obligations"] if o["name"] != name]

    return change


def both(name, factor):
    """Widen a parameter in the study and in the assumptions: a consistent forgery of a stronger claim."""

    def change(data):
        parameter = drive(data)["parameters"][name]
        parameter["tolerance"] = min(0.99, parameter["tolerance"] * factor)
        entry = next(a for a in own(data)["assumptions"] if a["name"] == f"parameter.{name}")
        spread = abs(parameter["value"]) * parameter["tolerance"] * (1 + 1e-12)
        entry["lower"], entry["upper"] = parameter["value"] - spread, parameter["value"] + spread

    return change


def load(low, high):
    def change(data):
        data["study"]["uncertainty"]["disturbances"]["load_force"]["range"] = [low, high]
        entry = next(a for a in own(data)["assumptions"] if a["name"] == "feedforward.load_force")
        entry["lower"], entry["upper"] = low, high

    return change


def rate(factor):
    def change(data):
        data["study"]["controller"]["rate_hz"] *= factor

    return change


def ultimate(factor):
    def change(data):
        ultimates = own(data)["certificate"]["envelope"]["ultimate"]
        ultimates[0] = str(Fraction(ultimates[0]) * factor)

    return change


def move_in_time(data):
    """A dwell moved back in time: the reference jumps, though its joints agree in position."""
    segment = own(data)["reference"]["segments"][2]
    segment["knots"] = [knot - 5.0 for knot in segment["knots"]]


def known_load(data):
    """A disturbance under the name of a design constant, which the law may read."""
    data["study"]["uncertainty"]["disturbances"]["nominal.load_force"] = {"range": [65e3, 76e3], "course": "any"}
    own(data)["assumptions"].append(
        {"name": "disturbance.nominal.load_force", "lower": 65e3, "upper": 76e3, "unit": "N", "source": "study"}
    )


def without_load(data):
    """A plant that does not feel its load."""
    program = own(data)["model"]["plant"]
    entry = next(o for o in program["operations"] if o[1] == "load_force")
    entry[:] = ["const", "0.0"]


def stuck(data):
    """An actuator whose effectiveness may be zero."""
    drive(data)["parameters"]["torque_scale"]["tolerance"] = 1.0
    entry = next(a for a in own(data)["assumptions"] if a["name"] == "parameter.torque_scale")
    entry["lower"], entry["upper"] = 0.0, 2.0


def upside_down(data):
    drive(data)["parameters"]["load_mass"]["tolerance"] = -0.9


def in_study(*path, value):
    return at_top("study", *path, value=value)


MUTATIONS = {
    "segment moved in time": move_in_time,
    "late start": lambda data: [s.update(knots=[k + 1.0 for k in s["knots"]]) for s in own(data)["reference"]["segments"]],
    "law that reads the jerk": set_at("model", "law", 1, value={
        "inputs": ["r3"], "operations": [["input", "r3"]], "outputs": [0]}),
    "disturbance named as a constant": known_load,
    "plant without its load": without_load,
    "negative tolerance": upside_down,
    "stuck actuator": stuck,
    "load upside down": in_study("uncertainty", "disturbances", "load_force", "range", value=[76e3, 65e3]),
    "one-sided noise": set_at("assumptions", -6, "lower", value=-0.05),
    "one-sided start": set_at("assumptions", -3, "lower", value=-5.0),
    "no rows": set_at("model", "rows", value=[]),
    "a first state that is neither": set_at("model", "first", value="angle"),
    "a fixed gain in the study": in_gains("beta_1", {"value": 50.0}),
    "another range of a gain": set_at("gains", 0, "min", value=1.0),
    "faster envelope": lambda data: own(data)["certificate"]["envelope"].update(rate="1000"),
    "a recorded refutation": at_top("obligations", 3, "verdict", value="refuted"),
    "an obligation of another member": at_top("obligations", 3, "member", value="other"),
    "negative simulated error": at_top("validation", "members", "actuator", "largest_error", value=-1.0),
    "a member twice": lambda data: data["members"].append(own(data)),
    "no member": at_top("members", value=[]),
    "a member that the study does not have": set_at("name", value="other"),
    "a coupling of one that is not there": at_top("couplings", value=[{"members": ["other"]}]),
    "a coupling without loads": at_top("couplings", value=[{"members": ["actuator"]}]),
    "an observer that is not there": in_study("controller", "observer", value={
        "bandwidth_rad_s": 100.0}),
    "a weaker actuator": in_drive("least_effectiveness", value=0.5),
    "wider stated bounds": set_at("reference", "derivative_bounds", 3, "upper", value=1e9),
    "limit on nothing": set_at("model", "limits", 1, "signals", value=[]),
    "limit with a line break": set_at("model", "limits", 0, "name", value="x\nother.json: proved"),
    "unit with a line break": in_drive("limits", "torque", "unit", value="x\nother.json: proved"),
    "unit of a row with a line break": set_at("model", "rows", 0, "unit", value="x\nother.json: proved"),
    "infinite golden vector": lambda data: own(data)["golden"][0].update(x=[1e200, 0.0, 0.0], theta_next=[0.0, 0.0]),
    "smaller outer gain": gain("beta_1", 0.9),
    "larger outer gain": gain("beta_1", 1.1),
    "smaller inner gain": gain("beta_2", 0.9),
    "larger inner gain": gain("beta_2", 1.1),
    "gain of zero": gain("beta_2", 0.0),
    "negative gain": gain("beta_2", -1.0),
    "stronger adaptation": gain("epsilon_2", 50.0),
    "less leakage": gain("sigma_2", 1e-4),
    "adaptation too fast for the rate": gain("delta_2", 1e5),
    "wider inertia": both("motor_inertia", 1.5),
    "wider torque scale": both("torque_scale", 2.0),
    "slower drive": both("drive_lag", 3.0),
    "more friction": both("coulomb_friction", 1.9),
    "more screw friction": both("screw_friction", 1.4),
    "assumption narrower than the study": assumption("parameter.motor_inertia", 1.05, 0.95),
    "load narrower than the study": assumption("feedforward.load_force", 1.02, 0.98),
    "heavier load": load(65e3, 80e3),
    "load from the other side": load(-76e3, 76e3),
    "slower rate": rate(0.8),
    "a rate of its own": in_study("controller", "rates_hz", value={"actuator": 500.0}),
    "negative box": rational("half_widths", Fraction(-1), 1),
    "negative held error": rational("input_bound", Fraction(-1), 0),
    **{f"smaller box of state {i}": rational("half_widths", Fraction(9, 10), i) for i in range(3)},
    **{f"hardly smaller box of state {i}": rational("half_widths", Fraction(99, 100), i) for i in range(3)},
    "smaller bound on the input": rational("input_bound", Fraction(9, 10), 0),
    "hardly smaller bound on the input": rational("input_bound", Fraction(99, 100), 0),
    "a box that hardly moves": rational("half_widths", Fraction(1, 10**40), 2),
    "smaller bound on the network": scaled("networks", 0, "bound", factor=Fraction(9, 10)),
    "no bound on the network": scaled("networks", 0, "bound", factor=Fraction(0)),
    "a demand cut from below": moved("networks", 0, "low", by="1"),
    "a demand cut from above": moved("networks", 0, "high", by="-1"),
    "a demand upside down": lambda data: own(data)["certificate"]["networks"][0].update(low="0", high="-30"),
    "another middle of the demand": moved("networks", 0, "middle", by="3"),
    "a middle far away": moved("networks", 0, "middle", by="-30"),
    "no network": set_at("certificate", "networks", value=[]),
    "a network twice": lambda data: own(data)["certificate"]["networks"].append(own(data)["certificate"]["networks"][0]),
    "a network of another row": set_at("certificate", "networks", 0, "row", value="position"),
    **{f"another force at {i}, {j}": scaled("force", i, j, factor=Fraction(13, 10))
       for i, j in ((0, 1), (1, 2), (2, 2))},
    "a force that is not there": moved("force", 1, 0, by="1000"),
    "a force of another sign": scaled("force", 1, 2, factor=Fraction(-1)),
    "a stronger input": scaled("drive", 2, 0, factor=Fraction(13, 10)),
    "no input": scaled("drive", 2, 0, factor=Fraction(0)),
    "an input of a row that has none": moved("drive", 1, 0, by="10"),
    "forces of two rows": lambda data: own(data)["certificate"]["force"].pop(),
    "half of the periods": every_cell(without_last(15)),
    "one period": every_cell(without_last(1)),
    "periods of nothing": every_cell(lambda cell: cell.update(groups=[0])),
    "no periods": every_cell(lambda cell: cell.update(groups=[])),
    "one large group of periods": every_cell(lambda cell: cell.update(groups=[sum(cell["groups"])])),
    "a group of a million periods": every_cell(lambda cell: cell["groups"].append(1_000_000)),
    "five hundred groups": every_cell(lambda cell: cell.update(groups=[1] * 500)),
    "a growth of two": every_cell(lambda cell: cell.update(growth="2")),
    "a faster decay": every_cell(lambda cell: cell.update(growth="11/10")),
    "a decay backwards": every_cell(lambda cell: cell.update(growth="9/10")),
    "no decay": every_cell(lambda cell: cell.update(growth="1")),
    "a negative growth": every_cell(lambda cell: cell.update(growth="-2")),
    "other blocks": every_cell(merged),
    "a block less": every_cell(lambda cell: cell["blocks"].pop()),
    "a block of three": every_cell(lambda cell: cell.update(blocks=[3, 1, 1])),
    "a block of nothing": every_cell(lambda cell: cell["blocks"].append(0)),
    "mixed coordinates": every_cell(coupled_columns),
    "coordinates in place of their inverse": every_cell(
        lambda cell: cell.update(columns=[list(row) for row in zip(*cell["columns"], strict=True)])
    ),
    "singular coordinates": every_cell(lambda cell: cell["columns"].__setitem__(1, ["0"] * len(cell["columns"]))),
    "a coordinate less": every_cell(lambda cell: cell["columns"].pop()),
    "coordinates of one state": every_cell(lambda cell: cell.update(columns=[["1"]], blocks=[1])),
    "huge coordinates": every_cell(lambda cell: cell["columns"][2].__setitem__(1, "1e60")),
    "coordinates of many digits": every_cell(
        lambda cell: cell["columns"][1].__setitem__(1, "1" * 100 + "/" + "3" * 100)
    ),
    "fewer cells": lambda data: own(data)["certificate"]["cells"].pop(),
    "no cells": set_at("certificate", "cells", value=[]),
    "no split": set_at("certificate", "split", value=[]),
    "split into nothing": set_at("certificate", "split", value=[0, 0, 0]),
    "one cell for all": lambda data: own(data)["certificate"].update(
        split=[1, 1, 1], cells=own(data)["certificate"]["cells"][:1]
    ),
    "sixty-five cells": lambda data: own(data)["certificate"].update(
        split=[1, 5, 13], cells=own(data)["certificate"]["cells"][:1] * 65
    ),
    "another split": lambda data: own(data)["certificate"].update(split=[1, 1, len(own(data)["certificate"]["cells"])]),
    "a load that changes faster": one_load_rate(3.0),
    "a load that changes at any rate": lambda data: data["study"]["uncertainty"]["disturbances"]["load_force"].pop("rate"),
    "a rate narrower than the study's": assumption("feedforward_rate.load_force", 0.5, 0.5),
    "a rate wider than the study's": assumption("feedforward_rate.load_force", 2.0, 2.0),
    "no rate among the assumptions": lambda data: own(data).update(
        assumptions=[a for a in own(data)["assumptions"] if a["name"] != "feedforward_rate.load_force"]
    ),
    "a negative rate": in_study("uncertainty", "disturbances", "load_force", "rate", value=-5e4),
    "half a period more of delay": delay(1.5e-3),
    "two periods of delay": delay(2e-3),
    "no delay": delay(0.0),
    "twenty periods of delay": delay(20e-3),
    "a negative delay": delay(-1e-3),
    "a stronger network": gain("gamma_2", 1.5),
    "a weaker network": gain("gamma_2", 0.6),
    "no network gain": gain("gamma_2", 0.0),
    "a network in the first row": in_study_and_gain("gamma_1", 1.0),
    "a network that is full": in_study_and_gain("phi_2", 40.0),
    "a network that holds nothing": in_study_and_gain("phi_2", 0.0),
    "a preload beyond its bound": in_study_and_gain("preload_2", 100.0),
    "a preload far away": in_study_and_gain("preload_2", 20.0),
    "golden estimate": set_at("golden", 3, "phi", 1, value=0.0),
    "golden estimate afterwards": set_at("golden", 3, "phi_next", 1, value=1.0),
    "golden vectors without estimates": lambda data: [v.pop("phi") for v in own(data)["golden"]],
    "a reference that does not rest": in_study("reference", "dwell_s", value=0.0),
    "smaller ball": ultimate(Fraction(95, 100)),
    "sign in the plant": operation("plant", "sub", "add"),
    "product made a sum": operation("plant", "mul", "add"),
    "unknown operator": operation("plant", "mul", "exec"),
    "law that knows the load": set_at("model", "law", 1, value={
        "inputs": ["load_force"], "operations": [["input", "load_force"]], "outputs": [0]}),
    "inertia that depends on the speed": set_at("model", "plant", "outputs", 1, value=0),
    "target that comes later": set_at("model", "rows", 1, "target", value=2),
    "target of itself": set_at("model", "rows", 1, "target", value=1),
    "lag turned into a governed row": set_at("model", "rows", 2, "controlled", value=True),
    "input of no row": set_at("model", "input_map", value=[7]),
    "no noise": set_at("assumptions", -5, "upper", value=0.0),
    "limit of zero": in_drive("limits", "torque", "value", value=0.0),
    "lower torque limit": in_drive("limits", "torque", "value", value=60.0),
    "lower speed limit": in_drive("limits", "speed", "value", value=0.05),
    "limit of nothing": set_at("model", "limits", 0, "signals", value=[]),
    "no limits": set_at("model", "limits", value=[]),
    "a limit less": lambda data: drive(data)["limits"].pop("speed"),
    "shorter stroke": in_drive("stroke", value=[0.0, 0.39]),
    "tighter requirement": in_study("requirements", "tracking_error_m", value=0.000013),
    "requirement of zero": in_study("requirements", "tracking_error_m", value=0.0),
    "larger initial error": in_study("uncertainty", "initial", "position", value=0.05),
    "more noise": in_study("uncertainty", "noise", "position", value=1e-3),
    "reference that jumps": set_at("reference", "segments", 1, "coefficients", 0, value=0.2),
    "reference that moves at its end": set_at("reference", "segments", -1, "coefficients", -2, value=0.1001),
    "faster reference": set_at("reference", "segments", 1, "coefficients", 14, value=0.45),
    "stated bounds on the reference": set_at("reference", "derivative_bounds", 2, "upper", value=0.001),
    "golden output": set_at("golden", 3, "u", 0, value=12.5),
    "golden state": set_at("golden", 3, "theta_next", 1, value=1.0),
    "few golden vectors": set_at("golden", value=[]),
    "simulation outside the envelope": at_top("validation", "members", "actuator", "largest_error", value=0.01),
    "another law": in_study("controller", "law", value="pid"),
    "another kind of certificate": set_at("certificate", "kind", value="trust-me"),
    "another schema": at_top("schema", value="hdmm-opt/gains/1"),
    "a nominal value": set_at("nominal", "transmission", value=1.0),
    **{f"without {name}": drop_obligation(name) for name in checker.REQUIRED["rac"]["impulse"]},
}  # fmt: skip


@pytest.mark.parametrize("name", MUTATIONS)
def test_a_resealed_mutation_is_refused(name, document, resealed):
    MUTATIONS[name](document)
    report = checker.check_text(resealed(document))
    assert report.status in (1, 2), f"{name}: {report.message}"
    assert "\n" not in report.message


@pytest.mark.parametrize(("name", "path", "value"), [
    ("authority", ("study", "plant", "joints", "actuator", "limits", "torque", "value"), 45.0),
    ("accuracy", ("study", "requirements", "tracking_error_m"), 1e-5),
])  # fmt: skip
def test_what_would_pass_passes(name, path, value, document, resealed):
    """The smallest change that a failing verdict names is enough, and hardly more."""
    put(document, path, value)
    failing = [o for o in checker.check_text(resealed(document)).obligations if o.verdict != "proved"]
    told = next(o for o in failing if o.name == name)
    amount = float(next(word for word in told.remedy.split() if word[0].isdigit()))
    enough = value + amount if name == "authority" else amount / 1e3
    put(document, path, enough)
    assert status(resealed(document)) == 0
    put(document, path, value + 0.9 * (enough - value))
    assert status(resealed(document)) == 1


def test_resealing_without_a_change_keeps_the_verdict(document, resealed):
    assert status(resealed(document)) == 0


def test_provenance_is_outside_the_hash(document):
    document["provenance"]["wall_time_s"] = 1.0
    assert status(json.dumps(document)) == 0


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "null", '"x"', '{"schema": NaN}', "[" * 100_000, '{"a":' * 50_000, '{"schema": 1e999999999}',
        '{"schema": ' + "9" * 5000 + "}", '{"a": 1, "a": 2}', "\x00", '{"schema": "hdmm-opt/gains/2"}',
    ],
)  # fmt: skip
def test_what_is_no_gain_file_is_unreadable(text):
    report = checker.check_text(text)
    assert report.status == 2 and report.message.startswith("unreadable") and "\n" not in report.message


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_truncated_files_are_unreadable(share, gain_text):
    assert status(gain_text[: int(share * len(gain_text))]) == 2


def test_a_chain_of_squares_does_not_explode(document, resealed):
    plant = own(document)["model"]["plant"]
    last = len(plant["operations"])
    plant["operations"].append(["input", "speed"])
    for k in range(400):
        plant["operations"].append(["mul", last + k, last + k])
    plant["operations"].append(["add", plant["outputs"][4], last + 400])
    plant["outputs"][4] = last + 401
    assert status(resealed(document)) == 1


@settings(max_examples=60)
@given(arrays(np.int64, (4, 4), elements=st.integers(-9, 9)), st.integers(-3, 30))
def test_exact_definiteness_agrees_with_eigenvalues(entries, shift):
    matrix = entries + entries.T + shift * np.eye(4, dtype=np.int64)
    smallest = np.linalg.eigvalsh(matrix.astype(float)).min()
    found = positive_definite([[Fraction(int(v)) for v in row] for row in matrix])
    if abs(smallest) > 1e-6:
        assert found == (smallest > 0)


def test_tiny_arguments_do_not_keep_the_checker_busy():
    tiny = Fraction(1, 2**2900)
    checker.WORK.begin(1000)
    low, high = checker.tanh((tiny, tiny))
    assert 0 < low <= tiny <= high
    for x in (Fraction(1, 2**39), Fraction(-1, 2**41), Fraction(1, 3)):
        low, high = checker.tanh_point(x)
        assert low <= high and high - low < Fraction(1, 2**80)
        assert float(low) == pytest.approx(np.tanh(float(x)), rel=1e-14)


def test_a_model_that_is_too_large_is_not_proved(document, resealed):
    plant = own(document)["model"]["plant"]
    speed = len(plant["operations"])
    plant["operations"].append(["input", "speed"])
    total = speed
    for _ in range(900):
        plant["operations"] += [["add", total, speed], ["mul", len(plant["operations"]), speed]]
        total = len(plant["operations"]) - 1
    plant["operations"].append(["add", plant["outputs"][4], total])
    plant["outputs"][4] = total + 1
    assert status(resealed(document)) == 1


def test_definiteness_is_strict():
    singular = [[Fraction(1), Fraction(1)], [Fraction(1), Fraction(1)]]
    assert not positive_definite(singular)
    singular[1][1] += Fraction(1, 10**60)
    assert positive_definite(singular)
