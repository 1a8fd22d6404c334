"""Costs of the toolkit as ratios, measured side by side in one run: `python benchmarks/run.py`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from hdmm_opt.jobs.certify import certificate, composition
from hdmm_opt.files.read import read
from hdmm_opt.files.restore import restored
from hdmm_opt.problem import GainSet, Problem
from hdmm_opt.simulation import Loop, Run, Scenario
from stability import Certificate, Gains, Impulse, certify, certify_impulse, checker
from stability.certificates.impulse import Search
from stability.certificates.quadratic import Inclusion, prove, search
from stability.certificates.cut import Partition
from stability.networks.contracts import Assume, Subsystem, replaced, solve_contracts
from stability.networks.springs import Coupling, coupled

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from known_answers import chain_bounds, claim_of, integrator_chain
from plain import plain
from timing import fastest

FILES = Path(__file__).parents[1] / "notebooks" / "gains"


def chain(order: int) -> Callable[[], object]:
    """Certificate of an integrator chain."""
    bandwidths = (15.0, 100.0, 600.0)[:order]
    gains = tuple(Gains(beta=2 * w) for w in bandwidths)
    limit = np.array([0.05, 1.0, 100.0])[:order]
    return lambda: certify(integrator_chain(order), chain_bounds(order), gains, limit)


def scipy_loop(problem: Problem, gains: GainSet, seconds: float) -> Callable[[], object]:
    """The same sampled loop, a period late, with SciPy's adaptive integrator on a plain rate function."""
    import casadi as ca

    (member,) = problem.members
    plant, law, period = member.plant, member.law, member.bounds.period
    rate = plain([plant.x, plant.u, plant.w, plant.p], plant.rate)
    x, r, z = ca.SX.sym("x", len(plant.states)), ca.SX.sym("r", 4), ca.SX.sym("z", law.states)
    nominal, values = list(plant.values().values()), gains[member.name]
    step = plain([x, r, z], ca.vertcat(*law.step(x, r, z, ca.DM(values), ca.DM(nominal), ca.DM([70e3]), period)[:2]))
    reference = member.reference(period * np.arange(round(seconds / period))).T.tolist()

    def right(_: float, x: np.ndarray, u: float) -> list[float]:
        return rate([*x.tolist(), u, 76e3, *nominal])

    def run() -> None:
        x, z, waiting = np.array([0.1, 0.0, 0.0]), law.start([0.0] * 3, values), 0.0
        for r in reference:
            acting = waiting
            waiting, *z = step([*x.tolist(), *r, *z])
            x = solve_ivp(right, (0, period), x, args=(acting,), rtol=1e-8, atol=1e-10).y[:, -1]

    return run


def network(count: int) -> tuple[dict[str, Subsystem], Assume]:
    """A chain of two-row loops that push their neighbours."""
    own = Subsystem(model=integrator_chain(2), gains=(Gains(beta=30.0), Gains(beta=200.0)), limit=np.array([0.05, 1.0]))
    couplings = [
        Coupling(source=str(j), target=str(i), disturbance="w", gain=250.0)
        for i in range(count)
        for j in (i - 1, i + 1)
        if 0 <= j < count
    ]
    alone = dict.fromkeys(map(str, range(count)), chain_bounds(2, period=1e-3, disturbance=0.4))
    return {str(i): own for i in range(count)}, coupled(alone, couplings)


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
    rows = [
        (f"contracts of {n} subsystems", fastest(lambda n=n: solve_contracts(*network(n)), 3)) for n in (4, 10, 20, 40)
    ]
    subsystems, assume = network(40)
    contracts = solve_contracts(subsystems, assume)
    assert isinstance(contracts, dict)
    rows.append(("exchange one of 40", fastest(lambda: replaced(contracts, assume, "17", subsystems["17"]))))
    contract, own = contracts["17"], subsystems["17"]
    claim = claim_of(own.model, contract.bounds, own.gains, contract.certificate)
    rows.append(("exact check of one contract", fastest(lambda: decide(claim))))
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


