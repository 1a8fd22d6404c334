"""What every executor is: a pure function mapped over items, in batches, here or elsewhere.

A worker evaluates a batch of items at once, so that the loops of a batch share vector lanes. The results depend on
neither the batches nor the workers, and a worker that dies costs time alone.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any

#: Makes, in each worker, the function that turns a batch of items into their results.
Make = Callable[..., Callable[[Sequence[Any]], list[Any]]]

#: Share of the time that may go to hand-over, and batches a worker gets in one map where that allows it.
OVERHEAD, BATCHES = 0.05, 2


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
