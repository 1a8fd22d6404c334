"""Progress on stderr: a bar on a terminal and in a notebook, elsewhere a plain line every few seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from .options import Progress

#: Seconds between two lines where there is no terminal.
PAUSE = 5.0


@contextmanager
def bar(*, quiet: bool = False) -> Iterator[Progress]:
    """A `Progress` that shows itself while the block runs; nothing where `quiet`."""
    if quiet:
        yield Progress()
    elif sys.stderr.isatty() or "ipykernel" in sys.modules:
        with _drawn() as progress:
            yield progress
    else:
        yield _lines()


def _lines() -> Progress:
    """Plain lines, for a log."""
    begun = told = time.monotonic()
    now = "start"

    def stage(name: str) -> None:
        nonlocal now
        now = name

    def update(share: float, note: str) -> None:
        nonlocal told
        if time.monotonic() - told >= PAUSE:
            told = time.monotonic()
            part = f" {share:.0%}" if share > 0 else ""
            print(f"{told - begun:.0f} s: {now}{part} {note}".rstrip(), file=sys.stderr, flush=True)

    return Progress(stage=stage, update=update)


@contextmanager
def _drawn() -> Iterator[Progress]:
    """A bar: stage, elapsed, remaining, best so far."""
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
    notebook = "ipykernel" in sys.modules
    with RichProgress(*columns, console=Console(stderr=not notebook), transient=True) as drawn:
        task = drawn.add_task("start", total=1.0, note="")

        def stage(name: str) -> None:
            drawn.reset(task, total=1.0, description=name, note="")

        def update(share: float, note: str) -> None:
            drawn.update(task, completed=share, note=note)

        yield Progress(stage=stage, update=update)
