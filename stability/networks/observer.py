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

from ..certificates.quadratic import Inclusion, prove, search


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


@dataclass(frozen=True, kw_only=True)
class SampledObserver:
    """A motion-state observer in sampled code, with one adaptive scalar (P-4).

        e = y - x̂,   x̂ <- x̂ + T ŝ + T²/2 a + (1 + θ̂) l_1 e,   ŝ <- ŝ + T a + (1 + θ̂) l_2 e,   0 <= θ̂ <= largest
        θ̂ <- θ̂ + T (ε e²/2 - σ θ̂), kept between its bounds

    Attributes:
        first: l_1 > 0.
        second: l_2 > 0, 1/s.
        largest: Bound on θ̂, 0 or more.
        period: T, s.

    Raises:
        ValueError: numbers outside these ranges.
    """

    first: float
    second: float
    largest: float
    period: float

    def __post_init__(self) -> None:
        if not (self.first > 0 and self.second > 0 and self.largest >= 0 and self.period > 0):
            raise ValueError(
                f"an observer needs positive gains and period, and a bound on θ̂ that is not negative: {self}"
            )

    @staticmethod
    def of_bandwidth(bandwidth: float, largest: float, period: float) -> SampledObserver:
        """A double real pole at exp(-bandwidth · T) for the middle of the adaptive gain."""
        away = -math.expm1(-bandwidth * period)
        middle = 1 + largest / 2
        return SampledObserver(
            first=_decimal(2 * away / middle), second=_decimal(away**2 / (period * middle)), largest=largest,
            period=period,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ObserverProof:
    """Bounds that hold at every sample; `checker.py` decides them.

    Attributes:
        pole: λ of the coordinates y_1 = e_1, y_2 = e_2 + k e_1 with k = (1 - g l_1 - λ)/T, g the middle gain.
        reach: R with |y| <= R. Length 2.
        position: Bound on |x - x̂|.
        speed: Bound on |x' - ŝ|.
    """

    pole: float
    reach: tuple[float, float]
    position: float
    speed: float


def sampled_bounds(
    observer: SampledObserver, *, noise: float, acceleration: float, initial: float
) -> ObserverProof | None:
    """Bounds on the errors of the sampled observer, from a comparison system as in `sampled.py`.

    Args:
        observer: Its gains.
        noise: Bound on the encoder's error, quantisation included.
        acceleration: Bound on |x'' - a|, between the samples too.
        initial: Bound on |x' - ŝ| at the start, where x̂ is the first measurement.

    Returns:
        The bounds; None where the observer does not contract for all values of its adaptive scalar.

    Not guaranteed: tightness where the adaptive scalar may move far, or the poles are complex.
    """
    t, middle, spread = observer.period, 1 + observer.largest / 2, observer.largest / 2
    trace = 2 - middle * observer.first
    product = 1 - middle * observer.first + t * middle * observer.second
    pole = _decimal(trace / 2 + math.sqrt(max(trace**2 / 4 - product, 0.0)))
    k = (1 - middle * observer.first - pole) / t
    inward = np.array([observer.first, observer.second + k * observer.first])
    nominal = np.array([[1 - middle * observer.first - k * t, t], [0.0, 0.0]])
    nominal[1] = [-(middle * observer.second + k * middle * observer.first) + k - k * (1 + k * t), 1 + k * t]
    moving = np.abs(nominal)
    moving[:, 0] += spread * np.abs(inward)
    push = (1 + observer.largest) * noise * np.abs(inward)
    push += acceleration * t * np.array([t / 2, 1 + abs(k) * t / 2])
    if not float(np.max(np.abs(np.linalg.eigvals(moving)))) < 1 - 1e-9:
        return None
    start = np.array([noise, initial + abs(k) * noise])
    reach = np.linalg.solve(np.eye(2) - moving, push * (1 + 1e-6))
    # a start outside grows the set along a direction in which it still contracts
    widest = float(np.max(start / reach, initial=1.0))
    reach = reach * widest * (1 + 1e-6)
    return ObserverProof(
        pole=pole, reach=(float(reach[0]), float(reach[1])), position=float(reach[0]),
        speed=float(reach[1] + abs(k) * reach[0]) * (1 + 1e-9),
    )  # fmt: skip


def _decimal(value: float) -> float:
    """Nine digits: what a file carries as a short rational."""
    return float(f"{value:.8e}")
