"""`hdmm-opt tradeoff`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .inputs import study_of
from .options import options_of, work
from .statuses import NOT_PROVED, PROVED

if TYPE_CHECKING:
    from ..jobs.options import Options


@click.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="Set to write; STUDY.tradeoff.json by default.")
@work
def command(study: str, output: Path | None, allow_code: bool, **given: Any) -> None:
    """The Pareto set of STUDY's gains: simulated error, certified error, and the share of the limits they use."""
    sys.exit(run(study, output, options_of(**given), allow_code))


def run(name: str, output: Path | None, options: Options, allow_code: bool) -> int:
    """Search the set, write it, show it."""
    from ..files.seal import to_text
    from ..files.text import write_text
    from ..jobs.evaluation import OBJECTIVES
    from ..jobs.tradeoff import SCHEMA, rows, tradeoff
    from .outputs import json_target
    from .progress import bar

    chosen = study_of(name, allow_code)
    target = json_target(output, f"{chosen.study.name}.tradeoff.json", "a trade-off")
    state = target.with_name(f".{target.name}.state")
    with bar() as progress:
        found, kept = tradeoff(chosen, replace(options, state=state), progress)
    table = rows(found)
    document = {"schema": SCHEMA, "study": chosen.model_dump(mode="json", exclude_none=True), "rows": table}
    write_text(target, to_text(document))
    kept.remove()
    gains = list(table[0]["gains"]) if table else []
    click.echo(",".join([*(f"{name} (share)" for name in OBJECTIVES), *gains]))
    for row in table:
        click.echo(",".join(f"{value:.4g}" for value in (*row["objectives"].values(), *row["gains"].values())))
    click.echo(
        f"{len(table)} proved designs of {found.evaluations} candidates in {target}; none of them is beaten", err=True
    )
    return PROVED if table else NOT_PROVED
