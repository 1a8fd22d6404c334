"""A design study over parameters: one design for every point of a grid, here, in processes or on a cluster."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ..errors import InvalidInputError
from ..files.read import certified_of
from ..files.result import Design
from ..files.sections import named_gains
from ..files.state import Journal
from ..machines.registry import model
from ..names import nearest
from ..study import Study, validated
from ..study.sections import LARGEST as LARGEST_NUMBER
from .options import Options, Progress
from .pipeline import design
from .workers import workers

SCHEMA = "hdmm-opt/sweep/1"
#: Designs of one sweep.
LARGEST = 10_000


@dataclass(frozen=True, kw_only=True)
class Axis:
    """A number of the study that is varied.

    Attributes:
        key: Its place in the study file, with dots; an index in a list counts from 0.
        values: What it becomes.
    """

    key: str
    values: tuple[float, ...]


def axis(text: str) -> Axis:
    """An axis from ``key=a:b:n``, n values from a to b, or ``key=a,b,c``.

    Raises:
        InvalidInputError: the text is neither.
    """
    key, _, given = text.partition("=")
    try:
        if ":" in given:
            low, high, count = given.split(":")
            ends = (float(low), float(high))
            if not all(abs(end) <= LARGEST_NUMBER for end in ends) or int(count) > LARGEST:
                raise InvalidInputError(
                    f"--vary takes at most {LARGEST} values within ±{LARGEST_NUMBER:g}: got {text}; vary less"
                )
            values = [float(f"{v:.12g}") for v in np.linspace(*ends, int(count))]
        else:
            values = [float(part) for part in given.split(",")]
    except ValueError:
        values = []
    if not key or not values or not all(map(math.isfinite, values)) or len(set(values)) < len(values):
        raise InvalidInputError(
            f'--vary needs key=a:b:n (n whole) or key=a,b,c with finite numbers that differ: got "{text}"; correct it'
        )
    return Axis(key=key, values=tuple(values))


def grid(study: Study, axes: Sequence[Axis]) -> list[tuple[dict[str, float], Study]]:
    """Every combination, as values by key and as a study.

    Raises:
        InvalidInputError: a key that the study does not have, a study that is not valid, or too many of them.
    """
    keys = [a.key for a in axes]
    for key in keys:
        if keys.count(key) > 1:
            raise InvalidInputError(f"--vary names a key once: got {key} twice; put its values in one list")
    count = math.prod(len(a.values) for a in axes)
    if count > LARGEST:
        raise InvalidInputError(f"a sweep makes at most {LARGEST} designs: got {count}; vary less")
    points = []
    for values in product(*(a.values for a in axes)):
        chosen = dict(zip((a.key for a in axes), values, strict=True))
        points.append((chosen, varied(study, chosen)))
    return points


def varied(study: Study, values: dict[str, float]) -> Study:
    """The study with other numbers at some places; a plant parameter may be named though the file leaves it out.

    Raises:
        InvalidInputError: a place that the study does not have, or a value that it refuses.
    """
    data = study.model_dump(mode="json", exclude_none=True)
    for key, value in values.items():
        parts = key.split(".")
        if parts[:2] == ["plant", "parameters"] and len(parts) == 4 and parts[2] not in data["plant"]["parameters"]:
            data["plant"]["parameters"][parts[2]] = _bundled(study, parts[2])
        place: Any = data
        for k, part in enumerate(parts):
            names = [str(i) for i in range(len(place))] if isinstance(place, list) else list(place)
            if part not in names:
                advice = nearest(part, names) if names else "it is empty"
                raise InvalidInputError(
                    f'the study gives no "{".".join(parts[: k + 1])}"; {advice}, or give it a value in the file first'
                )
            step: Any = int(part) if isinstance(place, list) else part
            if k == len(parts) - 1:
                if isinstance(place[step], str | bool | dict | list):
                    raise InvalidInputError(f'"{key}" is not a number of the study; name one')
                place[step] = int(value) if isinstance(place[step], int) and value == int(value) else value
            elif isinstance(place[step], dict | list):
                place = place[step]
            else:
                raise InvalidInputError(f'"{".".join(parts[: k + 1])}" is a single value; leave out what follows it')
    at = ", ".join(f"{key}={value:g}" for key, value in values.items())
    return validated(data, f"{study.study.name} with {at}")


def _bundled(study: Study, name: str) -> dict[str, Any]:
    """A parameter that the file leaves out, as the machine has it."""
    plants = model(study.plant.model).build(study.plant).plants
    known = plants[0].parameters
    if name not in known:
        raise InvalidInputError(f'the plant has no parameter "{name}"; {nearest(name, known)}')
    p = known[name]
    return {"value": p.value, "unit": p.unit, "tolerance": p.tolerance, "source": p.source}


def sweep(
    study: Study, axes: Sequence[Axis], options: Options, progress: Progress
) -> tuple[list[dict[str, Any]], Journal]:
    """Design every point of the grid.

    Args:
        study: A validated study.
        axes: What is varied.
        options: Seed, workers, cluster, state.
        progress: Where to report.

    Returns:
        A row for each point in the order of the grid, and the journal, to be removed once the rows are safe. The rows
        depend on neither the workers nor the order in which they finish.
    """
    points = grid(study, axes)
    job = {
        "sweep": study.model_dump(mode="json"), "seed": options.seed, "full": options.full,
        "axes": [[a.key, [repr(v) for v in a.values]] for a in axes],
    }  # fmt: skip
    journal = Journal(options.state, job, resume=options.resume)
    rows: dict[int, dict[str, Any]] = {int(k): row for k, row in journal.entries}
    left = [k for k in range(len(points)) if k not in rows]
    progress.stage("sweep")
    with workers(_designer, (options.seed, options.full), options.jobs, options.cluster) as pool:
        for done, row in pool.completed([points[k][1] for k in left], size=1):
            rows[left[done]] = row
            journal.add([left[done], row])
            progress.update(len(rows) / len(points), f"{len(rows)} of {len(points)} designs")
    return [{"values": points[k][0], **rows[k]} for k in range(len(points))], journal


def _designer(seed: int | None, full: bool) -> Callable[[Sequence[Study]], list[dict[str, Any]]]:
    return lambda studies: [_row(design(s, Options(seed=seed, full=full), Progress())) for s in studies]


def _row(found: Design) -> dict[str, Any]:
    """What a design came to."""
    proved = found.report is not None and found.report.status == 0
    row: dict[str, Any] = {
        "verdict": "proved" if found.document else "requirement missed" if proved else "not proved",
        "failed": found.verdicts[0].name if found.verdicts else found.missed[0] if found.missed else None,
        "certified_error_m": None,
        "simulated_error_m": None,
        "gains": named_gains(found.problem, found.gains),
    }
    if found.document:
        shown = found.document["validation"]
        row["certified_error_m"] = certified_of(found.document)
        row["simulated_error_m"] = shown["largest_error_after_transient_m"]
    return row
