"""The loop of a machine as symbols: every joint under its law, all bodies coupled, observers, faults, the tool.

The acceleration of the joints is the solution of ``M_i a_i = h_i(x_i, w_i)``, ``w = F(x, v, a, payload) - m a``. It is
linear but for the direction in which screws and gears lose, so that a few Newton steps from the reference's
acceleration solve it; `tests` measure what they leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from stability.observer import SampledObserver

from ..control import RAC
from ..machine import Machine, carried
from .metrics import Yardstick
from .system import Record, System, Task

#: Newton steps for the accelerations.
ROUNDS = 3
#: A joint further than this from its reference, in its unit, ends a run as lost.
LOST = 0.5


@dataclass(frozen=True, kw_only=True)
class Coupled:
    """What a loop of a machine is composed from.

    Attributes:
        machine: The machine.
        laws: The law of each joint.
        outer: What commands the joints in place of the laws' outer stages, or None; see `control/benchmarks`.
        observer: The observer of every joint; None where speeds are measured.
        adapting: ε and σ of the observer's adaptive scalar.
        noise: Bounds on the measurement errors of position, speed and current.
        foreseeing: Whether the laws are given the loads along the reference.
        period: Control period, s.
        substeps: Runge-Kutta steps in a period.
        yardstick: What the figures are measured by.
    """

    machine: Machine
    laws: tuple[RAC, ...]
    outer: Any
    observer: SampledObserver | None
    adapting: tuple[float, float]
    noise: tuple[float, float, float]
    foreseeing: bool
    period: float
    substeps: int
    yardstick: Yardstick

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Numbers of states, of adaptive scalars, of inputs, and of further states of the outer stage."""
        states = sum(len(plant.states) for plant in self.machine.plants)
        governed = sum(len(law.governed) for law in self.laws)
        inputs = sum(len(plant.inputs) for plant in self.machine.plants)
        return states, governed, inputs, 0 if self.outer is None else self.outer.states


def accelerations(machine: Machine, x: Any, w: Any, p: Any, payload: Any, guess: Any) -> tuple[Any, Any]:
    """The joints' accelerations, and the loads w_i, at given states.

    Args:
        machine: The machine.
        x: States of each plant, a list of columns.
        w: What the inputs add to the second row of each plant; a list.
        p: Parameters of each plant, a list of columns.
        payload: Payload, kg.
        guess: Accelerations to start from. Shape (n,).

    Returns:
        Two SX columns. Shape (n,).
    """
    import casadi as ca

    n = len(machine.joints)
    position, speed = (ca.vertcat(*(part[k] for part in x)) for k in (0, 1))
    a = ca.SX.sym("a", n)
    forces = machine.forces(position, speed, a, payload)
    inertia = ca.jacobian(forces, a)
    rest = ca.substitute([forces], [a], [ca.SX.zeros(n)])[0]
    own = ca.vertcat(*(p[i][list(plant.parameters).index(carried(plant))] for i, plant in enumerate(machine.plants)))
    coupling = inertia - ca.diag(own)
    current = ca.SX(guess)
    load = rest + coupling @ current
    for _ in range(ROUNDS):
        columns = []
        for i, plant in enumerate(machine.plants):
            symbol = ca.SX.sym("w")
            value = plant.at(x=x[i], u=ca.SX.zeros(len(plant.inputs)), w=symbol, p=p[i])[1] + w[i]
            slope = ca.jacobian(value, symbol)
            columns.append(ca.substitute([value, slope, plant.mass[1]], [symbol, plant.p], [load[i], p[i]]))
        value, slope, mass = (ca.vertcat(*part) for part in zip(*columns, strict=True))
        # mass a = value + slope (rest + coupling a - load)
        current = ca.solve(ca.diag(mass) - ca.diag(slope) @ coupling, value + slope * (rest - load))
        load = rest + coupling @ current
    return current, load


