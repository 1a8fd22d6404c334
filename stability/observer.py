"""The observer obligation: a certified bound on the estimation error of a motion-state observer, and what noise costs.

    x̂' = ŝ + l_1 (y - x̂),    ŝ' = a + l_2 (y - x̂),    y = x + n,    |n| <= noise,    |x'' - a| <= disturbance

estimates position and speed from an encoder alone. Its errors obey e' = A e + B w, which one quadratic certificate
bounds, proved exactly. Large gains forget the disturbance and amplify the noise: both shares are reported.

Source: Heydari Shahna (2025), P-4, for the observer; bounds derived here. Luenberger (1971) for its structure.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .quadratic import Inclusion, prove, search


@dataclass(frozen=True, kw_only=True)
class ObserverBounds:
    """Ultimate bounds, proved.

    Attributes:
        position: Bound on |x - x̂|, m.
        speed: Bound on |x' - ŝ|, m/s.
        amplification: Bound on the speed error per unit of noise, with no disturbance, 1/s.
        sensitivity: Bound on the speed error per unit of disturbance, with no noise, s.
    """

    position: float
    speed: float
    amplification: float
    sensitivity: float


def observer_bounds(
    first: float, second: float, *, noise: float, disturbance: float, spread: float = 0.0
) -> ObserverBounds | None:
    """Bounds on the errors of the observer.

    Args:
        first: l_1 > 0, 1/s.
        second: l_2 > 0, 1/s².
        noise: Bound on the encoder's error, quantisation included, m.
        disturbance: Bound on the acceleration that the model leaves out, m/s².
        spread: Relative uncertainty of the encoder's gain, which scales both innovations together.

    Returns:
        The bounds; None where no certificate is proved.

    Raises:
        ValueError: gains that are not positive, or negative bounds.

    Not guaranteed: the transient. The quadratic bound adds noise and disturbance as one ellipsoid holds both.
    """
    if not (first > 0 and second > 0 and noise >= 0 and disturbance >= 0 and 0 <= spread < 1):
        raise ValueError(
            f"an observer needs positive gains and bounds that are not negative: got {first:g}, {second:g}, {noise:g}, "
            f"{disturbance:g}, {spread:g}"
        )
    both = [_bound(first, second, noise, disturbance, spread, output) for output in (0, 1)]
    shares = _bound(first, second, 1.0, 0.0, spread, 1), _bound(first, second, 0.0, 1.0, spread, 1)
    if None in (*both, *shares):
        return None
    position, speed, amplification, sensitivity = (float(v or 0.0) for v in (*both, *shares))
    return ObserverBounds(position=position, speed=speed, amplification=amplification, sensitivity=sensitivity)


def _bound(first: float, second: float, noise: float, disturbance: float, spread: float, output: int) -> float | None:
    columns = [column for column, size in (((first, second), noise), ((0.0, 1.0), disturbance)) if size > 0]
    sizes = [size for size in (noise, disturbance) if size > 0]
    if not columns:
        return 0.0
    # an uncertain encoder gain: (1 + δ spread) (x - x̂) in both innovations
    uncertain = np.array([[first], [second]]) * spread
    inclusion = Inclusion(
        a=np.array([[-first, 1.0], [-second, 0.0]]),
        b=np.array(columns).T * np.array(sizes),
        left=uncertain if spread > 0 else np.zeros((2, 0)),
        right=np.array([[1.0, 0.0]]) if spread > 0 else np.zeros((0, 2)),
        sampled=False,
    )
    frequency = math.sqrt(second)
    length = max(noise, disturbance / second)
    found = search(inclusion, np.eye(2)[output], np.array([length, length * frequency]))
    squared = None if found is None else prove(inclusion, found)
    return None if squared is None else math.nextafter(math.sqrt(squared), math.inf)
