"""Where verbs write: refused before any work is done."""

from __future__ import annotations

from pathlib import Path

from ..errors import InvalidInputError
from ..files.text import check_writable


def json_target(output: Path | None, usual: str, what: str) -> Path:
    """The file to write.

    Args:
        output: What the user said, or None.
        usual: The name by default.
        what: What it is, for messages.

    Raises:
        InvalidInputError: it is not named .json, or cannot be written.
    """
    target = Path(usual) if output is None else output
    if target.suffix != ".json":
        raise InvalidInputError(f"{what} is named .json: got {target}; give -o another name")
    check_writable(target)
    return target


def beside(target: Path, ending: str) -> Path:
    """A file beside a gain file, with another ending."""
    return target.with_name(target.name.removesuffix(".json").removesuffix(".gains") + ending)


def prepared_folder(folder: Path) -> None:
    """Make a folder for a report.

    Raises:
        InvalidInputError: it cannot be made, or not be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{folder}: cannot make that folder: {error.strerror}; choose another") from None
    check_writable(folder / "report.html")
