"""Options that several verbs share."""

from __future__ import annotations

from typing import Any

import click

from .statuses import QUIET

BUDGET = click.option(
    "--budget", type=click.Choice(["quick", "full"]), default="quick", show_default=True,
    help="quick: as the study says; full: 50 x 100 candidates, and for a design 1000 random runs and 10000 attacks.",
)  # fmt: skip
RESUME = click.option("--resume", is_flag=True, help="Go on with an interrupted job.")
SEED = click.option("--seed", type=click.IntRange(0), help="Seed of the search; that of the study by default.")
CLUSTER = click.option("--cluster", metavar="ADDRESS", help='Evaluate on a Dask scheduler, or "local" for one here.')
JOBS = click.option(
    "--jobs", type=click.IntRange(1, 256), default=1, show_default=True,
    help="Processes for the search, threads for the runs.",
)  # fmt: skip


ALLOW_CODE = click.option(
    "--allow-code", is_flag=True, help='Let plant.model = "FILE.py:FUNCTION" of STUDY run that file.'
)  # fmt: skip


VERBOSE = click.option("-v", "--verbose", is_flag=True, help="Show every obligation with its margin.")


def _be_quiet(context: click.Context, _: click.Parameter, value: bool) -> None:
    context.meta[QUIET] = value


QUIET_OPTION = click.option(
    "-q", "--quiet", is_flag=True, expose_value=False, callback=_be_quiet, help="No progress on stderr."
)


def work(command: Any) -> Any:
    """The options of verbs that design."""
    for option in (QUIET_OPTION, ALLOW_CODE, BUDGET, RESUME, SEED, CLUSTER, JOBS):
        command = option(command)
    return command


def options_of(jobs: int, cluster: str | None, seed: int | None, resume: bool, budget: str) -> Any:
    """The options of a job."""
    from ..jobs.options import Options

    return Options(seed=seed, jobs=jobs, full=budget == "full", resume=resume, cluster=cluster)
