"""The hydraulic wheel that is bundled: its law by hand, its proof, and what its checker refuses."""

import json
import math
import tomllib
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from forging import forged
from known_answers import claim_of, verdict
from machines import study_from
from scipy.integrate import solve_ivp

from hdmm_opt.control.law import step_function
from hdmm_opt.control.rac import RAC
from hdmm_opt.errors import InvalidInputError
from hdmm_opt.jobs.contributions import contributions
from hdmm_opt.plants.hydraulic_wheel import defaults
from hdmm_opt.plants.registry import plant_model
from hdmm_opt.plants.sound import check_plant
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Run, Scenario
from hdmm_opt.study.read import bundled_text
from stability import Failure, Interval, checker
from stability.certificates.cut import Partition, parts_of, shared
from stability.certificates.impulse import Search
from stability.loops.box import UnboundedError
from stability.loops.deviation import deviation_rows, first_box

FILE = Path(__file__).parent.parent.parent / "notebooks" / "gains" / "wheel-p2.gains.json"


@pytest.fixture(scope="module")
def document():
    return json.loads(FILE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def problem():
    return assemble(study_from(tomllib.loads(bundled_text("wheel-p2"))))


@pytest.fixture(scope="module")
def values(document, problem):
    given = {gain["name"]: gain["value"] for gain in document["members"][0]["gains"]}
    return tuple(given[item.name] for item in problem.members[0].ranges)


def test_leads_are_backward_differences(problem):
    """(1 + a s)/(1 + f s) twice, by the textbook's rule s = (1 - 1/z)/T, beside the law's own states."""
    (member,) = problem.members
    law, period, a, f, beta = member.law, 1e-3, 0.02, 5e-4, 0.1
    gains = [{"beta_1": beta, "lead_1": a, "smooth_1": f, "phi_1": 1.0, "delta_1": 1.0, "sigma_1": 1.0}.get(i.name, 0.0)
             for i in member.ranges]  # fmt: skip
    step = step_function(law, period)
    errors = np.random.default_rng(3).uniform(-0.01, 0.01, 40)
    wanted = errors
    for _ in range(2):
        out, before_in, before_out = [], 0.0, 0.0
        for e in wanted:
            before_out = (f * before_out + (a + period) * e - a * before_in) / (f + period)
            out.append(before_out)
            before_in = e
        wanted = np.array(out)
    z, made = ca.DM.zeros(law.states), []
    nominal = list(member.plant.values().values())
    for e in errors:
        u, z, _ = step([e, 0, 0], [0, 0, 0, 0], z, gains, nominal, [0, 0])
        made.append(float(u[0]))
    assert made == pytest.approx((-beta / 2 * wanted).tolist(), rel=1e-9, abs=1e-15)


def test_equal_times_change_nothing(problem):
    (member,) = problem.members
    step, nominal = step_function(member.law, 1e-3), list(member.plant.values().values())
    common = {"beta_1": 0.1, "gamma_1": 20.0, "phi_1": 1.0, "delta_1": 1.0, "sigma_1": 1.0}
    for times in ((0.0, 0.0), (3e-3, 3e-3)):
        gains = [{**common, "lead_1": times[0], "smooth_1": times[1]}.get(i.name, 0.0) for i in member.ranges]
        z = ca.DM.zeros(member.law.states)
        for e in (0.01, -0.02, 0.005):
            u, z, _ = step([e, 0, 0], [0, 0, 0, 0], ca.DM([0, 0, *[float(v) for v in ca.vertsplit(z[2:])]]), gains,
                           nominal, [0, 0])  # fmt: skip
            assert float(u[0]) == pytest.approx(-0.05 * e, rel=1e-12)


def test_the_loop_with_leads_agrees_with_an_independent_integrator(problem, values):
    """Law by hand with its filters, the command a period late, equations by hand, SciPy at 1e-10."""
    (member,) = problem.members
    g = dict(zip((i.name for i in member.ranges), values, strict=True))
    q = member.plant.values()
    scenario = Scenario(name="grip", disturbances={"traction": ((0.0, 2500.0), (0.4, 2500.0), (0.5, 4000.0))})
    own = Loop(problem, refinement=8).trace({member.name: values}, scenario, duration=0.8).members[member.name]
    area = q["reduction"] * q["displacement"] / q["wheel_radius"]
    x, phi, w, commands, apart = own.x[:, 0].copy(), g["preload_1"], [0.0, 0.0], [], []
    for k in range(800):
        apart.append(np.abs(x - own.x[:, k]) / (1.0, 1.0, 1e7))
        r = member.reference(1e-3 * k)[:, 0]
        e = passed = x[0] - r[0]
        for j, before in enumerate(w):
            w[j] = (g["smooth_1"] * before + 1e-3 * passed) / (g["smooth_1"] + 1e-3)
            passed = ((g["lead_1"] + 1e-3) * passed + (g["smooth_1"] - g["lead_1"]) * before) / (g["smooth_1"] + 1e-3)
        commands.append(np.clip(area * r[0] / q["rated_flow"] - g["beta_1"] / 2 * passed - phi, -1, 1))
        phi += 1e-3 * g["gamma_1"] * e
        load = float(np.interp(1e-3 * k, *zip(*scenario.disturbances["traction"], strict=True)))

        def rates(_, z, u, load):
            v, y, p = z
            share = q["efficiency"] if p * v > 0 else 1 / q["efficiency"]
            held = q["coulomb_friction"] + q["stribeck_friction"] / (1 + (v / q["stribeck_speed"]) ** 2)
            return [(share * area * p - held * np.tanh(v / 0.005) - q["viscous_friction"] * v - load) / q["wheel_mass"],
                    (u - y) / q["valve_lag"],
                    4 * q["bulk_modulus"] / q["line_volume"] * (q["rated_flow"] * y - area * v - q["leakage"] * p)]  # fmt: skip

        held = commands[max(0, k - 1)]
        x = solve_ivp(rates, (0, 1e-3), x, args=(held, load), rtol=1e-10, atol=1e-12, method="DOP853").y[:, -1]
    assert np.max(apart) < 1e-6
    assert np.ptp(own.x[2]) > 1e6  # the pressure follows the load


def test_what_a_mode_carries_is_what_the_wheel_needs(problem):
    """The range of b* at the corners of all constants, by the equation of a wheel that rolls forwards."""
    (member,) = problem.members
    gains = member.gains(tuple(item.low for item in member.ranges))
    small = np.array([1e-6, 1e-6, 1.0])
    _, rows = first_box(member.model, member.bounds, gains, small)
    found = rows.ranges[0]["w:@pressure"]
    p, r = member.bounds.parameters, member.bounds.reference
    load = member.bounds.feedforward["traction"][0]

    def carried(end):
        pick = lambda span: getattr(span, end)  # noqa: E731
        v = pick(r[0])
        held = (
            pick(p["coulomb_friction"])
            + pick(p["viscous_friction"]) * v
            + pick(load)
            + pick(p["wheel_mass"]) * pick(r[1])
        )
        area = p["reduction"].low * p["displacement"].low / p["wheel_radius"].low
        return held / (p["efficiency"].low * area)

    assert found.low == pytest.approx(carried("low"), rel=3e-3) and found.low <= carried("low")
    assert found.high == pytest.approx(carried("high"), rel=3e-3) and found.high >= carried("high") - 1e-9
    # constants that are not known exactly act through their rate alone: what is left on the rim is the roughness
    rough = member.bounds.disturbances["roughness"].high
    assert rows.disturbance[0] == pytest.approx(rough, rel=0.05)


def test_parts_cover_a_range_and_go_where_they_help():
    whole = Interval(-1.0, 3.0)
    parts = parts_of(whole, 4)
    assert (parts[0].low, parts[-1].high) == (-1.0, 3.0)
    assert all(a.high == b.low for a, b in pairwise(parts))
    ratios = [part.high / part.low for part in parts_of(Interval(1.0, 16.0), 4)]
    assert ratios == pytest.approx([2.0] * 4)
    assert checker.parts_of((Fraction(-1), Fraction(3)), 2) == [(Fraction(-1), Fraction(1)), (Fraction(1), Fraction(3))]
    assert shared([0.4, 0.3, 0.0], 8) == [4, 2, 1]
    assert shared([0.0, 0.001], 8) == [1, 1]


def test_cells_and_lags_tighten_the_bound(problem, values):
    """The same gains: with the range of the lag in its own row, and with the leakage cut, proved bounds compared."""
    (member,) = problem.members
    own = member.gains(values)
    whole, cut = Partition((1, 3, 3), {}), Partition((1, 3, 3), {"leakage": 2})
    found = [Search(member.model, member.bounds, own, member.box, partition=p).run(member.bounds) for p in (whole, cut)]
    assert not any(isinstance(f, Failure) for f in found)
    assert found[1].ultimate[0] < found[0].ultimate[0] - 5e-4
    assert found[0].lags == ("opening",) and len(found[1].cells) == 18
    search = Search(member.model, member.bounds, own, member.box, partition=whole)
    search.lags = ()
    search.responses = search._responses(search.parts([search.rows]), member.bounds)
    plain = search.run(member.bounds)
    assert isinstance(plain, Failure) or plain.ultimate[0] > 1.1 * found[0].ultimate[0]


def test_parts_are_decided_by_the_checker(values):
    """Leakage in three parts, all else known: each part has its own middle, demand and place, and no other's."""
    data = tomllib.loads(bundled_text("wheel-p2"))
    for name, p in defaults("flow").items():
        if p.tolerance:
            spread = 0.5 if name == "leakage" else 0.0
            entry = {"value": p.value, "unit": p.unit, "tolerance": spread, "source": "assumed"}
            data["plant"]["parameters"][name] = entry
    (member,) = assemble(study_from(data)).members
    own, cut = member.gains(values), Partition((1, 1, 1), {"leakage": 3})
    found = Search(member.model, member.bounds, own, member.box, partition=cut).run(member.bounds)
    assert not isinstance(found, Failure), found.reason
    claim = claim_of(member.model, member.bounds, own, found, limit=1e30, accuracy=1e30)
    claim = replace(claim, first="speed")
    assert verdict(claim)
    assert not verdict(replace(claim, cells=claim.cells[::-1]))
    assert not verdict(replace(claim, cells=[claim.cells[0]] * 3))
    (low, high), rest = claim.demand[0], claim.demand[1:]
    assert not verdict(replace(claim, demand=[(low, high - (high - low) / 50), *rest]))


def test_each_part_of_the_law_is_needed(problem, values):
    """Nothing is proved without the network, the flow's feedforward or the leads."""
    (member,) = problem.members
    whole, *without = contributions(problem, {member.name: values})
    assert whole.certified is not None
    assert {c.part for c in without} == {"phi", "flow", "lead"}
    assert all(c.certified is None or c.certified > 1.2 * whole.certified for c in without)


def test_a_row_with_leads_is_tracked_by_no_row_under_the_law(problem):
    """Its virtual control would be another one than the prover takes."""
    (member,) = problem.members
    chain = plant_model("hydraulic_wheel").build("flow", {}, {}, sensor="pressure")
    for leads, said in ((5, "0 to 4"), (-1, "0 to 4")):
        with pytest.raises(InvalidInputError, match=said):
            check_plant(replace(chain, leads=leads))
    model = replace(RAC(plant=chain).loop_model(), leads=2, input_map=(0,))
    with pytest.raises(UnboundedError, match="a row with leads is tracked by no row under the law"):
        deviation_rows(model, member.bounds, (), first_box(member.model, member.bounds, member.gains(tuple(
            item.low for item in member.ranges)), np.array([1e-6, 1e-6, 1.0]))[0])  # fmt: skip


def own(data):
    return data["members"][0]


def gain(name, share):
    def change(data):
        entry = next(g for g in own(data)["gains"] if g["name"] == name)
        entry["value"] = float(f"{entry['value'] * share:.6g}")

    return change


def network(**changes):
    return lambda data: own(data)["certificate"]["networks"][0].update(changes)


def tolerance(name, value):
    """A wider range of a constant, in study and assumptions alike."""

    def change(data):
        for section in data["study"]["plant"]["joints"].values():
            section["parameters"][name]["tolerance"] = value
            middle = section["parameters"][name]["value"]
        entry = next(a for a in own(data)["assumptions"] if a["name"] == f"parameter.{name}")
        entry["lower"], entry["upper"] = middle * (1 - value) - 1e-15, middle * (1 + value) + 1e-15

    return change


CHANGES = {
    "more lead": gain("lead_1", 1.03),
    "a slower filter": gain("smooth_1", 1.4),
    "less gain of the network": gain("gamma_1", 0.7),
    "no leads": lambda data: own(data)["model"].pop("leads"),
    "one section": lambda data: own(data)["model"].update(leads=1),
    "another memory of the leads": lambda data: own(data)["golden"][3]["lead"].__setitem__(0, 0.5),
    "another next memory": lambda data: own(data)["golden"][3]["lead_next"].__setitem__(1, 0.5),
    "nothing that is followed": lambda data: own(data)["certificate"].pop("lags"),
    "a mode as a lag": lambda data: own(data)["certificate"].update(lags=["pressure"]),
    "a measured state as a lag": lambda data: own(data)["certificate"].update(lags=["speed"]),
    "an unknown lag": lambda data: own(data)["certificate"].update(lags=["valve"]),
    "twice the same lag": lambda data: own(data)["certificate"].update(lags=["opening", "opening"]),
    "parts without middles": lambda data: own(data)["certificate"].update(parts={"leakage": 2}),
    "parts of an inertia that are one": lambda data: own(data)["certificate"].update(parts={"leakage": 1}),
    "parts of what is no constant": lambda data: own(data)["certificate"].update(parts={"traction": 2}),
    "no middles": lambda data: own(data)["certificate"].pop("force"),
    "a mode that stands still": lambda data: own(data)["model"]["rows"][2].update(target="zero"),
    "the law's row in balance": lambda data: own(data)["model"]["rows"][0].update(target="balance"),
    "a lag in balance": lambda data: own(data)["model"]["rows"][1].update(target="balance"),
    "a slower valve": tolerance("valve_lag", 0.2),
    "a lag that reads the pressure": lambda data: own(data)["certificate"]["force"][1].__setitem__(2, "1/1000000"),
    "softer oil": tolerance("bulk_modulus", 0.1),
}  # fmt: skip


@pytest.mark.parametrize("what", CHANGES)
def test_a_resealed_change_is_refused(document, what):
    changed = json.loads(json.dumps(document))
    CHANGES[what](changed)
    assert checker.check_text(forged(changed)).status != 0


def test_the_bundled_wheel_is_proved(document):
    """By the checker alone, to 60 mm/s, and it says how far it is used; more friction is carried without a cost."""
    told = checker.check_text(FILE.read_text(encoding="utf-8"))
    assert told.status == 0 and "mm/s" in told.message
    assert document["study"]["controller"]["delay_s"] == 1e-3
    drives = next(iter(document["study"]["plant"]["joints"].values()))
    assert drives["parameters"]["valve_lag"]["tolerance"] == pytest.approx(0.1)
    assert document["study"]["uncertainty"]["disturbances"]["traction"]["rate"] == 15e3
    ultimate = Fraction(own(document)["certificate"]["envelope"]["ultimate"][0])
    assert 0.02 < ultimate < Fraction(6, 100)


def test_no_run_leaves_the_bound(problem, values, document):
    """Resonant courses at both ends of every constant, with noise; a quarter of the bound is reached at least."""
    (member,) = problem.members
    ultimate = float(Fraction(own(document)["certificate"]["envelope"]["ultimate"][0]))
    half, runs = 1 / (2 * 27.0), []
    for width in (half, 0.7 * half, 1.4 * half):
        rough = tuple((1.0 + width * k, 100.0 * (-1) ** k) for k in range(120))
        load = tuple((1.0 + width * k, 3000.0 + 7.5e3 * width * (-1) ** k) for k in range(120))
        for shares in (-1.0, 1.0):
            parameters = dict.fromkeys(("wheel_mass", "bulk_modulus", "leakage"), shares) | {"valve_lag": -shares}
            runs.append(Run(gains={member.name: values}, scenario=Scenario(
                name="s", disturbances={"traction": load, "roughness": rough}, noise=1.0, initial=1.0,
                parameters=parameters)))  # fmt: skip
    errors = [figures.maximum_error_m for figures in Loop(problem).figures(runs)]
    assert 0.25 * ultimate < max(errors) <= ultimate
    assert math.isfinite(max(errors))
