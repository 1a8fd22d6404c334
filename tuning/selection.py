"""Stage one of the gain selection: convex programs that lead to a proved starting point.

With the weights fixed, the conditions are convex in the gains of a row once the rows before it are fixed (theory §3);
with the gains fixed, they are convex in the weights. Alternating the two lowers the gains to the smallest that still
prove the required bound: small gains leave the most room for sampling, limits and noise.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stability import Certificate, Composition, Failure, Gains

Array = NDArray[np.float64]
Certify = Callable[[tuple[Gains, ...]], Certificate | Failure]
Compose = Callable[[tuple[Gains, ...]], Composition | Failure]

#: Largest factor by which one alternation may change a gain.
TRUST = 1.35


@dataclass(frozen=True, kw_only=True)
class Selection:
    """A starting point for the search.

    Attributes:
        gains: The gains.
        certificate: What certifies them, or why nothing does.
        rounds: Convex programs solved.
    """

    gains: tuple[Gains, ...]
    certificate: Certificate | Failure
    rounds: int


def select(
    certify: Certify,
    compose: Compose,
    violation: Callable[[Certificate | Failure], float],
    candidates: list[tuple[Gains, ...]],
    ranges: list[tuple[float, float]],
    target: float,
    *,
    rounds: int = 6,
) -> Selection:
    """Find proved gains.

    Args:
        certify: Certificate search for given gains.
        compose: Composition certificate of the continuous law, whose weights the convex program needs.
        violation: How far a certificate is from all obligations; 0 where they hold.
        candidates: Gains to try first.
        ranges: Admissible range of each β. Length k.
        target: Required bound on |Q_1|.
        rounds: Alternations.

    Returns:
        The best gains met on the way, by violation and then by certified bound. They may fail: the caller looks.
    """
    tried = [(gains, certify(gains)) for gains in candidates]
    best = min(tried, key=lambda entry: _rank(entry[1], violation))
    solved = 0
    gains, found = best
    for _ in range(rounds):
        composed = compose(gains)
        if isinstance(composed, Failure):
            break
        proposal = smaller_gains(composed, gains, ranges, target)
        solved += 1
        if proposal is None:
            break
        gains, found = proposal, certify(proposal)
        if _rank(found, violation) < _rank(best[1], violation):
            best = (gains, found)
    return Selection(gains=best[0], certificate=best[1], rounds=solved)


def _rank(found: Certificate | Failure, violation: Callable[[Certificate | Failure], float]) -> tuple[float, float]:
    return (violation(found), math.inf if isinstance(found, Failure) else float(found.ball[0]))


def smaller_gains(
    found: Composition, gains: tuple[Gains, ...], ranges: list[tuple[float, float]], target: float
) -> tuple[Gains, ...] | None:
    """The select program: weights fixed, minimise the sum of β_i / β_i(now), outer rows' effect on inner rows frozen.

    Returns:
        New gains within a trust region, or None where the program has no solution.
    """
    import cvxpy as cp

    rows, w, mu = found.rows, found.weights, found.decay
    governed = np.flatnonzero(rows.control_gain > 0)
    n, scale = len(w), np.sqrt(w * rows.mass_high)
    ratio, young = cp.Variable(len(governed)), cp.Variable(n)
    diagonal = []
    for i in range(n):
        own = rows.control_gain[i] / (2 * rows.mass_high[i])
        change = 0.0
        for k in np.flatnonzero(governed == i):
            change = own * gains[int(k)].beta * (ratio[int(k)] - 1)
        diagonal.append(-rows.high[i, i] / rows.mass_high[i] - mu / 2 + change - young[i] / 2)
    middle, radius = (rows.low + rows.high) / 2, (rows.high - rows.low) / 2
    size = (np.abs(w[:, None] * middle + (w[:, None] * middle).T) + w[:, None] * radius + (w[:, None] * radius).T) / 2
    size = size / np.outer(scale, scale)
    matrix = [[diagonal[i] if i == j else -size[i, j] for j in range(n)] for i in range(n)]
    disturbance = np.sqrt(w) * rows.disturbance / np.sqrt(rows.mass_high)
    level = mu * w[0] * rows.mass_low[0] * target**2 / 2
    cost = sum(cp.quad_over_lin(disturbance[i], young[i]) for i in range(n)) / (2 * level)
    low = np.array([max(r[0] / g.beta, 1 / TRUST) for g, r in zip(gains, ranges, strict=True)])
    high = np.array([min(r[1] / g.beta, TRUST) for g, r in zip(gains, ranges, strict=True)])
    bounds = [cp.bmat(matrix) >> 0, cost <= 1, ratio >= low, ratio <= high, young >= 1e-9]
    problem = cp.Problem(cp.Minimize(cp.sum(ratio)), bounds)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Solution may be inaccurate", category=UserWarning)
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.SolverError:
            return None
    if problem.status != cp.OPTIMAL or ratio.value is None or not np.isfinite(ratio.value).all():
        return None
    return tuple(replace(g, beta=float(g.beta * r)) for g, r in zip(gains, ratio.value, strict=True))
