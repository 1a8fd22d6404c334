"""Where a file comes from: versions, seed, budget, time. Nothing of it is part of what is proved."""

from __future__ import annotations

import os
import platform
import time
from importlib import metadata
from typing import Any

PACKAGES = ("hdmm-opt", "casadi", "cvxpy", "clarabel", "llvmlite", "numpy", "scipy")


def provenance(seed: int, jobs: int, budget: str, spent: dict[str, int], begun: float) -> dict[str, Any]:
    """The `provenance` section of a gain file.

    Args:
        seed: Seed of the search.
        jobs: Threads.
        budget: Which budget was used.
        spent: What the search cost.
        begun: When the job began, by `time.perf_counter`.
    """
    return {
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in PACKAGES}},
        "seed": seed,
        "budget": budget,
        **spent,
        "wall_time_s": round(time.perf_counter() - begun, 3),
        "threads": jobs,
        "cpus": os.cpu_count(),
    }


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "unknown"