def growth() -> None:
    """Search and exact check of one certificate, by order, periods of delay and cells."""
    period, ways = 5e-4, []
    for order in (1, 2, 3):
        gains = tuple(Gains(beta=2 * w) for w in (15.0, 100.0, 600.0)[:order])
        limit = np.array([1.0, 10.0, 1000.0])[:order]
        ways.append((f"{order} rows", integrator_chain(order), chain_bounds(order, period=period), gains, limit, (1,)))
    gains, limit = tuple(Gains(beta=2 * w) for w in (10.0, 40.0)), np.array([1.0, 10.0])
    for late in (1, 2, 4, 8):
        bounds = chain_bounds(2, period=period, delay=late * period)
        ways.append((f"2 rows, {late} periods of delay", integrator_chain(2), bounds, gains, limit, (1,)))
    problem, found = restored(read(FILES / "emla-p2.gains.json"))
    (member,) = problem.members
    own = member.gains(found[member.name])
    ways.append(("emla-p2, cells", member.model, member.bounds, own, member.box, (4, 8, 15)))
    searches, checks = [], []
    for name, model, bounds, values, box, cells in ways:
        for count in cells:
            cut = Partition((*[1] * (len(model.rows) - 1), count), {})
            search = lambda m=model, b=bounds, v=values, w=box, c=cut: Search(m, b, v, w, partition=c).run(b)  # noqa: E731
            made = search()
            assert isinstance(made, Impulse), (name, made)
            claim, told = claim_of(model, bounds, values, made), name.replace("cells", f"{len(made.cells)} cells")
            searches.append((f"search, {told}", fastest(search, 3)))
            checks.append((f"exact check, {told}", fastest(lambda c=claim: decide(c), 1)))
    show("growth of one certificate", searches)
    show("growth of its exact check", checks)


def decide(claim: checker.Claim) -> None:
    """Every obligation of a claim."""
    checker.WORK.begin(checker.MAX_PRODUCTS)
    checker.obligations(claim)


def studies() -> None:
    """Certificates and exact checks of the bundled studies, beside their bounds."""
    rows = []
    for path in sorted(FILES.glob("*.gains.json")):
        text, name = path.read_text(encoding="utf-8"), path.name.removesuffix(".gains.json")
        problem, gains = restored(read(path))
        if problem.linked:
            subsystems = problem.subsystems(gains)
            rows.append(
                (f"{name}: contracts", fastest(lambda p=problem, s=subsystems: solve_contracts(s, p.assume), 1))
            )
        else:
            rows += alone(name, problem, gains)
        rows.append((f"{name}: exact check of the file", fastest(lambda t=text: checker.check_text(t), 1)))
    show("studies", rows)


def alone(name: str, problem: Problem, gains: GainSet) -> list[tuple[str, float]]:
    """Certificates of one actuator beside their bounds."""
    (member,) = problem.members
    values = gains[member.name]
    arguments = (member.model, member.bounds, member.gains(values), member.box)
    makers: list[tuple[str, Callable[[], object]]] = [
        ("impulse", lambda: certify_impulse(*arguments)),
        ("impulse, refined", lambda: certify_impulse(*arguments, refine=True)),
        ("composition", lambda: composition(member, values)),
    ]
    rows = []
    for title, make in makers:
        found = make()
        bound = f"{1e3 * float(found.ultimate[0]):.4g} mm" if isinstance(found, Certificate) else "none"
        rows.append((f"{name}: {title} ({bound})", fastest(make, 1)))
    return rows


def main() -> None:
    """Print the tables."""
    problem, gains = restored(read(FILES / "emla-p2.gains.json"))
    loop, (member,) = Loop(problem), problem.members
    heavy = Scenario(name="heavy", disturbances={"load_force": ((0.0, 76e3),)})
    run = Run(gains=gains, scenario=heavy)
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
    growth()
    show(
        "closed loop, 0.5 s of emla-p2",
        [
            ("compiled", fastest(lambda: loop.figures([run], duration=0.5))),
            ("SciPy period by period, plain rate function", fastest(scipy_loop(problem, gains, 0.5), 1)),
            ("certificate at these gains", fastest(lambda: certificate(member, gains[member.name]))),
        ],
    )


if __name__ == "__main__":
    main()
