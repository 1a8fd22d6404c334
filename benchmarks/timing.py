"""How the benchmarks take time."""

from __future__ import annotations

import time
from collections.abc import Callable


def fastest(action: Callable[[], object], repeats: int = 5) -> float:
    """Shortest of some runs after one that warms up, s."""
    action()
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        action()
        times.append(time.perf_counter() - begun)
    return min(times)
