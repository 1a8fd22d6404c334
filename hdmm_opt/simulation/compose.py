"""The closed loop as symbols: plant, law, measurement, actuator."""

from __future__ import annotations

from ..control import RAC
from .metrics import Yardstick, records
from .system import System, Task


def compose(
    law: RAC, yardstick: Yardstick, noise: tuple[float, ...], nominal_load: float, period: float, substeps: int,
    diverged: float, extras: frozenset[str],
) -> System:  # fmt: skip
    """The closed loop of a law and its plant at one rate.

    Discrete states are the adaptive scalars, the commanded input, the errors, and the input that a faulty actuator
    applies. A fault leaves ``(1 - a(t)) u + a(t) u_stuck`` with ``a = share (1 - exp(-rate (t - start)))`` from
    its start on (Heydari Shahna 2025, P-3).

    Args:
        law: The law, with its plant.
        yardstick: What the figures are measured by.
        noise: Bounds on the measurement errors; a state with a bound of zero is measured exactly. Shape (n,).
        nominal_load: Load that the modelling terms assume, N.
        period: Control period, s.
        substeps: Integration steps in a period.
        diverged: A tracking error beyond this, m, loses the run.
        extras: What the runs need besides: "quantisation", "fault".

    Returns:
        The loop. Its constants are, in order: all gains as `gain_columns` has them, column by column; the plant's
        parameters; spread and offset of the measurement errors of the noisy states; quantisation steps, shape (n,);
        share, start, rate and stuck input of the fault.
    """
    import casadi as ca

    plant = law.plant
    n, k, m = len(plant.states), len(law.governed), len(plant.inputs)
    z, r, t, tau = ca.SX.sym("z", 2 * k + 2 * m), ca.SX.sym("r", 4), ca.SX.sym("t"), ca.SX.sym("tau")
    gains, parameters = ca.SX.sym("gains", 4 * k), plant.p
    noisy = [i for i, bound in enumerate(noise) if bound > 0]
    draws, spread, offset = (ca.SX.sym(name, len(noisy)) for name in ("draws", "spread", "offset"))
    grid, fault = ca.SX.sym("grid", n), ca.SX.sym("fault", 3 + m)
    measured = ca.vertcat(*(
        plant.x[i] + (spread[noisy.index(i)] * draws[noisy.index(i)] + offset[noisy.index(i)] if i in noisy else 0)
        for i in range(n)
    ))  # fmt: skip
    if "quantisation" in extras:
        measured = ca.vertcat(*(
            ca.if_else(grid[i] > 0, grid[i] * ca.floor(measured[i] / grid[i] + 0.5), measured[i]) for i in range(n)
        ))  # fmt: skip
    u, theta, q = law.step(
        measured, r, z[:k], ca.reshape(gains, k, 4), ca.DM(list(plant.values().values())),
        ca.DM([nominal_load]), period,
    )  # fmt: skip
    applied = u
    if "fault" in extras:
        a = ca.if_else(t >= fault[1], fault[0] * (1 - ca.exp(-fault[2] * (t - fault[1]))), 0)
        applied = (1 - a) * u + a * fault[3:]
    now, acting = z[k : k + m], z[2 * k + m :]
    outputs = {name: ca.substitute([value], [plant.u], [acting])[0] for name, value in plant.outputs.items()}
    return System(
        x=plant.x, z=z, shared=r, own=plant.w, draws=draws,
        fixed=ca.vertcat(gains, parameters, spread, offset, grid, fault), t=t, tau=tau,
        tasks=(Task(every=1, after=ca.vertcat(theta, u, q, applied)),),
        rate=ca.substitute([plant.rate], [plant.u], [acting])[0],
        alive=ca.fabs(plant.x[0] - r[0]) < diverged,
        records=records(plant, yardstick, plant.x, now, r, outputs, t, tau),
        signals={"x": plant.x, "u": now, "q": z[k + m : 2 * k + m], "theta": z[:k], **outputs},
        period=period, substeps=substeps,
    )  # fmt: skip
