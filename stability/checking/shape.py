"""Rules for what may stand at a place of a file.

Must fail: unknown or missing keys, numbers as text, text that is no plain text, more entries than a file of ours has.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from .limits import NAME, UNIT_TEXT, UnreadableError, need

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
    if isinstance(value, dict):
        need(len(value) <= 8, f"{where} has at most 8 signals")
        for key, share in value.items():
            for part in key.split("/", 1):
                name(part, where)
            plain_number(share, where)
    elif not isinstance(value, Fraction):
        some("reference", "zero", "balance")(value, where)


def operation(value: Any, where: str) -> None:
    """An operator with its arguments; `parsing` reads them."""
    need(isinstance(value, list) and 2 <= len(value) <= 3, f"{where} must be an operation")


def versions(value: Any, where: str) -> None:
    """Versions of packages by name."""
    need(isinstance(value, dict) and len(value) <= 32, f"{where} must be an object")
    for package, version in value.items():
        text(package, where)
        text(version, where)


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
