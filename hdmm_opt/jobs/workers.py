"""The executor that a user asked for, or one line on why there is none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tuning import Executor, executor
from tuning.executors.executor import Make

from ..errors import InvalidInputError
from ..plants.own import allow, allowed


def _with_code(code: tuple[tuple[str, Path], ...], make: Make, arguments: tuple[Any, ...]) -> Any:
    """`make` in a process that may run the same plants of the user's own."""
    for name, file in code:
        allow(f"{file}:{name.rpartition(':')[2]}", file.parent, known_as=name)
    return make(*arguments)


def workers(make: Make, arguments: tuple[Any, ...], jobs: int, cluster: str | None) -> Executor:
    """`tuning.executor`, with its failures as bad input.

    Raises:
        InvalidInputError: Dask is not installed, or no scheduler answers at the address.
    """
    try:
        return executor(_with_code, (allowed(), make, arguments), jobs, cluster)
    except ImportError:
        raise InvalidInputError(
            '--cluster needs Dask, which is not installed; pip install "dask[distributed]", or leave it out'
        ) from None
    except (OSError, ValueError) as error:
        if cluster is None:
            raise
        reason = str(error).splitlines()[0]
        raise InvalidInputError(
            f"--cluster needs the address of a Dask scheduler: got {cluster}: {reason}; start one with "
            '"dask scheduler", or give "local"'
        ) from None
