"""The sampled motion-state observer with one adaptive scalar (P-4), as expressions."""

from __future__ import annotations

from typing import Any

from stability.networks.observer import SampledObserver

#: Discrete states of an observer: x̂, ŝ, θ̂.
STATES = 3


def observed(
    observer: SampledObserver, adapting: tuple[float, float], noise: float, estimate: Any, encoder: Any, gain: Any
) -> Any:
    """The observer after a period.

    Args:
        observer: Its gains.
        adapting: ε and σ of its adaptive scalar.
        noise: Bound on the encoder's error, by which its own error is measured.
        estimate: x̂, ŝ and θ̂ before. Shape (3,).
        encoder: Measured position.
        gain: Acceleration of the reference.
    """
    import casadi as ca

    epsilon, sigma = adapting
    t = observer.period
    error = encoder - estimate[0]
    factor = (1 + estimate[2]) * error
    theta = estimate[2] + t * (epsilon * (error / noise) ** 2 / 2 - sigma * estimate[2])
    return ca.vertcat(
        estimate[0] + t * estimate[1] + t**2 / 2 * gain + observer.first * factor,
        estimate[1] + t * gain + observer.second * factor,
        ca.fmin(ca.fmax(theta, 0), observer.largest),
    )  # fmt: skip
