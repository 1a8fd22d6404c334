"""Plants of the user's own, named FILE.py:FUNCTION: code that runs where the user says so, or data of a gain file."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from importlib import util
from pathlib import Path
from typing import Any

from ..errors import InvalidInputError
from .parameter import Parameter
from .plant import Plant
from .registry import PlantModel
from .sound import check_parameters, check_plant

_NAME = re.compile(r"(?P<file>[^:]+\.py):(?P<function>[A-Za-z_][A-Za-z0-9_]{0,63})")
#: What was allowed to run, by name in a study: the file, and what its function gave.
_ALLOWED: dict[str, tuple[Path, PlantModel]] = {}
#: What gain files hold of such plants, by the same names.
_RECORDED: dict[str, PlantModel] = {}


def own_name(name: str) -> bool:
    """Whether a study's `plant.model` names a file of its user."""
    return ".py" in name


def own_plant(name: str) -> PlantModel | None:
    """The plant of such a name, as allowed code made it or as a gain file has it; None where there is neither."""
    if name in _ALLOWED:
        return _ALLOWED[name][1]
    return _RECORDED.get(name)


def allowed() -> tuple[tuple[str, Path], ...]:
    """Names and files of all that was allowed, for other processes."""
    return tuple((name, file) for name, (file, _) in _ALLOWED.items())


def record(name: str, plant: PlantModel) -> None:
    """Keep what a gain file holds of a plant; code that was allowed goes before it."""
    _RECORDED[name] = plant


def allow(name: str, folder: Path, *, known_as: str | None = None) -> None:
    """Run the file of a name and keep the plant that its function returns.

    Args:
        name: "FILE.py:FUNCTION"; FUNCTION takes nothing and returns a `PlantModel`.
        folder: Where a relative FILE starts: the folder of the study.
        known_as: The name in the study, where it is another.

    Raises:
        InvalidInputError: not of that form, no such file or function, or what it returns is no plant.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise InvalidInputError(f'plant.model of your own is "FILE.py:FUNCTION": got {name[:80]!r}; correct it')
    file = (folder / match["file"]).resolve()
    if not file.is_file():
        raise InvalidInputError(f"plant.model: there is no file {file.name} beside the study; correct the path")
    found = _tried(lambda: _function(file, match["function"]), match["file"])
    if found is None:
        raise InvalidInputError(f'plant.model: {file.name} has no function "{match["function"]}"; correct the name')
    made = _tried(found, match["file"])
    if not isinstance(made, PlantModel):
        raise InvalidInputError(
            f"plant.model: {match['function']}() must return a PlantModel: got {type(made).__name__}; "
            "see docs/own_machine.md"
        )
    _ALLOWED[known_as or name] = (file, _guarded(made, match["file"]))


def _guarded(made: PlantModel, file: str) -> PlantModel:
    """The plant model, with what its functions raise as one line and what they return looked at."""

    def defaults(level: str) -> dict[str, Parameter]:
        return check_parameters(_tried(lambda: made.defaults(level), file))

    def ratings(level: str) -> dict[str, Parameter]:
        return check_parameters(_tried(lambda: made.ratings(level), file))

    def build(level: str, parameters: Mapping[str, Parameter], ratings: Mapping[str, Parameter]) -> Plant:
        return check_plant(_tried(lambda: made.build(level, parameters, ratings), file))

    return PlantModel(levels=made.levels, defaults=defaults, build=build, ratings=ratings)


def _tried(function: Callable[[], Any], file: str) -> Any:
    try:
        return function()
    except Exception as error:
        raise InvalidInputError(
            f"plant.model: {file} fails: {type(error).__name__}: {_line(error)}; correct the file"
        ) from None


def _function(file: Path, function: str) -> Callable[[], object] | None:
    spec = util.spec_from_file_location(f"hdmm_opt_own_{file.stem}", file)
    assert spec is not None and spec.loader is not None
    module = util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found = getattr(module, function, None)
    return found if callable(found) else None


def _line(error: Exception) -> str:
    return (str(error).splitlines() or [""])[-1][:120]