def compose_machine(loop: Coupled, joints: Sequence[str]) -> System:
    """The loop as a system for the engine.

    Discrete states: θ̂ of all rows; inputs as commanded; inputs as the actuators apply them; x̂, ŝ and θ̂ of each
    observer; states of the outer stage. Shared columns: position … jerk of each reference, then the foreseen loads.
    Constants of a run: gains by joint, parameters by joint, payload, spread of the noise of position, speed and
    current, step of the encoders, and for each joint share, start, rate and stuck input of its fault.
    """
    import casadi as ca

    machine, n = loop.machine, len(loop.machine.joints)
    states, governed, inputs, outer = loop.sizes
    x, z = ca.SX.sym("x", states), ca.SX.sym("z", governed + 2 * inputs + 3 * n + outer)
    shared, t, tau = ca.SX.sym("shared", 5 * n), ca.SX.sym("t"), ca.SX.sym("tau")
    draws, noise = ca.SX.sym("draws", states), ca.SX.sym("noise", 4)
    gains, parameters, payload = ca.SX.sym("gains", 4 * governed), _parameters(machine), ca.SX.sym("payload")
    stuck = sum(3 + len(plant.inputs) for plant in machine.plants)
    fault = ca.SX.sym("fault", stuck)
    own = _split(x, [len(plant.states) for plant in machine.plants])
    r = [shared[4 * i : 4 * i + 4] for i in range(n)]
    theta, commanded, acting, watched, further = _split(z, [governed, inputs, inputs, 3 * n, outer])
    applied = _split(acting, [len(plant.inputs) for plant in machine.plants])

    after = _control(loop, own, r, shared[4 * n :], theta, watched, further, draws, noise, gains, fault, t)
    guess = ca.vertcat(*(r[i][2] for i in range(n)))
    effect = [_direct(plant, applied[i], own[i], parameters[i]) for i, plant in enumerate(machine.plants)]
    gain, load = accelerations(machine, own, effect, parameters, payload, guess)
    rates = []
    for i, plant in enumerate(machine.plants):
        symbols, values = [plant.x, plant.u, plant.w, plant.p], [own[i], applied[i], load[i], parameters[i]]
        rate = ca.substitute([plant.rate], symbols, values)[0]
        rates.append(ca.vertcat(rate[0], gain[i], rate[2:]))
    errors = [own[i][0] - _taylor(r[i], tau) for i in range(n)]
    place = machine.tool(ca.vertcat(*(part[0] for part in own)))
    wanted = machine.tool(ca.vertcat(*(_taylor(r[i], tau) for i in range(n))))
    tool = ca.norm_2(place - wanted)
    now = _split(commanded, [len(plant.inputs) for plant in machine.plants])
    records = _records(loop, joints, own, parameters, now, applied, errors, tool, t) + _missed(
        loop, joints, own, watched, tau
    )
    alive = ca.SX(1)
    for error in errors:
        alive = alive * (ca.fabs(error) < LOST)
    return System(
        x=x, z=z, shared=shared, own=ca.SX.sym("nothing", 0), draws=draws,
        fixed=ca.vertcat(
            gains, *parameters, payload, noise, fault, *([] if loop.outer is None else [loop.outer.symbols])
        ), t=t, tau=tau,
        tasks=(Task(every=1, after=after),), rate=ca.vertcat(*rates), alive=alive, records=records,
        signals={"x": x, "u": commanded, "theta": theta, "watched": watched, "tool": place, "wanted": wanted},
        period=loop.period, substeps=loop.substeps,
    )  # fmt: skip


def _direct(plant: Any, u: Any, x: Any, p: Any) -> Any:
    """What the input adds to the second row beside what it does at zero input."""
    import casadi as ca

    zero = ca.SX.zeros(len(plant.inputs))
    w = ca.SX.zeros(len(plant.disturbances))
    return plant.at(x=x, u=u, w=w, p=p)[1] - plant.at(x=x, u=zero, w=w, p=p)[1]


def _taylor(r: Any, tau: Any) -> Any:
    return r[0] + tau * (r[1] + tau * (r[2] / 2 + tau * (r[3] / 6)))


def _parameters(machine: Machine) -> list[Any]:
    import casadi as ca

    return [
        ca.vertcat(*(ca.SX.sym(f"{name}.{key}") for key in plant.parameters))
        for name, plant in zip(machine.joints, machine.plants, strict=True)
    ]


def _split(column: Any, sizes: Sequence[int]) -> list[Any]:
    parts, first = [], 0
    for size in sizes:
        parts.append(column[first : first + size])
        first += size
    return parts


