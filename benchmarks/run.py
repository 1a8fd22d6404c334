"""Costs of the toolkit as ratios, measured side by side in one run: `python benchmarks/run.py`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from hdmm_opt import study
from hdmm_opt.problem import Problem, assemble
from hdmm_opt.proof import certificate
from hdmm_opt.simulation import Scenario
from stability import Gains, certify, checker

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from known_answers import chain_bounds, integrator_chain

GAINS = (Gains(beta=24.0), Gains(beta=6000.0))


def fastest(action: Callable[[], object], repeats: int = 5) -> float:
    """Shortest of some runs after one that warms up, s."""
    action()
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        action()
        times.append(time.perf_counter() - begun)
    return min(times)


def chain(order: int) -> Callable[[], object]:
    """Certificate of an integrator chain."""
    bandwidths = (15.0, 100.0, 600.0)[:order]
    gains = tuple(Gains(beta=2 * w) for w in bandwidths)
    limit = np.array([0.05, 1.0, 100.0])[:order]
    return lambda: certify(integrator_chain(order), chain_bounds(order), gains, limit)


def scipy_loop(problem: Problem, seconds: float) -> Callable[[], object]:
    """The same sampled loop, period by period, with SciPy's adaptive integrator."""
    import casadi as ca

    plant, law = problem.plant, problem.law
    rate = ca.Function("f", [plant.x, plant.u, plant.w, plant.p], [plant.rate])
    step = law.step_function(problem.bounds.period)
    nominal = list(plant.values().values())
    gains = np.array([[g.beta, g.epsilon, g.delta, g.sigma] for g in GAINS])

    def right(_: float, x: np.ndarray, u: float) -> np.ndarray:
        return np.array(rate(x, u, 76e3, nominal)).ravel()

    def run() -> None:
        x, theta = np.array([0.1, 0.0, 0.0]), np.zeros(2)
        for k in range(round(seconds / problem.bounds.period)):
            r = problem.reference(k * problem.bounds.period)[:, 0]
            u, following, _ = step(x, r, theta, gains, nominal, 70e3)
            theta = np.array(following).ravel()
            x = solve_ivp(right, (0, problem.bounds.period), x, args=(float(u),), rtol=1e-8, atol=1e-10).y[:, -1]

    return run


def main() -> None:
    """Print one table."""
    problem = assemble(study.load("emla-p2"))
    heavy = Scenario(name="heavy", load=((0.0, 76e3),))
    gain_file = (Path(__file__).parents[1] / "notebooks" / "gains" / "emla-p2.gains.json").read_text(encoding="utf-8")
    rows = [
        ("composition certificate, 2 rows", one := fastest(chain(2)), one),
        ("composition certificate, 3 rows", fastest(chain(3)), one),
        ("certificate of emla-p2 with sampling", base := fastest(lambda: certificate(problem, GAINS)), one),
        ("exact check of the emla-p2 gain file", fastest(lambda: checker.check_text(gain_file)), base),
        (
            "closed loop, 0.5 s, compiled",
            ours := fastest(lambda: problem.loop.run(GAINS, problem.reference, heavy, duration=0.5)),
            ours,
        ),
        ("closed loop, 0.5 s, SciPy period by period", fastest(scipy_loop(problem, 0.5), 1), ours),
    ]
    for name, seconds, reference in rows:
        print(f"{name:44} {1e3 * seconds:9.2f} ms   x {seconds / reference:8.2f}")


if __name__ == "__main__":
    main()
