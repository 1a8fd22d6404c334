"""Gain files: building, writing and reading them."""

from __future__ import annotations

import json
from decimal import ROUND_CEILING, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from stability import Certificate, Composition, Gains, Sampled, checker
from trajectories import Reference, Spline

from .axis import KINDS, Axis
from .control import gain_columns
from .errors import InvalidInputError
from .problem import Problem, resolved
from .simulation import scenarios

#: Schema of what a refused design leaves behind.
REJECTED = "hdmm-opt/rejected/1"
#: Significant digits of the certificate's rationals.
DIGITS = 9
GOLDEN_VECTORS = 24
_MEANING = {
    "beta": "proportional gain",
    "epsilon": "adaptation gain",
    "delta": "adaptation rate",
    "sigma": "leakage of the adaptation",
}


def build(
    problem: Problem,
    gains: tuple[Gains, ...],
    found: Certificate,
    validation: dict[str, Any],
    provenance: dict[str, Any],
) -> dict[str, Any]:
    """The document of a design, without its obligations and hashes; see `seal`."""  # fmt: skip
    return {
        "schema": checker.SCHEMA,
        "study": resolved(problem),
        "controller": controller_data(problem, problem.study.controller.rate_hz),
        "gains": gains_data(problem, gains),
        "reference": reference_data(problem.reference),
        "assumptions": assumptions_data(problem),
        "certificate": certificate_data(problem, found),
        "obligations": [],
        "validation": validation,
        "golden": {"vectors": golden_vectors(problem, gains)},
        "provenance": provenance,
    }


def seal(document: dict[str, Any]) -> dict[str, Any]:
    """Add the hashes of the study, the reference and the whole."""
    sealed = dict(document)
    for part in ("study", "reference"):
        section = {key: value for key, value in sealed[part].items() if key != "sha256"}
        sealed[part] = {**section, "sha256": checker.digest(section)}
    sealed.pop("sha256", None)
    sealed["sha256"] = checker.digest(sealed, "provenance")
    return sealed


def prove(document: dict[str, Any]) -> tuple[dict[str, Any], checker.Report]:
    """Fill in the obligations with the checker's verdicts, seal, and check the finished text."""
    required = checker.REQUIRED[document["controller"]["law"]][document["certificate"]["kind"]]
    draft = {**document, "obligations": [{"name": name, "verdict": "proved"} for name in required]}
    report = checker.check_text(to_text(seal(draft)))
    entries = [
        {"name": o.name, "statement": o.statement, "margin": o.margin, "unit": o.unit, "verdict": o.verdict}
        for o in report.obligations
    ]
    finished = seal({**document, "obligations": entries})
    return finished, checker.check_text(to_text(finished)) if report.status == 0 else report


