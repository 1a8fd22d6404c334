"""The engine: compiled code against CasADi's virtual machine, NumPy, SciPy and closed forms."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hdmm_opt.simulation.engine import Batch, Engine, Record, System, Task, kernel
from hdmm_opt.simulation.engine.virtual import uniform
from hdmm_opt.simulation.sensitivity import differentiated
from stability.enclosures.translation import straight_line

TICK = 1e-3


def system(
    *, tasks=None, rate=None, records=(), signals=None, sizes=(1, 1, 1, 1, 0, 1), alive=None, period=TICK, **more
):
    """A loop from functions of its symbols by letter; sizes are those of x, z, shared, own, draws, fixed."""
    letters = ("x", "z", "s", "l", "v", "f")
    by = {name: ca.SX.sym(name, size) for name, size in zip(letters, sizes, strict=True)}
    by |= {"t": ca.SX.sym("t"), "d": ca.SX.sym("d")}
    tasks = tasks or [(1, lambda a: a["z"])]
    return System(
        x=by["x"],
        z=by["z"],
        shared=by["s"],
        own=by["l"],
        draws=by["v"],
        fixed=by["f"],
        t=by["t"],
        tau=by["d"],
        tasks=tuple(Task(every=every, after=after(by)) for every, after in tasks),
        rate=rate(by) if rate else ca.SX.zeros(sizes[0]),
        alive=alive(by) if alive else ca.SX(1),
        records=tuple(Record(name=n, kind=k, value=v(by), between=b) for n, k, v, b in records),
        signals={name: value(by) for name, value in (signals or {"z": lambda a: a["z"]}).items()},
        period=period,
        substeps=more.get("substeps", 4),
    )


def batch(loop, runs, ticks, seed=0, **given):
    random = np.random.default_rng(seed)
    sizes = loop.sizes
    own = given.get("own", random.normal(size=(runs, sizes["l"], ticks)))
    return Batch(
        fixed=given.get("fixed", random.normal(size=(sizes["f"], runs))),
        seeds=given.get("seeds", np.arange(runs, dtype=np.uint64)),
        x=given.get("x", random.normal(size=(sizes["x"], runs))),
        z=given.get("z", random.normal(size=(sizes["z"], runs))),
        shared=given.get("shared", random.normal(size=(ticks, sizes["s"]))),
        own=lambda run, first, size: own[run, :, first : first + size],
    )


@pytest.mark.parametrize("name", ["tanh", "exp", "sin", "cos"])
def test_transcendental_functions_are_exact_to_2e_15(name):
    random = np.random.default_rng(1)
    largest = {"tanh": 30.0, "exp": 700.0}.get(name, 1e5)
    x = np.concatenate([
        random.uniform(-largest, largest, 4000), random.uniform(-3, 3, 4000), 10.0 ** random.uniform(-18, 0, 2000),
        [0.0, -0.0, 1e-300, largest, -largest, np.pi / 4, np.pi / 2, 0.5 * np.log(2)],
    ])  # fmt: skip
    loop = system(tasks=[(1, lambda a: getattr(ca, name)(a["l"]))])
    found = Engine(loop, compiled=True).run(batch(loop, 1, x.size, own=x[None, None, :]), trace=True).trace[:, 0, 0]
    exact = getattr(np, name)(x.astype(np.longdouble))
    scale = np.maximum(np.abs(exact), 1e-300) if name in ("tanh", "exp") else 1.0
    assert float(np.abs((found - exact) / scale).max()) < 2e-15


def test_the_ends_of_exp_tanh_sin_and_cos():
    x = np.array([1e6, -1e6, 709.5, -709.5, np.nan, 25.0, -25.0, np.inf, -np.inf, 1e11, 1e18])
    tasks = [(1, lambda a: ca.vertcat(ca.exp(a["l"]), ca.tanh(a["l"]), ca.sin(a["l"]), ca.cos(a["l"])))]
    loop = system(tasks=tasks, sizes=(1, 4, 1, 1, 0, 1))
    found = Engine(loop, compiled=True).run(batch(loop, 1, x.size, own=x[None, None, :]), trace=True).trace[:, :, 0]
    assert (found[[0, 1, 3, 7, 8], 0] == [np.inf, 0, 0, np.inf, 0]).all()
    assert found[2, 0] == pytest.approx(np.exp(709.5), rel=1e-15) and np.isnan(found[4]).all()
    assert (found[[0, 1, 5, 6, 7, 8], 1] == [1, -1, 1, -1, 1, -1]).all()
    assert found[9, 2:] == pytest.approx([np.sin(1e11), np.cos(1e11)], abs=2e-15)
    assert np.isnan(found[[7, 8, 10], 2:]).all()  # no angle: better nothing than something


def test_draws_are_splitmix64():
    """The first outputs for seed 1234567 as its authors' reference program prints them."""
    printed = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431, 16408922859458223821]
    expected = [2 * (v >> 12) / 2**52 - 1 for v in printed]
    assert uniform(1234567, np.arange(5), 1)[0] == pytest.approx(expected, abs=1e-15)
    loop = system(tasks=[(1, lambda a: a["v"])], sizes=(1, 3, 1, 1, 3, 1))
    seeds = np.array([1234567, 2**64 - 1], dtype=np.uint64)
    trace = Engine(loop, compiled=True).run(batch(loop, 2, 50, seeds=seeds), trace=True).trace
    for lane, seed in enumerate(seeds):
        assert (trace[:, :, lane].T == uniform(int(seed), np.arange(50), 3)).all()
    many = uniform(5, np.arange(20000), 2)
    assert np.abs(many.mean(axis=1)).max() < 0.02 and many.min() >= -1 and many.max() < 1
    assert np.abs(np.corrcoef(many)[0, 1]) < 0.02


