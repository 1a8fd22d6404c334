"""What a file says more than once, and what it records, against the study and the proof.

Must fail: units, sources, meanings and nominal values that are not the study's, requirements that are not met,
records that the proof excludes, golden vectors that repeat each other.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from .claim import Claim
from .limits import CARRIED, MET, NAME, need
from .parsing import number, reads

#: Meaning of a gain by its kind.
MEANINGS = {
    "beta": "proportional gain", "epsilon": "adaptation gain", "delta": "adaptation rate",
    "sigma": "leakage of the adaptation", "gamma": "gain of the load network",
    "phi": "largest estimate of the load network", "preload": "estimate of the load network at the start",
}  # fmt: skip
#: The same of the leads of an input.
TIMES = {"lead": "time of each section of lead", "smooth": "time of their filters"}
#: Key of a stroke by the unit of the first state.
STROKE = {"m": "stroke_m", "rad": "stroke_rad", "m/s": "stroke_m_s", "rad/s": "stroke_rad_s"}


def stroke_of(section: dict[str, Any], unit: str) -> Any:
    """The range of the first state, in its unit."""
    need(unit in STROKE, f"the first state must be in {', '.join(STROKE)}: got {unit!r:.20}")
    given = [key for key in STROKE.values() if key in section]
    need(given == [STROKE[unit]], f"the study must give {STROKE[unit]}, and no other stroke")
    return section[STROKE[unit]]


def consistent(data: dict[str, Any], entry: dict[str, Any], claim: Claim) -> None:
    """Refuse facts about a member that contradict each other."""
    study = data["study"]
    section = study["plant"]["joints"][claim.name]
    units = {row["state"]: row["unit"] for row in claim.rows}
    _units(claim, units)
    _nominal(claim, section, study)
    _assumed(entry, claim, study, section, units)
    _gains(entry, claim, units)
    _terms(claim, study)
    _bundled(section)
    derivatives, own = ["", "/s", "/s^2", "/s^3"], claim.rows[0]["unit"].removesuffix("/s")
    first = 1 if claim.rows[0]["unit"].endswith("/s") else 0
    names = ("position", "speed", "acceleration", "jerk")
    for k, bound in enumerate(entry["reference"]["derivative_bounds"]):
        unit = own + [*derivatives, "/s^4"][first + k]
        need((bound["name"], bound["unit"]) == (names[k], unit), f"derivative {k} of the reference is in {unit}")


def _units(claim: Claim, units: dict[str, str]) -> None:
    """A limit is in the unit of what it limits; a rate in that of what it is the rate of."""
    amplitude = claim.limits[0]["unit"]
    for limit in claim.limits:
        for signal in limit["signals"]:
            need(
                limit["unit"] == units.get(signal, amplitude),
                f"the limit on {limit['name']} has the unit of no {signal}",
            )
    for row in claim.rows:  # a lag carries out what is commanded
        if row["target"] in claim.input_map:
            need(row["unit"] == amplitude, f"the input must be in the unit of {row['state']}, {row['unit']}")
    first, second = claim.rows[0], claim.rows[1] if len(claim.rows) > 1 else None
    if claim.first == "position" and second is not None:
        need(second["unit"] == f"{first['unit']}/s", f"{second['state']} must be in {first['unit']}/s")
    fits = first["unit"].endswith("/s") == (claim.first == "speed")
    need(fits, f"a {claim.first} cannot be in {first['unit']}")


def _nominal(claim: Claim, section: dict[str, Any], study: dict[str, Any]) -> None:
    """What the law takes for the plant are the study's values; for a load, one of its range."""
    for name, value in claim.nominal.items():
        if name in section["parameters"]:
            stated = number(section["parameters"][name]["value"], name)
            need(value == stated, f"the nominal value of {name} is not the study's")
        elif name in claim.parameters:
            low, high = claim.parameters[name]
            need(low <= value <= high, f"the nominal value of {name} is outside its range")
        else:
            given = study["uncertainty"]["disturbances"].get(name)
            low, high = claim.disturbances[name] if given is None else [number(v, name) for v in given["range"]]
            unknown = given is None and value == 0  # the load of a coupling that the law does not know
            need(unknown or low <= value <= high, f"the nominal value of {name} is outside its range")


