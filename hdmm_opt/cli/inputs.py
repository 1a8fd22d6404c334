"""What a verb asks of the files that it is given."""

from __future__ import annotations

from pathlib import Path

from .statuses import PROVED


def must_be_proved(path: Path, why: str) -> None:
    """Refuse a file that the checker does not prove; `why` ends the line."""
    from stability import checker

    from ..errors import InvalidInputError

    report = checker.check_file(path)
    if report.status != PROVED:
        raise InvalidInputError(f"{path}: {report.message}; {why}")
