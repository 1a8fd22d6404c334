"""Laws by name: a file of this folder with a `LAW`, a class of a plant and its modelling terms."""

from __future__ import annotations

from importlib import import_module, util
from pkgutil import iter_modules
from typing import Any

from stability import checker

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
    kind = _kind(name)
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
    package = import_module(__package__ or "")
    return [info.name for info in iter_modules(package.__path__) if _kind(info.name) is not None]


def _kind(name: str) -> Any:
    if not name.isidentifier() or util.find_spec(f"{__package__}.{name}") is None:
        return None
    return getattr(import_module(f"{__package__}.{name}"), "LAW", None)
