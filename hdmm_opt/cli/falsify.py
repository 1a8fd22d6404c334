"""`hdmm-opt falsify`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from .inputs import must_be_proved
from .options import QUIET_OPTION, RESUME
from .statuses import PROVED


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--budget", type=click.IntRange(1), default=300, show_default=True, help="Number of simulated runs.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the search.")
@click.option("--jobs", type=click.IntRange(1, 256), default=1, show_default=True, help="Threads for the runs.")
@RESUME
@QUIET_OPTION
def command(file: Path, budget: int, seed: int, jobs: int, resume: bool) -> None:
    """Search the worst load, parameters and start inside the assumptions of FILE, and keep the worst in it."""
    sys.exit(run(file, budget, seed, jobs=jobs, resume=resume))


def run(path: Path, budget: int, seed: int, *, jobs: int = 1, resume: bool = False) -> int:
    """Attack a proved file, and write it with its worst run."""
    from ..errors import DefectError
    from ..files.read import certified_of, read
    from ..files.seal import prove, to_text
    from ..files.text import upward, write_text
    from ..files.validation import stored
    from ..jobs.attack import attacked
    from .outputs import claimed
    from .progress import bar

    must_be_proved(path, "only a proved file can be attacked")
    document = read(path)
    kept = path.with_name(f".{path.name}.falsify.state")
    with claimed(path):
        with bar() as progress:
            problem, found = attacked(document, budget, seed, progress, jobs=jobs, kept=kept, resume=resume)
        finished, verdict = prove(stored(problem, document, found))
        if verdict.status != PROVED:
            raise DefectError(f"the file is no longer proved with its witness: {verdict.message}")
        # in this order: a file that is attacked already must not be attacked again by a resumed run
        kept.unlink(missing_ok=True)
        write_text(path, to_text(finished))
    click.echo(f"{found.runs} runs, none outside the certified envelope (that proves nothing more)", err=True)
    late, bound = found.figures.maximum_error_m, certified_of(document)
    worst = finished["validation"]["largest_error_after_transient_m"]
    unit = f"m{problem.machine.output_unit}"
    recorded = f"worst on record {1e3 * worst:.4g} {unit}, certified {upward(1e3 * bound)} {unit}"
    used = f"at most {100 * found.largest_use:.3g} % of a limit used"
    click.echo(f"worst {1e3 * late:.4g} {unit}, {recorded}: ratio {bound / worst:.3g}; {used}")
    return PROVED
