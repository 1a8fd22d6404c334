"""Costs of the toolkit as ratios, measured side by side in one run: `python benchmarks/run.py`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from hdmm_opt import gain_file, study
from hdmm_opt.gain_file import gains_of
from hdmm_opt.problem import Problem, assemble, study_of
from hdmm_opt.proof import certificate, composition
from hdmm_opt.simulation import Scenario
from stability import Gains, certify, certify_sampled, checker
from stability.network import Coupling, Subsystem, compose, exchange
from stability.quadratic import Inclusion, prove, search

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from known_answers import chain_bounds, claim_of, integrator_chain
from timing import fastest

GAINS = (Gains(beta=24.0), Gains(beta=6000.0))
FILES = Path(__file__).parents[1] / "notebooks" / "gains"


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


def network(count: int) -> tuple[dict[str, Subsystem], list[Coupling]]:
    """A chain of two-row loops that push their neighbours."""
    own = Subsystem(
        model=integrator_chain(2), bounds=chain_bounds(2, period=1e-3, disturbance=0.4),
        gains=(Gains(beta=30.0), Gains(beta=200.0)), limit=np.array([0.05, 1.0]),
    )  # fmt: skip
    couplings = [
        Coupling(source=str(j), target=str(i), disturbance="w", gain=250.0)
        for i in range(count)
        for j in (i - 1, i + 1)
        if 0 <= j < count
    ]
    return {str(i): own for i in range(count)}, couplings


def random_inclusion(states: int, uncertain: int) -> Inclusion:
    """A stable inclusion with uncertain rank-one terms."""
    random = np.random.default_rng(0)
    a = -np.diag(np.geomspace(1, 50, states)) + 0.3 * random.normal(size=(states, states))
    left, right = 0.3 * random.normal(size=(states, uncertain)), 0.3 * random.normal(size=(uncertain, states))
    return Inclusion(a=a, b=random.normal(size=(states, 2)), left=left / states, right=right, sampled=False)


def show(title: str, rows: list[tuple[str, float]]) -> None:
    """One block; each row as a multiple of the first."""
    print(title)
    for name, seconds in rows:
        print(f"  {name:58} {1e3 * seconds:9.2f} ms   x {seconds / rows[0][1]:8.2f}")


def modular() -> None:
    """Composition of subsystems, and the exchange of one."""
    rows = [(f"compose {n} subsystems", fastest(lambda n=n: compose(*network(n)), 3)) for n in (4, 10, 20, 40)]
    subsystems, couplings = network(40)
    contracts = compose(subsystems, couplings)
    assert isinstance(contracts, dict)
    rows.append(("exchange one of 40", fastest(lambda: exchange(contracts, couplings, "17", subsystems["17"]))))
    contract, own = contracts["17"], subsystems["17"]
    claim = claim_of(own.model, contract.bounds, own.gains, contract.certificate)
    rows.append(("exact check of one contract", fastest(lambda: checker.obligations(claim))))
    show("modular proofs", rows)


def quadratic() -> None:
    """Search and exact check, by size."""
    searches, checks = [], []
    for size in (4, 8, 12, 16):
        inclusion = random_inclusion(size, size)
        output, scale = np.eye(size)[0], np.ones(size)
        found = search(inclusion, output, scale)
        assert found is not None
        name = f"{size} states, {size} uncertain entries"
        searches.append((f"search, {name}", fastest(lambda i=inclusion, o=output, s=scale: search(i, o, s), 1)))
        checks.append((f"exact check, {name}", fastest(lambda i=inclusion, f=found: prove(i, f), 1)))
    show("quadratic certificate", [*searches, *checks])


def studies() -> None:
    """Certificates and exact checks of the bundled studies, beside their bounds."""
    rows = []
    for path in sorted(FILES.glob("*.gains.json")):
        text, document = path.read_text(encoding="utf-8"), gain_file.read(path)
        problem, gains = assemble(study_of(document["study"]), gain_file.reference_of(document)), gains_of(document)
        arguments = (problem.model, problem.bounds, gains, problem.box)
        name = path.name.removesuffix(".gains.json")
        plain, refined = certify_sampled(*arguments), certify_sampled(*arguments, refine=True)
        other = composition(problem, problem.bounds, gains)
        bounds = [f"{1e3 * float(c.ball[0]):.4g} mm" if hasattr(c, "ball") else "none" for c in (plain, refined, other)]
        rows += [
            (f"{name}: sampled ({bounds[0]})", fastest(lambda a=arguments: certify_sampled(*a))),
            (
                f"{name}: sampled, refined ({bounds[1]})",
                fastest(lambda a=arguments: certify_sampled(*a, refine=True), 1),
            ),
            (
                f"{name}: composition ({bounds[2]})",
                fastest(lambda p=problem, g=gains: composition(p, p.bounds, g), 1),
            ),
            (f"{name}: exact check of the file", fastest(lambda t=text: checker.check_text(t), 1)),
        ]
    show("studies", rows)


def main() -> None:
    """Print the tables."""
    problem = assemble(study.load("emla-p2"))
    heavy = Scenario(name="heavy", load=((0.0, 76e3),))
    show(
        "chains of integrators",
        [
            ("composition by a convex program, 2 rows", fastest(chain(2))),
            ("composition by a convex program, 3 rows", fastest(chain(3))),
        ],
    )
    modular()
    quadratic()
    studies()
    show(
        "closed loop, 0.5 s of emla-p2",
        [
            ("compiled", fastest(lambda: problem.loop.run(GAINS, problem.reference, heavy, duration=0.5))),
            ("SciPy period by period", fastest(scipy_loop(problem, 0.5), 1)),
            ("certificate at these gains", fastest(lambda: certificate(problem, GAINS))),
        ],
    )


if __name__ == "__main__":
    main()
