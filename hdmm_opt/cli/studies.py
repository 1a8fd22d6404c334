"""`hdmm-opt studies`."""

from __future__ import annotations

import json

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--show", metavar="NAME", help="Print the file of a bundled study, to begin your own from.")
def command(as_json: bool, show: str | None) -> None:
    """List the bundled studies: name, machine, law, what it shows."""
    from ..study.read import bundled, bundled_text

    if show is not None:
        click.echo(bundled_text(show), nl=False)
        return
    rows = [row(name) for name in bundled()]
    if as_json:
        click.echo(json.dumps(rows, indent=1))
        return
    widths = {key: max(len(entry[key]) for entry in rows) for key in ("name", "machine", "law")}
    for entry in rows:
        click.echo("  ".join(entry[key].ljust(width) for key, width in widths.items()) + "  " + entry["shows"])


def row(name: str) -> dict[str, str]:
    """What is said of a bundled study."""
    from ..study import Study
    from ..study.read import load_any

    chosen = load_any(name)
    if isinstance(chosen, Study):
        count = len(chosen.members)
        machine = f"{chosen.plant.model} ({chosen.plant.level if count == 1 else f'{count} members'})"
        kind = " model-based" if chosen.controller.modelling else " model-free"
        law = f"{chosen.controller.law}{kind}, {chosen.controller.rate_hz:g} Hz"
    else:
        machine, law = chosen.plant.model, f"no law: {chosen.reference.kind} motion"
    return {"name": name, "machine": machine, "law": law, "shows": chosen.study.summary}
