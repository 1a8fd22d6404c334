"""Pytest plugin: every `*.gains.json` that pytest meets is a set of tests, one an obligation."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect gain files."""
    if file_path.name.endswith(".gains.json"):
        return GainFile.from_parent(parent, path=file_path)
    return None


class GainFile(pytest.File):
    """A gain file, re-proved once."""

    def collect(self) -> Iterator[pytest.Item]:
        """The file as a whole, then its obligations."""
        from stability import checker

        from .junit import describe, label

        report = checker.check_file(self.path)
        yield Verdict.from_parent(self, name="gain file", proved=report.status == 0, text=report.message)
        for o in report.obligations:
            text = f"{o.verdict}: {label(o)}, {describe(o)}"
            yield Verdict.from_parent(self, name=label(o), proved=o.verdict == "proved", text=text)


class NotProvedError(Exception):
    """An obligation of a gain file is not proved."""


class Verdict(pytest.Item):
    """One verdict."""

    def __init__(self, *, proved: bool, text: str, **arguments: Any) -> None:
        super().__init__(**arguments)
        self.proved, self.text = proved, text

    def runtest(self) -> None:
        """Fail unless proved."""
        if not self.proved:
            raise NotProvedError(self.text)

    def repr_failure(self, excinfo: Any, style: Any = None) -> str:
        """The verdict alone, no traceback."""
        return str(excinfo.value)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Where the verdict belongs."""
        return self.path, None, f"{self.path.name}: {self.name}"
