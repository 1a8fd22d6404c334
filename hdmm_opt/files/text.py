"""Text: files written whole or not at all, and bounds printed so that they hold."""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from stability.checker import upward as upward

from ..errors import InvalidInputError


def csv_text(columns: Mapping[str, Iterable[Any]]) -> str:
    """Columns of one length as CSV; their names are the header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()


def write_text(path: Path, text: str) -> None:
    """Write a whole file or nothing: a temporary file in the same folder, then a rename.

    Raises:
        InvalidInputError: the place cannot be written.
    """
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot write there: {error.strerror}; choose a writable folder") from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot write there: {error.strerror}; choose another name") from None
    finally:
        Path(temporary).unlink(missing_ok=True)


def check_writable(path: Path) -> None:
    """Refuse an output place before any work is done.

    Raises:
        InvalidInputError: the folder is missing or not writable, or the path is a folder.
    """
    if path.is_dir():
        raise InvalidInputError(f"{path}: is a folder; give a file name")
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot write there: {error.strerror}; choose a writable folder") from None
    os.close(handle)
    Path(temporary).unlink()


def prepared_folder(folder: Path, page: str) -> None:
    """Make a folder for a page.

    Raises:
        InvalidInputError: it cannot be made, or the page not be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{folder}: cannot make that folder: {error.strerror}; choose another") from None
    check_writable(folder / page)
