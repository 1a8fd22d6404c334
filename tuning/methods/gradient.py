"""Descent along the gradient of the cost inside the proved set: IPOPT from several starts."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..budget import Budget

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Derivatives:
    """What a point of the unit cube gives.

    Attributes:
        cost: Cost; NaN where the point has no certificate.
        gradient: Its derivatives. Shape (d,).
        slacks: Constraints, nonnegative inside the proved set. Shape (c,).
        jacobian: Their derivatives. Shape (c, d).
        evaluations: What it cost, in evaluations of a candidate.
    """

    cost: float
    gradient: Array
    slacks: Array
    jacobian: Array
    evaluations: int


class _SpentError(Exception):
    """The budget is used."""


def descend(
    differentiate: Callable[[Array, bool], Derivatives], starts: Sequence[Array], slacks: int, budget: Budget,
    progress: Callable[[int, float], None] = lambda used, cost: None,
) -> tuple[list[Array], int]:  # fmt: skip
    """Minimise the cost from each start in turn until the budget is used.

    Args:
        differentiate: Cost and constraints at a point; with derivatives where the second argument is true.
        starts: Points of the unit cube to begin from; the first ones matter most. Each shape (d,).
        slacks: Number of constraints c.
        budget: Evaluations by the count of `differentiate`, and seconds.
        progress: Called with the evaluations used and the best cost.

    Returns:
        All points that were tried and have a certificate and nonnegative slacks, in order of cost, and the
        evaluations used. A point is tried when IPOPT asks for it; IPOPT's status is not believed.

    References:
        A. Wächter and L. T. Biegler (2006), Mathematical Programming 106, 25-57.
    """
    tried: list[tuple[float, Array]] = []
    used, begun = 0, time.monotonic()
    known: dict[tuple[bytes, bool], Derivatives] = {}

    def at(point: Array, derivatives: bool) -> Derivatives:
        nonlocal used
        point = np.clip(point, 0.0, 1.0)
        for key in ((point.tobytes(), True), (point.tobytes(), derivatives)):
            if key in known:
                return known[key]
        if used >= budget.evaluations or time.monotonic() - begun > budget.seconds:
            raise _SpentError
        found = differentiate(point, derivatives)
        used += found.evaluations
        known[point.tobytes(), derivatives] = found
        if np.isfinite(found.cost) and (found.slacks >= 0).all():
            tried.append((found.cost, point))
            progress(used, min(cost for cost, _ in tried))
        return found

    for first in starts:
        try:
            _solve(at, first, slacks)
        except _SpentError:
            break
    return [point for _, point in sorted(tried, key=lambda entry: entry[0])], used


def _solve(at: Callable[[Array, bool], Derivatives], first: Array, slacks: int) -> None:
    import casadi as ca

    size = first.size
    spent = False

    class Values(ca.Callback):
        """[cost; slacks] as a function that CasADi can ask, with its Jacobian as another one."""

        def __init__(self, name: str, derivatives: bool) -> None:
            ca.Callback.__init__(self)
            self.derivatives = derivatives
            self.inner: Any = None
            self.construct(name, {"enable_fd": False})

        def get_n_in(self) -> int:
            return 2 if self.derivatives else 1

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            return ca.Sparsity.dense(size, 1) if i == 0 else ca.Sparsity.dense(1 + slacks, 1)

        def get_sparsity_out(self, i: int) -> Any:
            return ca.Sparsity.dense(1 + slacks, size if self.derivatives else 1)

        def has_jacobian(self) -> bool:
            return not self.derivatives

        def get_jacobian(self, name: str, inputs: Any, outputs: Any, options: Any) -> Any:
            self.inner = Values(name, True)
            return self.inner

        def eval(self, arguments: Any) -> Any:
            nonlocal spent
            try:
                found = at(np.array(arguments[0]).ravel(), self.derivatives)
            except _SpentError:
                # an exception must not cross the solver: no number makes it stop
                spent = True
                return [np.full((1 + slacks, size if self.derivatives else 1), np.nan)]
            if self.derivatives:
                return [np.vstack([found.gradient, found.jacobian])]
            return [np.concatenate([[found.cost], found.slacks])]

    values = Values("values", False)
    point = ca.MX.sym("point", size)
    both = values(point)
    options = {
        "ipopt": {
            "print_level": 0, "sb": "yes", "hessian_approximation": "limited-memory", "max_iter": 200,
            "bound_push": 1e-3, "bound_frac": 1e-3, "mu_init": 1e-2, "tol": 1e-5, "acceptable_iter": 3,
            "acceptable_tol": 1e-3,
        },
        "print_time": False, "error_on_fail": False, "show_eval_warnings": False,
    }  # fmt: skip
    solver = ca.nlpsol("descent", "ipopt", {"x": point, "f": both[0], "g": both[1:]}, options)
    solver(x0=first, lbx=0, ubx=1, lbg=0, ubg=ca.inf)
    if spent:
        raise _SpentError
