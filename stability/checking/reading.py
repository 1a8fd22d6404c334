"""Reads what a file says of a member, and refuses what is not the study's.

Must fail: an assumption narrower than the study, a gain outside its range, a law that reads what it cannot know, a
plant that does not feel what the study states.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

from .arithmetic import Interval, magnitude
from .claim import Claim, cell_of
from .limits import (
    CARRIED,
    MAX_CELLS,
    MAX_DELAY,
    MAX_LEADS,
    MAX_ROWS,
    NAME,
    REQUIRED,
    ROUND,
    UNIT_TEXT,
    UnreadableError,
    need,
)
from .parsing import index, number, numbers, reads, valid_program
from .reference import reference_bounds
from .statement import TIMES, stroke_of


def read(data: dict[str, Any], entry: dict[str, Any], coupled: bool) -> Claim:
    """Read and cross-check the statement about a member: study, assumptions, gains, model, certificate."""
    try:
        return _read(data, entry, coupled)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise UnreadableError(f"a part of the gain file is missing or has the wrong type: {error}") from None


def _read(data: dict[str, Any], entry: dict[str, Any], coupled: bool) -> Claim:
    study, certificate, model = data["study"], entry["certificate"], entry["model"]
    controller, section = study["controller"], study["plant"]["joints"][entry["name"]]
    law = controller["law"]
    need(law in REQUIRED, f"unknown law {law!r:.40}; known: {', '.join(REQUIRED)}")
    kind = certificate["kind"]
    need(kind in REQUIRED[law], f"unknown certificate kind {kind!r:.40}; known: {', '.join(REQUIRED[law])}")
    rows, controlled, input_map = rows_of(model)
    need(model["first"] in ("position", "speed"), "the first state is a position or a speed")
    n, m, states = len(rows), len(model["inputs"]), [row["state"] for row in rows]
    plant = valid_program(model["plant"], "the plant")
    terms = [valid_program(term, "a modelling term") for term in model["law"]]
    need(len(plant["outputs"]) == 2 * n and len(terms) == len(controlled), "the model does not fit the rows")
    assumed = assumptions(entry["assumptions"], study, section, states, coupled)
    nominal = {name: number(value, "a nominal value") for name, value in entry["nominal"].items()}
    limits = limits_of(model, section, states)
    check_names(model, plant, terms, assumed, nominal, limits, states)
    rate = number(controller.get("rates_hz", {}).get(entry["name"], controller["rate_hz"]), "rate_hz")
    watched = observer_of(controller, entry, rate, terms, rows) if rate > 0 else ()
    transient = number(study["validation"]["transient_s"], "transient_s")
    need(rate > 0 and transient >= 0, "the control rate must be positive, the transient not negative")
    split = [index(v, MAX_CELLS + 1, "split") for v in certificate["split"]]
    parts = {name: index(v, MAX_CELLS + 1, "parts") for name, v in certificate.get("parts", {}).items()}
    cut = set(parts) <= set(assumed["parameter"]) - {"effectiveness"} and min(parts.values(), default=2) > 1
    need(cut, "only ranges of constants are cut into parts, and into two or more")
    cells = [cell_of(cell, cell if parts else certificate, n, m) for cell in certificate["cells"]]
    alone = all(("force" in c, "drive" in c) == (bool(parts), bool(parts)) for c in certificate["cells"])
    need(
        alone and ("force" in certificate, "drive" in certificate) == (not parts, not parts),
        "the middles of a loop are stated once: of each cell where constants are cut, else of all",
    )
    covered = len(split) == n and min(split) >= 1 and len(cells) == math.prod([*split, *parts.values()])
    need(covered, "the cells do not cover the inertias and the constants that are cut")
    leads = index(model["leads"], MAX_LEADS + 1, "a number of leads") if "leads" in model else 0
    need(leads > 0 or "leads" not in model, "a model without leads does not name them")
    tracked = {rows[i]["target"] for i in controlled} & set(input_map)
    need(not (leads and tracked), "a row with leads is tracked by no row under the law")
    gains = gains_of(entry["gains"], controlled, input_map if leads else [], study, entry["name"])
    own = [states[i] for i, gain in zip(controlled, gains, strict=True) if gain[4] > 0]
    lags = [states.index(name) if name in states else -1 for name in certificate.get("lags", [])]
    following = all(i >= 0 and isinstance(rows[i]["target"], int) and i not in controlled for i in lags)
    need(following and len(set(lags)) == len(lags), "a lag is of a row without law that follows another")
    networks = certificate["networks"]
    need([given["row"] for given in networks] == own, "the networks are not those of the gains")
    delay = number(controller["delay_s"], "delay_s")
    need(delay * rate <= MAX_DELAY, f"a computing delay is of at most {MAX_DELAY} periods")
    jitter = number(controller.get("jitter_s", Fraction(0)), "jitter_s")
    need(0 <= jitter <= delay and 2 * jitter * rate < 1, "jitter is at most the delay, and less than half a period")
    need(not watched or gains[0][4] == 0, "a row with an observer has no load network")
    need(
        ("observed" in certificate) == bool(watched), "what an observer shows is bounded where there is one, only there"
    )
    stroke = numbers(stroke_of(section, str(rows[0]["unit"])), 2, "stroke")
    return Claim(
        name=entry["name"], rows=rows, input_map=input_map, inputs=model["inputs"], plant=plant, law=terms,
        parameters=assumed["parameter"], disturbances=assumed["disturbance"], nominal=nominal,
        reference=reference_bounds(entry["reference"]),
        noise=[magnitude(assumed["noise"][s]) for s in states],
        initial=[magnitude(assumed["initial"][s]) for s in states],
        period=1 / rate, delay=delay, gains=gains, split=split, parts=parts, cells=cells,
        half_widths=numbers(certificate["half_widths"], n, "half_widths"),
        input_bound=numbers(certificate["input_bound"], m, "input_bound"),
        demand=[(number(given["low"], "low"), number(given["high"], "high")) for given in networks],
        middle=[number(given["middle"], "middle") for given in networks],
        network_bound=[number(given["bound"], "bound") for given in networks],
        ultimate=numbers(certificate["envelope"]["ultimate"], n, "ultimate"),
        limits=limits, stroke=(stroke[0], stroke[1]), accuracy=accuracy_of(study, entry["name"]),
        transient=transient,
        feedforward={name: (v, assumed["feedforward_rate"][name]) for name, v in assumed["feedforward"].items()},
        first=model["first"], rest=rest_of(entry["reference"]["segments"], study["reference"]["dwell_s"]),
        jitter=jitter, leads=leads, lags=lags, observer=watched,
        shown=numbers(certificate["observed"], 3, "observed") if watched else [],
    )  # fmt: skip


def observer_of(
    controller: dict[str, Any], entry: dict[str, Any], rate: Fraction, terms: list[dict[str, Any]],
    rows: list[dict[str, Any]],
) -> tuple[Fraction, ...]:  # fmt: skip
    """l_1 and l_2 of a member's observer, which are those of the study's bandwidth; nothing where it has none."""
    asked = controller.get("observer")
    need(("observer" in entry) == (asked is not None), "members have an observer where the study asks for one")
    if asked is None:
        return ()
    first, second = (number(entry["observer"][key], f"the observer's {key}") for key in ("first", "second"))
    bandwidth = number(asked["bandwidth_rad_s"], "bandwidth_rad_s") if "bandwidth_rad_s" in asked else None
    need(bandwidth is None or bandwidth > 0, "an observer's bandwidth is positive")
    away = 1.0 if bandwidth is None else -math.expm1(-float(bandwidth / rate))
    wanted = away * (2 - away), away**2 * float(rate)
    close = all(abs(float(g) - w) <= 1e-6 * w for g, w in zip((first, second), wanted, strict=True))
    need(close and 0 < first <= 1 and second > 0, "the observer's gains are not those of its bandwidth")
    good = len(rows) > 1 and rows[1]["target"] == 0 and rows[0]["controlled"]
    need(good, "an observer estimates the first state and the one that answers to it")
    speed = [terms[0]["operations"][k] for k in terms[0]["outputs"]]
    need(speed == [["input", "r1"]], "an observer is around the reference: the first modelling term must be its speed")
    return first, second


def rest_of(segments: list[dict[str, Any]], pause: Any) -> tuple[Fraction, Fraction]:
    """Where the reference rests at first and for how long; that it does, `course.follows` decides."""
    if not number(pause, "dwell_s") > 0:
        return Fraction(0), Fraction(0)
    knots = [number(v, "a knot") for v in segments[0]["knots"]]
    return number(segments[0]["coefficients"][0], "a coefficient"), knots[-1] - knots[0]


def rows_of(model: dict[str, Any]) -> tuple[list[dict[str, Any]], list[int], list[int]]:
    """The subsystems, indices of those with gains, and the row of each input."""
    rows = model["rows"]
    n, m = len(rows), len(model["inputs"])
    need(1 <= n <= MAX_ROWS and 1 <= m <= n, f"1 to {MAX_ROWS} rows are needed: got {n}")
    for i, row in enumerate(rows):
        target = row["target"]
        if isinstance(target, dict):
            need(row["controlled"] is False, "a row under the law tracks the reference, zero, or a row")
            row["target"] = {name: number(share, "a row's target") for name, share in target.items()}
        elif target == "balance":
            need(row["controlled"] is False, "a row under the law tracks the reference, zero, or a row")
        elif target not in ("reference", "zero"):
            row["target"] = index(target, i, "a row's target")
            need(rows[row["target"]]["controlled"] is True, "a row's target must be a controlled row")
        need(
            isinstance(row["controlled"], bool) and isinstance(row["state"], str), "a row needs a state and controlled"
        )
        need(printable(row["unit"]), "a row's unit must be printable text")
    need(rows[0]["target"] == "reference", "the first row must track the reference")
    controlled = [i for i, row in enumerate(rows) if row["controlled"]]
    input_map = [index(d, n, "an input's row") for d in model["input_map"]]
    good = len(input_map) == m and all(rows[d]["controlled"] for d in input_map)
    need(good, "each input must be the control of a controlled row")
    return rows, controlled, input_map


def limits_of(model: dict[str, Any], section: dict[str, Any], states: list[str]) -> list[dict[str, Any]]:
    """The study's limits on the signals that the model names for each; the first is the amplitude limit."""
    limits, given = model["limits"], section["limits"]
    known = {*states, *model["inputs"]}
    need(limits and [x["name"] for x in limits] == list(given), "the limits of the model are not those of the study")
    need(all(x["signals"] and set(x["signals"]) <= known for x in limits), "a limit names an unknown signal")
    need(all(printable(value["unit"]) for value in given.values()), "a limit's unit must be printable text")
    need(set(limits[0]["signals"]) == set(model["inputs"]), "the first limit must be the amplitude limit of the inputs")
    return [
        {"name": x["name"], "signals": x["signals"], "unit": given[x["name"]]["unit"],
         "value": number(given[x["name"]]["value"], "a limit")}
        for x in limits
    ]  # fmt: skip


