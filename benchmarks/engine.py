"""Closed-loop simulation side by side: `python benchmarks/engine.py`. Needs gcc; rivals that are not installed are left out.

One core throughout. Every program runs the same sampled loop with the same integration steps on the same reference;
each one's largest error is compared with the project's before it is timed. Figures are control periods a second, the
best of some repetitions, and ratios to scalar C. The project's runs also record all the figures of a design and draw
measurement noise; the programs in C record the largest error alone.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from hdmm_opt import study
from hdmm_opt.problem import assemble
from hdmm_opt.simulation import Loop, Run, Scenario
from hdmm_opt.simulation.engine import Batch, Engine, Record, System, Task, kernel
from hdmm_opt.simulation.engine.compiler import compiled_text
from plain import plain
from timing import fastest

Array = np.ndarray
TICKS = 4000
GAINS = [24.0, 50.0, 2.0, 5.0, 5900.0, 200.0, 1.0, 20.0]


@dataclass(frozen=True, kw_only=True)
class Case:
    """A loop for all programs: its system, one run's start and constants, and the arguments of its C function."""

    name: str
    system: System
    record: str
    fixed: Array
    x: Array
    z: Array
    shared: Array
    own: float
    c_parameters: Array


def emla() -> Case:
    problem = assemble(study.load("emla-p2"))
    loop, (member,) = Loop(problem), problem.members
    heavy = Scenario(name="heavy", disturbances={"load_force": ((0.0, 76e3),)})
    start = loop.batches.batch([Run(gains={member.name: tuple(GAINS)}, scenario=heavy)], None)
    values = [value for name, value in member.plant.values().items() if name != "effectiveness"]  # it is 1
    return Case(
        name="EMLA at torque level, 3 states, 2 adaptive scalars, 2 tanh", system=loop.system(), record="error",
        fixed=start.fixed[:, 0], x=start.x[:, 0], z=start.z[:, 0], shared=np.ascontiguousarray(start.shared[:TICKS]),
        own=76e3, c_parameters=np.concatenate([GAINS, values, [76e3]]),
    )  # fmt: skip


def joint() -> Case:
    """A crane's lift joint on its cylinder, proportional velocity law; sin, cos, tanh and a root."""
    x, z, r, own, f = (ca.SX.sym(name, size) for name, size in (("x", 2), ("z", 1), ("r", 4), ("l", 1), ("f", 10)))
    t, tau = ca.SX.sym("t"), ca.SX.sym("tau")
    goal = r[0] + tau * (r[1] + tau * (r[2] / 2 + tau * r[3] / 6))
    sine, cosine = ca.sin(x[0]), ca.cos(x[0])
    arm = f[8] * sine / ca.sqrt(f[9] + 2 * f[8] * cosine)
    torque = arm * z[0] - f[2] * cosine - f[5] * x[1] - f[6] * ca.tanh(x[1] / f[7])
    system = System(
        x=x, z=z, shared=r, own=own, draws=ca.SX.sym("v", 0), fixed=f, t=t, tau=tau,
        tasks=(Task(every=1, after=-f[1] / 2 * (x[1] - (r[1] - f[0] / 2 * (x[0] - r[0])))),),
        rate=ca.vertcat(x[1], torque / (f[3] + f[4] * sine**2)), alive=ca.fabs(x[0]) < 100,
        records=(Record(name="error", kind="max", value=ca.fabs(x[0] - goal), between=True),),
        signals={"x": x}, period=1e-3, substeps=10,
    )  # fmt: skip
    times = 1e-3 * np.arange(TICKS)
    w = 1.2
    reference = np.array([1 + 0.4 * np.sin(w * times), 0.4 * w * np.cos(w * times), -0.4 * w**2 * np.sin(w * times),
                          -0.4 * w**3 * np.cos(w * times)]).T.copy()  # fmt: skip
    fixed = np.array([20.0, 4e6, 9000.0, 2200.0, 300.0, 500.0, 150.0, 0.01, 0.379, 1.156])
    return Case(
        name="lift joint, 2 states, sin, cos, tanh, root", system=system, record="error", fixed=fixed,
        x=np.array([1.0, 0.0]), z=np.zeros(1), shared=reference, own=0.0, c_parameters=fixed,
    )  # fmt: skip


def batch(case: Case, runs: int) -> Batch:
    own = np.full((1, TICKS), case.own)
    return Batch(
        fixed=np.repeat(case.fixed[:, None], runs, axis=1), seeds=np.arange(runs, dtype=np.uint64),
        x=np.repeat(case.x[:, None], runs, axis=1), z=np.repeat(case.z[:, None], runs, axis=1), shared=case.shared,
        own=lambda run, first, size: own[:, first : first + size],
    )  # fmt: skip