def hybrid(period=TICK):
    """Three rates, a latch, a counter, quantised and noisy measurement, a load that varies in time."""

    def fast(a):
        x, z, f = a["x"], a["z"], a["f"]
        measured = ca.floor((x[1] + 0.01 * a["v"][0]) / 0.05 + 0.5) * 0.05
        command = ca.if_else(z[2] > 0, 0, f[0] * (z[0] - measured) + z[4])
        return ca.vertcat(z[0], ca.fmin(ca.fmax(command, -3), 3), z[2], z[3] + 1, z[4])

    def middle(a):
        x, z = a["x"], a["z"]
        integral = z[4] + 0.02 * (z[0] - x[1])
        tripped = ca.logic_or(z[2] > 0, ca.logic_and(ca.fabs(x[0]) > 2.0, a["t"] > 0.05))
        return ca.vertcat(z[0], z[1], tripped, z[3], integral)

    def slow(a):
        return ca.vertcat(ca.tanh(a["s"][0] - a["x"][0]), a["z"][1:])

    def rate(a):
        x, z = a["x"], a["z"]
        friction = ca.tanh(x[1] / 0.1) * ca.sin(x[0]) / (1 + x[0] ** 2)
        return ca.vertcat(x[1], a["f"][1] * z[1] - friction + 0.3 * a["l"][0] * ca.cos(3 * a["t"]))

    records = (
        ("peak", "max", lambda a: ca.fabs(a["x"][0]), True),
        ("work", "sum", lambda a: a["z"][1] * a["x"][1], False),
        ("reach", "max", lambda a: a["x"][0] + a["d"], True),
    )
    signals = {"x": lambda a: a["x"], "z": lambda a: a["z"]}
    return system(
        tasks=[(20, slow), (4, middle), (1, fast)], rate=rate, records=records, signals=signals,
        sizes=(2, 5, 1, 1, 1, 2), alive=lambda a: ca.fabs(a["x"][0]) < 50, period=period,
    )  # fmt: skip


def fixed_of(runs):
    return np.vstack([np.linspace(0.5, 3, runs), np.linspace(1, 4, runs)])


def test_compiled_and_interpreted_loops_agree():
    loop = hybrid()
    given = batch(loop, 5, 700, fixed=fixed_of(5), x=np.vstack([np.linspace(0, 2.5, 5), np.zeros(5)]))
    one, other = (Engine(loop, compiled=c).run(given, trace=True) for c in (True, False))
    assert one.trace == pytest.approx(other.trace, abs=1e-11)
    assert one.figures == pytest.approx(other.figures, abs=1e-9) and (one.lost == other.lost).all()
    assert (one.trace[:, 4] > 0).any() and (one.trace[:, 4] == 0).any()  # some latch has tripped, some has not


