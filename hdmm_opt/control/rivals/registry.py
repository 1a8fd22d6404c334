"""Rivals by name: every file of this folder with a `RIVAL`, a class of a plant and its modelling terms."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from .cascade import Cascade


def rivals() -> dict[str, type[Cascade]]:
    """All rivals by the name that they give themselves."""
    package = import_module(__package__ or "")
    modules = [import_module(f"{__package__}.{info.name}") for info in iter_modules(package.__path__)]
    found = [module.RIVAL for module in modules if hasattr(module, "RIVAL")]
    return {kind.NAME: kind for kind in found}
