"""`hdmm-opt sweep`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .inputs import study_of
from .options import options_of, work
from .statuses import PROVED

if TYPE_CHECKING:
    from ..jobs.options import Options


@click.command()
@click.argument("study")
@click.option(
    "--vary",
    "vary",
    multiple=True,
    required=True,
    metavar="KEY=A:B:N",
    help="A number of the study, such as controller.rate_hz=500:2000:4, or KEY=A,B,C. Several make a grid.",
)
@click.option("-o", "output", type=click.Path(path_type=Path), help="Table to write; STUDY.sweep.json by default.")
@work
def command(study: str, vary: tuple[str, ...], output: Path | None, allow_code: bool, **given: Any) -> None:
    """Design STUDY at every point of a grid of its numbers; what is proved where, and with which gains."""
    sys.exit(run(study, vary, output, options_of(**given), allow_code))


def run(name: str, vary: tuple[str, ...], output: Path | None, options: Options, allow_code: bool) -> int:
    """Design all, write the table, show it."""
    from ..files.seal import to_text
    from ..files.text import write_text
    from ..jobs.sweep import SCHEMA, axis, sweep
    from .outputs import json_target
    from .progress import bar

    chosen = study_of(name, allow_code)
    axes = [axis(text) for text in vary]
    target = json_target(output, f"{chosen.study.name}.sweep.json", "the table of a sweep")
    with bar() as progress:
        state = target.with_name(f".{target.name}.state")
        rows, journal = sweep(chosen, axes, replace(options, state=state), progress)
    document = {"schema": SCHEMA, "study": chosen.model_dump(mode="json", exclude_none=True), "rows": rows}
    write_text(target, to_text(document))
    journal.remove()
    columns = [a.key for a in axes]
    click.echo(",".join([*columns, "verdict", "certified_error_m", "simulated_error_m"]))
    for row in rows:
        found = [
            row["verdict"],
            *("" if row[k] is None else f"{row[k]:.6g}" for k in ("certified_error_m", "simulated_error_m")),
        ]
        click.echo(",".join([*(f"{row['values'][key]:g}" for key in columns), *found]))
    proved = sum(row["verdict"] == "proved" for row in rows)
    click.echo(f"{proved} of {len(rows)} designs proved; gains and verdicts in {target}", err=True)
    return PROVED
