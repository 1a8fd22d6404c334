"""Every key that a file may have, and what stands at it; whatever else stands in a file is refused.

Must fail: unknown or missing keys, numbers as text, text that is no plain text, more entries than a file of ours has.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from .limits import (
    MAX_CELLS,
    MAX_COEFFICIENTS,
    MAX_MEMBERS,
    MAX_OPERATIONS,
    MAX_ROWS,
    NAME,
    UNIT_TEXT,
    UnreadableError,
    need,
)

#: Refuses a value at a place of the file that it does not fit.
Rule = Callable[[Any, str], None]


def entry_of(fixed: dict[str, Rule], optional: dict[str, Rule] | None = None) -> Rule:
    """An object with these keys, and none but them."""
    may = optional or {}

    def rule(value: Any, where: str) -> None:
        need(isinstance(value, dict), f"{where} must be an object")
        for key in value:
            need(key in fixed or key in may, f"unknown key {where}.{key!r:.40}")
        for key in fixed:
            need(key in value, f"{where}.{key} is missing")
        for key, part in value.items():
            (fixed.get(key) or may[key])(part, f"{where}.{key}")

    return rule


def named(part: Rule, largest: int = 64) -> Rule:
    """An object with names for keys."""

    def rule(value: Any, where: str) -> None:
        need(isinstance(value, dict) and len(value) <= largest, f"{where} must be an object of at most {largest}")
        for key, inner in value.items():
            need(all(NAME.fullmatch(word) for word in key.split(".")), f"a key of {where} must be a plain name")
            part(inner, f"{where}.{key}")

    return rule


def listed(part: Rule, low: int, high: int) -> Rule:
    """A list."""

    def rule(value: Any, where: str) -> None:
        good = isinstance(value, list) and low <= len(value) <= high
        need(good, f"{where} must list {low} to {high} entries" if low < high else f"{where} must list {low} entries")
        for k, inner in enumerate(value):
            part(inner, f"{where}[{k}]")

    return rule


def some(*words: str) -> Rule:
    """One of some words."""

    def rule(value: Any, where: str) -> None:
        need(isinstance(value, str) and value in words, f"{where} must be one of {', '.join(words)}: got {value!r:.40}")

    return rule


def maybe(part: Rule) -> Rule:
    """Null or a value."""

    def rule(value: Any, where: str) -> None:
        if value is not None:
            part(value, where)

    return rule


def plain_number(value: Any, where: str) -> None:
    """A JSON number."""
    need(isinstance(value, Fraction), f"{where} must be a number: got {value!r:.40}")


def positive(value: Any, where: str) -> None:
    """A number above zero."""
    need(isinstance(value, Fraction) and value > 0, f"{where} must be a number above 0: got {value!r:.40}")


def share(value: Any, where: str) -> None:
    """A number that is not negative."""
    need(isinstance(value, Fraction) and value >= 0, f"{where} must be a number from 0 on: got {value!r:.40}")


def whole(value: Any, where: str) -> None:
    """A whole number that is not negative."""
    good = isinstance(value, Fraction) and value.denominator == 1 and value >= 0
    need(good, f"{where} must be a whole number: got {value!r:.40}")


def ratio(value: Any, where: str) -> None:
    """An exact number, as text."""
    need(isinstance(value, str), f"{where} must be an exact number in a string: got {value!r:.40}")


def flag(value: Any, where: str) -> None:
    """True or false."""
    need(isinstance(value, bool), f"{where} must be true or false: got {value!r:.40}")


def text(value: Any, where: str) -> None:
    """A line of text."""
    need(isinstance(value, str) and len(value) <= 400, f"{where} must be a line of text")


def name(value: Any, where: str) -> None:
    """A plain identifier."""
    need(
        isinstance(value, str) and NAME.fullmatch(value) is not None, f"{where} must be a plain name: got {value!r:.40}"
    )


def unit(value: Any, where: str) -> None:
    """A unit and nothing else."""
    good = isinstance(value, str) and UNIT_TEXT.fullmatch(value) is not None
    need(good, f"{where} must be a unit: got {value!r:.40}")


def target(value: Any, where: str) -> None:
    """What a row tracks."""
    if not isinstance(value, Fraction):
        some("reference", "zero")(value, where)


def operation(value: Any, where: str) -> None:
    """An operator with its arguments; `parsing` reads them."""
    need(isinstance(value, list) and 2 <= len(value) <= 3, f"{where} must be an operation")


def versions(value: Any, where: str) -> None:
    """Versions of packages by name."""
    need(isinstance(value, dict) and len(value) <= 32, f"{where} must be an object")
    for package, version in value.items():
        text(package, where)
        text(version, where)


MODELLING = ("mechanics", "friction", "resistance", "back_emf", "decoupling")
RANGE = entry_of({}, dict.fromkeys(("value", "min", "max"), plain_number))
SOURCE = some("table", "derived", "public", "assumed")
HASH = text
PAIR = listed(plain_number, 2, 2)
TRIPLE = listed(plain_number, 3, 3)
LIMIT = entry_of({"value": positive, "unit": unit, "source": SOURCE})
STROKES = {key: PAIR for key in ("stroke_m", "stroke_rad", "stroke_m_s", "stroke_rad_s")}
DRIVE = entry_of(
    {
        "parameters": named(entry_of({"value": plain_number, "unit": unit, "tolerance": plain_number,
                                      "source": SOURCE, "meaning": text})),
        "limits": named(LIMIT),
    },
    {"ratings": named(LIMIT), "least_effectiveness": plain_number, "bundled": listed(text, 0, 64), **STROKES},
)  # fmt: skip
NOTHING = named(text, 0)
COURSE = listed(PAIR, 1, 1_000)
FAULT = entry_of({"share": plain_number, "start_s": plain_number, "rate_1_s": plain_number,
                  "stuck": listed(plain_number, 0, 2)})  # fmt: skip
SCENARIO = {
    "name": text, "disturbances": named(COURSE), "parameters": named(plain_number), "noise": plain_number,
    "bias": plain_number, "initial": plain_number, "quantisation": plain_number, "faults": named(FAULT),
}  # fmt: skip
MOTION_LIMITS = entry_of(
    dict.fromkeys(("speed_m_s", "acceleration_m_s2", "jerk_m_s3"), plain_number),
    dict.fromkeys(("torque_nm", "current_a", "voltage_v"), plain_number),
)
REQUIREMENTS = (
    "settling_time_s", "peak_torque_nm", "rms_torque_nm", "peak_current_a", "rms_current_a", "peak_voltage_v",
)  # fmt: skip
STUDY = entry_of(
    {
        "study": entry_of({"name": text, "publication": text, "summary": text}),
        "plant": entry_of(
            {"model": text, "parameters": NOTHING, "ratings": NOTHING, "limits": NOTHING,
             "joints": named(DRIVE, MAX_MEMBERS), "locked": named(plain_number)},
            {"level": name, "urdf": text, "tip_m": TRIPLE, "least_lever_m_rad": plain_number},
        ),
        "uncertainty": entry_of({
            "disturbances": named(entry_of({"range": PAIR, "course": some("constant", "any"), "unit": unit}), 8),
            "noise": named(plain_number), "initial": named(plain_number),
        }),
        "reference": entry_of(
            {"kind": some("quintic", "bspline"), "coordinates": some("members"),
             "waypoints": listed(listed(plain_number, 1, MAX_MEMBERS), 2, 50),
             "durations_s": listed(plain_number, 0, 49), "dwell_s": plain_number, "objective": some("time", "energy"),
             "pace": positive, "jerk_weight": share, "longest_s": positive, "spans": whole},
            {"limits": MOTION_LIMITS},
        ),
        "controller": entry_of(
            {"law": text, "modelling": listed(some(*MODELLING), 0, 8), "rate_hz": plain_number,
             "rates_hz": named(plain_number),
             "gains": NOTHING, "members": named(named(RANGE))},
            {"observer": entry_of(dict.fromkeys(("bandwidth_rad_s", "largest", "epsilon", "sigma"), plain_number))},
        ),
        "requirements": entry_of(
            {"tracking_error_m": plain_number, "member_error": named(plain_number)},
            dict.fromkeys((*REQUIREMENTS, "settling_band_m"), positive),
        ),
        "tuning": entry_of(
            {"method": some("jaya", "tlbo", "random", "gradient"), "population": whole, "iterations": whole,
             "seed": whole,
             "weights": entry_of(dict.fromkeys(("rms_error", "certified_bound", "itae", "effort"), share))},
            {"seconds": positive},
        ),
        "validation": entry_of({"transient_s": plain_number, "monte_carlo": whole, "falsify": whole,
                                "worst_case": flag, "scenarios": listed(entry_of(SCENARIO), 1, 200)}),
        "sha256": HASH,
    }
)  # fmt: skip
PROGRAM = entry_of({"inputs": listed(text, 0, 200), "operations": listed(operation, 1, MAX_OPERATIONS),
                    "outputs": listed(whole, 1, 64)})  # fmt: skip
EXACT = listed(ratio, 1, MAX_ROWS)
CERTIFICATE = entry_of(
    {"kind": text, "decay": ratio, "half_widths": EXACT, "input_bound": EXACT,
     "envelope": entry_of({"rate": ratio, "ultimate": EXACT})},
    {"guarantee": listed(ratio, 3, 3), "weights": EXACT, "young": EXACT, "leak": EXACT,
     "split": listed(whole, 1, MAX_ROWS),
     "cells": listed(entry_of({"transform": listed(EXACT, 1, MAX_ROWS), "reach": EXACT, "start": EXACT,
                               "shape": EXACT}), 1, MAX_CELLS)},
)  # fmt: skip
MEMBER = entry_of(
    {
        "name": name,
        "model": entry_of({
            "rows": listed(entry_of({"state": name, "unit": unit, "target": target, "controlled": flag}), 1, MAX_ROWS),
            "input_map": listed(whole, 1, MAX_ROWS), "inputs": listed(name, 1, MAX_ROWS), "plant": PROGRAM,
            "law": listed(PROGRAM, 1, MAX_ROWS),
            "limits": listed(entry_of({"name": name, "signals": listed(name, 1, MAX_ROWS)}), 1, 16),
            "first": some("position", "speed"),
        }),
        "nominal": named(plain_number),
        "gains": listed(entry_of({"name": name, "value": plain_number, "unit": text, "min": plain_number,
                                  "max": plain_number, "meaning": text}), 1, 64),
        "assumptions": listed(entry_of({"name": text, "lower": plain_number, "upper": plain_number, "unit": unit,
                                        "source": text}), 1, 128),
        "reference": entry_of({
            "segments": listed(entry_of({"degree": whole, "knots": listed(plain_number, 12, MAX_COEFFICIENTS + 6),
                                         "coefficients": listed(plain_number, 6, MAX_COEFFICIENTS)}), 1, 200),
            "derivative_bounds": listed(entry_of({"name": name, "unit": unit, "lower": plain_number,
                                                  "upper": plain_number}), 4, 4),
            "sha256": HASH,
        }),
        "certificate": CERTIFICATE,
        "golden": listed(entry_of(
            {key: listed(plain_number, 1, MAX_ROWS) for key in ("x", "r", "theta", "u", "theta_next")},
            {"load": listed(plain_number, 1, 1)}), 20, 100),
    },
    {"observer": entry_of({"first": plain_number, "second": plain_number, "pole": plain_number})},
)  # fmt: skip
COUPLING = entry_of({"members": listed(name, 1, MAX_MEMBERS), "loads": PROGRAM, "place": PROGRAM, "halvings": whole,
                     "envelope": entry_of({"output": ratio})})  # fmt: skip
OBLIGATION = entry_of(
    {"name": text, "member": text, "verdict": some("proved")}, {"statement": text, "margin": plain_number, "unit": text}
)
RECORDED = maybe(plain_number)
FIGURES = entry_of({
    **dict.fromkeys(("maximum_error_m", "largest_error_m", "rms_error_m", "settling_time_s", "itae", "limit_use",
                     "diverged_s"), RECORDED),
    "members": named(entry_of({
        **dict.fromkeys(("largest_error", "maximum_error", "rms_error", "limit_use", "peak_input", "energy_j"),
                        RECORDED),
        "peaks": named(RECORDED), "rms": named(RECORDED), "estimates": listed(RECORDED, 0, 2),
    })),
})  # fmt: skip
VALIDATION = entry_of({
    "requirements": listed(entry_of({"name": text, "required": plain_number, "simulated": plain_number,
                                     "certified": maybe(plain_number)}), 1, 32),
    "scenarios": listed(entry_of({"name": text, "figures": FIGURES}), 1, 200),
    "worst_case": maybe(entry_of({"scenario": entry_of({**SCENARIO, "seed": whole}), "figures": FIGURES})),
    "monte_carlo": maybe(entry_of({"runs": whole, "met": whole})),
    "simulated_runs": whole, "integration_error_m": plain_number, "largest_error_m": plain_number,
    "largest_error_after_transient_m": plain_number,
    "members": named(entry_of(
        {"largest_error": plain_number, "largest_error_after_transient": plain_number, "unit": unit},
        {"estimates": listed(plain_number, 2, 2)})),
})  # fmt: skip
PROVENANCE = entry_of(
    {}, {"versions": versions, "seed": whole, "budget": some("quick", "full"), "evaluations": whole,
         "search_runs": whole, "wall_time_s": plain_number, "threads": whole, "cpus": maybe(whole)},
)  # fmt: skip
FILE = entry_of({
    "schema": text, "study": STUDY, "members": listed(MEMBER, 1, MAX_MEMBERS), "couplings": listed(COUPLING, 0, 1),
    "obligations": listed(OBLIGATION, 0, 200), "validation": VALIDATION, "provenance": PROVENANCE, "sha256": HASH,
})  # fmt: skip


def plain_text(value: Any) -> None:
    """Refuse control characters, lone surrogates and other text that a terminal does not print as it stands."""
    if isinstance(value, dict):
        for key, part in value.items():
            plain_text(key)
            plain_text(part)
    elif isinstance(value, list):
        for part in value:
            plain_text(part)
    elif isinstance(value, str) and not value.isprintable():
        raise UnreadableError(f"a text of the file is not plain text: {value!a:.60}")


def shaped(data: dict[str, Any]) -> None:
    """Refuse a file with any other keys or kinds of values."""
    plain_text(data)
    FILE(data, "file")
