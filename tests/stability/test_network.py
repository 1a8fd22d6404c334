"""Modular proofs on a chain of 40 loops, against a simulation of all of them together."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from known_answers import chain_bounds, claim_of, integrator_chain, verdict

from stability import Failure, Gains
from stability.networks.contracts import Subsystem, replaced, solve_contracts
from stability.networks.springs import Coupling, coupled

COUNT, PERIOD, STIFFNESS = 40, 1e-3, 250.0


def loop(outer=15.0, inner=100.0, disturbance=0.4, initial=0.0):
    """x1' = x2, x2' = u + w + what the neighbours push."""
    bounds = replace(chain_bounds(2, period=PERIOD, disturbance=disturbance), initial=(initial, 0.0))
    gains = (Gains(beta=2 * outer), Gains(beta=2 * inner))
    return Subsystem(model=integrator_chain(2), gains=gains, limit=np.array([0.05, 1.0])), bounds


def chain(count=COUNT, stiffness=STIFFNESS):
    """A chain in which each loop feels the position errors of both neighbours, with bandwidths that alternate."""
    loops = {f"joint-{i}": loop(outer=14.0 + i % 3, disturbance=0.3 + 0.1 * (i % 2)) for i in range(count)}
    subsystems = {name: own for name, (own, _) in loops.items()}
    alone = {name: bounds for name, (_, bounds) in loops.items()}
    couplings = [
        Coupling(source=f"joint-{j}", target=f"joint-{i}", disturbance="w", gain=stiffness)
        for i in range(count)
        for j in (i - 1, i + 1)
        if 0 <= j < count
    ]
    return subsystems, alone, couplings


def simulate(subsystems, alone, seed, periods=3000, substeps=4, stiffness=STIFFNESS):
    """Largest |x_1| and |x_1''| of each loop, all of them together, disturbances switching in step or at random."""
    random = np.random.default_rng(seed)
    n = len(subsystems)
    outer = np.array([s.gains[0].beta / 2 for s in subsystems.values()])
    inner = np.array([s.gains[1].beta / 2 for s in subsystems.values()])
    limit = np.array([bounds.disturbances["w"].high for bounds in alone.values()])
    x, v, largest, fastest, side = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.ones(n)
    h = PERIOD / substeps
    for k in range(periods):
        if k % 500 == 499:
            side = random.choice((-1.0, 1.0), n) if seed else -side
        u = -inner * (v + outer * x)
        for _ in range(substeps):
            pushed = stiffness * (np.concatenate([[0.0], x[:-1]]) + np.concatenate([x[1:], [0.0]]))
            a = u + limit * side + pushed
            fastest = np.maximum(fastest, np.abs(a))
            x, v = x + h * v + h * h / 2 * a, v + h * a
        largest = np.maximum(largest, np.abs(x))
    return largest, fastest


def tubes(contracts, part):
    return np.array([getattr(contract.guarantee, part) for contract in contracts.values()])


def test_forty_loops_are_proved_together_and_simulation_agrees():
    subsystems, alone, couplings = chain()
    contracts = solve_contracts(subsystems, coupled(alone, couplings))
    assert not isinstance(contracts, Failure), contracts
    guaranteed, guaranteed_rate = tubes(contracts, "position"), tubes(contracts, "acceleration")
    for seed in range(3):
        largest, fastest = simulate(subsystems, alone, seed)
        assert (largest <= guaranteed).all() and (fastest <= guaranteed_rate).all()
        if seed == 0:  # all in step is the worst case: the guarantees are not far above it
            assert guaranteed[20] < 1.6 * largest[20] and guaranteed_rate[20] < 2.5 * fastest[20]
    for name, contract in list(contracts.items())[::13]:
        own = subsystems[name]
        assert verdict(claim_of(own.model, contract.bounds, own.gains, contract.certificate))
        assert contract.guarantee.holds(contract.reached)
        assert contract.certificate.half_widths[0] == contract.reached.position


def test_an_exchanged_actuator_is_proved_alone():
    subsystems, alone, couplings = chain()
    contracts = solve_contracts(subsystems, coupled(alone, couplings))
    own, bounds = loop(outer=16.0, inner=120.0, disturbance=0.4)
    assumed = {**alone, "joint-17": bounds}
    changed = replaced(contracts, coupled(assumed, couplings), "joint-17", own)
    assert not isinstance(changed, Failure)
    assert [name for name in contracts if changed[name] is not contracts[name]] == ["joint-17"]
    assert verdict(claim_of(own.model, changed["joint-17"].bounds, own.gains, changed["joint-17"].certificate))
    largest, _ = simulate({**subsystems, "joint-17": own}, assumed, 0)
    assert (largest <= tubes(changed, "position")).all()


def test_an_actuator_that_breaks_its_guarantee_is_named():
    subsystems, alone, couplings = chain(6)
    assume = coupled(alone, couplings)
    contracts = solve_contracts(subsystems, assume)
    weak = replaced(contracts, assume, "joint-3", loop(outer=8.0, inner=60.0)[0])
    assert isinstance(weak, Failure) and "joint-3 needs" in weak.reason and "has guaranteed" in weak.reason
    wild = replaced(contracts, assume, "joint-3", loop(outer=8.0, inner=2500.0)[0])
    assert isinstance(wild, Failure) and wild.reason.startswith("joint-3")


def test_an_exchange_that_changes_what_others_meet_is_refused():
    subsystems, alone, couplings = chain(4)
    contracts = solve_contracts(subsystems, coupled(alone, couplings))
    stiffer = [replace(c, gain=1.2 * c.gain) if c.source == "joint-1" else c for c in couplings]
    found = replaced(contracts, coupled(alone, stiffer), "joint-1", subsystems["joint-1"])
    assert isinstance(found, Failure) and "changes what joint-" in found.reason


@pytest.mark.parametrize("stiffness", [1000.0, 5000.0])
def test_couplings_that_are_too_strong_are_refused(stiffness):
    """At ω_1 ω_2 = 1500 per loop, two neighbours with k >= 750 each make the chain unstable."""
    subsystems, alone, couplings = chain(10, stiffness)
    assert isinstance(solve_contracts(subsystems, coupled(alone, couplings)), Failure)


def test_a_coupling_names_what_exists():
    _, alone, couplings = chain(3)
    with pytest.raises(KeyError, match="elsewhere"):
        coupled(alone, [replace(couplings[0], source="elsewhere")])


def test_a_broken_guarantee_is_not_hidden():
    """A contract is only as good as its neighbours' guarantees: with smaller ones the proof is another."""
    subsystems, alone, couplings = chain(4)
    contracts = solve_contracts(subsystems, coupled(alone, couplings))
    own, contract = subsystems["joint-1"], contracts["joint-1"]
    claim = claim_of(own.model, contract.bounds, own.gains, contract.certificate)
    heavier = tuple(Fraction(1.1 * float(v)) for v in claim.disturbances["w"])
    assert not verdict(replace(claim, disturbances={"w": heavier}))
