"""The exact zero-order-hold map of the plant in deviations, and the comparison system that bounds it over a period.

Between two samples the plant is ``M z' = J z + B v + d`` with held v (see `deviation.py`). Its map over a period is
split into the exact map of the nominal numbers and the noise, the first-order effect of each uncertain inertia, kept
with its sign, and a rest that a positive linear system bounds: deviations of J and B, disturbance, drift of the
feed-forward. In coordinates y = W z this gives ``|y(t + T)| <= A_v |y(t)| + b_v`` at every vertex v of the inertias.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .deviation import DeviationRows
from .model import LoopModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Map:
    """|y(t + T)| <= A_v |y| + b_v at every vertex, and what happens in between.

    Attributes:
        nominal: The nominal closed map in y, with its signs. Shape (n, n).
        vertices: Pairs (A_v, b_v). Shapes (n, n), (n,).
        inverse: W^-1. Shape (n, n).
        control: Bounds |v| <= control |y|. Shape (m, n).
        motion: Bounds |z(t) - z(t_k)| <= motion[0] |y| + motion[1] within a period. Shapes (n, n), (n,).
    """

    nominal: Array
    vertices: list[tuple[Array, Array]]
    inverse: Array
    control: Array
    motion: tuple[Array, Array]


@dataclass(frozen=True)
class Nominal:
    """Middle values and spreads of the enclosures, rows divided by a middle inertia M0.

    Attributes:
        a: J0 / M0. Shape (n, n).
        b: B0 / M0. Shape (n, m).
        a_spread: Radius of J over M0. Shape (n, n).
        b_spread: Radius of B over M0. Shape (n, m).
        k: Middle feedback. Shape (m, n).
        k_spread: Radius of the feedback. Shape (m, n).
        inertia: Bounds μ_i on |M0_i / M_i - 1|. Shape (n,).
        mass: M0. Shape (n,).
    """

    a: Array
    b: Array
    a_spread: Array
    b_spread: Array
    k: Array
    k_spread: Array
    inertia: Array
    mass: Array


def nominal(rows: DeviationRows) -> Nominal:
    """Split the enclosures into middle and spread."""
    mass = 2 / (1 / rows.mass_low + 1 / rows.mass_high)
    per = 1 / mass[:, None]
    return Nominal(
        a=(rows.low + rows.high) / 2 * per,
        b=(rows.input_low + rows.input_high) / 2 * per,
        a_spread=(rows.high - rows.low) / 2 * per,
        b_spread=(rows.input_high - rows.input_low) / 2 * per,
        k=(rows.feedback_low + rows.feedback_high) / 2,
        k_spread=(rows.feedback_high - rows.feedback_low) / 2,
        inertia=mass / rows.mass_low - 1,
        mass=mass,
    )


def held_map(a: Array, b: Array, period: float) -> tuple[Array, Array]:
    """The zero-order-hold map: z(t + T) = Φ z + Γ v."""
    from scipy.linalg import expm

    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = a, b
    whole = np.asarray(expm(block * period), dtype=np.float64)
    return whole[:n, :n], whole[:n, n:]


def coordinates(model: LoopModel, rows: DeviationRows, period: float) -> Array:
    """W: along each chain of rows y_1 = z_1 and y_{i+1} = (y_i(t + T) - λ_i y_i) / T, slow poles first.

    A loop with real, positive poles becomes a cascade of first-order lags, whose peak the comparison finds exactly.
    """
    at = nominal(rows)
    transition, entry = held_map(at.a, at.b, period)
    closed = transition - entry @ at.k
    w = np.zeros_like(closed)
    for chain in chains(model):
        block = closed[np.ix_(chain, chain)]
        poles = sorted(np.linalg.eigvals(block), key=lambda v: (-abs(v), v.imag))
        row = np.eye(len(chain))[0]
        for k, i in enumerate(chain):
            w[i, chain] = row
            row = row @ (block - np.real(poles[k]) * np.eye(len(chain))) / period
    return w


def chains(model: LoopModel) -> list[list[int]]:
    """Rows that follow each other, by their targets."""
    found: list[list[int]] = []
    for i, row in enumerate(model.rows):
        home = next((chain for chain in found if row.target in chain), None)
        found.append([i]) if home is None else home.append(i)
    return found


def comparison(rows: DeviationRows, period: float, transform: Array) -> Map:
    """The comparison system in the coordinates y = W z.

    Args:
        rows: Enclosures of the plant.
        period: Control period, s.
        transform: W. Shape (n, n).

    Raises:
        LinAlgError: W is singular.
    """
    at = nominal(rows)
    n = len(at.a)
    transition, entry = held_map(at.a, at.b, period)
    closed, drive = transition - entry @ at.k, at.a - at.b @ at.k
    rest = _rest(at, rows, period)
    inverse = np.asarray(np.linalg.inv(transform), dtype=np.float64)
    size, back = np.abs(transform), np.abs(inverse)
    control = np.abs(at.k @ inverse) + at.k_spread @ back

    speed, known = np.abs(drive @ inverse), np.abs(at.b) @ rows.noise

    def fold(block: Array) -> tuple[Array, Array]:
        here, quick, inputs = block[:, :n], block[:, n : 2 * n], block[:, 2 * n : -1]
        moving = here @ back + quick @ speed + inputs @ control
        return moving, quick @ known + inputs @ rows.noise + block[:, -1]

    shares = [tuple(size @ part for part in fold(rest.share(i))) for i in range(n)]
    base = transform @ closed @ inverse
    uncertain = [i for i in range(n) if at.inertia[i] > 0]
    effects = {i: transform @ _inertia_effect(at.a, i, period) for i in uncertain}
    noise = np.abs(transform @ entry) @ rows.noise
    noise += sum((at.inertia[i] * np.abs(e @ at.b) @ rows.noise for i, e in effects.items()), np.zeros(n))
    effects = {i: e @ drive @ inverse for i, e in effects.items()}
    vertices = []
    for signs in product((-1.0, 1.0), repeat=len(uncertain)):
        change = np.zeros(n)
        change[uncertain] = np.array(signs) * at.inertia[uncertain]
        signed = base + sum((change[i] * effects[i] for i in uncertain), np.zeros_like(base))
        moving = np.abs(signed) + sum((1 + change[i]) * shares[i][0] for i in range(n))
        vertices.append((moving, noise + sum((1 + change[i]) * shares[i][1] for i in range(n))))
    return Map(nominal=base, vertices=vertices, inverse=inverse, control=control, motion=fold(rest.motion()))


def _inertia_effect(a: Array, i: int, period: float) -> Array:
    """∫ exp(a (T - t)) e_i e_i' exp(a t) dt: how a change of the i-th inertia moves the end of a period."""
    from scipy.linalg import expm

    n = len(a)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n] = block[n:, n:] = a
    block[i, n + i] = 1.0
    return np.asarray(expm(block * period)[:n, n:], dtype=np.float64)


