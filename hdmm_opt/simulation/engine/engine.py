"""Many runs of one loop: groups of lanes in compiled code, groups in threads.

The figures of a run depend on nothing but the run: not on the number of lanes or threads, nor on its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import kernel
from .compiler import compiled_text
from .system import System
from .virtual import VirtualKernel

Array = NDArray[np.float64]

#: Ticks between two looks at which runs are lost.
CHUNK = 2048
#: Vector registers that one group of lanes fills, and those where the loop turns angles, which takes registers of its
#: own; measured in benchmarks/engine.py.
REGISTERS, TURNING = 4, 2


@dataclass(frozen=True, kw_only=True)
class Batch:
    """What the runs are.

    Attributes:
        fixed: What is constant in each run. Shape (f, runs).
        seeds: Seeds of the draws. Shape (runs,).
        x: States at the first tick. Shape (n, runs).
        z: Discrete states at the first tick. Shape (d, runs).
        shared: Columns that all runs meet. Shape (ticks, s).
        own: Columns of one run, called with its index, the first tick and a number of ticks. Returns shape (l, ticks).
    """

    fixed: Array
    seeds: NDArray[np.uint64]
    x: Array
    z: Array
    shared: Array
    own: Callable[[int, int, int], Array]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What the runs did.

    Attributes:
        figures: The records of the system. Shape (records, runs).
        lost: Time at which a run was lost, s; infinite for a sound one. Shape (runs,).
        trace: Signals at every tick, or nothing. Shape (ticks, signals, runs).
    """

    figures: Array
    lost: Array
    trace: Array


class Engine:
    """A loop, ready to run.

    Args:
        system: The loop.
        compiled: Whether to use machine code; by default wherever it can be made.
    """

    def __init__(self, system: System, *, compiled: bool | None = None) -> None:
        self.system = system
        self.compiled = kernel.available() if compiled is None else compiled
        self._kernels: dict[tuple[int, bool], Callable[..., None]] = {}
        self._registers = TURNING if _turns(system) else REGISTERS

    def run(self, batch: Batch, *, trace: bool = False, jobs: int = 1, lanes: int | None = None) -> Outcome:
        """Run all.

        Args:
            batch: The runs.
            trace: Whether to keep the signals.
            jobs: Threads.
            lanes: Runs in one group; chosen by the processor's registers where None.

        Raises:
            ValueError: an array whose shape does not fit.
        """
        batch = self._checked(batch)
        count, runs = batch.shared.shape[0], batch.seeds.size
        if lanes is not None and lanes < 1:
            raise ValueError(f"a group has at least one lane: got {lanes}")
        rows = sum(value.numel() for value in self.system.signals.values()) if trace else 0
        kept = np.empty((count if trace else 0, rows, runs))
        groups = [
            (members, self.kernel(width, trace=trace), width) for members, width in self._groups(runs, jobs, lanes)
        ]

        def one(group: tuple[range, Callable[..., None], int]) -> Array:
            return self._group(batch, *group, kept if trace else None)

        if jobs > 1 and len(groups) > 1:
            with ThreadPoolExecutor(jobs) as pool:
                cells = list(pool.map(one, groups))
        else:
            cells = [one(group) for group in groups]
        held = self.system.sizes["x"] + self.system.sizes["z"]
        after = np.hstack([np.zeros((held + 1 + len(self.system.records), 0)), *cells])
        return Outcome(figures=after[held + 1 :], lost=after[held], trace=kept)

    def _checked(self, batch: Batch) -> Batch:
        """The batch with arrays as the kernels read them.

        Raises:
            ValueError: an array whose shape does not fit the system or the number of runs.
        """
        sizes, runs = self.system.sizes, batch.seeds.size
        wanted = {"fixed": (sizes["f"], runs), "x": (sizes["x"], runs), "z": (sizes["z"], runs),
                  "shared": (batch.shared.shape[0], sizes["s"])}  # fmt: skip
        arrays = {name: np.ascontiguousarray(getattr(batch, name), dtype=np.float64) for name in wanted}
        for name, shape in wanted.items():
            if arrays[name].shape != shape:
                raise ValueError(f"{name} of a batch has the shape {shape}: got {arrays[name].shape}")
        seeds = np.ascontiguousarray(batch.seeds, dtype=np.uint64).ravel()
        return Batch(**arrays, seeds=seeds, own=batch.own)

    def kernel(self, lanes: int, *, trace: bool) -> Callable[..., None]:
        """The function that moves a group; made at its first use."""
        key = (lanes if self.compiled else 0, trace)
        if key not in self._kernels:
            self._kernels[key] = (
                kernel.Kernel(compiled_text(self.system, lanes, trace=trace))
                if self.compiled
                else VirtualKernel(self.system, trace=trace)
            )
        return self._kernels[key]

    def _groups(self, runs: int, jobs: int, lanes: int | None) -> list[tuple[range, int]]:
        """Runs that go together, each with a number of lanes: as many as pay, fewer where fewer runs are left."""
        if lanes is not None or not self.compiled:
            lanes = lanes or 1
            return [(range(first, min(first + lanes, runs)), lanes) for first in range(0, runs, lanes)]
        widths = [1, *(kernel.vector_lanes() * 2**k for k in range(self._registers.bit_length()))]
        most = next((width for width in widths if width >= -(-runs // jobs)), widths[-1])
        groups, first = [], 0
        while first < runs:
            size = min(most, runs - first)
            groups.append((range(first, first + size), next(width for width in widths if width >= size)))
            first += size
        return groups

    def _group(
        self, batch: Batch, group: Sequence[int], advance: Callable[..., None], lanes: int, kept: Array | None
    ) -> Array:
        """Cells of a group of runs at its end; empty lanes repeat the last run."""
        members = [*group, *[group[-1]] * (lanes - len(group))]
        count, sizes = batch.shared.shape[0], self.system.sizes
        fixed, seeds = np.ascontiguousarray(batch.fixed[:, members]), batch.seeds[members]
        held = sizes["x"] + sizes["z"]
        state = np.zeros((held + 1 + len(self.system.records), lanes))
        state[:held] = np.vstack([batch.x, batch.z])[:, members]
        state[held] = np.inf
        for first in range(0, count, CHUNK):
            size = min(CHUNK, count - first)
            own = np.zeros((size, sizes["l"], lanes))
            for lane, run in enumerate(group):
                columns = batch.own(run, first, size)
                if columns.shape != (sizes["l"], size):
                    raise ValueError(f"own columns have the shape {(sizes['l'], size)}: got {columns.shape}")
                own[:, :, lane] = columns.T
            own[:, :, len(group) :] = own[:, :, len(group) - 1, None]
            shared = np.ascontiguousarray(batch.shared[first : first + size])
            rows = np.zeros((size, kept.shape[1], lanes)) if kept is not None else np.zeros((0, 0, 0))
            advance(first, size, shared, own, fixed, seeds, state, rows)
            if kept is not None:
                kept[first : first + size, :, group[0] : group[-1] + 1] = rows[:, :, : len(group)]
            if kept is None and np.isfinite(state[held]).all():
                break
        return state[:, : len(group)]


def _turns(system: System) -> bool:
    """Whether the plant's motion holds sines or cosines."""
    import casadi as ca

    rate = ca.Function("rate", ca.symvar(ca.SX(system.rate)), [ca.SX(system.rate)])
    return any(rate.instruction_id(k) in (ca.OP_SIN, ca.OP_COS) for k in range(rate.n_instructions()))