@pytest.mark.parametrize(("lanes", "jobs"), [(1, 1), (4, 1), (8, 2), (32, 2), (None, 2)])
def test_a_run_depends_on_neither_lanes_nor_threads_nor_neighbours(lanes, jobs):
    loop = hybrid()
    given = batch(loop, 37, 300, fixed=fixed_of(37))
    engine = Engine(loop, compiled=True)
    alone, found = engine.run(given, lanes=1), engine.run(given, lanes=lanes, jobs=jobs)
    assert (alone.figures == found.figures).all() and (alone.lost == found.lost).all()


def test_three_rates_against_scipy():
    """The same hybrid loop written by hand, its plant integrated by SciPy at 1e-11."""
    loop = hybrid()
    given = batch(loop, 1, 400, fixed=np.array([[2.0], [3.0]]), seeds=np.array([9], dtype=np.uint64))
    found = Engine(loop, compiled=True).run(given, trace=True).trace[:, :, 0]
    x, z = given.x[:, 0], given.z[:, 0].copy()
    load, draws = given.own(0, 0, 400)[0], uniform(9, np.arange(400), 1)[0]
    for k in range(400):
        t = TICK * k
        if k % 20 == 0:
            z[0] = np.tanh(given.shared[k, 0] - x[0])
        if k % 4 == 0:
            z[4] += 0.02 * (z[0] - x[1])
            z[2] = float(z[2] > 0 or (abs(x[0]) > 2.0 and t > 0.05))
        measured = np.floor((x[1] + 0.01 * draws[k]) / 0.05 + 0.5) * 0.05
        z[1] = 0.0 if z[2] > 0 else np.clip(2.0 * (z[0] - measured) + z[4], -3, 3)
        z[3] += 1
        assert np.concatenate([x, z]) == pytest.approx(found[k], abs=1e-8)

        def rate(_, y, k=k, t=t):
            friction = np.tanh(y[1] / 0.1) * np.sin(y[0]) / (1 + y[0] ** 2)
            return [y[1], 3.0 * z[1] - friction + 0.3 * load[k] * np.cos(3 * t)]

        x = solve_ivp(rate, (0, TICK), x, rtol=1e-11, atol=1e-13, method="DOP853").y[:, -1]


def oscillator(period, frequency=20.0):
    return system(
        rate=lambda a: ca.vertcat(a["x"][1], -(frequency**2) * a["x"][0]),
        records=(
            ("between", "max", lambda a: a["x"][0], True),
            ("at ticks", "max", lambda a: a["x"][0], False),
            ("late", "max", lambda a: a["t"] + a["d"], True),
        ),
        sizes=(2, 1, 1, 1, 0, 1), period=period, substeps=32,
    )  # fmt: skip


def test_extremes_between_the_ticks_are_recorded():
    """x = sin(20 t) at ticks of half a period less a bit: at the ticks it is small, between it reaches 1."""
    loop = oscillator(0.98 * np.pi / 20)
    given = batch(loop, 1, 4, x=np.array([[0.0], [20.0]]))
    between, at, late = Engine(loop, compiled=True).run(given).figures[:, 0]
    assert at < 0.3 and between == pytest.approx(1.0, abs=2e-3)
    assert late == pytest.approx(4 * loop.period)


def test_a_lost_run_is_frozen_and_its_neighbours_go_on():
    loop = system(
        rate=lambda a: a["f"][0] * a["x"] ** 2,
        records=(("peak", "max", lambda a: a["x"], False), ("ticks", "sum", lambda a: ca.SX(1), False)),
        alive=lambda a: ca.fabs(a["x"]) < 10,
        signals={"x": lambda a: a["x"]},
    )
    fixed = np.array([[0.0, 1.0, 0.5, np.nan]])
    given = batch(loop, 4, 3000, fixed=fixed, x=np.full((1, 4), 1.0))
    found = Engine(loop, compiled=True).run(given, lanes=4)
    assert found.lost[0] == np.inf and found.figures[:, 0] == pytest.approx([1.0, 3000])
    assert found.lost[1] == pytest.approx(0.9, abs=2e-3)  # x = 1 / (1 - t) passes 10 at t = 0.9
    assert found.lost[2] == pytest.approx(1.8, abs=2e-3) and found.figures[1, 2] == pytest.approx(1800, abs=2)
    assert found.figures[0, 1] < 10 and found.lost[3] == pytest.approx(TICK)
    interpreted = Engine(loop, compiled=False).run(given)
    assert (interpreted.lost == found.lost).all()