@dataclass(frozen=True)
class _Rest:
    """End values of the positive system that bounds what the nominal map leaves out, by source (|z|, |c|, |v|, 1)."""

    values: Array
    n: int

    def _block(self, k: int) -> Array:
        return self.values[k * self.n : (k + 1) * self.n]

    def motion(self) -> Array:
        return self._block(1) + self._block(2)

    def share(self, i: int) -> Array:
        return self._block(3 + i)


def _rest(at: Nominal, rows: DeviationRows, period: float) -> _Rest:
    """Integrate the positive system over a period.

    States: bound g on the nominal speed |z0'|, starting at |c| = |(a - b k) z(t_k)|; bound s on the nominal motion,
    s' = g; bound e on the whole rest |z - z0|; the share r_i of the rest that row i's sources make; the ramp of the
    drifting feed-forward. Constants: |z(t_k)|, |v|, 1.
    """
    from scipy.linalg import expm

    n, m = at.b.shape
    speed, motion, whole = slice(0, n), slice(n, 2 * n), slice(2 * n, 3 * n)
    ramp = slice((3 + n) * n, (3 + n) * n + m)
    here, inputs, one = slice(ramp.stop, ramp.stop + n), slice(ramp.stop + n, ramp.stop + n + m), ramp.stop + n + m
    size, entry = np.abs(at.a), np.abs(at.b) + at.b_spread
    metzler = np.where(np.eye(n, dtype=bool), at.a, size)
    growing = np.where(np.eye(n, dtype=bool), np.maximum(at.a, 0.0), size)
    sources = np.zeros((n, one + 1))
    sources[:, here] = at.a_spread + entry @ at.k_spread
    sources[:, motion] = sources[:, whole] = at.a_spread
    sources[:, ramp] = entry
    sources[:, inputs] = at.b_spread
    sources[:, one] = rows.disturbance / at.mass
    system = np.zeros((one + 1, one + 1))
    system[speed, speed] = metzler
    system[motion, speed] = np.eye(n)
    system[whole] = (1 + at.inertia)[:, None] * sources
    system[whole, whole] += growing + at.inertia[:, None] * size
    system[whole, speed] += np.diag(at.inertia)
    for i in range(n):
        share = slice((3 + i) * n, (4 + i) * n)
        system[share, share] = metzler
        system[share.start + i] += sources[i]
        system[share.start + i, whole] += at.inertia[i] / (1 - at.inertia[i]) * size[i]
    system[ramp, one] = rows.drift
    begin = np.zeros((one + 1, 2 * n + m + 1))
    begin[here, :n] = begin[speed, n : 2 * n] = np.eye(n)
    begin[inputs, 2 * n : 2 * n + m] = np.eye(m)
    begin[one, -1] = 1.0
    return _Rest(expm(system * period) @ begin, n)
