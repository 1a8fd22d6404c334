"""Random strict-feedback plants: an adversary that simulates them never contradicts a proof."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_answers import claim_of, verdict

from stability import Bounds, Gains, Impulse, Interval, LoopModel, Row, certify_impulse, from_casadi

LANES, PERIODS, SUBSTEPS = 24, 240, 6


@dataclass(frozen=True)
class Case:
    """M_i x_i' = -c_i x_i - f_i tanh(x_i / s_i) + g_i y_i + w_i with y_i = x_{i+1}, and for the last row
    y_n = u + bend tanh(u / size); the law adds `known` x_n to its last virtual control.
    """

    model: LoopModel
    bounds: Bounds
    gains: tuple[Gains, ...]
    limit: np.ndarray
    damping: np.ndarray
    friction: np.ndarray
    scale: np.ndarray
    known: float
    bend: float
    size: float


def random_case(family: str, seed: int) -> Case:
    """Normal: separated bandwidths. Stiff: up to the edge of the rate. Degenerate: anything goes."""
    random = np.random.default_rng([seed, len(family)])
    n = int(random.integers(1, 4))
    ratio = {"normal": (4.0, 10.0), "stiff": (3.0, 30.0), "degenerate": (0.5, 5.0)}[family]
    width = np.cumprod([10.0 ** random.uniform(0.5, 1.5), *random.uniform(*ratio, n - 1)])
    fastest = {"normal": 0.2, "stiff": 0.9, "degenerate": 2.5}[family]
    period = float(fastest * random.uniform(0.3, 1.0) / width[-1])
    spread = {"normal": 0.1, "stiff": 0.2, "degenerate": 0.7}[family]
    unit = 10.0 ** random.uniform(-3, 3)
    mass, drive = 10.0 ** random.uniform(-2, 2, n), 10.0 ** random.uniform(-1, 1, n)
    mass[0] = drive[0] = 1.0
    slack = np.concatenate([[0.0], random.uniform(0, spread, n - 1)])
    size = unit * np.concatenate([[1.0], width[:-1]])
    damping = mass * width * random.uniform(0, 0.3, n) * (np.arange(n) > 0)
    friction = mass * width * size * 0.02 * random.uniform(0, 1, n) * (np.arange(n) > 0)
    scale = size * 10.0 ** random.uniform(-3, 0, n)
    push = mass * width * size * 0.02 * random.uniform(0, 1, n)
    names = [f"x{i}" for i in range(n)]
    order = (*names, "u", *(f"m{i}" for i in range(n)), *(f"g{i}" for i in range(n)), *(f"w{i}" for i in range(n)))
    z = ca.SX.sym("z", len(order))
    # in every second case the law compensates part of the last row's damping, from its measured state, and the input bends
    nonlinear = bool(random.integers(0, 2))
    known = float(nonlinear * random.uniform(0, 1) * damping[-1] / drive[-1])
    size_u = float(mass[-1] * width[-1] * size[-1] / drive[-1])
    bend = float(nonlinear * random.uniform(-0.2, 0.2) * 0.1 * size_u)
    last = z[n] + bend * ca.tanh(z[n] / (0.1 * size_u))
    x, following = z[:n], ca.vertcat(z[1:n], last)
    m, g, w = z[n + 1 : 2 * n + 1], z[2 * n + 1 : 3 * n + 1], z[3 * n + 1 :]
    force = ca.vertcat(*(
        -damping[i] * x[i] - friction[i] * ca.tanh(x[i] / scale[i]) + g[i] * following[i] + w[i] for i in range(n)
    ))  # fmt: skip
    plant = from_casadi(ca.Function("plant", [z], [ca.vertcat(m, force)]), order)
    y = ca.SX.sym("y", 1)
    closing = from_casadi(ca.Function("term", [y], [known * y[0]]), (names[-1],))
    nothing = from_casadi(ca.Function("term", [ca.SX.sym("r")], [ca.SX(0)]), ("r0",))
    rows = tuple(
        Row(state=s, unit="1", target="reference" if i == 0 else i - 1, controlled=True) for i, s in enumerate(names)
    )
    ranges = {f"m{i}": (mass[i], slack[i]) for i in range(n)} | {
        f"g{i}": (drive[i], slack[i] if i else 0.0) for i in range(n)
    }
    bounds = Bounds(
        parameters={k: Interval(v * (1 - s), v * (1 + s)) for k, (v, s) in ranges.items()},
        disturbances={f"w{i}": Interval(-push[i], push[i]) for i in range(n)},
        nominal={},
        reference=(Interval(0.0),) * 4,
        noise=tuple(1e-3 * size * random.uniform(0, 1, n)),
        initial=tuple(0.05 * size * random.uniform(0, 1, n)),
        period=period,
        transient=40.5 * period,  # a whole number of rounded periods may be one fewer
    )
    epsilon = random.uniform(0, 0.2, n) / size
    gains = tuple(
        Gains(beta=float(2 * wd * mi / gi), epsilon=float(e), delta=0.5, sigma=float(0.5 / period))
        for wd, mi, gi, e in zip(width, mass, drive, epsilon, strict=True)
    )
    model = LoopModel(rows=rows, input_map=(n - 1,), inputs=("u",), plant=plant, law=(*(nothing,) * (n - 1), closing))
    return Case(model, bounds, gains, 1e3 * size, damping, friction, scale, known, bend, 0.1 * size_u)


def attack(case: Case, seed: int) -> np.ndarray:
    """|x_1| of lanes that each push their own way: corners of the parameters, bang-bang forces, biased sensors."""
    random, bounds, n = np.random.default_rng([seed, 7]), case.bounds, len(case.limit)
    sign = lambda *shape: random.choice((-1.0, 1.0), shape)  # noqa: E731
    pick = lambda kind: np.array([  # noqa: E731
        np.where(sign(LANES) > 0, bounds.parameters[f"{kind}{i}"].high, bounds.parameters[f"{kind}{i}"].low)
        for i in range(n)
    ])  # fmt: skip
    mass, drive = pick("m"), pick("g")
    limit = np.array([bounds.disturbances[f"w{i}"].high for i in range(n)])[:, None]
    noise = np.array(bounds.noise)[:, None] * sign(n, LANES)
    beta, epsilon, delta, sigma = (
        np.array([getattr(g, k) for g in case.gains])[:, None] for k in ("beta", "epsilon", "delta", "sigma")
    )
    theta = np.zeros((n, LANES))
    q = np.array(bounds.initial)[:, None] * sign(n, LANES)
    x = q.copy()
    for i in range(1, n):
        x[i] = q[i] - beta[i - 1] / 2 * q[i - 1]
    side, hold = sign(n, LANES), random.integers(1, 120, LANES)
    step, found = bounds.period / SUBSTEPS, [np.abs(x[0])]

    def rate(x, u, w):
        following = np.vstack([x[1:], (u + case.bend * np.tanh(u / case.size))[None]])
        friction = case.friction[:, None] * np.tanh(x / case.scale[:, None])
        return (-case.damping[:, None] * x - friction + drive * following + w) / mass

    for k in range(PERIODS):
        side = np.where(k % hold == 0, -side, side)
        measured = x + (noise if k % 3 else noise * random.uniform(-1, 1, noise.shape))
        goal = np.zeros(LANES)
        for i in range(n):
            error = measured[i] - goal
            goal = -(beta[i] + epsilon[i] * theta[i]) * error / 2
            theta[i] += bounds.period * (epsilon[i] * delta[i] * error**2 / 2 - delta[i] * sigma[i] * theta[i])
        goal = goal + case.known * measured[-1]
        for _ in range(SUBSTEPS):
            w = limit * side
            a = rate(x, goal, w)
            b = rate(x + step / 2 * a, goal, w)
            c = rate(x + step / 2 * b, goal, w)
            x = x + step / 6 * (a + 2 * b + 2 * c + rate(x + step * c, goal, w))
        found.append(np.abs(x[0]))
    return np.array(found).max(axis=1)


def contradicted(family: str, seed: int) -> tuple[int, int]:
    """Number of proofs of a case, and of those that the adversary contradicts."""
    case = random_case(family, seed)
    found = certify_impulse(case.model, case.bounds, case.gains, case.limit, refine=seed % 10 == 0)
    if not isinstance(found, Impulse) or not verdict(claim_of(case.model, case.bounds, case.gains, found)):
        return 0, 0
    error = attack(case, seed)
    after = int(case.bounds.transient / case.bounds.period) + 1
    return 1, int(error.max() > found.half_widths[0] or error[after:].max() > found.ultimate[0] * (1 + 1e-5))


@pytest.mark.parametrize(("family", "least"), [("normal", 22), ("stiff", 18), ("degenerate", 3)])
def test_falsification_never_contradicts_a_proof(family, least):
    """75 cases in all; enough of them are proved for the test to mean something."""
    proofs = []

    @settings(max_examples=25)
    @given(st.integers(0, 10**6))
    def run(seed):
        count, wrong = contradicted(family, seed)
        assert wrong == 0, f"{family} {seed}"
        proofs.append(count)

    run()
    assert sum(map(bool, proofs)) >= least


@pytest.mark.long
@pytest.mark.parametrize("part", range(6))
def test_falsification_never_contradicts_a_proof_at_length(part):
    """2,100 seeded cases."""
    family = ("normal", "stiff", "degenerate")[part % 3]
    results = [contradicted(family, 350 * part + k) for k in range(350)]
    assert sum(wrong for _, wrong in results) == 0
    assert sum(count for count, _ in results) > 0
