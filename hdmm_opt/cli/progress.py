"""A progress bar on stderr: stage, elapsed, remaining, best so far; silent where stderr is not a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from ..design.options import Progress


@contextmanager
def bar() -> Iterator[Progress]:
    """A `Progress` that draws a bar while the block runs."""
    if not sys.stderr.isatty():
        yield Progress()
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as RichProgress

    columns = (
        TextColumn("{task.description:28}"),
        BarColumn(bar_width=30),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with RichProgress(*columns, console=Console(stderr=True), transient=True) as drawn:
        task = drawn.add_task("start", total=1.0, note="")

        def stage(name: str) -> None:
            drawn.reset(task, total=1.0, description=name, note="")

        def update(share: float, note: str) -> None:
            drawn.update(task, completed=share, note=note)

        yield Progress(stage=stage, update=update)
