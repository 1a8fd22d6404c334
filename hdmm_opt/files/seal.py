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
    """Fill in the obligations with the checker's verdicts, and seal; the file is checked once.

    The checker decides every obligation before it looks whether the file records it as proved, so its report on the
    draft, in which all are recorded, is its report on the finished file: the two differ in statements and margins,
    which it does not read.
    """
    law = document["study"]["controller"]["law"]
    required = [
        {"name": name, "member": entry["name"], "verdict": "proved"}
        for entry in document["members"] for name in checker.REQUIRED[law][entry["certificate"]["kind"]]
    ]  # fmt: skip
    required += [{"name": name, "member": "", "verdict": "proved"} for name in _joining(document)]
    report = checker.check_text(to_text(seal({**document, "obligations": required})))
    entries = [
        {"name": o.name, "member": o.member, "statement": o.statement, "margin": o.margin, "unit": o.unit,
         "verdict": o.verdict}
        for o in report.obligations
    ]  # fmt: skip
    return seal({**document, "obligations": entries}), report


def _joining(document: dict[str, Any]) -> dict[str, None]:
    """Obligations that join the members."""
    observing = document["study"]["controller"].get("observer") is not None
    names = [*(checker.COUPLED if document["couplings"] else ()), *(checker.OBSERVED if observing else ())]
    return dict.fromkeys(names)


def to_text(document: dict[str, Any]) -> str:
    """JSON text; floats round-trip, no NaN."""
    return json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
