"""Plants by name: a file of this folder with a `PLANT` is a machine of one member."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..discovery import all_offered, offered
from .parameter import Parameter
from .plant import Plant


@dataclass(frozen=True, kw_only=True)
class PlantModel:
    """How a plant is made from a study.

    Attributes:
        levels: Input levels that a study chooses from.
        defaults: Level -> parameters with units, tolerances and sources.
        build: (level, parameters, ratings) -> the plant; of one with `sensors` (…, sensor=).
        ratings: Level -> numbers that its equations do not read.
        sensors: Where the sensor may be, for a plant that is not rigid.
    """

    levels: tuple[str, ...]
    defaults: Callable[[str], dict[str, Parameter]]
    build: Callable[..., Plant]
    ratings: Callable[[str], dict[str, Parameter]] = lambda level: {}
    sensors: tuple[str, ...] = ()

    def made(self, section: Any, parameters: Mapping[str, Parameter], ratings: Mapping[str, Parameter]) -> Plant:
        """The plant of a `[plant]` section with other numbers."""
        where = {"sensor": section.sensor} if self.sensors else {}
        return self.build(section.level, parameters, ratings, **where)


def plant_model(name: str) -> PlantModel | None:
    """The plant of a name, or None."""
    return offered(f"{__package__}", name, "PLANT")


def plant_names() -> list[str]:
    """All names."""
    return list(all_offered(f"{__package__}", "PLANT"))
