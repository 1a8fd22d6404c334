"""Where verbs write: refused before any work is done."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
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


@contextmanager
def claimed(target: Path) -> Iterator[None]:
    """Hold a place to write while the block runs, so that no second run writes there.

    The lock is the system's: it goes with the process, however that ends. Where there is none nothing is held.

    Raises:
        InvalidInputError: another run holds it.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    lock = target.with_name(f".{target.name}.lock")
    handle = os.open(lock, os.O_CREAT | os.O_RDWR, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise InvalidInputError(f"{target}: another run is writing it; wait for it, or give -o another name") from None
    try:
        yield
    finally:
        lock.unlink(missing_ok=True)
        os.close(handle)