def check_names(
    model: dict[str, Any], plant: dict[str, Any], terms: list[dict[str, Any]], assumed: dict[str, dict[str, Interval]],
    nominal: dict[str, Fraction], limits: list[dict[str, Any]], states: list[str],
) -> None:  # fmt: skip
    """Refuse a model that reads what has no assumption, or a law that reads what a controller cannot know."""
    parameters = assumed["parameter"]
    inertias = reads(plant, plant["outputs"][: len(states)])
    need(inertias <= set(parameters) - {"effectiveness"}, "an inertia depends on more than constant parameters")
    signals = ["r0", "r1", "r2", "r3", "constant"]
    listed = [*states, *model["inputs"], *parameters, *assumed["disturbance"], *signals]
    for name in (*listed, *nominal, *(str(limit["name"]) for limit in limits)):
        need(isinstance(name, str) and NAME.fullmatch(name) is not None, "a name must be a plain identifier")
    need(len(set(listed)) == len(listed), "a name stands for two different signals")
    need(reads(plant) <= set(listed) - set(signals), "the plant reads a name without an assumption")
    unread = {*parameters, *assumed["disturbance"]} - reads(plant)
    need(not unread, f"the plant does not use {', '.join(sorted(unread))}, which the study states")
    foreseen = {*nominal, *assumed["feedforward"]}
    for term in terms:  # r3, the jerk, has no bounded rate
        allowed = {*states, "r0", "r1", "r2", *(f"nominal.{name}" for name in foreseen)}
        need(reads(term) <= allowed, "a modelling term reads what a controller cannot know")