def test_the_differentiated_loop_gives_the_derivative_of_the_loop():
    loop = system(
        tasks=[(2, lambda a: ca.vertcat(a["z"][0] + a["f"][0] * a["x"][0], ca.tanh(a["f"][1] * a["z"][0])))],
        rate=lambda a: ca.vertcat(a["x"][1], -a["f"][1] * a["x"][0] - ca.sin(a["x"][1]) + a["z"][1]),
        records=(("sum", "sum", lambda a: a["x"][0] ** 2 * (1 + a["f"][0]), False), ("peak", "max", lambda a: a["x"][0], True)),
        sizes=(2, 2, 1, 1, 0, 2),
    )  # fmt: skip
    double = differentiated(loop)
    assert [r.name for r in double.records] == ["sum", "peak", "d sum"]
    at, start = np.array([0.3, 2.0]), np.array([[0.5], [0.1]])

    def total(fixed):
        given = batch(loop, 1, 500, fixed=fixed[:, None], x=start, z=np.zeros((2, 1)))
        return Engine(loop).run(given).figures[0, 0]

    directions = np.eye(2)
    given = batch(
        double, 2, 500, fixed=np.vstack([np.repeat(at[:, None], 2, axis=1), directions]),
        x=np.vstack([np.repeat(start, 2, axis=1), np.zeros((2, 2))]), z=np.zeros((4, 2)),
    )  # fmt: skip
    slopes = Engine(double).run(given).figures[2]
    for k in range(2):
        step = 1e-5 * directions[k]
        assert slopes[k] == pytest.approx((total(at + step) - total(at - step)) / 2e-5, rel=1e-6)


def test_what_cancels_stays_zero_and_divisions_are_rounded_as_such():
    """a² - b² under a root, and quotients that a floor looks at: fused or multiplied they would be off by an ulp."""
    random = np.random.default_rng(3)
    a, b = random.normal(size=(2, 20_000))

    def task(s):
        x, y, c = s["l"][0], s["l"][1], s["f"][0]
        return ca.vertcat(ca.sqrt(x**2 - (x + 0 * y) ** 2), x / 49, x / c, ca.floor(100 * x / c), x * y - y * x)

    loop = system(tasks=[(1, task)], sizes=(1, 5, 1, 2, 0, 1))
    fixed = np.array([[0.1, 0.0025, 49.0]])
    given = batch(loop, 3, a.size, own=np.repeat(np.array([[a, b]]), 3, axis=0), fixed=fixed)
    one, other = (Engine(loop, compiled=c).run(given, trace=True).trace for c in (True, False))
    assert (one[:, [0, 4]] == 0).all() and (one == other).all()
    for k, c in enumerate(fixed[0]):
        assert (one[:, 2, k] == a / c).all()


def test_minimum_maximum_and_sign_are_those_of_casadi_for_nan_and_zero():
    special = np.array([0.0, -0.0, 1.0, -2.0, np.inf, -np.inf, np.nan])
    pairs = np.array([[p, q] for p in special for q in special]).T

    def task(s):
        p, q = s["l"][0], s["l"][1]
        return ca.vertcat(ca.fmin(p, q), ca.fmax(p, q), ca.sign(p), p < q, p <= q, p == q, p != q,
                          ca.logic_and(p, q), ca.logic_or(p, q), ca.logic_not(p), ca.if_else(p, q, 3))  # fmt: skip

    loop = system(tasks=[(1, task)], sizes=(1, 11, 1, 2, 0, 1))
    given = batch(loop, 1, pairs.shape[1], own=pairs[None])
    one, other = (Engine(loop, compiled=c).run(given, trace=True).trace for c in (True, False))
    np.testing.assert_array_equal(one, other)


