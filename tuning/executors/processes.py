"""Evaluation in processes of this machine; those that are lost are replaced."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from typing import Any

from .executor import Executor, Make

#: Variables that keep linear algebra to one thread in a worker: there is a worker for every core already.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
#: How often lost workers are replaced before the error is passed on.
REPLACEMENTS = 20


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