def gains_of(
    entries: list[dict[str, Any]], controlled: list[int], led: list[int], study: dict[str, Any], name: str
) -> list[tuple[Fraction, ...]]:
    """β, ε, δ, σ, γ, Φ, φ̂(0), a and f of each controlled row, inside the ranges of the file and of the study."""
    kinds = ("beta", "epsilon", "delta", "sigma", "gamma", "phi", "preload")
    given = {entry["name"]: number(entry["value"], entry["name"]) for entry in entries}
    names = [f"{kind}_{k + 1}" for k in range(len(controlled)) for kind in kinds]
    names += [f"{kind}_{k + 1}" for k, row in enumerate(controlled) if row in led for kind in TIMES]
    need(set(given) == set(names) and len(entries) == len(names), "the gains do not fit the subsystems")
    gains = [tuple(given.get(f"{kind}_{k + 1}", Fraction(0)) for kind in (*kinds, *TIMES))
             for k in range(len(controlled))]  # fmt: skip
    good = all(b > 0 and e >= 0 and d > 0 and s > 0 and g >= 0 and phi >= abs(p) * (g > 0) >= 0 <= min(times)
               for b, e, d, s, g, phi, p, *times in gains)  # fmt: skip
    need(good, "gains must be positive, and a preload inside phi")
    ranges = study["controller"]["members"][name]
    need(set(ranges) == set(names), f"the ranges of the gains of {name} are not those of its gains")
    fixed = all(set(r) in ({"value"}, {"min", "max"}) for r in ranges.values())
    need(fixed, "a gain has either a value, or min and max")
    for entry in entries:
        key, value = entry["name"], given[entry["name"]]
        wanted = ranges[key]
        low, high = wanted.get("value", wanted.get("min")), wanted.get("value", wanted.get("max"))
        need((low, high) == (entry["min"], entry["max"]), f"the range of {key} is not the study's")
        need(number(low, key) <= value <= number(high, key), f"{key} is outside the range of the study")
    return gains


