"""Plants by name: a file of this folder with a `PLANT` is a machine of one member."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module, util
from pkgutil import iter_modules

from .parameter import Parameter
from .plant import Plant


@dataclass(frozen=True, kw_only=True)
class PlantModel:
    """How a plant is made from a study.

    Attributes:
        levels: Input levels that a study chooses from.
        defaults: Level -> parameters with units, tolerances and sources.
        build: (level, parameters) -> the plant.
    """

    levels: tuple[str, ...]
    defaults: Callable[[str], dict[str, Parameter]]
    build: Callable[[str, Mapping[str, Parameter]], Plant]


def plant_model(name: str) -> PlantModel | None:
    """The plant of a name, or None."""
    if not name.isidentifier() or util.find_spec(f"{__package__}.{name}") is None:
        return None
    return getattr(import_module(f"{__package__}.{name}"), "PLANT", None)


def plant_names() -> list[str]:
    """All names."""
    package = import_module(__package__ or "")
    return [info.name for info in iter_modules(package.__path__) if plant_model(info.name) is not None]
