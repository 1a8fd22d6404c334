"""What an interrupted job goes on from: named parts in one file, always whole."""

from __future__ import annotations

import hashlib
import json
import time
from importlib import metadata
from pathlib import Path
from typing import Any

from stability import checker

from .errors import InvalidInputError
from .files import write_text

SCHEMA = "hdmm-opt/state/2"
#: Parts that change often are written at most this often, s.
PAUSE = 0.5


class State:
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

    def remove(self) -> None:
        """The job is done."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)


def _seal(parts: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()
