"""The command `hdmm-opt`: finds its verbs, and turns bad input into one line.

Human text goes to stderr, results to stdout. Heavy libraries are imported inside the verbs; a verb is a file of this
folder with a `command`.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import Any

import click

from ..names import nearest
from .inputs import INPUT
from .statuses import INTERRUPTED, MISUSE, NOT_PROVED

# The matrices here are small: threads of the linear algebra only get in the way of the search's own workers.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

#: The verbs, in the order in which a user meets them.
VERBS = (
    "studies", "design", "check", "report", "simulate", "falsify", "trajectory", "compare", "tradeoff", "sweep",
)  # fmt: skip


class _Group(click.Group):
    """Turns bad input into one line and exit status 2, and Ctrl-C into 130."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in VERBS:
            return None
        return import_module(f"{__package__}.{cmd_name}").command

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run a verb; misuse of the command line is one line too."""
        try:
            status = super().main(*args, **{**kwargs, "standalone_mode": False})
        except click.UsageError as error:
            verb = error.ctx.info_name if error.ctx is not None and error.ctx.command is not self else None
            where = f"hdmm-opt {verb}" if verb else "hdmm-opt"
            click.echo(f"hdmm-opt: {error.format_message().rstrip('.')}; see {where} --help", err=True)
            sys.exit(MISUSE)
        except click.ClickException as error:
            click.echo(f"hdmm-opt: {error.format_message()}", err=True)
            sys.exit(MISUSE)
        except click.Abort:
            sys.exit(INTERRUPTED)
        sys.exit(status if isinstance(status, int) else 0)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            raise click.UsageError(f'no verb is named "{args[0]}", {nearest(args[0], VERBS)}', ctx)
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        from ..errors import DefectError, InvalidInputError

        try:
            return super().invoke(ctx)
        except InvalidInputError as error:
            given, text = ctx.meta.get(INPUT, ""), str(error)
            for line in text.splitlines() or [""]:
                click.echo(f"hdmm-opt: {line if given in line else f'{given}: {line}'}", err=True)
            sys.exit(MISUSE)
        except DefectError as error:
            click.echo(f"hdmm-opt: DEFECT of the prover: {error}", err=True)
            sys.exit(NOT_PROVED)
        except (KeyboardInterrupt, click.Abort):
            verb = self.get_command(ctx, ctx.invoked_subcommand or "")
            resumes = verb is not None and any(option.name == "resume" for option in verb.params)
            advice = "; the same command with --resume goes on" if resumes else ""
            click.echo(f"hdmm-opt: interrupted; nothing half-written{advice}", err=True)
            sys.exit(INTERRUPTED)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="hdmm-opt")
def main() -> None:
    """Design controllers for heavy-duty mobile machines, with proofs that anyone can re-check.

    Start with "hdmm-opt studies", then "hdmm-opt design emla-p2", then "hdmm-opt check emla-p2.gains.json".
    """