def _assumed(
    entry: dict[str, Any], claim: Claim, study: dict[str, Any], section: dict[str, Any], units: dict[str, str]
) -> None:
    """Units and sources of the assumptions."""
    load = {name: d["unit"] for name, d in study["uncertainty"]["disturbances"].items()}
    for given in entry["assumptions"]:
        kind, _, name = given["name"].partition(".")
        stated = section["parameters"].get(name)
        if kind == "parameter" and stated is not None:
            wanted = stated["unit"], stated["source"]
        elif kind == "parameter":  # effectiveness, or a member's own part of the inertia of a machine's bodies
            wanted = ("1", given["source"]) if name not in CARRIED else (given["unit"], "derived")
            need(given["source"] in ("derived", "assumed"), f"{given['name']} has another source")
        elif kind in ("noise", "initial"):
            wanted = units[name], "study"
        elif kind == "feedforward_rate":
            own = next(e["unit"] for e in entry["assumptions"] if e["name"] == f"feedforward.{name}")
            wanted = f"{own}/s", "study"
        else:
            wanted = load.get(name, given["unit"]), "study"
        need((given["unit"], given["source"]) == wanted, f"{given['name']} must be in {wanted[0]}, source {wanted[1]}")


def _gains(entry: dict[str, Any], claim: Claim, units: dict[str, str]) -> None:
    """Units and meanings of the gains: β maps Q to what the row asks for, ε θ̂ has the unit of β."""
    order = [f"{kind}_{k + 1}" for k in range(len(claim.controlled)) for kind in MEANINGS]
    led = [k for k, row in enumerate(claim.controlled) if claim.leads and row in claim.input_map]
    order += [f"{kind}_{k + 1}" for k in led for kind in TIMES]
    need([gain["name"] for gain in entry["gains"]] == order, "the gains stand in another order")
    for gain in entry["gains"]:
        kind, _, place = gain["name"].partition("_")
        row = claim.controlled[int(place) - 1]
        state = claim.rows[row]["state"]
        following = [units[r["state"]] for r in claim.rows if r["target"] == row]
        control = following[0] if following else claim.limits[0]["unit"]
        ratio = f"({control})/({units[state]})"
        unit = {"beta": ratio, "epsilon": f"sqrt({ratio}/s)/({units[state]})", "delta": "1", "sigma": "1/s",
                "gamma": f"{ratio}/s", "phi": control, "preload": control}.get(kind, "s")  # fmt: skip
        need(gain["unit"] == unit, f"{gain['name']} must be in {unit}")
        meaning = f"{ {**MEANINGS, **TIMES}[kind] } of subsystem {place} ({state})"
        need(gain["meaning"] == meaning, f"{gain['name']} means something else")


def _terms(claim: Claim, study: dict[str, Any]) -> None:
    """A law without modelling terms knows nothing but the rate of its reference."""
    modelling = study["controller"]["modelling"]
    need(len(set(modelling)) == len(modelling), "a modelling term stands twice")
    need(all(NAME.fullmatch(term) for term in modelling), "a modelling term must be a plain name")
    known = any(read.startswith("nominal.") for term in claim.law for read in reads(term))
    need(not modelling or known, "the study names modelling terms, and the law models nothing")
    for k, term in enumerate(claim.law if not modelling else []):
        allowed = {"r1"} if k == 0 and claim.first == "position" else set()
        need(reads(term) <= allowed, "the law models something, and the study names no modelling term")


def _runs(data: dict[str, Any], certified: dict[str, Fraction]) -> None:
    """Recorded runs without a fault are sound, inside what is proved, and no worse than what is said to be met."""
    study, shown = data["study"]["validation"], data["validation"]
    told = {row["name"]: row["simulated"] for row in shown["requirements"]}
    runs = [r["figures"] for s, r in zip(study["scenarios"], shown["scenarios"], strict=True) if not s["faults"]]
    runs = [run_ for run_ in runs if "met_use" not in run_ or run_["met_use"] is None or run_["met_use"] <= 1]
    runs += [shown["worst_case"]["figures"]] if shown["worst_case"] is not None else []
    for run_ in runs:
        need(run_["diverged_s"] is None and run_["maximum_error_m"] is not None, "a recorded run was lost")
        need(0 <= run_["maximum_error_m"] <= certified["tracking_error_m"], "a recorded run passes what is proved")
        need(
            run_["maximum_error_m"] <= run_["largest_error_m"] <= shown["largest_error_m"],
            "a record is not the largest",
        )
        need(0 <= run_["limit_use"] <= 1, "a recorded run passes a limit")
        for name, own in run_["members"].items():
            need(name in shown["members"], "records are of the members")
            limit = next(iter(data["study"]["plant"]["joints"][name]["limits"].values()))["value"]
            need(
                own["peak_input"] is not None and own["peak_input"] <= limit * (1 + MET),
                "a recorded input passes its limit",
            )
            for key, value in own.items():
                if isinstance(value, Fraction) and key != "energy_j":
                    need(value >= 0, f"{key} must not be negative")
            for group, before in (("peaks", "peak"), ("rms", "rms")):
                for output, unit in (("torque", "nm"), ("current", "a")):
                    met, value = told.get(f"{before}_{output}_{unit}"), own[group].get(output)
                    if met is not None and value is not None and rotary(data, name, output):
                        need(value <= met, f"a recorded run passes {before}_{output}_{unit}")


