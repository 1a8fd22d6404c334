"""What the files of a folder offer, found by the names of the files."""

from __future__ import annotations

from importlib import import_module, util
from pkgutil import iter_modules
from typing import Any


def offered(package: str, name: str, attribute: str) -> Any:
    """The attribute of a file of a package, or None where there is no such file or it has none."""
    if not name.isidentifier() or util.find_spec(f"{package}.{name}") is None:
        return None
    return getattr(import_module(f"{package}.{name}"), attribute, None)


def all_offered(package: str, attribute: str) -> dict[str, Any]:
    """The attribute of every file of a package that has it, by the name of the file."""
    names = [info.name for info in iter_modules(import_module(package).__path__)]
    found = {name: offered(package, name, attribute) for name in names}
    return {name: value for name, value in found.items() if value is not None}