def error_of(case: Case, found: Array) -> float:
    return float(found[[r.name for r in case.system.records].index(case.record)].max())


def project(case: Case, runs: int, lanes: int | None, *, compiled: bool = True) -> tuple[float, float]:
    engine, given = Engine(case.system, compiled=compiled), batch(case, runs)
    seconds = fastest(lambda: engine.run(given, lanes=lanes), 7 if compiled else 2)
    return runs * TICKS / seconds, error_of(case, engine.run(given, lanes=lanes).figures)


def built(folder: Path, source: Path, flags: str, name: str) -> ctypes.CDLL:
    target = folder / f"{name}.so"
    subprocess.run(["gcc", *flags.split(), "-shared", "-fPIC", str(source), "-o", str(target), "-lm"], check=True)
    return ctypes.CDLL(str(target))


def by_hand(case: Case, folder: Path, function: str, flags: str, lanes: int) -> tuple[float, float]:
    library = built(
        folder, Path(__file__).with_name("loops.c"), f"{flags} -DLANES={lanes}", f"{function}{abs(hash(flags))}{lanes}"
    )
    run = getattr(library, function)
    pointer = ctypes.POINTER(ctypes.c_double)
    run.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_double, pointer, pointer, pointer]
    p, out = np.repeat(case.c_parameters[:, None], lanes, axis=1).copy(), np.zeros(lanes)
    arguments = [np.ascontiguousarray(a).ctypes.data_as(pointer) for a in (case.shared, p, out)]
    seconds = fastest(lambda: run(TICKS, case.system.substeps, case.system.period, *arguments))
    return lanes * TICKS / seconds, float(out.max())


def generated(case: Case, folder: Path, function: str) -> tuple[float, float]:
    """CasADi's own C code for a period, compiled, and called period by period from a C loop."""
    from hdmm_opt.simulation.engine.virtual import _tick

    tick = _tick(case.system)
    tick = ca.Function("tick", tick.sx_in(), [tick(*tick.sx_in())[0]])
    generator = ca.CodeGenerator(f"{function}_tick.c")
    generator.add(tick)
    generator.generate(f"{folder}/")
    cells, columns = tick.numel_in(0), tick.numel_in(1)
    driver = folder / f"{function}driver.c"
    driver.write_text(
        f'#include "{function}_tick.c"\n'
        "void drive(long ticks, double *cells, const double *columns, const double *fixed) {\n"
        f"  static casadi_int iw[{tick.sz_iw() + 1}]; static double w[{tick.sz_w() + 1}], after[{cells}];\n"
        "  for (long k = 0; k < ticks; k++) {\n"
        f"    const double *arg[{tick.sz_arg()}] = {{cells, columns + k * {columns}, fixed}}; double *res[{tick.sz_res()}] = {{after}};\n"
        f"    tick(arg, res, iw, w, 0); for (int i = 0; i < {cells}; i++) cells[i] = after[i];\n"
        "  }\n}\n",
        encoding="utf-8",
    )  # fmt: skip
    library = built(folder, driver, "-O3 -march=native", f"{function}generated")
    sizes, given = case.system.sizes, batch(case, 1)
    ticks = np.arange(TICKS)
    stacked = np.hstack([ticks[:, None], case.shared, given.own(0, 0, TICKS).T, np.zeros((TICKS, sizes["v"]))]).copy()
    start = np.zeros(cells)
    start[: sizes["x"]] = case.x
    start[sizes["x"] : sizes["x"] + sizes["z"]] = case.z
    start[sizes["x"] + sizes["z"]] = np.inf
    state = start.copy()
    pointer = ctypes.POINTER(ctypes.c_double)

    def go() -> None:
        state[:] = start
        library.drive(ctypes.c_long(TICKS), *(a.ctypes.data_as(pointer) for a in (state, stacked, case.fixed)))

    seconds = fastest(go)
    return TICKS / seconds, error_of(case, state[sizes["x"] + sizes["z"] + 1 :, None])


def period_by_period(case: Case, ticks: int, advance: Callable[[Array, Array, int], Array]) -> tuple[float, float]:
    """A Python loop over the periods: the law in plain Python, the plant by another program."""
    system = case.system
    after = system.tasks[0].after
    if system.draws.numel():
        after = ca.substitute([after], [system.draws], [ca.SX.zeros(system.draws.numel())])[0]
    law, constant = plain(_groups(system), after), [case.own, *case.fixed.tolist()]
    x, z, most = case.x.copy(), case.z.copy(), 0.0
    begun = time.perf_counter()
    for k in range(ticks):
        most = max(most, abs(x[0] - case.shared[k, 0]))
        z = np.array(law([*x.tolist(), *z.tolist(), *case.shared[k].tolist(), *constant, k * system.period]))
        x = advance(x, z, k)
    return ticks / (time.perf_counter() - begun), most


