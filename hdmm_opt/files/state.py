"""What an interrupted job goes on from: named parts in one file, always whole."""

from __future__ import annotations

import hashlib
import json
import os
import time
from importlib import metadata
from pathlib import Path
from typing import Any

from stability import checker

from ..errors import InvalidInputError
from .text import write_text

SCHEMA, JOURNAL = "hdmm-opt/state/3", "hdmm-opt/journal/1"
#: Parts that change often are written at most this often, s.
PAUSE = 0.5


class _Kept:
    """Something of a job that lives in a file while the job does."""

    path: Path | None

    def remove(self) -> None:
        """The job is done."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)


class State(_Kept):
    """The state of one job.

    Args:
        path: Its file; None keeps nothing.
        job: What the job is: study, seed, budget. Another job, or another release, does not go on from it.
        resume: Whether to go on from what the file holds.

    Raises:
        InvalidInputError: the file is to be read, and is not the state of this job.
    """

    def __init__(self, path: Path | None, job: dict[str, Any], *, resume: bool) -> None:
        self.path = path
        self._key = checker.digest({**job, "version": metadata.version("hdmm-opt")})
        self._parts: dict[str, Any] = {}
        self._written = -PAUSE
        if resume and path is not None and path.exists():
            self._parts = self._read(path)

    def _read(self, path: Path) -> dict[str, Any]:
        advice = "delete it or leave out --resume"
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
            key, parts, seal = data["key"], dict(data["parts"]), data["seal"]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            raise InvalidInputError(f"{path}: damaged, or not a state of this release; {advice}") from None
        if seal != _seal(parts):
            raise InvalidInputError(f"{path}: its content was changed; {advice}")
        if key != self._key or data.get("schema") != SCHEMA:
            raise InvalidInputError(f"{path}: belongs to another study, seed, budget or release; {advice}")
        return parts

    def get(self, part: str) -> Any:
        """A part as it was put, or None."""
        return self._parts.get(part)

    def put(self, part: str, data: Any, *, often: bool = False) -> None:
        """Keep a part; the file holds it when this returns, unless it is put `often`."""
        self._parts[part] = data
        if self.path is None or (often and time.monotonic() - self._written < PAUSE):
            return
        data = {"schema": SCHEMA, "key": self._key, "seal": _seal(self._parts), "parts": self._parts}
        write_text(self.path, json.dumps(data))
        self._written = time.monotonic()


def _seal(parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


class Journal(_Kept):
    """Entries of one job that are only ever added: one line each, so that a long job does not write itself anew.

    Args:
        path: Its file; None keeps nothing.
        job: What the job is, as for `State`.
        resume: Whether to go on from what the file holds. A last line that was cut off is dropped.

    Raises:
        InvalidInputError: the file is to be read, and is not the journal of this job.
    """

    def __init__(self, path: Path | None, job: dict[str, Any], *, resume: bool) -> None:
        self.path, self.entries = path, []
        head = {"schema": JOURNAL, "key": checker.digest({**job, "version": metadata.version("hdmm-opt")})}
        if path is None:
            return
        if resume and path.exists():
            self.entries = self._read(path, head)
        write_text(path, "".join(_line(entry) for entry in (head, *self.entries)))

    def _read(self, path: Path, head: dict[str, Any]) -> list[Any]:
        advice = "delete it or leave out --resume"
        try:
            first, *rest = path.read_text(encoding="utf-8").splitlines(keepends=True)
            given = json.loads(first)["entry"]
        except (OSError, ValueError, KeyError, TypeError):
            raise InvalidInputError(f"{path}: damaged, or not a state of this release; {advice}") from None
        if given != head:
            raise InvalidInputError(f"{path}: belongs to another study, seed, budget or release; {advice}")
        found = []
        for number, line in enumerate(rest, 2):
            if not line.endswith("\n"):
                break
            try:
                data = json.loads(line)
                good = data["seal"] == _seal(data["entry"])
            except (ValueError, KeyError, TypeError):
                good = False
            if not good:
                raise InvalidInputError(f"{path}: line {number} was changed; {advice}")
            found.append(data["entry"])
        return found

    def add(self, entry: Any) -> None:
        """Keep an entry; the file holds it when this returns."""
        self.entries.append(entry)
        if self.path is None:
            return
        with self.path.open("a", encoding="utf-8") as stream:
            stream.write(_line(entry))
            stream.flush()
            os.fsync(stream.fileno())


def _line(entry: Any) -> str:
    return json.dumps({"entry": entry, "seal": _seal(entry)}) + "\n"
