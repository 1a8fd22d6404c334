"""The machines that studies can name: files of this folder with a `MODEL`, and plants by themselves."""

from __future__ import annotations

from importlib import import_module, util
from pkgutil import iter_modules

from ..errors import RefusedKeyError
from ..names import nearest
from ..plants.registry import plant_model, plant_names
from .model import Model
from .single import single


def model(name: str) -> Model:
    """The model of a name: a machine of this folder, or a plant as a machine of one member.

    Raises:
        RefusedKeyError: there is none.
    """
    if name.isidentifier() and util.find_spec(f"{__package__}.{name}") is not None:
        found = getattr(import_module(f"{__package__}.{name}"), "MODEL", None)
        if found is not None:
            return found
    plant = plant_model(name)
    if plant is None:
        raise RefusedKeyError("model", f"is unknown: got {name[:40]!r}", nearest(name, model_names()))
    return single(name, plant)


def model_names() -> list[str]:
    """All names that a study can give."""
    package = import_module(__package__ or "")
    own = [i.name for i in iter_modules(package.__path__)
           if getattr(import_module(f"{__package__}.{i.name}"), "MODEL", None) is not None]  # fmt: skip
    return sorted([*own, *plant_names()])
