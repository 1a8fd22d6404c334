"""What goes wrong, and what it says to whom."""

from __future__ import annotations

from collections.abc import Iterable


class InvalidInputError(Exception):
    """Bad input: one line with the rule, what came, and what would do."""


class RefusedKeyError(InvalidInputError):
    """A key of a study that does not fit.

    Args:
        key: Its place, with dots, from the section on that is judged.
        rule: What holds, and what came.
        remedy: What would do.
    """

    def __init__(self, key: str, rule: str, remedy: str) -> None:
        super().__init__(f"{key} {rule}; {remedy}")
        self.key, self.rule, self.remedy = key, rule, remedy


def refuse(found: Iterable[InvalidInputError]) -> None:
    """Raise what was found, all at once, one line each; nothing where nothing was found."""
    listed = list(dict.fromkeys(str(error) for error in found))
    if listed:
        raise InvalidInputError("\n".join(listed))


class DefectError(Exception):
    """A simulation contradicts a proof: a defect of this toolkit, not of the input."""
