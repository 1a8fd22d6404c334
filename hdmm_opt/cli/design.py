"""`hdmm-opt design`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from .explain import explain, proved
from .inputs import must_be_proved, study_of
from .options import VERBOSE, options_of, work
from .statuses import NOT_PROVED, PROVED

if TYPE_CHECKING:
    from ..files.result import Design
    from ..jobs.options import Options
    from ..study import Study

NEEDED = "an actuator is exchanged in a proved file"


@click.command()
@click.argument("study")
@click.option(
    "-o",
    "output",
    type=click.Path(path_type=Path),
    help="Gain file; NAME.gains.json by default.",
)
@click.option("--report", type=click.Path(path_type=Path, file_okay=False), help="Folder for an HTML report.")
@click.option(
    "--exchange",
    nargs=2,
    type=(click.Path(path_type=Path), str),
    metavar="FILE MEMBER",
    help="For machines of several members: take the proofs of FILE, prove anew only MEMBER, whose actuator is another.",
)
@VERBOSE
@work
def command(
    study: str,
    output: Path | None,
    report: Path | None,
    exchange: tuple[Path, str] | None,
    allow_code: bool,
    verbose: bool,
    **given: Any,
) -> None:
    """Design gains for STUDY, a bundled name or a TOML file: reference, gains, proof, validation, gain file."""
    sys.exit(run(study, output, report, options_of(**given), exchange, allow_code=allow_code, verbose=verbose))


def run(
    name: str, output: Path | None, report: Path | None, options: Options, exchange: tuple[Path, str] | None = None,
    *, allow_code: bool = False, verbose: bool = False,
) -> int:  # fmt: skip
    """Design, write the gain file or what a refusal leaves, and say so."""
    from ..files.rejected import rejected_document
    from ..files.report import PAGE_NAME, check_report, write_report
    from ..files.seal import to_text
    from ..files.text import prepared_folder, write_text
    from .outputs import beside, claimed, json_target

    chosen = study_of(name, allow_code)
    target = json_target(output, f"{chosen.study.name}.gains.json", "a gain file")
    rejected, state = beside(target, ".rejected.json"), target.with_name(f".{target.name}.state")
    if report is not None:
        check_report()
        prepared_folder(report, PAGE_NAME)
    standing = None if exchange is None else _standing(exchange[0])
    with claimed(target):
        result = _designed(chosen, replace(options, state=state), exchange, standing)
        document = rejected_document(result) if result.document is None else result.document
        write_text(rejected if result.document is None else target, to_text(document))
        if result.document is None:
            explain(result, rejected, target)
        else:
            rejected.unlink(missing_ok=True)
            proved(result, verbose=verbose)
        state.unlink(missing_ok=True)
    if report is not None:
        click.echo(f"report: {write_report(document, report, result.report)}", err=True)
    if result.document is None:
        return NOT_PROVED
    click.echo(str(target))
    return PROVED


def _designed(
    chosen: Study, options: Options, exchange: tuple[Path, str] | None, standing: dict[str, Any] | None
) -> Design:
    """The design, or the machine of a proved file with another actuator."""
    from ..jobs.pipeline import design
    from ..jobs.replacement import replace_actuator
    from .progress import bar

    with bar() as progress:
        if exchange is None or standing is None:
            return design(chosen, options, progress)
        result = replace_actuator(standing, chosen, exchange[1], replace(options, state=None), progress)
        if result.report is not None and result.report.status != PROVED:
            must_be_proved(exchange[0], NEEDED)
        return result


def _standing(path: Path) -> dict[str, Any]:
    """A gain file that an actuator is exchanged in; its proofs are checked with the file that is made of it."""
    from ..errors import InvalidInputError
    from ..files.read import read, rejected

    document = read(path)
    if rejected(document):
        raise InvalidInputError(f"{path}: not proved; {NEEDED}")
    return document
