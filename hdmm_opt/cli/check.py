"""`hdmm-opt check`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from .options import VERBOSE


@click.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option("--json", "as_json", is_flag=True, help="Print the verdicts as JSON.")
@click.option("--junit", type=click.Path(path_type=Path), help="Write the verdicts as JUnit XML.")
@VERBOSE
def command(files: tuple[Path, ...], as_json: bool, junit: Path | None, verbose: bool) -> None:
    """Re-prove gain files from the files alone, in exact arithmetic.

    Nothing that a file says of itself is believed.
    """
    from stability import checker

    from ..files.junit import to_xml
    from ..files.text import check_writable, write_text

    if junit is not None:
        check_writable(junit)
    reports = [checker.check_file(path) for path in files]
    checker.show(reports, as_json=as_json, verbose=verbose)
    if junit is not None:
        write_text(junit, to_xml(reports))
    sys.exit(max(report.status for report in reports))