def _control(
    loop: Coupled, own: list[Any], r: list[Any], foreseen: Any, theta: Any, watched: Any, further: Any, draws: Any,
    noise: Any, gains: Any, fault: Any, t: Any,
) -> Any:  # fmt: skip
    """One period of all controllers, in the order of the discrete states."""
    import casadi as ca

    machine, n = loop.machine, len(loop.machine.joints)
    channel = _split(draws, [len(plant.states) for plant in machine.plants])
    thetas = _split(theta, [len(law.governed) for law in loop.laws])
    columns = _split(gains, [4 * len(law.governed) for law in loop.laws])
    faults = _split(fault, [3 + len(plant.inputs) for plant in machine.plants])
    estimates = _split(watched, [3] * n)
    seen = []
    following = []
    for i in range(n):
        sensed = own[i] + ca.vertcat(
            noise[0] * channel[i][0], noise[1] * channel[i][1],
            *(noise[2] * channel[i][k] for k in range(2, own[i].numel())),
        )  # fmt: skip
        encoder = ca.if_else(noise[3] > 0, noise[3] * ca.floor(sensed[0] / noise[3] + 0.5), sensed[0])
        if loop.observer is None:
            seen.append(ca.vertcat(encoder, sensed[1:]))
            following.append(estimates[i])
        else:
            seen.append(ca.vertcat(estimates[i][:2], sensed[2:]))
            following.append(_observed(loop, estimates[i], encoder, r[i][2]))
    loads = [foreseen[i] if loop.foreseeing else ca.SX(0) for i in range(n)]
    commands, inner = (None, further) if loop.outer is None else loop.outer.step(loop, seen, r, loads, further)
    adapted, wanted, applied = [], [], []
    for i, law in enumerate(loop.laws):
        nominal = ca.DM(list(law.plant.values().values()))
        given = None if commands is None else {1: commands[i]}
        k = len(law.governed)
        u, step, _ = law.step(
            seen[i], r[i], thetas[i], ca.reshape(columns[i], k, 4), nominal, loads[i], loop.period, given=given
        )  # fmt: skip
        share = ca.if_else(t >= faults[i][1], faults[i][0] * (1 - ca.exp(-faults[i][2] * (t - faults[i][1]))), 0)
        adapted.append(step)
        wanted.append(u)
        applied.append((1 - share) * u + share * faults[i][3:])
    return ca.vertcat(*adapted, *wanted, *applied, *following, inner)


def _observed(loop: Coupled, estimate: Any, encoder: Any, gain: Any) -> Any:
    """x̂, ŝ and θ̂ of an observer after a period."""
    import casadi as ca

    observer, (epsilon, sigma) = loop.observer, loop.adapting
    assert observer is not None
    t = observer.period
    error = encoder - estimate[0]
    factor = (1 + estimate[2]) * error
    theta = estimate[2] + t * (epsilon * (error / loop.noise[0]) ** 2 / 2 - sigma * estimate[2])
    return ca.vertcat(
        estimate[0] + t * estimate[1] + t**2 / 2 * gain + observer.first * factor,
        estimate[1] + t * gain + observer.second * factor,
        ca.fmin(ca.fmax(theta, 0), observer.largest),
    )  # fmt: skip


def _records(
    loop: Coupled, joints: Sequence[str], own: list[Any], parameters: list[Any], commanded: list[Any],
    applied: list[Any], errors: list[Any], tool: Any, t: Any,
) -> tuple[Record, ...]:  # fmt: skip
    import casadi as ca

    late = t >= loop.yardstick.transient
    found = [
        Record(name="tool", kind="max", value=tool, between=True),
        Record(name="tool late", kind="max", value=ca.if_else(late, tool, 0), between=True),
        Record(name="tool squares", kind="sum", value=ca.if_else(late, tool**2, 0)),
        Record(name="tool itae", kind="sum", value=t * tool),
        Record(name="outside", kind="max", value=ca.if_else(tool > loop.yardstick.band, t, -1)),
    ]
    for i, name in enumerate(joints):
        plant, error = loop.machine.plants[i], ca.fabs(errors[i])
        signals = {s: own[i][k] for k, s in enumerate(plant.states)}
        signals |= {s: commanded[i][k] for k, s in enumerate(plant.inputs)}
        use = ca.SX(0)
        for limit in plant.limits:
            parts = [signals[s] for s in limit.signals]
            size = ca.fabs(parts[0]) if len(parts) == 1 else ca.sqrt(sum(part**2 for part in parts))
            use = ca.fmax(use, size / limit.value)
        symbols, values = [plant.x, plant.u, plant.p], [own[i], applied[i], parameters[i]]
        torque = ca.substitute([plant.outputs["torque"]], symbols, values)[0]
        found += [
            Record(name=f"error {name}", kind="max", value=error, between=True),
            Record(name=f"late {name}", kind="max", value=ca.if_else(late, error, 0), between=True),
            Record(name=f"squares {name}", kind="sum", value=ca.if_else(late, error**2, 0)),
            Record(name=f"use {name}", kind="max", value=use),
            Record(name=f"torque {name}", kind="max", value=ca.fabs(torque)),
            Record(name=f"torque squares {name}", kind="sum", value=torque**2),
        ]
    return tuple(found)


def _missed(loop: Coupled, joints: Sequence[str], own: list[Any], watched: Any, tau: Any) -> tuple[Record, ...]:
    """The errors of the observers, where what they foresaw for the end of a period has come."""
    import casadi as ca

    if loop.observer is None:
        return ()
    ended = tau > (1 - 1e-6) * loop.period
    found = []
    for i, name in enumerate(joints):
        for k, what in enumerate(("position", "speed")):
            missed = ca.if_else(ended, ca.fabs(own[i][k] - watched[3 * i + k]), 0)
            found.append(Record(name=f"estimated {what} {name}", kind="max", value=missed, between=True))
    return tuple(found)
