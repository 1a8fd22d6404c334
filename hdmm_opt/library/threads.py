"""One thread of linear algebra inside the library: its matrices are small, and idle threads cost many times more."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def alone(function: Callable[P, R]) -> Callable[P, R]:
    """The function with one thread of linear algebra while it runs; the caller's setting comes back."""

    @wraps(function)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        import numpy as np
        import scipy.linalg
        from threadpoolctl import threadpool_limits

        _ = np, scipy.linalg  # each brings a library of its own, which must be there to be limited
        with threadpool_limits(limits=1):
            return function(*args, **kwargs)

    return inside
