"""Laws by name: a file of this folder with a `LAW`, a class of a plant and its modelling terms."""

from __future__ import annotations

from stability import checker

from ..discovery import all_offered, offered
from ..errors import InvalidInputError
from ..names import nearest
from ..plants import Plant
from .law import ProvableLaw


def law_for(name: str, plant: Plant, modelling: tuple[str, ...]) -> ProvableLaw:
    """The law of a study for a plant.

    Raises:
        InvalidInputError: there is no such law, the checker has no obligations for it, or it has not that modelling
            term for this plant.
    """
    kind = offered(f"{__package__}", name, "LAW")
    if kind is None:
        raise InvalidInputError(f'controller.law "{name}" is unknown; {nearest(name, law_names())}')
    if name not in checker.REQUIRED:
        raise InvalidInputError(
            f'controller.law "{name}" cannot be proved: the checker has no obligations for it; '
            f"use {' or '.join(checker.REQUIRED)}"
        )
    try:
        return kind(plant=plant, modelling=modelling)
    except ValueError as error:
        raise InvalidInputError(f"controller: {error}") from None


def law_names() -> list[str]:
    """All names that a study can give."""
    return list(all_offered(f"{__package__}", "LAW"))
