"""Studies by name or path."""

from __future__ import annotations

from pathlib import Path

from ..errors import InvalidInputError
from ..study import Study, load


def load_study(name: str | Path, *, allow_code: bool = False) -> Study:
    """Read a study of a design.

    Args:
        name: Name of a bundled study, or path of a TOML file.
        allow_code: Whether `plant.model = "FILE.py:FUNCTION"` may run that file.

    Returns:
        The validated study; the other functions take it, or its name.

    Raises:
        InvalidInputError: one line with the rule, what came, and what would do.
    """
    return load(str(name), allow_code=allow_code)


def study_of(given: Study | str | Path) -> Study:
    """A study, or the study of a name.

    Raises:
        InvalidInputError: it is neither.
    """
    if isinstance(given, Study):
        return given
    if isinstance(given, str | Path):
        return load_study(given)
    raise InvalidInputError(f"a study or its name is needed: got {type(given).__name__}; use load_study")