def test_sparse_outputs_keep_their_places():
    x = ca.SX.sym("x", 3)
    y = ca.SX(4, 1)
    y[2], y[3] = x[0] + 1, x[2] ** 2
    program = straight_line(ca.Function("f", [x], [y]), ("a", "b", "c"))
    assert program({"a": 1.0, "b": 2.0, "c": 3.0}) == [0.0, 0.0, 2.0, 9.0]
    with pytest.raises(ValueError, match="dense input"):
        straight_line(ca.Function("f", [ca.SX.sym("s", ca.Sparsity.diag(2))], [ca.SX(1)]), ("a", "b", "c", "d"))
    loop = system(rate=lambda a: ca.mtimes(ca.sparsify(ca.DM([[0, 0], [1, 0]])), a["x"]), sizes=(2, 1, 1, 1, 0, 1),
                  signals={"x": lambda a: a["x"]}, period=1.0)  # fmt: skip
    given = batch(loop, 1, 3, x=np.array([[1.0], [0.0]]))
    for compiled in (True, False):
        assert Engine(loop, compiled=compiled).run(given, trace=True).trace[:, :, 0].tolist() == [
            [1, 0],
            [1, 1],
            [1, 2],
        ]


@pytest.mark.parametrize("compiled", [True, False])
def test_a_loss_in_the_last_tick_is_seen(compiled):
    loop = system(
        rate=lambda a: a["l"], alive=lambda a: ca.fabs(a["x"]) < 10, records=(("peak", "max", lambda a: a["x"], True),)
    )
    for bad in (np.nan, np.inf, 1e9):
        own = np.zeros((2, 1, 5))
        own[1, 0, -1] = bad
        found = Engine(loop, compiled=compiled).run(batch(loop, 2, 5, own=own, x=np.zeros((1, 2))))
        assert found.lost[0] == np.inf and found.lost[1] == pytest.approx(5 * TICK)


def test_arrays_of_any_kind_are_taken_and_wrong_shapes_refused():
    loop = system(tasks=[(1, lambda a: a["s"][:1] + a["f"][0])], sizes=(1, 1, 2, 1, 0, 2))
    good = batch(loop, 3, 4)
    engine = Engine(loop, compiled=True)
    for kind in (np.int64, np.float32):
        whole = replace(good, shared=np.arange(8).reshape(4, 2).astype(kind), fixed=np.ones((2, 3), dtype=kind))
        assert engine.run(whole, trace=True).trace[:, 0, 1].tolist() == [1, 3, 5, 7]
    turned = replace(good, shared=np.asfortranarray(good.shared))
    assert (engine.run(turned, trace=True).trace == engine.run(good, trace=True).trace).all()
    for wrong in (
        {"shared": good.shared[:, :1]}, {"fixed": good.fixed[:1]}, {"x": np.zeros((2, 3))}, {"z": np.zeros((1, 2))},
        {"own": lambda run, first, size: np.zeros((2, size))},
    ):  # fmt: skip
        with pytest.raises(ValueError, match="shape"):
            engine.run(replace(good, **wrong))
    with pytest.raises(ValueError, match="at least one lane"):
        engine.run(good, lanes=0)
    assert engine.run(batch(loop, 0, 4)).figures.shape == (0, 0)