def to_text(document: dict[str, Any]) -> str:
    """JSON text; floats round-trip, no NaN."""
    return json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def read(path: Path) -> dict[str, Any]:
    """Read a gain file, or what a refused design left behind, that matches its hashes and schema.

    Raises:
        InvalidInputError: one line on what is wrong with the file.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise InvalidInputError(f"{path}: cannot read the gain file: {reason}; check the path") from None
    try:
        data = checker.parse(text)
        if data.get("schema") != REJECTED:
            checker.need(data.get("schema") == checker.SCHEMA, checker.wrong_schema(data.get("schema")))
            checker.check_digests(text)
    except checker.UnreadableError as error:
        raise InvalidInputError(f"{path}: unreadable: {error}") from None
    return json.loads(text)


def gains_of(document: dict[str, Any]) -> tuple[Gains, ...]:
    """The gains of a document, one for each governed row."""
    values = {entry["name"]: float(entry["value"]) for entry in document["gains"]}
    count = len(values) // len(KINDS)
    return tuple(Gains(**{kind: values[f"{kind}_{k + 1}"] for kind in KINDS}) for k in range(count))


def ball_of(document: dict[str, Any]) -> float:
    """The certified bound on the tracking error after the transient, m."""
    return float(Fraction(document["certificate"]["envelope"]["ball"][0]))


def reference_of(document: dict[str, Any]) -> Reference:
    """The reference of a document.

    Raises:
        InvalidInputError: segments that do not join.
    """
    try:
        return Reference(
            segments=tuple(
                Spline(knots=np.array(s["knots"], dtype=float), coefficients=np.array(s["coefficients"], dtype=float))
                for s in document["reference"]["segments"]
            )
        )
    except ValueError as error:
        raise InvalidInputError(f"reference: {error}; write the file again with design") from None


def reference_data(reference: Reference) -> dict[str, Any]:
    """The `reference` section."""
    names = (("position", "m"), ("speed", "m/s"), ("acceleration", "m/s^2"), ("jerk", "m/s^3"))
    return {
        "segments": [
            {"degree": 5, "knots": s.knots.tolist(), "coefficients": s.coefficients.tolist()}
            for s in reference.segments
        ],
        "derivative_bounds": [
            {"name": name, "unit": unit, "lower": low, "upper": high}
            for (name, unit), (low, high) in zip(names, reference.bounds(), strict=True)
        ],
    }


def golden_vectors(problem: Problem, gains: tuple[Gains, ...]) -> list[dict[str, Any]]:
    """Inputs and outputs of one control period along the first scenario, so that a port can be tested."""
    trace = problem.loop.run(gains, problem.reference, scenarios(problem.study)[0])
    law = problem.law.step_function(problem.bounds.period)
    nominal, load = list(problem.plant.values().values()), problem.loop.nominal_load
    vectors = []
    for k in np.linspace(0, trace.t.size - 1, GOLDEN_VECTORS).astype(int):
        x, r, theta = trace.x[:, k], trace.r[:, k], trace.theta[:, k]
        u, following, _ = law(x, r, theta, np.array(gain_columns(gains)), nominal, load)
        columns = {"x": x, "r": r, "theta": theta, "u": np.array(u).ravel(), "theta_next": np.array(following).ravel()}
        vectors.append({key: [float(v) for v in values] for key, values in columns.items()})
    return vectors


def controller_data(axis: Axis, rate: float) -> dict[str, Any]:
    """The `controller` section of an axis at a rate, Hz."""
    return {
        "law": "rac",
        "modelling": list(axis.law.modelling),
        "rate_hz": rate,
        "period_s": axis.bounds.period,
        "subsystems": [
            {"state": row.state, "unit": row.unit, "tracks": row.target, "governed": row.governed}
            for row in axis.law.rows
        ],
        "nominal": dict(axis.bounds.nominal),
    }


def gains_data(axis: Axis, gains: tuple[Gains, ...]) -> list[dict[str, Any]]:
    """The `gains` section."""
    values = [getattr(g, kind) for g in gains for kind in KINDS]
    entries = []
    for value, item in zip(values, axis.ranges, strict=True):
        kind, _, subsystem = item.name.partition("_")
        state = axis.plant.states[axis.law.governed[int(subsystem) - 1]]
        entries.append({
            "name": item.name, "value": value, "unit": item.unit, "min": item.low, "max": item.high,
            "meaning": f"{_MEANING[kind]} of subsystem {subsystem} ({state})", "dtype": "float32",
        })  # fmt: skip
    return entries


def assumptions_data(axis: Axis) -> list[dict[str, Any]]:
    """The `assumptions` section."""
    bounds, plant = axis.bounds, axis.plant
    entries = []
    for name, p in plant.parameters.items():
        interval = bounds.parameters[name]
        entries.append((f"parameter.{name}", interval.low, interval.high, p.unit, p.source))
    for name, interval in bounds.disturbances.items():
        entries.append((f"disturbance.{name}", interval.low, interval.high, plant.load_unit, "study"))
    for name, (value, rate) in bounds.feedforward.items():
        entries.append((f"feedforward.{name}", value.low, value.high, plant.load_unit, "study"))
        entries.append((f"feedforward_rate.{name}", rate.low, rate.high, f"{plant.load_unit}/s", "study"))
    for kind, values in (("noise", bounds.noise), ("initial", bounds.initial)):
        for state, unit, value in zip(plant.states, plant.state_units, values, strict=True):
            entries.append((f"{kind}.{state}", -value, value, unit, "study"))
    keys = ("name", "lower", "upper", "unit", "source")
    return [dict(zip(keys, entry, strict=True)) for entry in entries]


def certificate_data(axis: Axis, found: Certificate) -> dict[str, Any]:
    """The `certificate` section."""
    composed = isinstance(found, Composition)
    data: dict[str, Any] = {
        "kind": "composition" if composed else "sampled",
        "model": axis.model.to_data(),
        "decay": short(found.decay),
        "radii": [short(v, up=True) for v in found.radii],
        "held": [short(v, up=True) for v in found.held],
        "envelope": {
            "initial": [short(v, up=True) for v in axis.bounds.initial],
            "rate": short((0.4999999 if composed else 0.9999999) * found.decay),
            "ball": [short(v * (1 + 1e-5), up=True) for v in found.ball],
        },
    }
    vectors = checker.VECTORS[data["kind"]]
    if isinstance(found, Sampled):
        data["split"] = list(found.split)
        data["cells"] = [
            {
                "transform": [[short(v) for v in row] for row in cell.transform],
                **{name: [short(v) for v in getattr(cell, name)] for name in vectors},
            }
            for cell in found.cells
        ]
        return data
    return data | {name: [short(v) for v in getattr(found, name)] for name in vectors}


def short(value: float, *, up: bool = False) -> str:
    """A short rational near a float, as "p/q" text; not below it where `up`."""
    context = Context(prec=DIGITS, rounding=ROUND_CEILING if up else ROUND_HALF_EVEN)
    return str(Fraction(context.create_decimal(Decimal(value))))
