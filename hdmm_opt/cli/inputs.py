"""What a verb asks of the files that it is given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from .statuses import PROVED

if TYPE_CHECKING:
    from ..study import Study
    from ..study.motion import MotionStudy

#: Where a verb keeps the name of what it reads, for messages.
INPUT = "hdmm_opt.input"


def study_of(name: str, allow_code: bool) -> Study:
    """The study of a design; what is found wrong with it later names it too."""
    from ..study import load

    click.get_current_context().meta[INPUT] = name
    return load(name, allow_code=allow_code)


def any_study_of(name: str, allow_code: bool) -> Study | MotionStudy:
    """The study of a design or of a motion alone."""
    from ..study.read import load_any

    click.get_current_context().meta[INPUT] = name
    return load_any(name, allow_code=allow_code)


def must_be_proved(path: Path, why: str) -> None:
    """Refuse a file that the checker does not prove; `why` ends the line."""
    from stability import checker

    from ..errors import InvalidInputError

    report = checker.check_file(path)
    if report.status != PROVED:
        refused = "hdmm-opt/rejected" in report.message
        what = "a refused design left it, and nothing is proved" if refused else report.message
        raise InvalidInputError(f"{path}: {what}; {why}")
