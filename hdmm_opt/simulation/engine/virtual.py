"""The same loop in CasADi's virtual machine, for machines without a compiler: slower, and equal within rounding."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .instructions import MIXES, STRIDE
from .system import System

Array = NDArray[np.float64]

#: Ticks in one call.
CHUNK = 1000


class VirtualKernel:
    """Takes the arguments of a compiled kernel; see `compiler.py`.

    Args:
        system: The loop.
        trace: Whether the signals are stored at every tick.
    """

    def __init__(self, system: System, *, trace: bool) -> None:
        self.system, self.trace = system, trace
        self._tick = _tick(system)
        self._maps: dict[int, Any] = {}

    def __call__(
        self, first: int, count: int, shared: Array, own: Array, fixed: Array, seeds: NDArray[np.uint64], state: Array,
        trace: Array,
    ) -> None:  # fmt: skip
        """Move all lanes over ticks ``first … first + count - 1``; `state` and `trace` are written."""
        for lane in range(fixed.shape[1]):
            for start in range(0, count, CHUNK):
                stop = min(start + CHUNK, count)
                ticks = np.arange(first + start, first + stop)
                draws = uniform(int(seeds[lane]), ticks, self.system.sizes["v"])
                columns = np.vstack([ticks[None, :], shared[start:stop].T, own[start:stop, :, lane].T, draws])
                after, signals = self._map(stop - start)(state[:, lane], columns, fixed[:, lane])
                state[:, lane] = np.array(after)[:, -1]
                if self.trace:
                    trace[start:stop, :, lane] = np.array(signals).T

    def _map(self, size: int) -> Any:
        if size not in self._maps:
            self._maps[size] = self._tick.mapaccum("loop", size, 1)
        repeated = self._maps[size]

        def call(state: Array, columns: Array, fixed: Array) -> Any:
            return repeated(state, columns, np.repeat(fixed[:, None], size, axis=1))

        return call


def uniform(seed: int, ticks: NDArray[np.int64], channels: int) -> Array:
    """The draws of some ticks, bit for bit those of compiled loops. Shape (channels, ticks)."""
    counter = (
        ticks.astype(np.uint64)[None, :] * np.uint64(channels) + np.arange(1, channels + 1, dtype=np.uint64)[:, None]
    )
    with np.errstate(over="ignore"):
        z = np.uint64(seed) + counter * np.uint64(STRIDE)
        for shift, factor in MIXES:
            z = (z ^ (z >> np.uint64(shift))) * np.uint64(factor)
        z = z ^ (z >> np.uint64(31))
    return 2.0 * ((z >> np.uint64(12)) | np.uint64(0x3FF << 52)).view(np.float64) - 3.0


def _tick(system: System) -> Any:
    """CasADi function (cells, [tick; shared; own; draws], fixed) -> (cells after a tick, signals)."""
    import casadi as ca

    tick, lost = ca.SX.sym("tick"), ca.SX.sym("lost")
    figures = ca.SX.sym("figures", len(system.records))
    x, z = system.x, system.z
    for task in system.tasks:
        after = _at(system, task.after, x, z)
        due = ca.remainder(tick, task.every) == 0
        z = ca.vertcat(*(ca.if_else(due, after[i], z[i]) for i in range(z.numel()))) if task.every > 1 else after
    signals = ca.vertcat(*(_at(system, value, x, z) for value in system.signals.values()))
    time = tick * system.period
    now = _judged(system, lost, time, x, z, 0.0)
    alive = now == ca.inf
    sums = _recorded(system, figures, alive, x, z, 0.0, between=False)
    h = system.period / system.substeps
    rate = ca.Function("rate", [system.x, *_held(system)], [system.rate])
    held = [z if symbols is system.z else symbols for symbols in _held(system)]
    for step in range(system.substeps):
        k1 = rate(x, *held)
        k2 = rate(x + h / 2 * k1, *held)
        k3 = rate(x + h / 2 * k2, *held)
        k4 = rate(x + h * k3, *held)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        sums = _recorded(system, sums, alive, x, z, (step + 1) * h, between=True)
    now = _judged(system, now, time + system.period, x, z, system.period)
    before = ca.vertcat(system.x, system.z, lost, figures)
    columns = ca.vertcat(tick, system.shared, system.own, system.draws)
    outputs = [ca.vertcat(x, z, now, sums), signals]
    outputs = [ca.substitute([part], [system.t], [time])[0] for part in outputs]
    return ca.Function("tick", [before, columns, system.fixed], outputs, {"cse": True})


def _judged(system: System, lost: Any, time: Any, x: Any, z: Any, tau: float) -> Any:
    """The first time at which a run is not sound."""
    import casadi as ca

    sound = _at(system, system.alive, x, z, tau)
    failed = ca.logic_or(sound == 0, sound != sound)
    return ca.if_else(failed, ca.if_else(lost < time, lost, time), lost)


def _held(system: System) -> list[Any]:
    return [system.z, system.shared, system.own, system.fixed, system.t]


def _at(system: System, value: Any, x: Any, z: Any, tau: Any = 0.0) -> Any:
    import casadi as ca

    return ca.substitute([ca.SX(value)], [system.x, system.z, system.tau], [x, z, ca.SX(tau)])[0]


def _recorded(system: System, figures: Any, alive: Any, x: Any, z: Any, tau: float, *, between: bool) -> Any:
    import casadi as ca

    kept = []
    for i, record in enumerate(system.records):
        before = figures[i]
        if between and not record.between:
            kept.append(before)
            continue
        value = _at(system, record.value, x, z, tau)
        after = ca.if_else(value > before, value, before) if record.kind == "max" else before + value
        kept.append(ca.if_else(alive, after, before))
    return ca.vertcat(*kept)
