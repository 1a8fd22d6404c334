"""Where candidates are evaluated: in this process, in several, or on a cluster.

A worker evaluates a batch of items at once, so that the loops of a batch share vector lanes. The results depend on
neither the batches nor the workers, and a worker that dies costs time alone.
"""

from __future__ import annotations

import os
import signal
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from types import TracebackType
from typing import Any

#: Makes, in each worker, the function that turns a batch of items into their results.
Make = Callable[..., Callable[[Sequence[Any]], list[Any]]]

#: Share of the time that may go to hand-over, and batches a worker gets in one map where that allows it.
OVERHEAD, BATCHES = 0.05, 2
#: Variables that keep linear algebra to one thread in a worker: there is a worker for every core already.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
#: How often lost workers are replaced before the error is passed on.
REPLACEMENTS = 20


class Executor(ABC):
    """Maps a pure function over items.

    Attributes:
        workers: How many batches are evaluated at a time.
        hand_over: Time that handing over a batch costs, s.
    """

    workers: int = 1
    hand_over: float = 0.0
    _seconds_an_item: float = 0.0

    def map(self, items: Sequence[Any]) -> list[Any]:
        """Results in the order of the items."""
        found = dict(self.completed(items))
        return [found[k] for k in range(len(items))]

    def completed(self, items: Sequence[Any], size: int | None = None) -> Iterator[tuple[int, Any]]:
        """Results as they come, each with the index of its item; in batches of `size`, or as `batch_size` says."""
        size = self.batch_size(len(items)) if size is None else size
        batches = [list(items[first : first + size]) for first in range(0, len(items), size)]
        begun = time.perf_counter()
        for k, results in self._completed(batches):
            yield from enumerate(results, k * size)
        if items:
            busy = min(self.workers, len(batches))
            self._seconds_an_item = (time.perf_counter() - begun) * busy / len(items)

    def batch_size(self, items: int) -> int:
        """Items in a batch: enough that hand-over stays a small share, few enough that every worker has some."""
        if self.workers == 1 or items == 0:
            return max(items, 1)
        even = -(-items // (BATCHES * self.workers))
        least = self.hand_over / (OVERHEAD * self._seconds_an_item) if self._seconds_an_item > 0 else 1.0
        return min(max(even, round(least)), -(-items // self.workers))

    @abstractmethod
    def _completed(self, batches: list[list[Any]]) -> Iterator[tuple[int, list[Any]]]:
        """The index and the results of each batch, as they come."""

    def __enter__(self) -> Executor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(abandon=kind is not None)

    @abstractmethod
    def close(self, *, abandon: bool) -> None:
        """Free the workers; where `abandon`, without waiting for what they do."""


class Here(Executor):
    """Evaluates in this process."""

    def __init__(self, make: Make, arguments: tuple[Any, ...]) -> None:
        self._evaluate = make(*arguments)

    def _completed(self, batches: list[list[Any]]) -> Iterator[tuple[int, list[Any]]]:
        for k, batch in enumerate(batches):
            yield k, self._evaluate(batch)

    def close(self, *, abandon: bool) -> None:
        """Nothing to free."""


class Processes(Executor):
    """Evaluates in processes of this machine."""

    hand_over = 0.0005

    def __init__(self, make: Make, arguments: tuple[Any, ...], jobs: int) -> None:
        self.workers, self._task = jobs, (make, arguments)
        self._pool = self._open()

    def _open(self) -> ProcessPoolExecutor:
        pool = ProcessPoolExecutor(
            self.workers, mp_context=get_context("spawn"), initializer=_prepare, initargs=self._task
        )
        # processes inherit an ignored Ctrl-C from their first instant on; it is this process that reacts to it
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        before = {name: os.environ.get(name) for name in THREADS}
        os.environ.update(dict.fromkeys(THREADS, "1"))
        try:
            # each submission starts one process, as long as none of them has come up
            for _ in range(self.workers):
                pool.submit(_ready)
        finally:
            signal.signal(signal.SIGINT, handler)
            for name, value in before.items():
                os.environ.pop(name) if value is None else os.environ.update({name: value})
        return pool

    def _completed(self, batches: list[list[Any]]) -> Iterator[tuple[int, list[Any]]]:
        missing = set(range(len(batches)))
        for attempt in range(REPLACEMENTS + 1):
            try:
                futures = {self._pool.submit(_call, batches[k]): k for k in sorted(missing)}
                for future in as_completed(futures):
                    results = future.result()
                    missing.discard(futures[future])
                    yield futures[future], results
                return
            except BrokenProcessPool:
                if attempt == REPLACEMENTS:
                    raise
                self._pool.shutdown(wait=True, cancel_futures=True)
                self._pool = self._open()

    def close(self, *, abandon: bool) -> None:
        """End the processes."""
        if abandon:
            for child in active_children():
                child.terminate()
        self._pool.shutdown(wait=True, cancel_futures=True)


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


_evaluate: Callable[[Sequence[Any]], list[Any]] | None = None


def _prepare(make: Make, arguments: tuple[Any, ...]) -> None:
    global _evaluate
    _evaluate = make(*arguments)


def _ready() -> None:
    """Nothing; its submission starts a process."""


def _call(batch: list[Any]) -> list[Any]:
    if _evaluate is None:
        raise RuntimeError("the worker was not prepared")
    return _evaluate(batch)
