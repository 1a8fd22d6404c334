"""Evaluation in this process."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .executor import Executor, Make


class Here(Executor):
    """Evaluates in this process."""

    def __init__(self, make: Make, arguments: tuple[Any, ...]) -> None:
        self._evaluate = make(*arguments)

    def _completed(self, batches: list[list[Any]]) -> Iterator[tuple[int, list[Any]]]:
        for k, batch in enumerate(batches):
            yield k, self._evaluate(batch)

    def close(self, *, abandon: bool) -> None:
        """Nothing to free."""