def accuracy_of(study: dict[str, Any], name: str) -> Fraction:
    """The required bound on a member's error: its own, or where it is the only one that of the machine."""
    own = study["requirements"].get("member_error", {})
    need(name in own or len(study["plant"]["joints"]) == 1, f"the study requires no error of {name}")
    return number(own.get(name, study["requirements"]["tracking_error_m"]), "the required error")


def assumptions(
    entries: list[dict[str, Any]], study: dict[str, Any], section: dict[str, Any], states: list[str], coupled: bool
) -> dict[str, dict[str, Interval]]:
    """The assumptions by kind; each must cover what the study states.

    What a coupling does to a member is decided by obligations of its own.
    """
    kinds = ("parameter", "disturbance", "noise", "initial", "feedforward", "feedforward_rate")
    found: dict[str, dict[str, Interval]] = {kind: {} for kind in kinds}
    for entry in entries:
        kind, _, name = entry["name"].partition(".")
        bounds = number(entry["lower"], entry["name"]), number(entry["upper"], entry["name"])
        need(kind in found and name not in found[kind], f"unknown or doubled assumption {entry['name']!r:.60}")
        need(bounds[0] <= bounds[1], f"{entry['name']}: lower > upper")
        found[kind][name] = bounds
    need(
        set(found["noise"]) == set(found["initial"]) == set(states), "noise and initial errors are those of the states"
    )
    foreseen = set(found["feedforward"])
    need(foreseen == set(found["feedforward_rate"]), "a foreseen disturbance needs a range and a range of its rate")
    need(foreseen <= set(found["disturbance"]), "what has a rate must be a disturbance")
    stated = stated_ranges(study, section, states, coupled)
    carried = {name for name in found["parameter"] if coupled and name in CARRIED}
    listed = {name for kind, name, _, _ in stated if kind == "parameter"}
    need(listed == set(found["parameter"]) - carried, "the parameters are not those of the study")
    for kind, name, low, high in stated:
        need(name in found[kind], f"the assumption {kind}.{name} is missing")
        bounds = found[kind][name]
        need(low <= high, f"the study's range of {name} is upside down")
        need(bounds[0] <= low and high <= bounds[1], f"the assumption {kind}.{name} is narrower than the study's")
        room = ROUND * max(abs(low), abs(high))
        need(low - bounds[0] <= room and bounds[1] - high <= room, f"the assumption {kind}.{name} is not the study's")
    if not coupled:
        disturbed = {name for kind, name, _, _ in stated if kind == "disturbance"}
        need(disturbed == set(found["disturbance"]), "the disturbances are not those of the study")
        rated = {name for kind, name, _, _ in stated if kind == "feedforward"}
        need(rated == foreseen, "the disturbances with a rate are not those of the study")
    return found


