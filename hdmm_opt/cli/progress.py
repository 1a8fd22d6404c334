"""Progress of a verb: nothing with --quiet."""

from __future__ import annotations

from contextlib import AbstractContextManager

import click

from ..jobs.options import Progress
from ..jobs.showing import bar as shown
from .statuses import QUIET


def bar() -> AbstractContextManager[Progress]:
    """A `Progress` that shows itself on stderr while the block runs."""
    context = click.get_current_context(silent=True)
    return shown(quiet=context is not None and bool(context.meta.get(QUIET)))
