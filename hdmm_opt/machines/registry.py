"""The machines that studies can name: files of this folder with a `MODEL`, and plants by themselves."""

from __future__ import annotations

from ..discovery import all_offered, offered
from ..errors import RefusedKeyError
from ..names import nearest
from ..plants.own import own_name, own_plant
from ..plants.registry import plant_model, plant_names
from .free import free
from .model import Model


def model(name: str) -> Model:
    """The model of a name: a machine of this folder, or a plant as a machine of one member.

    Raises:
        RefusedKeyError: there is none.
    """
    found = offered(f"{__package__}", name, "MODEL")
    if found is not None:
        return found
    plant = own_plant(name) if own_name(name) else plant_model(name)
    if plant is None and own_name(name):
        raise RefusedKeyError("model", f"is code of your own: got {name[:60]!r}", "--allow-code runs it")
    if plant is None:
        raise RefusedKeyError("model", f"is unknown: got {name[:40]!r}", nearest(name, model_names()))
    return free(name, plant)


def model_names() -> list[str]:
    """All names that a study can give."""
    return sorted([*all_offered(f"{__package__}", "MODEL"), *plant_names()])