def stated_ranges(
    study: dict[str, Any], section: dict[str, Any], states: list[str], coupled: bool
) -> list[tuple[str, str, Fraction, Fraction]]:
    """Kind, name and range of everything that the study states of a member."""
    uncertainty, stated = study["uncertainty"], []
    for name, entry in section["parameters"].items():
        value = number(entry["value"], name)
        spread = abs(value) * number(entry["tolerance"], name)
        stated.append(("parameter", name, value - spread, value + spread))
    if "least_effectiveness" in section:
        least = number(section["least_effectiveness"], "least_effectiveness")
        need(0 <= least <= 1, "an actuator delivers between nothing and all of its torque")
        stated.append(("parameter", "effectiveness", least, Fraction(1)))
    for name, entry in {} if coupled else uncertainty["disturbances"].items():
        low, high = numbers(entry["range"], 2, name)
        if "rate" not in entry:
            stated.append(("disturbance", name, low, high))
            continue
        rate = number(entry["rate"], f"the rate of {name}")
        need(rate > 0, f"the rate of {name} must be positive")
        stated += [("disturbance", name, Fraction(0), Fraction(0)), ("feedforward", name, low, high),
                   ("feedforward_rate", name, -rate, rate)]  # fmt: skip
    observed = study["controller"].get("observer") is not None
    for kind in ("noise", "initial"):
        given = uncertainty.get(kind, {})
        for k, state in enumerate(states):
            need(state in given, f"the study does not say {kind} of {state}")
            value = number(given[state], f"{kind} of {state}")
            need(value >= 0, f"{kind} of {state} must not be negative")
            if kind == "noise" and "resolution" in uncertainty:
                step = number(uncertainty["resolution"].get(state, Fraction(0)), f"the resolution of {state}")
                need(step >= 0, f"the resolution of {state} must not be negative")
                value += step / 2
            need(not (kind == "noise" and k == 1 and observed) or value == 0, f"{state} is estimated, not measured")
            stated.append((kind, state, -value, value))
    return stated


def printable(unit: Any) -> bool:
    """Whether it is a unit and nothing else."""
    return isinstance(unit, str) and UNIT_TEXT.fullmatch(unit) is not None
