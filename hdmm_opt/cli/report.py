"""`hdmm-opt report`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("-o", "folder", type=click.Path(path_type=Path, file_okay=False), default=Path("report"),
              show_default=True, help="Folder for the page.")  # fmt: skip
def command(file: Path, folder: Path) -> None:
    """Write the HTML page of FILE, a gain file or what a refusal left behind."""
    from ..files.read import read
    from ..files.report import PAGE_NAME, check_report, write_report
    from ..files.restore import whole
    from ..files.text import prepared_folder

    check_report()
    document = read(file)
    prepared_folder(folder, PAGE_NAME)
    with whole():
        target = write_report(document, folder)
    click.echo(str(target))
