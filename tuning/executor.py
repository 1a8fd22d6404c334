"""Where candidates are evaluated: in this process or in several."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import active_children, get_context
from types import TracebackType
from typing import Any

_evaluate: Callable[[Any], Any] | None = None


def _prepare(make: Callable[..., Callable[[Any], Any]], arguments: tuple[Any, ...]) -> None:
    global _evaluate
    _evaluate = make(*arguments)


def _ready() -> None:
    """Nothing; its submission starts the processes."""


def _call(item: Any) -> Any:
    if _evaluate is None:
        raise RuntimeError("the worker was not prepared")
    return _evaluate(item)


class Executor:
    """Maps a pure function over items; the order and the values do not depend on the number of processes.

    Args:
        make: Importable function that returns the function to map; called once in each process.
        arguments: Its arguments; they must pickle.
        jobs: Number of processes; 1 runs here.
    """

    def __init__(self, make: Callable[..., Callable[[Any], Any]], arguments: tuple[Any, ...], jobs: int = 1) -> None:
        self._local = make(*arguments) if jobs <= 1 else None
        self._pool = None
        if jobs > 1:
            self._pool = ProcessPoolExecutor(
                jobs, mp_context=get_context("spawn"), initializer=_prepare, initargs=(make, arguments)
            )
            # processes inherit an ignored Ctrl-C from their first instant on; it is this process that reacts to it
            handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
            try:
                self._pool.submit(_ready)
            finally:
                signal.signal(signal.SIGINT, handler)

    def map(self, items: Sequence[Any]) -> list[Any]:
        """Results in the order of the items."""
        if self._pool is None:
            return [self._local(item) for item in items] if self._local else []
        return list(self._pool.map(_call, items))

    def __enter__(self) -> Executor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is not None:
            if kind is not None:
                for child in active_children():
                    child.terminate()
            self._pool.shutdown(wait=True, cancel_futures=True)
