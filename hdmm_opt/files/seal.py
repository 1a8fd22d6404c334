"""Hashes of a gain file, and the exact check that a file must pass before it is written."""

from __future__ import annotations

import json
from typing import Any

from stability import checker


def seal(document: dict[str, Any]) -> dict[str, Any]:
    """Add the hashes of the study, of every reference, and of the whole."""
    sealed = dict(document)
    sealed["study"] = _hashed(sealed["study"])
    sealed["members"] = [{**entry, "reference": _hashed(entry["reference"])} for entry in sealed["members"]]
    sealed.pop("sha256", None)
    sealed["sha256"] = checker.digest(sealed, "provenance")
    return sealed


def _hashed(section: dict[str, Any]) -> dict[str, Any]:
    plain = {key: value for key, value in section.items() if key != "sha256"}
    return {**plain, "sha256": checker.digest(plain)}


def prove(document: dict[str, Any]) -> tuple[dict[str, Any], checker.Report]:
    """Fill in the checker's verdicts and what it proved of the requirements, and seal; the file is checked once.

    What the file records of them is what the checker found on a draft without them: it is the same on the finished
    file, which differs in nothing else.
    """
    report = checker.check_text(to_text(seal({**document, "obligations": []})), recorded=False)
    entries = [
        {"name": o.name, "member": o.member, "statement": o.statement, "margin": o.margin, "unit": o.unit,
         "verdict": o.verdict}
        for o in report.obligations
    ]  # fmt: skip
    shown = [
        {**row, "certified": report.required[row["name"]][1]} if row["name"] in report.required else row
        for row in document["validation"]["requirements"]
    ]
    validation = {**document["validation"], "requirements": shown}
    return seal({**document, "obligations": entries, "validation": validation}), report


def to_text(document: dict[str, Any]) -> str:
    """JSON text; floats round-trip, no NaN."""
    return json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
