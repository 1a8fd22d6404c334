"""The closed loop as symbols: every member under its law, measurement, observers, faults, coupling, output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..control.observer import observed
from ..machines.body import Body
from ..plants import Plant
from ..problem import Problem
from .acceleration import accelerations
from .engine.system import System, Task
from .layout import FAULT, Part, size_of
from .records import Settings, Signals, records
from .scenario import KINDS

#: A member further than this from its reference, in its unit, ends a run as lost.
DIVERGED = 0.5


def compose(
    problem: Problem, parts: Sequence[Part], settings: Settings, period: float, substeps: int, extras: frozenset[str]
) -> System:
    """The loop as a system for the engine; `layout.py` says where everything lies.

    Args:
        problem: The problem.
        parts: Its members in the loop.
        settings: What the figures are measured by.
        period: Duration of a tick, s.
        substeps: Runge-Kutta steps in a tick.
        extras: What the runs need besides: "quantisation", "fault", "ground".
    """
    import casadi as ca

    machine, n = problem.machine, len(parts)
    body = machine.body if "ground" in extras else None
    moved = ca.SX.sym("body", 0 if body is None else len(body.states))
    watched = ca.SX.sym("watched", 0 if body is None else 2 * len(body.met))
    x, z = ca.vertcat(ca.SX.sym("x", size_of(parts, "x")), moved), ca.SX.sym("z", size_of(parts, "z"))
    shared = ca.SX.sym("shared", (5 if problem.foreseeing else 4) * n)
    ground = ca.SX.sym("ground", 0 if body is None else len(body.signals))
    courses, draws = ca.SX.sym("own", len(machine.disturbances)), ca.SX.sym("draws", size_of(parts, "draws"))
    own = ca.vertcat(courses, ground)
    fixed, t, tau = ca.SX.sym("fixed", size_of(parts, "fixed")), ca.SX.sym("t"), ca.SX.sym("tau")
    r = [shared[4 * i : 4 * i + 4] for i in range(n)]
    states = [x[part.x] for part in parts]
    discrete = [part.discrete(z) for part in parts]
    constants = [part.constants(fixed) for part in parts]
    foreseen = [shared[4 * n + i] if problem.foreseeing else None for i in range(n)]
    tasks = [
        Task(every=task.every, after=ca.vertcat(task.after, watched))
        for task in _tasks(problem, parts, states, discrete, constants, draws, r, foreseen, z, t, extras)
    ]
    met, use = courses, None
    if body is not None:
        firsts = ca.vertcat(*(state[0] for state in states))
        asked, names = body.loads(moved, firsts, ground), [d.name for d in machine.disturbances]
        met = ca.vertcat(*(asked[body.met.index(n)] if n in body.met else courses[k] for k, n in enumerate(names)))
        tasks.append(Task(every=1, after=ca.vertcat(z, asked, watched[: len(body.met)])))
        use = _use(problem, body, watched, period)
    rates = _rates(problem, parts, states, discrete, constants, met, r, t, extras)
    rates += [body.rate(moved, firsts, ground)] if body is not None else []
    errors = [states[i][0] - _taylor(r[i], tau) for i in range(n)]
    place = machine.place(ca.vertcat(*(part[0] for part in states)))
    wanted = machine.place(ca.vertcat(*(_taylor(r[i], tau) for i in range(n))))
    alive = ca.SX(1)
    for error in errors:
        alive = alive * (ca.fabs(error) < DIVERGED)
    outputs = [_outputs(part, states[i], discrete[i], constants[i], own) for i, part in enumerate(parts)]
    signals = Signals(
        states=states, errors=errors, commanded=[d["commanded"] for d in discrete], outputs=outputs,
        travels=[d["travel"] for d in discrete], estimates=[d["observer"] for d in discrete],
        apart=_distance(place - wanted, free=machine.free), met_use=use,
        stopped=shut_down(parts, discrete) if any(part.monitor for part in parts) else None, t=t, tau=tau,
    )  # fmt: skip
    shown: dict[str, Any] = {"x": x, "place": place, "wanted": wanted, "met": met}
    if body is not None:
        shown["body"] = ca.vertcat(moved, body.outputs(moved, firsts, ground))
    for key in ("law", "commanded", "errors", "monitor"):
        shown[key] = ca.vertcat(*(d[key] for d in discrete))
    shown["outputs"] = ca.vertcat(*(value for column in outputs for value in column.values()))
    return System(
        x=x, z=ca.vertcat(z, watched), shared=shared, own=own, draws=draws, fixed=fixed, t=t, tau=tau,
        tasks=tuple(tasks),
        rate=ca.vertcat(*rates), alive=alive, records=records(problem, parts, settings, signals), signals=shown,
        period=period, substeps=substeps,
    )  # fmt: skip


def _use(problem: Problem, body: Body, watched: Any, period: float) -> Any:
    """The largest share of an assumed range or rate that the body's loads take, at a tick and since the one before."""
    import casadi as ca

    use, count = ca.SX(0), len(body.met)
    for k, name in enumerate(body.met):
        span, rate = problem.disturbance(name), problem.rate_of(name)
        middle, half = (span.low + span.high) / 2, (span.high - span.low) / 2
        use = ca.fmax(use, ca.fabs(watched[k] - middle) / half)
        if rate is not None:
            use = ca.fmax(use, ca.fabs(watched[k] - watched[count + k]) / (rate * period))
    return use