def rate_of(case: Case) -> Callable[[Array, Array, int], list[float]]:
    rate, constant = plain(_groups(case.system), case.system.rate), [case.own, *case.fixed.tolist()]

    def at(x: Array, z: Array, k: int) -> list[float]:
        return rate([*x.tolist(), *z.tolist(), *case.shared[k].tolist(), *constant, k * case.system.period])

    return at


def _groups(system: System) -> list[ca.SX]:
    return [system.x, system.z, system.shared, system.own, system.fixed, system.t]


def scipy_periods(case: Case, ticks: int) -> tuple[float, float]:
    from scipy.integrate import solve_ivp

    rate, period = rate_of(case), case.system.period
    return period_by_period(
        case, ticks,
        lambda x, z, k: solve_ivp(lambda _, y: rate(y, z, k), (0, period), x, rtol=1e-8, atol=1e-10).y[:, -1],
    )  # fmt: skip


def python_control(case: Case, ticks: int) -> tuple[float, float]:
    """python-control, a response for each period with the input held over it."""
    import control

    rate, s = rate_of(case), case.system
    n, d = s.sizes["x"], s.sizes["z"]
    plant = control.nlsys(lambda t, x, u, p: rate(x, u, p["k"]), inputs=d, states=n, params={"k": 0})

    def advance(x: Array, z: Array, k: int) -> Array:
        held = np.repeat(z[:, None], 2, axis=1)
        found = control.input_output_response(
            plant, [0, s.period], held, x, params={"k": k}, solve_ivp_kwargs={"rtol": 1e-8, "atol": 1e-10}
        )
        return found.states[:, -1]

    return period_by_period(case, ticks, advance)


