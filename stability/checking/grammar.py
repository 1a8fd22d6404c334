"""Every key that a file may have, and what stands at it; whatever else stands in a file is refused.

Must fail: a key more, a key less, another kind of value, at every place of a file.
"""

from __future__ import annotations

from typing import Any

from .limits import MAX_CELLS, MAX_COEFFICIENTS, MAX_GROUPS, MAX_LEADS, MAX_MEMBERS, MAX_OPERATIONS, MAX_ORDER, MAX_ROWS
from .shape import (
    Rule,
    entry_of,
    flag,
    listed,
    maybe,
    name,
    named,
    operation,
    plain_number,
    plain_text,
    positive,
    ratio,
    share,
    some,
    target,
    text,
    unit,
    versions,
    whole,
)  # fmt: skip

MODELLING = ("mechanics", "friction", "resistance", "back_emf", "decoupling", "flow")
RANGE = entry_of({}, dict.fromkeys(("value", "min", "max"), plain_number))
SOURCE = some("table", "derived", "public", "assumed")
HASH = text
PAIR = listed(plain_number, 2, 2)
TRIPLE = listed(plain_number, 3, 3)
LIMIT = entry_of({"value": positive, "unit": unit, "source": SOURCE})
STROKES = {key: PAIR for key in ("stroke_m", "stroke_rad", "stroke_m_s", "stroke_rad_s")}
CONSTANT = entry_of({"value": plain_number, "unit": unit, "tolerance": plain_number, "source": SOURCE, "meaning": text})
DRIVE = entry_of(
    {
        "parameters": named(CONSTANT),
        "limits": named(LIMIT),
    },
    {"ratings": named(LIMIT), "least_effectiveness": plain_number, "bundled": listed(text, 0, 64), **STROKES},
)  # fmt: skip
NOTHING = named(text, 0)
COURSE = listed(PAIR, 1, 1_000)
FAULT = entry_of(
    {"share": plain_number, "start_s": plain_number, "rate_1_s": plain_number, "stuck": listed(plain_number, 0, 2)},
    {"kind": some("actuator", "bias", "noise", "frozen", "blocked"), "size": plain_number},
)
SCENARIO = {
    "name": text, "disturbances": named(COURSE), "parameters": named(plain_number), "noise": plain_number,
    "bias": plain_number, "initial": plain_number, "quantisation": plain_number, "faults": named(FAULT),
}  # fmt: skip
GROUND = {"ground": named(COURSE)}
MOTION_LIMITS = entry_of(
    {},
    {**dict.fromkeys(("speed_m_s", "acceleration_m_s2", "jerk_m_s3"), plain_number),
     **dict.fromkeys(("torque_nm", "current_a", "voltage_v"), plain_number),
     **dict.fromkeys(("speed", "acceleration", "jerk"), listed(plain_number, 1, MAX_MEMBERS))},
)  # fmt: skip

REQUIREMENTS = (
    "settling_time_s", "peak_torque_nm", "rms_torque_nm", "peak_current_a", "rms_current_a", "peak_voltage_v",
)  # fmt: skip
STUDY = entry_of(
    {
        "study": entry_of({"name": text, "publication": text, "summary": text}),
        "plant": entry_of(
            {"model": text, "parameters": NOTHING, "ratings": NOTHING, "limits": NOTHING,
             "joints": named(DRIVE, MAX_MEMBERS), "locked": named(plain_number)},
            {"body": named(CONSTANT), "shared": named(LIMIT),
             "level": name, "sensor": name, "urdf": text, "tip_m": TRIPLE, "least_lever_m_rad": plain_number},
        ),
        "uncertainty": entry_of({
            "disturbances": named(entry_of({"range": PAIR, "course": some("constant", "any"), "unit": unit},
                                           {"rate": positive}), 8),
            "noise": named(plain_number), "initial": named(plain_number),
        }, {"resolution": named(plain_number)}),
        "reference": entry_of(
            {"kind": some("quintic", "bspline"), "coordinates": some("members"),
             "waypoints": listed(listed(plain_number, 1, MAX_MEMBERS), 2, 50),
             "durations_s": listed(plain_number, 0, 49), "dwell_s": plain_number, "objective": some("time", "energy"),
             "pace": positive, "jerk_weight": share, "longest_s": positive, "spans": whole},
            {"limits": MOTION_LIMITS},
        ),
        "controller": entry_of(
            {"law": text, "modelling": listed(some(*MODELLING), 0, 8), "rate_hz": plain_number,
             "rates_hz": named(plain_number), "delay_s": share,
             "gains": NOTHING, "members": named(named(RANGE))},
            {"observer": entry_of({}, {"bandwidth_rad_s": plain_number}), "jitter_s": positive,
             "monitor": entry_of({"error": positive, "limits": named(PAIR)})},
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
                                "worst_case": flag, "scenarios": listed(entry_of(SCENARIO, GROUND), 1, 200)}),
        "sha256": HASH,
    }
)  # fmt: skip
PROGRAM = entry_of({"inputs": listed(text, 0, 200), "operations": listed(operation, 1, MAX_OPERATIONS),
                    "outputs": listed(whole, 1, 64)})  # fmt: skip
EXACT = listed(ratio, 1, MAX_ROWS)
MIDDLE: dict[str, Rule] = dict.fromkeys(("force", "drive"), listed(EXACT, 1, MAX_ROWS))
CERTIFICATE = entry_of(
    {"kind": text, "half_widths": EXACT, "input_bound": EXACT,
     "networks": listed(entry_of(dict.fromkeys(("row", "low", "high", "middle", "bound"), ratio) | {"row": name}),
                        0, MAX_ROWS),
     "split": listed(whole, 1, MAX_ROWS),
     "cells": listed(entry_of({"columns": listed(listed(ratio, 1, MAX_ORDER), 1, MAX_ORDER),
                               "blocks": listed(whole, 1, MAX_ORDER), "groups": listed(whole, 1, MAX_GROUPS),
                               "growth": ratio}, MIDDLE), 1, MAX_CELLS),
     "envelope": entry_of({"rate": ratio, "ultimate": EXACT})},
    dict.fromkeys(("guarantee", "observed"), listed(ratio, 3, 3)) | MIDDLE | {
        "parts": named(whole, MAX_ROWS), "lags": listed(name, 1, MAX_ROWS),
    },
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
            "outputs": named(entry_of({"unit": unit, "program": PROGRAM}), 8),
        }, {"leads": whole}),
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
            dict.fromkeys(("x", "r", "theta", "phi", "u", "theta_next", "phi_next"), listed(plain_number, 1, MAX_ROWS)),
            {"load": listed(plain_number, 1, 1),
             **dict.fromkeys(("lead", "lead_next"), listed(plain_number, 1, MAX_LEADS * MAX_ROWS))}), 20, 100),
    },
    {"observer": entry_of({"first": plain_number, "second": plain_number})},
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
    }, {"travel": RECORDED})),
}, {"met_use": RECORDED, "spread": RECORDED, "stopped_s": RECORDED})  # fmt: skip
VALIDATION = entry_of({
    "requirements": listed(entry_of({"name": text, "required": plain_number, "simulated": plain_number,
                                     "certified": maybe(plain_number)}), 1, 32),
    "scenarios": listed(entry_of({"name": text, "figures": FIGURES}), 1, 200),
    "worst_case": maybe(entry_of({"scenario": entry_of({**SCENARIO, "seed": whole}, GROUND), "figures": FIGURES})),
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


def shaped(data: dict[str, Any]) -> None:
    """Refuse a file with any other keys or kinds of values."""
    plain_text(data)
    FILE(data, "file")