def _distance(away: Any, *, free: bool) -> Any:
    import casadi as ca

    return ca.mmax(ca.fabs(away)) if free else ca.norm_2(away) if away.numel() > 1 else ca.fabs(away)


def _taylor(r: Any, tau: Any) -> Any:
    """The reference between ticks; within a period T this misses the fourth derivative's T⁴/24."""
    return r[0] + tau * (r[1] + tau * (r[2] / 2 + tau * (r[3] / 6)))


def _outputs(part: Part, x: Any, discrete: dict[str, Any], constants: dict[str, Any], own: Any) -> dict[str, Any]:
    import casadi as ca

    plant = part.law.plant
    symbols, values = [plant.x, plant.u, plant.p], [x, discrete["applied"], constants["parameters"]]
    return {name: ca.substitute([ca.SX(value)], symbols, values)[0] for name, value in plant.outputs.items()}


def _rates(
    problem: Problem, parts: Sequence[Part], states: list[Any], discrete: list[Any], constants: list[Any], own: Any,
    r: list[Any], t: Any, extras: frozenset[str],
) -> list[Any]:  # fmt: skip
    """X' of each member, under its own disturbances or under the loads of the coupling."""
    import casadi as ca

    machine = problem.machine
    inputs, parameters = [d["applied"] for d in discrete], [c["parameters"] for c in constants]
    gained = None
    if machine.free:
        loads = [own[machine.met_by(i)] for i in range(len(parts))]
    else:
        guess = ca.vertcat(*(r[i][2 if p.law.plant.first == "position" else 1] for i, p in enumerate(parts)))
        gained, load = accelerations(machine, states, inputs, parameters, own, guess)
        loads = [load[i] for i in range(len(parts))]
    rates = []
    for i, part in enumerate(parts):
        plant = part.law.plant
        symbols, values = [plant.x, plant.u, plant.w, plant.p], [states[i], inputs[i], loads[i], parameters[i]]
        rate = ca.substitute([plant.rate], symbols, values)[0]
        if gained is not None:
            row = plant.accelerating
            rate = ca.vertcat(rate[:row], gained[i], rate[row + 1 :])
        rate = rate - ca.substitute([_relieved(plant, states[i])], [plant.p], [parameters[i]])[0]
        if "fault" in extras:
            fault, row = constants[i]["fault"], plant.accelerating
            blocked = ca.logic_and(t >= fault[1], fault[3] == KINDS.index("blocked"))
            held = ca.if_else(blocked, -states[i][row] / ca.fmax(fault[4], 1e-9), rate[row])
            rate = ca.vertcat(rate[:row], held, rate[row + 1 :])
        rates.append(rate)
    return rates


def _relieved(plant: Plant, x: Any) -> Any:
    """What relief valves take off the rate of each state, which they only do beyond its limit."""
    import casadi as ca

    limits = {limit.signals[0]: limit.value for limit in plant.limits if len(limit.signals) == 1}
    rows = []
    for k, state in enumerate(plant.states):
        opens = plant.relief.get(state)
        over = ca.fmax(ca.fabs(x[k]) - limits[state], 0) if opens else 0
        rows.append(opens * ca.sign(x[k]) * over / plant.mass[k] if opens else ca.SX(0))
    return ca.vertcat(*rows)


def _tasks(
    problem: Problem, parts: Sequence[Part], states: list[Any], discrete: list[Any], constants: list[Any], draws: Any,
    r: list[Any], foreseen: list[Any], z: Any, t: Any, extras: frozenset[str],
) -> tuple[Task, ...]:  # fmt: skip
    """One task for each control period; members of one period run together."""
    import casadi as ca

    stop, found = shut_down(parts, discrete), []
    for every in sorted({part.every for part in parts}):
        after = []
        for i, part in enumerate(parts):
            if part.every != every:
                after.append(z[part.z])
                continue
            channel = draws[part.draws]
            measured = _measured(part, states[i], channel, discrete[i], constants[i], t, extras)
            after.append(_controlled(
                problem, part, states[i], measured, r[i], foreseen[i], discrete[i], constants[i], t, stop, extras
            ))  # fmt: skip
        found.append(Task(every=every, after=ca.vertcat(*after)))
    if any(part.waiting for part in parts):
        passed = [_passed(part, discrete[i], constants[i], t, extras) for i, part in enumerate(parts)]
        found.append(Task(every=1, after=ca.vertcat(*passed)))
    return tuple(found)


