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
    r"validation\..*", r"members\.0\.golden\..*", r"members\.0\.model\.outputs\..*",
    r"study\.plant\.joints\.\w+\.bundled\.\d+",
)  # fmt: skip
#: Numbers that a proof bounds from one side: it holds for others too.
BOUNDED = (
    r"study\.plant\.joints\.\w+\.stroke_m\.\d", r"study\.reference\.limits\.\w+",
    r"members\.0\.certificate\..*", r"study\.validation\.transient_s", r"study\.uncertainty\.disturbances\.\w+\.course",
    r"study\.controller\.modelling\.\d", r"study\.requirements\.\w+", r"study\.controller\.members\.\w+\.\w+\.(min|max)",
    r"members\.0\.gains\.\d+\.(min|max|value)", r"members\.0\.nominal\.load_force",
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


@pytest.fixture(scope="module", params=["gain_text", "arm_text"])
def text(request):
    return request.getfixturevalue(request.param)


def changed(value):
    if isinstance(value, bool):
        return not value
    if value is None:
        return 1.0
    if isinstance(value, str):
        return value + "x"
    return value * 1.01 + 1e-3 if isinstance(value, float) else value + 1


@pytest.mark.parametrize("ways", [1, pytest.param(2, marks=pytest.mark.long)])
def test_every_leaf_is_verified_or_a_record(gain_text, ways):
    """One leaf of every kind that is on none of the lists above, up and down in turn, at length both: each is refused."""
    document, allowed, count = json.loads(gain_text), re.compile("|".join((*RECORDED, *BOUNDED))), 0
    for path, value in {pattern(p): (p, v) for p, v in leaves(document)}.values():
        place = ".".join(map(str, path))
        if "sha256" in path or path[0] in ("provenance", "schema") or allowed.fullmatch(place):
            continue
        both = [changed(value)] if not isinstance(value, float) else [changed(value), value * 0.99 - 1e-3]
        for other in both if ways > 1 else [both[count % len(both)]]:
            bent = copy.deepcopy(document)
            at(bent, path[:-1])[path[-1]] = other
            count += 1
            assert judged(bent, document["obligations"]).status, place
    assert count > 100 * ways


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


def torque_of(name):
    """The torque is something else, whatever the machine does."""
    program = {"inputs": [name], "operations": [["input", name]], "outputs": [0]}

    def bend(d):
        own(d)["model"]["outputs"]["torque"]["program"] = program

    return bend


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


def golden_of_the_jerk(d):
    """The same vector, but for the jerk, which the law does not read."""
    first = own(d)["golden"][0]
    own(d)["golden"] = [{**first, "r": [*first["r"][:3], float(k)]} for k in range(20)]


def adaptation_of_nothing(d):
    for vector in own(d)["golden"]:
        vector["theta_next"][0] = -9e-9


def ghost(name):
    """A disturbance or parameter that is there only outside the certified set."""

    def bend(d):
        program = own(d)["model"]["plant"]
        front = [
            ["input", "position"], ["const", "0.09"], ["sub", 0, 1], ["const", "10000.0"], ["mul", 2, 3], ["tanh", 4],
            ["const", "1.0"], ["sub", 6, 5], ["const", "0.5"], ["mul", 7, 8], ["input", name], ["mul", 9, 10],
        ]  # fmt: skip
        where, shift = program["operations"].index(["input", name]), len(front)
        moved = [[o[0], *(11 if a == where else a + shift for a in o[1:])] if o[0] not in ("input", "const") else o
                 for o in program["operations"]]  # fmt: skip
        program["operations"], program["outputs"] = front + moved, [o + shift for o in program["outputs"]]

    return bend


def dummy_speed(d):
    """A limit that is about the speed of nothing."""
    entry, count = own(d), 4
    model = entry["model"]
    model["rows"].append({"state": "rod_speed", "unit": "m/s", "target": "zero", "controlled": False})
    program = model["plant"]
    operations = program["operations"]
    operations += [["const", "1.0"], ["input", "rod_speed"], ["const", "-100.0"]]
    last = len(operations)
    operations.append(["mul", last - 2, last - 1])
    program["outputs"] = [*program["outputs"][:3], last - 3, *program["outputs"][3:], last]
    model["limits"][1]["signals"] = ["rod_speed"]
    for kind in ("noise", "initial"):
        d["study"]["uncertainty"][kind]["rod_speed"] = 0.0
        entry["assumptions"].append(
            {"name": f"{kind}.rod_speed", "lower": 0.0, "upper": 0.0, "unit": "m/s", "source": "study"}
        )
    certificate = entry["certificate"]
    for key in ("half_widths",):
        certificate[key].append("1/1000")
    certificate["envelope"]["ultimate"].append("1/1000")
    certificate["split"].append(1)
    certificate["force"] = [[*row, "0"] for row in certificate["force"]] + [["0", "0", "0", "-100"]]
    certificate["drive"].append(["0"])
    for cell in certificate["cells"]:
        columns = [[*row, "0"] for row in cell["columns"]]
        cell["columns"] = [*columns[:3], ["0"] * len(columns) + ["1"], *columns[3:]]
        cell["blocks"].append(1)
    for vector in entry["golden"]:
        vector["x"].append(0.0)
    assert len(model["rows"]) == count


def figures_of_a_run(key, value):
    def bend(d):
        d["validation"]["scenarios"][0]["figures"][key] = value

    return bend


def strong_input(d):
    d["validation"]["scenarios"][0]["figures"]["members"]["actuator"]["peak_input"] = 5000.0


def easy_requirement(d):
    """A requirement that the file's own runs miss."""
    d["study"]["requirements"]["peak_torque_nm"] = 1.0
    row = next(r for r in d["validation"]["requirements"] if r["name"] == "peak_torque_nm")
    row["simulated"] = 0.001


def no_runs(d):
    d["validation"]["monte_carlo"] = None


def no_worst(d):
    d["validation"]["worst_case"] = None


def gain_with_two_ranges(d):
    value = own(d)["gains"][0]["value"]
    d["study"]["controller"]["members"]["actuator"]["beta_1"] = {"value": value, "min": 1e6, "max": 1e7}
    own(d)["gains"][0] |= {"min": value, "max": value}


def range_of_no_gain(d):
    d["study"]["controller"]["members"]["actuator"]["beta_9"] = {"value": 1.0}


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
    "a torque that is a constant": (torque_of("torque_scale"), 2),
    "a torque of what is no state": (torque_of("load_force"), 2),
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
    "a load times a hundred-thousandth": (scaled_load("1e-5"), 1),
    "a load outside the certified set": (ghost("load_force"), 1),
    "a friction outside the certified set": (ghost("coulomb_friction"), 1),
    "golden vectors that differ in the jerk alone": (golden_of_the_jerk, 2),
    "golden vectors without adaptation": (adaptation_of_nothing, 1),
    "the speed of nothing": (dummy_speed, 2),
    "a lost run": (figures_of_a_run("diverged_s", 1.0), 2),
    "a run beyond the bound": (figures_of_a_run("maximum_error_m", 5.0), 2),
    "a run beyond a limit": (figures_of_a_run("limit_use", 3.0), 2),
    "a negative record": (figures_of_a_run("maximum_error_m", -1.0), 2),
    "an input beyond its limit": (strong_input, 2),
    "a requirement that the runs miss": (easy_requirement, 2),
    "random runs that were asked for": (no_runs, 2),
    "a worst case that was asked for": (no_worst, 2),
    "a gain with two ranges": (gain_with_two_ranges, 2),
    "a range of no gain": (range_of_no_gain, 2),
    "modelling terms of a law that models nothing": (study("controller", "modelling", value=["mechanics"]), 2),
    "a transient longer than the motion": (study("validation", "transient_s", value=1e6), 2),
    "a member that is locked": (study("plant", "locked", value={"actuator": 0.3}), 2),
    "pole pairs below zero": (study("plant", "joints", "actuator", "ratings", "pole_pairs", "value", value=-5.0), 2),
    "a torque limit in another unit": (study("plant", "joints", "actuator", "limits", "torque", "unit", value="mN m"), 2),
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


def no_place(d):
    d["couplings"][0]["place"] = {"inputs": ["x0"], "operations": [["input", "x0"], ["const", "1e-30"], ["mul", 0, 1]],
                                  "outputs": [2]}  # fmt: skip


def small_place(d):
    program = d["couplings"][0]["place"]
    count = len(program["operations"])
    program["operations"] += [["const", "0.01"], *(["mul", o, count] for o in program["outputs"])]
    program["outputs"] = [count + 1 + k for k in range(len(program["outputs"]))]


def loads_of_bodies_without_weight(d):
    names = ("a0", "a1", "a2")
    operations = [["input", name] for name in names] + [["input", "payload"], ["const", "1e-6"], ["mul", 3, 4]]
    outputs = []
    for k, entry in enumerate(d["members"]):
        inertia = next(a["lower"] for a in entry["assumptions"] if a["name"] == "parameter.load_inertia")
        load = next(a for a in entry["assumptions"] if a["name"] == "feedforward.load_force")
        operations += [["const", repr(inertia)], ["const", repr((load["lower"] + load["upper"]) / 2)]]
        at_ = len(operations)
        operations += [["mul", k, at_ - 2], ["add", at_, at_ - 1], ["add", at_ + 1, 5]]
        outputs.append(at_ + 2)
    d["couplings"][0]["loads"] = {"inputs": [], "operations": operations, "outputs": outputs}


def payload_of_any_course(d):
    d["study"]["uncertainty"]["disturbances"]["payload"]["course"] = "any"


def other_order(d):
    joints = d["study"]["plant"]["joints"]
    d["study"]["plant"]["joints"] = dict(reversed(joints.items()))


def noisy_speed(d):
    d["study"]["uncertainty"]["noise"]["speed"] = 1000.0


def slow_observer(d):
    d["study"]["controller"]["observer"]["bandwidth_rad_s"] = 1.0


def differences(d):
    del d["study"]["controller"]["observer"]["bandwidth_rad_s"]


def sharper_estimate(d):
    d["members"][0]["certificate"]["observed"][1] = "1/10000000"


def no_observer(d):
    del d["study"]["controller"]["observer"]


def no_jitter(d):
    del d["study"]["controller"]["jitter_s"]


def coarser(d):
    d["study"]["uncertainty"]["resolution"]["position"] *= 2


def half_a_current(d):
    d["members"][0]["model"]["limits"][1]["signals"] = ["i_d"]


def limits_of_joints(**limits):
    def bend(d):
        d["study"]["reference"]["limits"] = limits

    return bend


MACHINES = {
    "a joint that is faster than its limit": ("arm-p3", limits_of_joints(speed=[1.0, 0.04, 1.0])),
    "a jerk over its limit": ("arm-p3", limits_of_joints(jerk=[1.0, 1.0, 1e-3])),
    "limits of two of three joints": ("arm-p3", limits_of_joints(speed=[1.0, 1.0])),
    "limits of one actuator": ("arm-p3", limits_of_joints(speed_m_s=1.0, acceleration_m_s2=1.0, jerk_m_s3=1.0)),
    "an output that nothing moves": ("arm-p3", no_place), "an output of a hundredth": ("arm-p3", small_place),
    "bodies without weight": ("arm-p3", loads_of_bodies_without_weight),
    "a payload of any course": ("arm-p3", payload_of_any_course), "joints in another order": ("arm-p3", other_order),
    "a noise that is estimated": ("crane-p4", noisy_speed), "a slower observer": ("crane-p4", slow_observer),
    "a limit on half the current": ("crane-p4", half_a_current), "no observer": ("crane-p4", no_observer),
    "no jitter": ("emla-p2-encoder", no_jitter),
    "a coarser encoder": ("emla-p2-encoder", coarser), "differences for an observer": ("crane-p4", differences), "a sharper estimate": ("crane-p4", sharper_estimate),
}  # fmt: skip


@pytest.mark.parametrize("name", MACHINES)
def test_a_false_statement_about_a_machine_is_refused(name, arm_text):
    file, bend = MACHINES[name]
    text = arm_text if file == "arm-p3" else (GAINS / f"{file}.gains.json").read_text(encoding="utf-8")
    document = json.loads(text)
    bend(document)
    report = judged(document)
    assert report.status in (1, 2) and report.message.isprintable(), report.message


def test_limits_of_joints_that_hold_are_accepted(arm_text):
    document = json.loads(arm_text)
    limits_of_joints(speed=[1.0, 1.0, 1.0], jerk=[1.0, 1.0, 1.0])(document)
    assert judged(document).status == 0


def test_a_machine_that_is_the_same_for_every_payload_is_refused(arm_text):
    for factor, status in (("0.0", 2), (None, 2)):
        document = json.loads(arm_text)
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