@given(st.integers(0, 10_000))
def test_random_loops_agree(seed):
    """Random straight-line programs over every operation of the compiler, at one tick."""
    random = np.random.default_rng(seed)
    unary = [ca.sin, ca.cos, ca.tanh, ca.fabs, ca.floor, ca.sign, lambda v: ca.sqrt(ca.fabs(v)), lambda v: v * v,
             lambda v: ca.exp(-(v**2)), lambda v: -v, ca.atan, lambda v: ca.log(1 + v * v), lambda v: 2 / (2 + v * v)]  # fmt: skip
    binary = [lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / (1 + b * b), ca.fmin, ca.fmax,
              lambda a, b: ca.if_else(a < b, a, b + 1), lambda a, b: ca.atan2(a, 1 + b * b), lambda a, b: a * (b <= 0.3)]  # fmt: skip

    def program(a):
        values = [a["x"][0], a["z"][0], a["s"][0], a["l"][0], a["f"][0], ca.SX(float(random.normal()))]
        for _ in range(12):
            if random.uniform() < 0.4:
                values.append(unary[random.integers(len(unary))](values[random.integers(len(values))]))
            else:
                i, j = random.integers(len(values), size=2)
                values.append(binary[random.integers(len(binary))](values[i], values[j]))
        return values[-1] / (1 + values[-1] ** 2)

    loop = system(tasks=[(1, program)], rate=lambda a: a["z"] - a["x"] / a["f"][0] ** 2)
    given = batch(loop, 3, 1, seed=seed)
    one, other = (Engine(loop, compiled=c).run(given, trace=True) for c in (True, False))
    assert one.trace == pytest.approx(other.trace, rel=1e-11, abs=1e-11)


def test_kernels_are_kept_on_disk_and_a_damaged_one_is_not_loaded(tmp_path, monkeypatch):
    monkeypatch.setenv(kernel.CACHE_VARIABLE, str(tmp_path))
    loop = hybrid(period=1.25e-3)
    given = batch(loop, 1, 50, fixed=fixed_of(1))
    first = Engine(loop, compiled=True).run(given).figures
    (kept,) = tmp_path.iterdir()
    compiled = []
    real = kernel._compiled
    monkeypatch.setattr(kernel, "_compiled", lambda *a: compiled.append(1) or real(*a))
    assert (Engine(loop, compiled=True).run(given).figures == first).all() and not compiled
    kept.write_bytes(kept.read_bytes()[:-7])
    assert (Engine(loop, compiled=True).run(given).figures == first).all() and compiled
    assert [p.suffix for p in tmp_path.iterdir()] == [".o"]
    monkeypatch.setenv(kernel.CACHE_VARIABLE, str(tmp_path / "file" / "below"))
    (tmp_path / "file").write_text("in the way")
    assert (Engine(loop, compiled=True).run(given).figures == first).all()
    monkeypatch.delenv(kernel.CACHE_VARIABLE)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(kernel.Path, "home", homeless)
    assert (Engine(loop, compiled=True).run(given).figures == first).all()


def test_without_a_compiler_the_loop_is_interpreted(monkeypatch):
    monkeypatch.setattr(kernel, "available", lambda: False)
    loop = hybrid()
    engine = Engine(loop)
    assert not engine.compiled and np.isfinite(engine.run(batch(loop, 2, 30, fixed=fixed_of(2))).figures).all()


def test_an_unknown_operation_is_refused():
    loop = system(tasks=[(1, lambda a: ca.erf(a["x"]))])
    with pytest.raises(NotImplementedError, match="rewrite the model"):
        Engine(loop, compiled=True).run(batch(loop, 1, 5))


@pytest.mark.parametrize("wrong", [{"period": 0.0}, {"period": float("nan")}, {"substeps": 0}, {"tasks": [(0, lambda a: a["z"])]}])  # fmt: skip
def test_periods_and_steps_must_be_positive(wrong):
    with pytest.raises(ValueError, match="positive whole numbers"):
        system(**wrong)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"rate": lambda a: ca.vertcat(a["x"], a["x"])}, "the rate is a column of 1 rows"),
        ({"rate": lambda a: a["x"] * a["v"]}, "the rate depends on"),
        ({"rate": lambda a: a["x"] * a["d"]}, "the rate depends on"),
        ({"tasks": [(1, lambda a: ca.horzcat(a["z"], a["z"]))]}, "a task is a column"),
        ({"tasks": [(2, lambda a: ca.vertcat(a["z"], a["z"]))]}, "a task is a column"),
        ({"records": [("r", "max", lambda a: ca.vertcat(a["x"], a["x"]), True)]}, 'record "r" is a column of 1'),
        ({"alive": lambda a: ca.SX.sym("stranger")}, "got stranger"),
    ],
)
def test_a_loop_with_wrong_shapes_or_strangers_is_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        system(**{"sizes": (1, 1, 1, 1, 1, 1), **wrong})
