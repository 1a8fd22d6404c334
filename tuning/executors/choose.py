"""The executor for some workers."""

from __future__ import annotations

from typing import Any

from .executor import Executor, Make
from .here import Here
from .processes import Processes


def executor(make: Make, arguments: tuple[Any, ...], jobs: int = 1, cluster: str | None = None) -> Executor:
    """The executor for some workers.

    Args:
        make: Importable function that returns the function to map; called once in each worker.
        arguments: Its arguments; they must pickle.
        jobs: Processes; 1 evaluates here.
        cluster: Address of a Dask scheduler, or "local" for a cluster of `jobs` processes on this machine.

    Raises:
        ImportError: a cluster is asked for and Dask is not installed.
        OSError: the scheduler does not answer.
    """
    if cluster is not None:
        from .cluster import Cluster

        return Cluster(make, arguments, jobs, cluster)
    return Here(make, arguments) if jobs <= 1 else Processes(make, arguments, jobs)
