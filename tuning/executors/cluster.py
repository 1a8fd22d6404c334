"""Evaluation on a Dask cluster; the scheduler gives the work of a lost worker to another one."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from .executor import Executor, Make

#: Time in which a scheduler has to answer, s.
ANSWER = 10
#: Workers that may die on one batch before it counts as the batch's fault.
DEATHS = 10


class Cluster(Executor):
    """Evaluates on the workers of a Dask scheduler.

    Args:
        make: Importable function that returns the function to map; called once in each worker.
        arguments: Its arguments; they must pickle.
        jobs: Workers of a local cluster.
        address: Address of a scheduler, or "local".

    Raises:
        ImportError: Dask is not installed.
        OSError: the scheduler does not answer.
    """

    hand_over = 0.003

    def __init__(self, make: Make, arguments: tuple[Any, ...], jobs: int, address: str) -> None:
        from dask.config import set as configure
        from distributed import Client, LocalCluster

        configure({"distributed.scheduler.allowed-failures": DEATHS})
        local = address == "local"
        self._own = (
            LocalCluster(n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address=":0")
            if local
            else None
        )
        self._client: Any = Client(self._own or address, timeout=ANSWER)
        self.workers = max(1, sum(self._client.nthreads().values()))
        self._task = (uuid.uuid4().hex, make, arguments)

    def _completed(self, batches: list[list[Any]]) -> Iterator[tuple[int, list[Any]]]:
        from distributed import as_completed

        futures = {self._client.submit(_call, self._task, batch, pure=False): k for k, batch in enumerate(batches)}
        for future, results in as_completed(list(futures), with_results=True):
            yield futures[future], results

    def close(self, *, abandon: bool) -> None:
        """Leave the cluster; end it where it is our own."""
        self._client.close()
        if self._own is not None:
            self._own.close()


#: The functions of the tasks that this worker has seen last, by the name of the task.
_made: dict[str, Callable[[Sequence[Any]], list[Any]]] = {}
_one_at_a_time = threading.Lock()


def _call(task: tuple[str, Make, tuple[Any, ...]], batch: list[Any]) -> list[Any]:
    name, make, arguments = task
    with _one_at_a_time:
        if name not in _made:
            _made.clear()
            _made[name] = make(*arguments)
        return _made[name](batch)
