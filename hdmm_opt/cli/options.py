"""Options that several verbs share."""

from __future__ import annotations

from typing import Any

import click

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


def work(command: Any) -> Any:
    """The options of verbs that design."""
    for option in (BUDGET, RESUME, SEED, CLUSTER, JOBS):
        command = option(command)
    return command


def options_of(jobs: int, cluster: str | None, seed: int | None, resume: bool, budget: str) -> Any:
    """The options of a job."""
    from ..design.options import Options

    return Options(seed=seed, jobs=jobs, full=budget == "full", resume=resume, cluster=cluster)
