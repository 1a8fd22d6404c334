"""The quadratic certificate: oracles of theory §3 and §4, exact verdicts, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from known_answers import ORACLE_ROWS, chain_bounds, integrator_chain

from stability import Gains, error_rows
from stability.certificates.quadratic import Inclusion, from_error_rows, prove, search

#: (ω_1, ω_2) -> published bounds with g known and with g in ±20 %, mm.
PUBLISHED = {(15, 100): (0.569, 0.724), (10, 60): (1.431, 1.825), (20, 80): (0.555, 0.720)}


def continuous(bandwidths, spread=0.0):
    n = len(bandwidths)
    gains = tuple(Gains(beta=2.0 * w) for w in bandwidths)
    rows = error_rows(integrator_chain(n), chain_bounds(n, spread=spread), gains, np.full(n, 1e-3), np.zeros(1))
    scale = np.cumprod([1e-3, *bandwidths[:-1]])
    return from_error_rows(rows, scale), np.eye(n)[0], scale


def proved_bound(inclusion, output, scale):
    found = search(inclusion, output, scale)
    assert found is not None
    squared = prove(inclusion, found)
    assert squared is not None
    return 1e3 * float(squared) ** 0.5


@pytest.mark.parametrize("bandwidths", PUBLISHED)
def test_oracle_table(bandwidths):
    exact, _, adversary, _ = ORACLE_ROWS[bandwidths]
    known, uncertain = PUBLISHED[bandwidths]
    assert exact < proved_bound(*continuous(bandwidths)) == pytest.approx(known, rel=3e-3)
    assert adversary < proved_bound(*continuous(bandwidths, 0.2)) == pytest.approx(uncertain, rel=3e-3)


def test_third_subsystem():
    assert proved_bound(*continuous((15, 100, 600))) == pytest.approx(0.566, rel=6e-3)


def test_a_loop_with_complex_poles():
    """x'' = -2 ζ ω x' - ω² x + w with ζ = 0.3, far from any positive system; exact peak gain by its impulse response."""
    omega, zeta = 5.0, 0.3
    inclusion = Inclusion(
        a=np.array([[0.0, 1.0], [-(omega**2), -2 * zeta * omega]]), b=np.array([[0.0], [1.0]]), left=np.zeros((2, 0)),
        right=np.zeros((0, 2)), sampled=False,
    )  # fmt: skip
    t = np.linspace(0, 12, 200_001)
    damped = omega * np.sqrt(1 - zeta**2)
    exact = np.trapezoid(np.abs(np.exp(-zeta * omega * t) * np.sin(damped * t) / damped), t)
    found = search(inclusion, np.array([1.0, 0.0]), np.array([0.1, 0.5]))
    squared = prove(inclusion, found)
    assert exact < float(squared) ** 0.5 < 1.6 * exact


@pytest.mark.parametrize("pole", [-1e-3, 0.0, 1e-3])
def test_hurwitz_or_not(pole):
    """A 3x3 matrix whose slowest pole is nearly, exactly and no more on the axis."""
    turn = np.linalg.qr(np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 1.0], [0.3, 0.1, 2.0]]))[0]
    a = turn @ np.diag([pole, -2.0, -30.0]) @ turn.T
    inclusion = Inclusion(a=a, b=np.eye(3)[:, :1], left=np.zeros((3, 0)), right=np.zeros((0, 3)), sampled=False)
    found = search(inclusion, np.eye(3)[0], np.full(3, 300.0), rounds=0)
    assert (found is not None and prove(inclusion, found) is not None) == (pole < 0)


def test_what_is_changed_is_refused():
    inclusion, output, scale = continuous((15, 100), 0.2)
    found = search(inclusion, output, scale)
    assert prove(inclusion, found) is not None
    forged = {
        "faster decay": replace(found, decay=1.2 * found.decay),
        "no decay": replace(found, decay=0.0),
        "larger P": replace(found, p=found.p * np.array([[1.5, 1.0], [1.0, 1.0]])),
        "another sign": replace(found, p=found.p * np.array([[1.0, -1.0], [-1.0, 1.0]])),
        "smaller multipliers": replace(found, multipliers=0.5 * found.multipliers),
        "negative multipliers": replace(found, multipliers=-found.multipliers),
        "smaller tau": replace(found, tau=0.9 * found.tau),
        "smaller bound": replace(found, bound=0.99 * found.bound),
    }
    for name, changed in forged.items():
        assert prove(inclusion, changed) is None, name
    wider = replace(inclusion, left=1.1 * inclusion.left)
    pushed = replace(inclusion, b=1.1 * inclusion.b)
    unstable = replace(inclusion, a=-inclusion.a)
    for changed in (wider, pushed, unstable):
        assert prove(changed, found) is None
    assert search(unstable, output, scale) is None


@pytest.mark.parametrize("unit", [1e-8, 1.0, 1e8])
def test_units_do_not_matter(unit):
    inclusion, output, scale = continuous((15, 100))
    other = replace(inclusion, b=unit * inclusion.b)
    assert proved_bound(other, output, unit * scale) / unit == pytest.approx(
        proved_bound(inclusion, output, scale), rel=1e-4
    )