def jax_batch(case: Case, runs: int) -> tuple[float, float]:
    """JAX on the CPU: the same straight-line programs, vmap over runs, a scan over ticks; for the lift joint."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    f, T, steps = jnp.asarray(case.fixed), case.system.period, case.system.substeps
    h = T / steps

    def rate(x: Array, u: Array) -> Array:
        s, c = jnp.sin(x[0]), jnp.cos(x[0])
        arm = f[8] * s / jnp.sqrt(f[9] + 2 * f[8] * c)
        torque = arm * u - f[2] * c - f[5] * x[1] - f[6] * jnp.tanh(x[1] / f[7])
        return jnp.array([x[1], torque / (f[3] + f[4] * s * s)])

    def tick(carry: tuple, r: Array) -> tuple:
        x, most = carry
        u = -f[1] / 2 * (x[1] - (r[1] - f[0] / 2 * (x[0] - r[0])))
        most = jnp.maximum(most, jnp.abs(x[0] - r[0]))

        def step(i: int, inner: tuple) -> tuple:
            x, most = inner
            k1 = rate(x, u)
            k2 = rate(x + h / 2 * k1, u)
            k3 = rate(x + h / 2 * k2, u)
            k4 = rate(x + h * k3, u)
            x, tau = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), (i + 1) * h
            goal = r[0] + tau * (r[1] + tau * (r[2] / 2 + tau * r[3] / 6))
            return x, jnp.maximum(most, jnp.abs(x[0] - goal))

        return jax.lax.fori_loop(0, steps, step, (x, most)), None

    def one(x: Array) -> Array:
        return jax.lax.scan(tick, (x, 0.0), jnp.asarray(case.shared))[0][1]

    many = jax.jit(jax.vmap(one))
    starts = jnp.asarray(np.repeat(case.x[None, :], runs, axis=0))
    seconds = fastest(lambda: many(starts).block_until_ready(), 2)
    return runs * TICKS / seconds, float(many(starts).max())


def table(case: Case, folder: Path, function: str) -> None:
    print(f"\n{case.name}; {case.system.substeps} Runge-Kutta steps a period, one core")
    strict, fast = "-O3 -march=native -ffp-contract=off", "-O3 -march=native -ffast-math"
    width = kernel.vector_lanes()
    rows: list[tuple[str, Callable[[], tuple[float, float]]]] = [
        ("scalar C, by hand (strict)", lambda: by_hand(case, folder, function, strict, 1)),
        ("scalar C, by hand (fast-math)", lambda: by_hand(case, folder, function, fast, 1)),
        ("C in 32 lanes, by hand (fast-math, vector library)", lambda: by_hand(case, folder, function, fast, 32)),
        ("CasADi, generated C", lambda: generated(case, folder, function)),
        ("CasADi, virtual machine", lambda: project(case, 1, None, compiled=False)),
        ("SciPy, period by period", lambda: scipy_periods(case, 300)),
        ("python-control, period by period", lambda: python_control(case, 100)),
        ("project, a single run", lambda: project(case, 1, 1)),
        *[(f"project, {n} lanes", lambda n=n: project(case, 4 * n, n)) for n in (width, 2 * width, 4 * width, 8 * width)],
    ]  # fmt: skip
    if function == "joint":
        rows.insert(7, ("JAX, 256 runs", lambda: jax_batch(case, 256)))
    truth = project(case, 1, 1)[1]
    base = 0.0
    for name, measure in rows:
        try:
            speed, error = measure()
        except ImportError:
            print(f"  {name:52} not installed")
            continue
        full = "period" not in name
        assert not full or abs(error - truth) < 1e-9 * truth + 1e-12, (name, error, truth)
        base = base or speed
        print(f"  {name:52} {speed / 1e6:9.4f} M/s   x {speed / base:8.3f}")


def compile_times(case: Case) -> None:
    print(f"\nfrom the symbols to a kernel: {case.name}")
    code = (
        "import sys, time; sys.path.insert(0, {folder!r}); import engine; case = engine.{name}(); b = time.perf_counter();"
        "e = engine.Engine(case.system, compiled=True);"
        "[e.kernel(n, trace=False) for n in {lanes}]; print(time.perf_counter() - b)"
    )
    name = "emla" if "EMLA" in case.name else "joint"
    with tempfile.TemporaryDirectory() as cache:
        for title in ("cold", "from the cache"):
            for lanes in ([1], [4 * kernel.vector_lanes()]):
                text = code.format(folder=str(Path(__file__).parent), name=name, lanes=lanes)
                environment = {**os.environ, kernel.CACHE_VARIABLE: cache}
                out = subprocess.run(
                    [sys.executable, "-c", text], env=environment, check=True, capture_output=True, text=True
                )
                print(f"  {title:16} {lanes[0]:3} lanes  {float(out.stdout):6.3f} s")


def growth() -> None:
    """Cost of a control period by states and subsystems, and of a population by its size."""
    print("\ngrowth: control periods a second in full lanes, ratio of the time to the first row")
    base = 0.0
    for blocks in (1, 2, 4, 8, 16):
        system = chain(blocks)
        case = Case(
            name="", system=system, record="error", fixed=np.ones(1), x=np.zeros(2 * blocks), z=np.zeros(blocks), own=0.0,
            shared=np.ones((TICKS, 1)), c_parameters=np.zeros(0),
        )  # fmt: skip
        os.environ[kernel.CACHE_VARIABLE] = ""
        begun = time.perf_counter()
        size = len(compiled_text(system, 4 * kernel.vector_lanes(), trace=False).splitlines())
        engine = Engine(system, compiled=True)
        engine.kernel(4 * kernel.vector_lanes(), trace=False)
        seconds = time.perf_counter() - begun
        speed, _ = project(case, 16 * kernel.vector_lanes(), None)
        base = base or speed
        print(
            f"  {blocks:3} subsystems of 2 states {speed / 1e6:8.3f} M/s   x {base / speed:6.2f}   {size} instructions, made in {seconds:.2f} s"
        )
    case = emla()
    one = project(case, 1, None)[0]
    for runs in (1, 2, 8, 32, 128, 512):
        speed, _ = project(case, runs, None)
        print(f"  {runs:4} candidates at once      {speed / 1e6:8.3f} M/s   x {speed / one:6.2f} of one candidate's")


def chain(blocks: int) -> System:
    """Subsystems that push their neighbours, each with its own law at the tick."""
    x, z, r = ca.SX.sym("x", 2 * blocks), ca.SX.sym("z", blocks), ca.SX.sym("r", 1)
    f, t, tau = ca.SX.sym("f", 1), ca.SX.sym("t"), ca.SX.sym("tau")
    rates, laws = [], []
    for i in range(blocks):
        near = sum(x[2 * j] - x[2 * i] for j in (i - 1, i + 1) if 0 <= j < blocks)
        rates += [x[2 * i + 1], z[i] - x[2 * i + 1] + near + ca.tanh(x[2 * i])]
        laws.append(-f[0] * (x[2 * i] - r) - 2 * x[2 * i + 1])
    return System(
        x=x, z=z, shared=r, own=ca.SX.sym("l", 1), draws=ca.SX.sym("v", 0), fixed=f, t=t, tau=tau,
        tasks=(Task(every=1, after=ca.vertcat(*laws)),), rate=ca.vertcat(*rates), alive=ca.fabs(x[0]) < 100,
        records=(Record(name="error", kind="max", value=ca.fabs(x[0] - r), between=True),), signals={"x": x},
        period=1e-3, substeps=4,
    )  # fmt: skip


def main() -> None:
    """Print the tables."""
    cases = (("emla", emla()), ("joint", joint()))
    with tempfile.TemporaryDirectory() as folder:
        for function, case in cases:
            table(case, Path(folder), function)
    for _, case in cases:
        compile_times(case)
    growth()


if __name__ == "__main__":
    main()
