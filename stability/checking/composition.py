"""The composition certificate: a Lyapunov function of all subsystems.

Theorem: V = sum w_i M_i Q_i^2 / 2 decays to a level (theory of docs/proof.md); the matrix condition by exact LDL^T
at every sign vertex (Rohn 1994). Obligations: composition, invariance, sampling, accuracy. Must fail: smaller
weights, a faster decay, theta in V where it does not adapt.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product

from .arithmetic import WORK, down, exponential, magnitude, root, up
from .claim import Claim
from .limits import NotProvedError
from .loop import Loop


def positive_definite(matrix: list[list[Fraction]]) -> bool:
    """Strict definiteness of a symmetric rational matrix by exact LDLᵀ."""
    rest = [list(row) for row in matrix]
    while rest:
        pivot = rest[0][0]
        if pivot <= 0:
            return False
        head = rest[0]
        rest = [[row[j] - row[0] * head[j] / pivot for j in range(1, len(row))] for row in rest[1:]]
    return True


def conditions_hold(claim: Claim, loop: Loop, spare: Fraction) -> bool:
    """P - (μ/2 + spare/2) diag(w M) positive definite at every sign vertex (Rohn 1994)."""
    n, w = len(claim.rows), claim.weights
    middle = [[Fraction(0)] * n for _ in range(n)]
    radius = [[Fraction(0)] * n for _ in range(n)]
    for i in range(n):
        adapted = loop.own_gain(i) * w[i] * claim.leak[i] / 2 if i in loop.gain and claim.leak[i] > 0 else Fraction(0)
        decay = (claim.decay + spare) / 2 * w[i] * loop.mass[i][1]
        middle[i][i] = down(-w[i] * loop.entry(i, i)[1] + adapted - w[i] * claim.young[i] / 2 - decay)
        for j in range(i):
            a, b = loop.entry(i, j), loop.entry(j, i)
            low, high = down(-(w[i] * a[1] + w[j] * b[1]) / 2), up(-(w[i] * a[0] + w[j] * b[0]) / 2)
            middle[i][j] = middle[j][i] = (low + high) / 2
            radius[i][j] = radius[j][i] = (high - low) / 2
    WORK.one(2 ** (n - 1) * n**3)
    for signs in product((1, -1), repeat=n - 1):
        z = (1, *signs)
        if not positive_definite([[middle[i][j] - z[i] * z[j] * radius[i][j] for j in range(n)] for i in range(n)]):
            return False
    return True


def leak_is_sound(claim: Claim, loop: Loop) -> bool:
    """θ̂ may be part of V only in a controlled row that adapts and whose gain cannot change sign."""
    used = [i for i, leak in enumerate(claim.leak) if leak > 0]
    return all(i in loop.gain and loop.gain[i].epsilon[0] > 0 and loop.own_gain(i) > 0 for i in used)


def level(claim: Claim, loop: Loop) -> Fraction:
    """c/μ."""
    total = Fraction(0)
    for i, w in enumerate(claim.weights):
        total += w * loop.disturbance[i] ** 2 / (2 * claim.young[i])
        if claim.leak[i] > 0:
            gain = loop.gain[i]
            star = claim.leak[i] / gain.epsilon[0]
            leaked = gain.sigma[1] * star**2 / 2
            residual = max(loop.theta[i], star) * loop.adaptation_residual(i) / gain.delta[0]
            total += w * loop.own_gain(i) * (leaked + residual)
    return up(total / claim.decay)


def start(claim: Claim, loop: Loop) -> Fraction:
    """The largest V over the initial errors, θ̂(0) = 0."""
    total = Fraction(0)
    for i, w in enumerate(claim.weights):
        total += w * loop.mass[i][1] * claim.initial[i] ** 2 / 2
        if claim.leak[i] > 0:
            star = claim.leak[i] / loop.gain[i].epsilon[0]
            total += w * loop.own_gain(i) * star**2 / (2 * loop.gain[i].delta[0])
    return up(total)


def spare_decay(claim: Claim, loop: Loop) -> Fraction:
    """By how much μ could grow before the conditions fail, to a part in 4096; negative where they fail already."""
    if not conditions_hold(claim, loop, Fraction(0)):
        return -claim.decay
    low, high = Fraction(0), claim.decay
    for _ in range(12):
        trial = (low + high) / 2
        low, high = (trial, high) if conditions_hold(claim, loop, trial) else (low, trial)
    return low


class Composed:
    """Verdicts of a composition certificate."""

    def __init__(self, claim: Claim, loop: Loop) -> None:
        if not leak_is_sound(claim, loop):
            raise NotProvedError("theta is part of V in a row that does not adapt or whose gain may change sign")
        self.claim, self.loop = claim, loop

    def contracts(self) -> bool:
        """The matrix condition."""
        return conditions_hold(self.claim, self.loop, Fraction(0))

    def contraction(self) -> tuple[str, str, Fraction]:
        """Name, statement and margin of the matrix condition."""
        statement = f"P - (mu/2) diag(w M) > 0 at every vertex, mu = {float(self.claim.decay):.4g} 1/s"
        return "composition", statement, spare_decay(self.claim, self.loop)

    def invariance(self) -> Fraction:
        """The smallest share by which a side of the box exceeds what can be reached; negative where it can be left."""
        claim, loop = self.claim, self.loop
        top = max(level(claim, loop), start(claim, loop))
        spare = []
        for i, radius in enumerate(claim.half_widths):
            by_energy = root(up(2 * top / (claim.weights[i] * loop.mass[i][0])), True)
            pull, push = -loop.entry(i, i)[1], loop.disturbance[i]
            push += sum(magnitude(loop.entry(i, j)) * r for j, r in enumerate(claim.half_widths) if j != i)
            by_row = max(push / pull, claim.initial[i]) if pull > 0 else by_energy
            spare.append(1 - min(by_energy, by_row) / radius)
        return min(spare)

    def sampling(self) -> tuple[str, Fraction]:
        """The assumed input error against what the rows make of it."""
        errors = [self.loop.input_error(k) for k in range(len(self.claim.input_bound))]
        spare = min(1 - e / h if h > 0 else -e for h, e in zip(self.claim.input_bound, errors, strict=True))
        return "held inputs stay within the assumed error of the continuous law", spare

    def ultimate(self, i: int) -> Fraction:
        """Bound on |Q_i| from the end of the transient on: V <= c/μ + (V(0) - c/μ) exp(-μt) where V(0) > c/μ."""
        claim, loop = self.claim, self.loop
        settled = level(claim, loop)
        excess = max(Fraction(0), start(claim, loop) - settled)
        if excess > 0:
            settled += up(excess * exponential(-min(claim.decay * claim.transient, Fraction(100)))[1])
        energy = root(up(2 * settled / (claim.weights[i] * loop.mass[i][0])), True)
        return min(energy, claim.half_widths[i])
