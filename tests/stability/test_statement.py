"""The checker's statement is the whole file: what stands in it is verified, or is a record that the documents list."""

import copy
import json
import re

import pytest
from conftest import GAINS
from forging import forged, programs

from hdmm_opt.files.seal import seal, to_text
from stability import checker

#: Places whose text or number may change without a change of what is proved: docs/certificate.md lists them.
RECORDED = (
    r"study\.study\.(name|publication|summary)", r"study\.plant\.(model|level)", r"study\..*\.meaning",
    r"study\.plant\.joints\.\w+\.(ratings\.\w+|limits\.\w+)\.(value|source)", r"study\.plant\.joints\.\w+\.ratings\.\w+\.unit",
    r"study\.reference\.(objective|jerk_weight|longest_s|spans)", r"study\.reference\.limits\.(torque_nm|current_a|voltage_v)",
    r"study\.tuning\..*", r"study\.validation\.(monte_carlo|falsify|worst_case)", r"study\.validation\.scenarios\..*",
    r"study\.requirements\.settling_band_m", r"validation\..*", r"members\.0\.golden\..*",
    r"study\.plant\.joints\.\w+\.bundled\.\d+",
)  # fmt: skip
#: Numbers that a proof bounds from one side: it holds for others too.
BOUNDED = (
    r"study\.plant\.joints\.\w+\.stroke_m\.\d", r"study\.reference\.limits\.\w+",
    r"members\.0\.certificate\..*", r"study\.validation\.transient_s", r"study\.uncertainty\.disturbances\.\w+\.course",
    r"study\.controller\.modelling\.\d", r"study\.requirements\.\w+", r"study\.controller\.members\.\w+\.\w+\.(min|max)",
    r"members\.0\.gains\.\d\.(min|max|value)", r"members\.0\.nominal\.load_force",
    r"members\.0\.model\.(plant|law\.\d)\.inputs\.\d+",  # the forger lists them anew
)  # fmt: skip


#: Records whose keys are names: of joints that stand still, packages, outputs, and what a scenario changes.
NAMED = ("locked", "versions", "peaks", "rms", "parameters", "disturbances", "faults")


def leaves(node, path=()):
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from leaves(value, (*path, key))
    else:
        yield path, node


def objects(node, path=()):
    if isinstance(node, dict):
        yield path
    for key, value in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        yield from objects(value, (*path, key))


def at(node, path):
    for key in path:
        node = node[key]
    return node


def pattern(path):
    return ".".join("*" if isinstance(key, int) else key for key in path)


def once(paths):
    """One path of every kind."""
    return list({pattern(path): path for path in paths}.values())


def judged(document, recorded=None):
    return checker.check_text(forged(document, recorded))


def plainly_judged(document):
    """With hashes alone made right: what is changed is no repetition of anything."""
    return checker.check_text(to_text(seal(document)))


@pytest.fixture(scope="module", params=["emla-p2", "arm-p3"])
def text(request):
    return (GAINS / f"{request.param}.gains.json").read_text(encoding="utf-8")


def changed(value):
    if isinstance(value, bool):
        return not value
    if value is None:
        return 1.0
    if isinstance(value, str):
        return value + "x"
    return value * 1.01 + 1e-3 if isinstance(value, float) else value + 1


def test_every_leaf_is_verified_or_a_record(gain_text):
    """One leaf of every kind that is on none of the lists above, both ways: each is refused."""
    document, allowed, count = json.loads(gain_text), re.compile("|".join((*RECORDED, *BOUNDED))), 0
    for path, value in {pattern(p): (p, v) for p, v in leaves(document)}.values():
        place = ".".join(map(str, path))
        if "sha256" in path or path[0] in ("provenance", "schema") or allowed.fullmatch(place):
            continue
        for other in [changed(value)] if not isinstance(value, float) else [changed(value), value * 0.99 - 1e-3]:
            bent = copy.deepcopy(document)
            at(bent, path[:-1])[path[-1]] = other
            count += 1
            assert judged(bent, document["obligations"]).status, place
    assert count > 150


def test_unknown_keys_are_refused_everywhere(text):
    document = json.loads(text)
    places = [path for path in once(objects(document)) if path[-1:] not in ((name,) for name in NAMED)]
    assert len(places) > 60
    for path in places:
        bent = copy.deepcopy(document)
        at(bent, path)["unheard_of"] = 1.0
        report = plainly_judged(bent)
        assert report.status == 2 and "\n" not in report.message, path


def test_numbers_as_text_are_refused(text):
    document = json.loads(text)
    paths = [p for p, v in leaves(document) if isinstance(v, float | int) and not isinstance(v, bool)]
    for path in once(p for p in paths if p[0] != "provenance" and "operations" not in p):
        bent = copy.deepcopy(document)
        holder = at(bent, path[:-1])
        holder[path[-1]] = str(holder[path[-1]])
        assert plainly_judged(bent).status == 2, path


def own(d):
    return d["members"][0]


def study(*path, value):
    def bend(d):
        at(d["study"], path[:-1])[path[-1]] = value

    return bend


def scaled_load(factor):
    """The load enters the plant through a factor."""

    def bend(d):
        program = own(d)["model"]["plant"]
        where = next(k for k, o in enumerate(program["operations"]) if o == ["input", "load_force"])
        users = [o for o in program["operations"] if where in o[1:] and o[0] not in ("input", "const")]
        count = len(program["operations"])
        # the load moves to the front, so that its product comes before whoever reads it
        shift = [["input", "load_force"], ["const", factor], ["mul", 0, 1]]
        moved = [
            [o[0], *(a + 3 if o[0] not in ("input", "const") else a for a in o[1:])] for o in program["operations"]
        ]
        for o in moved:
            if o[0] not in ("input", "const"):
                o[1:] = [2 if a == where + 3 else a for a in o[1:]]
        assert users and count
        program["operations"] = [*shift, *moved]
        program["outputs"] = [o + 3 for o in program["outputs"]]

    return bend