def rotary(data: dict[str, Any], name: str, output: str) -> bool:
    """Whether a member's torque is in N m: that of a sliding joint is a force, and no requirement on torque."""
    rows = next(entry["model"]["rows"] for entry in data["members"] if entry["name"] == name)
    limit = next(iter(data["study"]["plant"]["joints"][name]["limits"].values()))
    return output == "current" or any(row["unit"] == "N m" for row in rows) or limit["unit"] in ("N m", "V")


def _bundled(section: dict[str, Any]) -> None:
    """What a study left to the bundled machine is named once, and there."""
    given = section.get("bundled", [])
    known = {*section["parameters"], *section.get("ratings", {}), *(f"{name} limit" for name in section["limits"])}
    known |= {f"{name} tolerance" for name in section["parameters"]}
    need(
        len(set(given)) == len(given) and set(given) <= {*known, "stroke"}, "bundled names what the study does not have"
    )


def met(data: dict[str, Any], certified: dict[str, Fraction]) -> None:
    """Refuse requirements that are not the study's or not met, and records that the proof excludes.

    Args:
        data: The file.
        certified: What is proved, by the name of the requirement.
    """
    kept = ("member_error", "settling_band_m")
    wanted = {key: value for key, value in data["study"]["requirements"].items() if key not in kept}
    if len(data["members"]) > 1:
        wanted |= {f"member_error.{k}": v for k, v in data["study"]["requirements"]["member_error"].items()}
    rows = data["validation"]["requirements"]
    need([row["name"] for row in rows] == list(wanted), "the requirements are not those of the study")
    for row in rows:
        name, limit, seen = row["name"], number(row["required"], "required"), number(row["simulated"], "simulated")
        need(limit == number(wanted[name], name), f"{name} is required otherwise in the study")
        need(0 <= seen <= limit, f"{name} is not met by the recorded runs")
        if name in certified:
            need(row["certified"] is not None, f"{name} is proved, and the file does not say so")
            told = number(row["certified"], "certified")
            need(certified[name] <= told <= limit, f"{name} states another bound than is proved")
            need(seen <= told, f"a recorded run passes what is proved of {name}")
        else:
            need(row["certified"] is None, f"{name} is stated as proved, and is not")
    _records(data, certified)


def _records(data: dict[str, Any], certified: dict[str, Fraction]) -> None:
    """Records that the proof excludes, or that contradict each other."""
    shown, study = data["validation"], data["study"]
    late = number(shown["largest_error_after_transient_m"], "largest_error_after_transient_m")
    need(
        0 <= late <= number(shown["largest_error_m"], "largest_error_m"), "an error after the transient is the largest"
    )
    need(late <= certified["tracking_error_m"], "a recorded run passes what is proved of the output")
    need(set(shown["members"]) == {entry["name"] for entry in data["members"]}, "records are of the members")
    for entry in data["members"]:
        own = shown["members"][entry["name"]]
        need(own["unit"] == entry["model"]["rows"][0]["unit"], "a record is in the unit of its member")
        ends = [number(own[key], key) for key in ("largest_error_after_transient", "largest_error")]
        need(0 <= ends[0] <= ends[1], "an error after the transient is larger than the largest")
        bound = certified.get(f"member_error.{entry['name']}", certified["tracking_error_m"])
        need(ends[0] <= bound, f"a recorded run passes what is proved of {entry['name']}")
        watched = study["controller"].get("observer") is not None
        need(("estimates" in own) == watched, "estimates are recorded where there is an observer, and only there")
        for seen, bound in zip(own.get("estimates", []), entry["certificate"].get("observed", []), strict=False):
            inside = number(seen, "an estimate") <= number(bound, "observed")
            need(inside, f"a recorded estimate of {entry['name']} passes what is proved")
    names = [scenario["name"] for scenario in study["validation"]["scenarios"]]
    need([run["name"] for run in shown["scenarios"]] == names, "the recorded scenarios are not those of the study")
    _runs(data, certified)
    drawn, asked = shown["monte_carlo"], study["validation"]
    need(drawn is None or drawn["met"] == drawn["runs"], "a random run missed a requirement")
    need(bool(asked["monte_carlo"]) <= (drawn is not None), "the study asks for random runs, and none are recorded")
    need(
        asked["worst_case"] <= (shown["worst_case"] is not None),
        "the study asks for a worst case, and none is recorded",
    )
    count = drawn["runs"] if drawn is not None else 0
    need(count <= shown["simulated_runs"], "more random runs are recorded than runs")
    need(number(shown["integration_error_m"], "integration_error_m") >= 0, "an error must not be negative")
