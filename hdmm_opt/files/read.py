"""Reading gain files, and what refused designs left behind."""

from __future__ import annotations

import json
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from stability import checker
from trajectories import Reference, Spline

from ..errors import InvalidInputError
from ..problem import GainSet

#: Schema of what a refused design leaves behind.
REJECTED = "hdmm-opt/rejected/2"


def read(path: Path) -> dict[str, Any]:
    """Read a gain file that matches its hashes and schema, or what a refused design left behind, which has no hash.

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
        if data.get("schema") == REJECTED:
            _look(data)
        else:
            checker.need(data.get("schema") == checker.SCHEMA, checker.wrong_schema(data.get("schema")))
            checker.check_digests(text)
    except checker.UnreadableError as error:
        raise InvalidInputError(f"{path}: unreadable: {error}") from None
    return json.loads(text)


def _look(data: Mapping[str, Any]) -> None:
    """Whether what a refused design left has its parts; it carries no proof and no hash."""
    parts = {"study": dict, "members": list, "obligations": list}
    checker.need(all(isinstance(data.get(key), kind) for key, kind in parts.items()), "a part of it is missing")


def rejected(document: Mapping[str, Any]) -> bool:
    """Whether it is what a refused design left behind."""
    return document["schema"] == REJECTED


def gains_of(document: Mapping[str, Any]) -> GainSet:
    """The gains of a gain file or of a rejected one."""
    return {
        entry["name"]: tuple(float(gain["value"]) for gain in entry["gains"]) for entry in document["members"]
    }  # fmt: skip


def certified_of(document: Mapping[str, Any]) -> float:
    """The certified bound on the error of the output after the transient, m."""
    if document["couplings"]:
        return above(document["couplings"][0]["envelope"]["output"])
    return max(map(ultimate_of, document["members"]))


def ultimate_of(entry: Mapping[str, Any]) -> float:
    """The certified bound on the error of a member after the transient, in the unit of its first state."""
    return above(entry["certificate"]["envelope"]["ultimate"][0])


def above(exact: str) -> float:
    """A float that is not below an exact bound of a file."""
    return checker.above(Fraction(exact))


def references_of(document: Mapping[str, Any]) -> tuple[Reference, ...]:
    """The references of a gain file.

    Raises:
        InvalidInputError: segments that do not join.
    """
    try:
        return tuple(
            Reference(
                segments=tuple(
                    Spline(
                        knots=np.array(s["knots"], dtype=float), coefficients=np.array(s["coefficients"], dtype=float)
                    )
                    for s in entry["reference"]["segments"]
                )
            )
            for entry in document["members"]
        )
    except ValueError as error:
        raise InvalidInputError(f"reference: {error}; write the file again with design") from None
