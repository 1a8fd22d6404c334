"""What a study that is refused is told: the rule, what came, what would do, in one line."""

from __future__ import annotations

import math
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from ..names import nearest


def refused(key: str, rule: str, remedy: str) -> PydanticCustomError:
    """An error of a validator.

    Args:
        key: Place of the value in the section that is judged, with dots; empty for the section itself.
        rule: What holds, and what came.
        remedy: What would do.
    """
    return PydanticCustomError("refused", "{rule}; {remedy}", {"key": key, "rule": rule, "remedy": remedy})


def one_line(error: ValidationError, whole: type[BaseModel]) -> str:
    """The first problem of a file as one line."""
    problems = error.errors()
    first = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    place = [str(part) for part in first["loc"]]
    path, kind, value = ".".join(place), first["type"], first["input"]
    shown = repr(value) if isinstance(value, str) else f"{value}"
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    context = first.get("ctx", {})
    if kind == "refused":
        return f"{'.'.join(part for part in (path, context['key']) if part)} {context['rule']}; {context['remedy']}"
    if kind == "extra_forbidden":
        return f'unknown key "{path}"; {nearest(place[-1], _known_keys(whole, place[:-1]))}'
    if kind == "missing":
        return f'"{path}" is required and missing; add it'
    if kind == "finite_number" or (isinstance(value, float) and not math.isfinite(value)):
        return f"{path} must be a finite number: got {shown}; give a number"
    if kind == "literal_error":
        return f"{path} must be {context.get('expected', 'a known word')}: got {shown}; choose one"
    if kind == "too_short":
        return f"{path} must have at least {context.get('min_length', 1)} entries: got {shown}; add what is missing"
    if kind == "model_type" and place[0] == "plant":
        return f"{path} must be a section: got {shown}; give value, unit and source"
    if kind == "too_long":
        return f"{path} must have at most {context.get('max_length')} entries: got {shown}; remove what is too much"
    if kind == "model_type":
        return f"{path} must be a section: got {shown}; a fixed number is {{ value = {shown} }}"
    if kind == "tuple_type":
        return f"{path} must be a list: got {shown}; put it in brackets"
    rule = first["msg"].replace("Input should be", "must be")
    return f"{path} {rule[0].lower()}{rule[1:]}: got {shown}; correct the value"


def _known_keys(whole: Any, place: list[str]) -> list[str]:
    """Field names of the section at a place of the file."""
    section: Any = whole
    for part in place:
        annotation = section.model_fields[part].annotation if part in getattr(section, "model_fields", {}) else None
        found = _models(annotation)
        if found:
            section = found[0]
    return list(section.model_fields)


def _models(annotation: Any) -> list[type[BaseModel]]:
    """The section classes in a type."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models(part)]
