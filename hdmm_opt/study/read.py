"""Reading study files: TOML, validated, with errors of one line."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ..errors import InvalidInputError
from ..names import nearest
from ..plants.own import allow, own_name
from .messages import lines
from .motion import MotionStudy
from .sections import LARGEST
from .study import Study

T = TypeVar("T", bound=BaseModel)


def bundled() -> list[str]:
    """Names of the studies that come with the package."""
    folder = resources.files("hdmm_opt") / "studies"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def bundled_text(name: str) -> str:
    """The file of a bundled study.

    Raises:
        InvalidInputError: there is none of that name.
    """
    if name not in bundled():
        raise InvalidInputError(f'no bundled study is named "{name}"; {nearest(name, bundled())}')
    return (resources.files("hdmm_opt") / "studies" / f"{name}.toml").read_text(encoding="utf-8")


def load(name: str, *, allow_code: bool = False) -> Study:
    """Read a study of a design.

    Args:
        name: Name of a bundled study, or path of a TOML file.
        allow_code: Whether `plant.model = "FILE.py:FUNCTION"` may run that file.

    Returns:
        The validated study.

    Raises:
        InvalidInputError: one line with the rule, what came, and what would do.
    """
    found = load_any(name, allow_code=allow_code)
    if not isinstance(found, Study):
        raise InvalidInputError(
            f'{name}: a design needs a controller: this study is of a motion alone; use "hdmm-opt trajectory {name}"'
        )
    return found


def load_any(name: str, *, allow_code: bool = False) -> Study | MotionStudy:
    """Read a study of a design, or of a motion alone; as `load`."""
    if name in bundled():
        return parse(bundled_text(name), name)
    path = Path(name)
    if path.suffix != ".toml" and not path.exists():
        raise InvalidInputError(
            f'no bundled study is named "{name}"; {nearest(name, bundled())} (or give a .toml path)'
        )
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        if isinstance(error, UnicodeDecodeError):
            raise InvalidInputError(f"{path}: not UTF-8 text; save it as UTF-8") from None
        raise InvalidInputError(f"{path}: cannot read the study file: {error.strerror}; check the path") from None
    return parse(text, str(path), allow_code=allow_code, folder=path.parent)


def parse(text: str, where: str, *, allow_code: bool = False, folder: Path = Path()) -> Study | MotionStudy:
    """Read a study from TOML text; `where` names it in errors, `folder` holds the code that it may name."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInputError(f"{where}: not valid TOML: {error}; correct that line") from None
    except (ValueError, RecursionError):
        raise InvalidInputError(
            f"{where}: not a study: a number has too many digits, or lists are nested too deeply; correct it"
        ) from None
    plant = data.get("plant")
    own = plant.get("model") if isinstance(plant, dict) else None
    if isinstance(own, str) and own_name(own):
        if not allow_code:
            raise InvalidInputError(
                f'{where}: plant.model = "{own[:80]}" would run that file; add --allow-code if you trust it'
            )
        try:
            allow(own, folder)
        except InvalidInputError as error:
            raise InvalidInputError(f"{where}: {error}") from None
    motion = "controller" not in data and isinstance(data.get("reference"), dict) and "moves" in data["reference"]
    return _validated(data, where, MotionStudy) if motion else validated(data, where)


def validated(data: dict[str, Any], where: str) -> Study:
    """Validate a study of a design given as data; `where` names it in errors.

    Raises:
        InvalidInputError: one line with the rule, what came, and what would do.
    """
    return _validated(data, where, Study)


def _validated(data: dict[str, Any], where: str, kind: type[T]) -> T:
    try:
        numbers = list(_numbers(data))
    except InvalidInputError as error:
        raise InvalidInputError(f"{where}: {error}") from None
    for path, value in numbers:
        if math.isfinite(value) and abs(value) > LARGEST:
            raise InvalidInputError(
                f"{where}: {path} must be within ±{LARGEST:g} in SI units: got {value:g}; check the unit"
            )
    try:
        return kind.model_validate(data)
    except ValidationError as error:
        raise InvalidInputError("\n".join(f"{where}: {line}" for line in lines(error, kind))) from None


def _numbers(data: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a file with its place."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _numbers(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list | tuple):
        for value in data:
            yield from _numbers(value, path)
    elif isinstance(data, bool) and not path.endswith("worst_case"):
        raise InvalidInputError(f"{path} must be a number or text: got {str(data).lower()}; correct the value")
    elif isinstance(data, int | float):
        yield path, float(data) if isinstance(data, float) or abs(data) < 10**300 else 1e300
