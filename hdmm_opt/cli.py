"""The command line: each verb parses, calls one function, and returns an exit status.

0 proved or done, 1 not proved or a requirement missed, 2 misuse or unreadable input, 130 interrupted. Human text goes
to stderr, results to stdout. Heavy libraries are imported inside the verbs.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import click

PROVED, NOT_PROVED, MISUSE, INTERRUPTED = 0, 1, 2, 130


# The matrices here are small: threads of the linear algebra only get in the way of the search's own workers.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")


class _Group(click.Group):
    """Turns bad input into one line and exit status 2, and Ctrl-C into 130."""

    def invoke(self, ctx: click.Context) -> Any:
        from .errors import DefectError, InvalidInputError

        try:
            return super().invoke(ctx)
        except InvalidInputError as error:
            click.echo(f"hdmm-opt: {error}", err=True)
            sys.exit(MISUSE)
        except DefectError as error:
            click.echo(f"hdmm-opt: DEFECT of the prover: {error}", err=True)
            sys.exit(NOT_PROVED)
        except (KeyboardInterrupt, click.Abort):
            click.echo("hdmm-opt: interrupted; nothing half-written, go on with --resume", err=True)
            sys.exit(INTERRUPTED)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="hdmm-opt")
def main() -> None:
    """Design controllers for heavy-duty mobile machines, with proofs that anyone can re-check.

    Start with "hdmm-opt studies", then "hdmm-opt design emla-p2", then "hdmm-opt check emla-p2.gains.json".
    """


@main.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def studies(as_json: bool) -> None:
    """List the bundled studies: name, machine, law, what it shows."""
    from .commands import study_row
    from .study import bundled

    rows = [study_row(name) for name in bundled()]
    if as_json:
        click.echo(json.dumps(rows, indent=1))
        return
    widths = {key: max(len(row[key]) for row in rows) for key in ("name", "machine", "law")}
    for row in rows:
        click.echo("  ".join(row[key].ljust(width) for key, width in widths.items()) + "  " + row["shows"])


def _work(command: Any) -> Any:
    """The options of verbs that design."""
    for option in (
        click.option("--budget", type=click.Choice(["quick", "full"]), default="quick", show_default=True,
                     help="quick: as the study says; full: 50 x 100 candidates, 1000 random runs, 10000 attacks."),
        click.option("--resume", is_flag=True, help="Go on with an interrupted job."),
        click.option("--seed", type=click.IntRange(0), help="Seed of the search; that of the study by default."),
        click.option("--cluster", metavar="ADDRESS", help='Evaluate on a Dask scheduler, or "local" for one here.'),
        click.option("--jobs", type=click.IntRange(1, 256), default=1, show_default=True,
                     help="Processes for the search, threads for the runs."),
    ):  # fmt: skip
        command = option(command)
    return command


def _options(jobs: int, cluster: str | None, seed: int | None, resume: bool, budget: str) -> Any:
    from .selection import Options

    return Options(seed=seed, jobs=jobs, full=budget == "full", resume=resume, cluster=cluster)


@main.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="Gain file to write; STUDY.gains.json by default.")
@click.option("--report", type=click.Path(path_type=Path, file_okay=False), help="Folder for an HTML report.")
@click.option(
    "--exchange",
    nargs=2,
    type=(click.Path(path_type=Path), str),
    metavar="FILE JOINT",
    help="For a machine: take FILE's proofs, and prove anew only JOINT, whose actuator is another in STUDY.",
)
@_work
def design(
    study: str, output: Path | None, report: Path | None, exchange: tuple[Path, str] | None, **work: Any
) -> None:
    """Design gains for STUDY, a bundled name or a TOML file: reference, gains, proof, validation, gain file."""
    from .commands import run_design

    sys.exit(run_design(study, output, report, _options(**work), exchange))


@main.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="JSON file for gains and figures of all.")
@click.option("--seed", type=click.IntRange(0), help="Seed of the searches; that of the study by default.")
@click.option(
    "--jobs", type=click.IntRange(1, 256), default=1, show_default=True, help="Processes for the law's search."
)
@click.option(
    "--budget",
    type=click.Choice(["quick", "full"]),
    default="quick",
    show_default=True,
    help="Candidates for each controller; quick: as the study says; full: 50 x 101.",
)
def compare(study: str, output: Path | None, seed: int | None, jobs: int, budget: str) -> None:
    """Compare the law with its rivals on STUDY, a machine: equal tuning budget, same scenarios, same inner loops."""
    from .machine_commands import run_compare
    from .study import load_any

    sys.exit(run_compare(load_any(study), output, _options(jobs, None, seed, False, budget)))


@main.command()
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
@_work
def sweep(study: str, vary: tuple[str, ...], output: Path | None, **work: Any) -> None:  # fmt: skip
    """Design STUDY at every point of a grid of its numbers; what is proved where, and with which gains."""
    from .commands import run_sweep

    sys.exit(run_sweep(study, vary, output, _options(**work)))


@main.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="Set to write; STUDY.tradeoff.json by default.")
@_work
def tradeoff(study: str, output: Path | None, **work: Any) -> None:
    """The Pareto set of STUDY's gains: simulated error, certified error, and the share of the limits they use."""
    from .commands import run_tradeoff

    sys.exit(run_tradeoff(study, output, _options(**work)))


@main.command()
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option("--json", "as_json", is_flag=True, help="Print the verdicts as JSON.")
@click.option("--junit", type=click.Path(path_type=Path), help="Write the verdicts as JUnit XML.")
def check(files: tuple[Path, ...], as_json: bool, junit: Path | None) -> None:
    """Re-prove gain files from the files alone, in exact arithmetic. Nothing that a file says of itself is believed."""
    from .verdicts import run_check

    sys.exit(run_check(files, as_json, junit))


@main.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--scenario", help="One scenario: a name of the study, worst-case, or witness (of a refusal).")
@click.option("--csv", "csv_path", type=click.Path(path_type=Path), help="Write the signals of one scenario as CSV.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def simulate(file: Path, scenario: str | None, csv_path: Path | None, as_json: bool) -> None:
    """Simulate the closed loop with the gains of FILE (a gain file, or what a refusal left behind)."""
    from .commands import run_simulate

    sys.exit(run_simulate(file, scenario, csv_path, as_json))


@main.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--budget", type=click.IntRange(1), default=300, show_default=True, help="Number of simulated runs.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the search.")
@click.option("--jobs", type=click.IntRange(1, 256), default=1, show_default=True, help="Threads for the runs.")
@click.option("--resume", is_flag=True, help="Go on with an interrupted search.")
def falsify(file: Path, budget: int, seed: int, jobs: int, resume: bool) -> None:
    """Search the worst load, parameters and start inside the assumptions of FILE, and keep the worst in it."""
    from .commands import run_falsify

    sys.exit(run_falsify(file, budget, seed, jobs=jobs, resume=resume))


@main.command()
@click.argument("study")
@click.option("-o", "output", type=click.Path(path_type=Path), help="Write the reference as JSON.")
def trajectory(study: str, output: Path | None) -> None:
    """Build the reference of STUDY alone, and show the limits that it respects."""
    from .commands import run_trajectory

    sys.exit(run_trajectory(study, output))