def _passed(part: Part, discrete: dict[str, Any], constants: dict[str, Any], t: Any, extras: frozenset[str]) -> Any:
    """Inputs on their way to the actuator, moved on by a tick."""
    import casadi as ca

    if not part.waiting:
        return ca.vertcat(*discrete.values())
    size, queue = len(part.law.plant.inputs), ca.vertcat(discrete["commanded"], discrete["pending"])
    acting = queue[size * part.waiting : size * (part.waiting + 1)]
    if part.early:
        late = _offset(part, constants, t)
        for k in range(-part.early, part.early + 1):
            first = size * (part.waiting + k)
            acting = ca.if_else(ca.fabs(late - k) < 0.5, queue[first : first + size], acting)
    moved = {
        "applied": _delivered(acting, constants, t, extras),
        "pending": queue[: size * (part.waiting + part.early)],
    }
    return ca.vertcat(*(discrete | moved).values())


def _offset(part: Part, constants: dict[str, Any], t: Any) -> Any:
    """By how many ticks the input that begins to act around now is late: another number in every period."""
    import casadi as ca

    due = part.waiting * part.period / part.every
    number = ca.floor((t - due) / part.period + 0.5)
    mixed = 43758.5453 * ca.sin(12.9898 * number + 78.233 * constants["phase"])
    return ca.floor((mixed - ca.floor(mixed)) * (2 * part.early + 1)) - part.early


def _delivered(u: Any, constants: dict[str, Any], t: Any, extras: frozenset[str]) -> Any:
    """What a faulty actuator makes of its input."""
    import casadi as ca

    if "fault" not in extras:
        return u
    fault = constants["fault"]
    acts = ca.logic_and(t >= fault[1], fault[3] == KINDS.index("actuator"))
    a = ca.if_else(acts, fault[0] * (1 - ca.exp(-fault[2] * (t - fault[1]))), 0)
    return (1 - a) * u + a * fault[FAULT:]


def shut_down(parts: Sequence[Part], discrete: list[dict[str, Any]]) -> Any:
    """Whether the monitor of any member has shut its actuator down: then all are."""
    import casadi as ca

    stop = ca.SX(0)
    for part, own in zip(parts, discrete, strict=True):
        if part.monitor is not None:
            stop = ca.logic_or(stop, own["monitor"][-1] > 0)
    return stop


def _measured(
    part: Part, x: Any, draws: Any, discrete: dict[str, Any], constants: dict[str, Any], t: Any, extras: frozenset[str]
) -> Any:  # fmt: skip
    """What the sensors say: noise, offset, rounding, and what goes wrong with that of the first state."""
    import casadi as ca

    noisy, n, grid = part.noisy, len(part.law.plant.states), constants["grid"]
    sensed = [
        x[i] + (constants["spread"][noisy.index(i)] * draws[noisy.index(i)] + constants["offset"][noisy.index(i)]
                if i in noisy else 0)
        for i in range(n)
    ]  # fmt: skip
    if "quantisation" in extras:
        sensed = [ca.if_else(grid[i] > 0, grid[i] * ca.floor(sensed[i] / grid[i] + 0.5), sensed[i]) for i in range(n)]
    if "fault" in extras:
        fault = constants["fault"]
        kind = ca.if_else(t >= fault[1], fault[3], 0)
        wrong = ca.if_else(kind == KINDS.index("bias"), fault[4], 0)
        if noisy:
            wrong += ca.if_else(kind == KINDS.index("noise"), fault[4] * draws[0], 0)
        sensed[0] = ca.if_else(kind == KINDS.index("frozen"), discrete["seen"], sensed[0] + wrong)
    return ca.vertcat(*sensed)


def _controlled(
    problem: Problem, part: Part, x: Any, measured: Any, r: Any, foreseen: Any, discrete: dict[str, Any],
    constants: dict[str, Any], t: Any, stop: Any, extras: frozenset[str],
) -> Any:  # fmt: skip
    """One period of a member's observer, law, monitor and actuator, in the order of its discrete states."""
    import casadi as ca

    plant, seen, following = part.law.plant, measured, discrete["observer"]
    if part.observer is not None:
        estimate, after = observed(part.observer, part.period, following[:2], measured[0] - r[0])
        seen = ca.vertcat(r[:2] + estimate, measured[2:])
        following = ca.vertcat(after, seen[:2] - x[:2])
    nominal = ca.DM(list(plant.values().values()))
    bounds = problem.members[part.index].bounds
    load = foreseen if foreseen is not None else ca.DM([bounds.nominal[name] for name in plant.disturbances])
    u, after, errors = part.law.step(
        seen, r, discrete["law"], constants["gains"], nominal, load, part.period
    )  # fmt: skip
    watched = ca.SX(0, 1)
    if part.monitor is not None:
        bad, watched = part.monitor.watched(
            plant, discrete["monitor"], measured, r[0], u, discrete["commanded"], nominal, part.period
        )
        u = ca.if_else(ca.logic_or(bad, stop), ca.SX.zeros(u.numel()), u)
        watched[-1] = ca.logic_or(bad, stop)
    applied = discrete["applied"] if part.waiting else _delivered(u, constants, t, extras)
    travel = discrete["travel"] + ca.norm_1(u - discrete["commanded"])
    return ca.vertcat(after, u, applied, errors, travel, following, discrete["pending"], measured[0], watched)
