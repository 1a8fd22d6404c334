"""The differentiated loop: a loop beside its derivative in one direction of what is constant in a run.

The derivative of a Runge-Kutta step is the same step of the variational equation, so the differentiated loop is again a
loop, and the same engine runs it: a lane for each direction.
"""

from __future__ import annotations

from typing import Any

from .engine.system import Record, System, Task


def differentiated(system: System) -> System:
    """The loop with doubled states.

    Args:
        system: The loop.

    Returns:
        A loop with states (x, dx), discrete states (z, dz) and constants (fixed, direction). Each "sum" record has a
        twin, named with a leading "d ", that sums its derivative; "max" records have none.

    Not guaranteed: at a kink, such as a saturation that is just reached, the derivative is that of one side.
    """
    import casadi as ca

    x, z, fixed = (
        ca.SX.sym(f"d{name}", s.numel()) for name, s in (("x", system.x), ("z", system.z), ("f", system.fixed))
    )
    symbols, direction = ca.vertcat(system.x, system.z, system.fixed), ca.vertcat(x, z, fixed)

    def along(value: Any) -> Any:
        return ca.jtimes(ca.SX(value), symbols, direction)

    twins = tuple(
        Record(name=f"d {r.name}", kind="sum", value=along(r.value), between=r.between)
        for r in system.records
        if r.kind == "sum"
    )
    return System(
        x=ca.vertcat(system.x, x), z=ca.vertcat(system.z, z), shared=system.shared, own=system.own, draws=system.draws,
        fixed=ca.vertcat(system.fixed, fixed), t=system.t, tau=system.tau,
        tasks=tuple(Task(every=t.every, after=ca.vertcat(t.after, along(t.after))) for t in system.tasks),
        rate=ca.vertcat(system.rate, along(system.rate)), alive=system.alive, records=(*system.records, *twins),
        signals={}, period=system.period, substeps=system.substeps,
    )  # fmt: skip
