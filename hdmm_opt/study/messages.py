"""What a study that is refused is told: the rule, what came, what would do, in one line."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from ..errors import RefusedKeyError
from ..names import nearest

#: Problems of a file that are listed at once.
SHOWN = 12


def refused(key: str, rule: str, remedy: str) -> PydanticCustomError:
    """An error of a validator.

    Args:
        key: Place of the value in the section that is judged, with dots; empty for the section itself.
        rule: What holds, and what came.
        remedy: What would do.
    """
    return PydanticCustomError("refused", "{rule}; {remedy}", {"key": key, "rule": rule, "remedy": remedy})


def refused_together(found: Iterable[RefusedKeyError]) -> None:
    """Raise the error of a validator for all keys that do not fit; nothing where all do."""
    keys = [(error.key, error.rule, error.remedy) for error in found]
    if keys:
        raise PydanticCustomError("refused", "{keys}", {"keys": keys})


def lines(error: ValidationError, whole: type[BaseModel]) -> list[str]:
    """The problems of a file, one line each: unknown keys first, because others follow from them."""
    problems = sorted(error.errors(), key=lambda p: p["type"] != "extra_forbidden")
    meant = [p["loc"][:-1] + (nearest_of(p, whole),) for p in problems if p["type"] == "extra_forbidden"]
    problems = [p for p in problems if not (p["type"] == "missing" and p["loc"] in meant)]
    inner = {p["loc"][:k] for p in problems for k in range(len(p["loc"]))}
    problems = [p for p in problems if not (p["type"] == "too_short" and p["loc"] in inner)]
    found = [line for problem in problems for line in _lines(problem, whole)]
    listed = list(dict.fromkeys(found))
    more = len(listed) - SHOWN
    return listed if more <= 0 else [*listed[:SHOWN], f"{more} more; correct these first"]


def nearest_of(problem: Any, whole: type[BaseModel]) -> str:
    """The key that an unknown one was meant to be; empty where none is near."""
    place = [str(part) for part in problem["loc"]]
    words = nearest(place[-1], _known_keys(whole, place[:-1])).split('"')
    return words[1] if len(words) == 3 else ""


def _lines(problem: Any, whole: type[BaseModel]) -> list[str]:
    path = ".".join(str(part) for part in problem["loc"])
    context = problem.get("ctx", {})
    if problem["type"] == "refused" and "keys" in context:
        return [f"{'.'.join(p for p in (path, key) if p)} {rule}; {remedy}" for key, rule, remedy in context["keys"]]
    return [_line(problem, whole)]


def _line(first: Any, whole: type[BaseModel]) -> str:
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
