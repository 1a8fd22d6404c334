"""The sampled motion-state observer as expressions; `stability/loops/observer.py` has what it is."""

from __future__ import annotations

from typing import Any

from stability import Observer

#: Discrete states: ξ and η, and the errors of both estimates at the last sample.
SIZE = 4


def observed(observer: Observer, period: float, before: Any, error: Any) -> tuple[Any, Any]:
    """Estimates of position and speed less the reference's, and the observer's states after the period.

    Args:
        observer: Its gains.
        period: Control period, s.
        before: ξ and η. Shape (2,).
        error: Measured position less the reference's.
    """
    import casadi as ca

    missed = error - before[0]
    position, speed = before[0] + observer.first * missed, before[1] + observer.second * missed
    return ca.vertcat(position, speed), ca.vertcat(position + period * speed, speed)