def last_segment_lost(d):
    own(d)["reference"]["segments"].pop()


def slow_end(d):
    """The last pause is shorter than the study's."""
    segment = own(d)["reference"]["segments"][-1]
    begin = segment["knots"][0]
    segment["knots"] = [begin + (k - begin) / 2 for k in segment["knots"]]


def same_golden(d):
    own(d)["golden"] = [own(d)["golden"][0]] * 20


def unmet(d):
    row = next(r for r in d["validation"]["requirements"] if r["name"] == "rms_torque_nm")
    row["simulated"] = 100.0


def invented(d):
    next(r for r in d["validation"]["requirements"] if r["name"] == "peak_torque_nm")["certified"] = 60.0


def record(key, value):
    def bend(d):
        d["obligations"][3][key] = value

    return bend


def moved_signal(d):
    own(d)["model"]["limits"][1]["signals"] = ["torque"]


def gain_out_of_range(d):
    own(d)["gains"][0]["value"] = 7.0


def meaning(d):
    own(d)["gains"][0]["meaning"] = "proved for every load"


def source(d):
    entry = next(a for a in own(d)["assumptions"] if a["name"] == "parameter.motor_inertia")
    entry["source"] = "table"


def unit_of_gain(d):
    own(d)["gains"][0]["unit"] = "1"


#: Changes that the forger would undo.
UNREPEATED = (invented,)
FALSE = {
    "a larger start in the study": (study("uncertainty", "initial", "position", value=2e-4), 2),
    "a smaller start in the study": (study("uncertainty", "initial", "position", value=1e-5), 2),
    "another waypoint": (study("reference", "waypoints", 1, value=[0.45]), 2),
    "one waypoint more": (study("reference", "waypoints", value=[[0.1], [0.4], [0.1], [0.4]]), 2),
    "a shorter move": (study("reference", "durations_s", 0, value=5.0), 2),
    "a lower speed limit of the reference": (study("reference", "limits", "speed_m_s", value=0.05), 2),
    "a lower jerk limit of the reference": (study("reference", "limits", "jerk_m_s3", value=0.01), 2),
    "a longer pause": (study("reference", "dwell_s", value=2.0), 2),
    "the last segment lost": (last_segment_lost, 2),
    "a shorter last pause": (slow_end, 2),
    "a load times nothing": (scaled_load("0.0"), 1),
    "a load times hardly anything": (scaled_load("1e-12"), 1),
    "one golden vector twenty times": (same_golden, 2),
    "a requirement that is not met": (unmet, 2),
    "an invented bound on the torque": (invented, 2),
    "another stored statement": (record("statement", "nothing can go wrong"), 1),
    "a larger stored margin": (record("margin", 1e9), 1),
    "another stored unit": (record("unit", "km"), 1),
    "a gain outside its range": (gain_out_of_range, 2),
    "another unit of a gain": (unit_of_gain, 2),
    "a claim for a meaning": (meaning, 2),
    "another source of an assumption": (source, 2),
    "a speed limit on the torque": (moved_signal, 2),
    "a modelling term that nobody knows": (study("controller", "modelling", value=["everything"]), 2),
    "an unknown rating": (study("plant", "joints", "actuator", "bundled", value=["nothing"]), 2),
    "a load in another unit": (study("uncertainty", "disturbances", "load_force", "unit", value="kN"), 2),
    "a parameter in another unit": (study("plant", "joints", "actuator", "parameters", "load_mass", "unit", value="t"), 2),
    "a name that draws a line": (study("study", "summary", value="x\x1b[2K\rproved"), 2),
    "a lone surrogate": (study("study", "name", value="\ud800"), 2),
    "text from right to left": (study("study", "name", value="x\u202eproved"), 2),
}  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_a_false_statement_is_refused(name, document):
    bend, status = FALSE[name]
    before = copy.deepcopy(document["obligations"])
    bend(document)
    report = judged(document, before) if bend not in UNREPEATED else plainly_judged(document)
    assert report.status == status and report.message.isprintable(), report.message


def test_a_machine_that_is_the_same_for_every_payload_is_refused():
    text = (GAINS / "arm-p3.gains.json").read_text(encoding="utf-8")
    for factor, status in (("0.0", 2), (None, 2)):
        document = json.loads(text)
        program = document["couplings"][0]["loads"]
        entry = next(o for o in program["operations"] if o == ["input", "payload"])
        entry[:] = ["const", factor or "5.0"]
        report = judged(document)
        assert report.status == status and "payload" in report.message


def test_bounds_are_printed_upwards_and_margins_downwards():
    assert checker.upward(checker.Fraction(1, 3)) == "0.3334" and checker.downward(checker.Fraction(2, 3)) == "0.6666"
    assert (
        checker.downward(checker.Fraction(-1, 3)) == "-0.3334" and checker.upward(checker.Fraction(1, 5000)) == "0.0002"
    )
    assert checker.milli(checker.Fraction(1, 10**7), "m") == "0.0001 mm"
    exact = checker.Fraction(1, 3)
    assert checker.Fraction(checker.below(exact)) <= exact < checker.Fraction(-checker.below(-exact))


def test_the_forger_changes_nothing_by_itself(text):
    assert judged(json.loads(text)).status == 0 and len(list(programs(json.loads(text)))) > 2
