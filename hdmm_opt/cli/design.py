"""`hdmm-opt design`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .explain import explain, proved
from .inputs import must_be_proved
from .options import options_of, work
from .statuses import NOT_PROVED, PROVED

if TYPE_CHECKING:
    from ..design.options import Options

NEEDED = "an actuator is exchanged in a proved file"


@click.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="Gain file to write; STUDY.gains.json by default.")
@click.option("--report", type=click.Path(path_type=Path, file_okay=False), help="Folder for an HTML report.")
@click.option(
    "--exchange",
    nargs=2,
    type=(click.Path(path_type=Path), str),
    metavar="FILE MEMBER",
    help="For members that push each other: take FILE's proofs, prove anew only MEMBER, whose actuator is another.",
)
@work
def command(
    study: str, output: Path | None, report: Path | None, exchange: tuple[Path, str] | None, **given: Any
) -> None:
    """Design gains for STUDY, a bundled name or a TOML file: reference, gains, proof, validation, gain file."""
    sys.exit(run(study, output, report, options_of(**given), exchange))


def run(
    name: str, output: Path | None, report: Path | None, options: Options, exchange: tuple[Path, str] | None = None
) -> int:
    """Design, write the gain file or what a refusal leaves, and say so."""
    from ..design.pipeline import design
    from ..design.replacement import replace_actuator
    from ..files.rejected import rejected_document
    from ..files.report import check_report, write_report
    from ..files.seal import to_text
    from ..files.text import write_text
    from ..study import load
    from .outputs import beside, json_target, prepared_folder
    from .progress import bar

    chosen = load(name)
    target = json_target(output, f"{chosen.study.name}.gains.json", "a gain file")
    rejected = beside(target, ".rejected.json")
    state = target.with_name(f".{target.name}.state")
    if report is not None:
        check_report()
        prepared_folder(report)
    standing = None if exchange is None else _standing(exchange[0])
    with bar() as progress:
        if exchange is None or standing is None:
            result = design(chosen, replace(options, state=state), progress)
        else:
            result = replace_actuator(standing, chosen, exchange[1], options, progress)
            if result.report is not None and result.report.status != PROVED:
                must_be_proved(exchange[0], NEEDED)
    document = rejected_document(result) if result.document is None else result.document
    write_text(rejected if result.document is None else target, to_text(document))
    if result.document is None:
        explain(result, rejected, target)
    else:
        rejected.unlink(missing_ok=True)
        proved(result)
    state.unlink(missing_ok=True)
    if report is not None:
        click.echo(f"report: {write_report(document, report)}", err=True)
    if result.document is None:
        return NOT_PROVED
    click.echo(str(target))
    return PROVED


def _standing(path: Path) -> dict[str, Any]:
    """A gain file that an actuator is exchanged in; its proofs are checked with the file that is made of it."""
    from ..errors import InvalidInputError
    from ..files.read import read, rejected

    document = read(path)
    if rejected(document):
        raise InvalidInputError(f"{path}: not proved; {NEEDED}")
    return document
