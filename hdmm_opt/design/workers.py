"""The executor that a user asked for, or one line on why there is none."""

from __future__ import annotations

from typing import Any

from tuning import Executor, executor
from tuning.executors.executor import Make

from ..errors import InvalidInputError


def workers(make: Make, arguments: tuple[Any, ...], jobs: int, cluster: str | None) -> Executor:
    """`tuning.executor`, with its failures as bad input.

    Raises:
        InvalidInputError: Dask is not installed, or no scheduler answers at the address.
    """
    try:
        return executor(make, arguments, jobs, cluster)
    except ImportError:
        raise InvalidInputError(
            '--cluster needs Dask, which is not installed; pip install "hdmm-opt[cluster]", or leave it out'
        ) from None
    except (OSError, ValueError) as error:
        if cluster is None:
            raise
        reason = str(error).splitlines()[0]
        raise InvalidInputError(
            f"--cluster needs the address of a Dask scheduler: got {cluster}: {reason}; start one with "
            '"dask scheduler", or give "local"'
        ) from None
