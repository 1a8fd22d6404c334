"""A sampled-data loop as symbols: what runs at which rate, what moves in between, what is recorded.

One definition serves every engine: `kernel.py` compiles it, `virtual.py` interprets it, tests integrate it otherwise.
A tick is one period of the fastest task. At each tick the tasks that are due run in their order, each on what the ones
before it left; then the plant moves by classical Runge-Kutta steps with everything else held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal


@dataclass(frozen=True, kw_only=True)
class Task:
    """A part of the controller, of a supervisor, or of a fault.

    Attributes:
        every: It runs at each tick whose number is a multiple of this, 1 or more.
        after: The discrete states that it leaves, as an expression of all symbols but `tau`. Shape (d,).
    """

    every: int
    after: Any


@dataclass(frozen=True, kw_only=True)
class Record:
    """A figure that a run accumulates.

    Attributes:
        name: Name of the figure.
        kind: "max" (from 0) or "sum" over the instants; nothing is added once a run is lost.
        value: What is accumulated, as an expression of all symbols.
        between: Taken after every integration step (`tau` > 0) and at the tick (`tau` = 0); otherwise at ticks only.
    """

    name: str
    kind: Literal["max", "sum"]
    value: Any
    between: bool = False


@dataclass(frozen=True, kw_only=True)
class System:
    """The loop.

    Attributes:
        x: Symbols of the plant's states. Shape (n,).
        z: Symbols of the discrete states: held inputs, adaptation, latches, filters. Shape (d,).
        shared: Symbols of what every run meets alike, such as the reference; a column for each tick. Shape (s,).
        own: Symbols of what differs from run to run, such as the load; a column for each tick. Shape (l,).
        draws: Symbols of uniform draws from [-1, 1), new at each tick. Shape (v,).
        fixed: Symbols of what is constant in a run: gains, parameters. Shape (f,).
        t: Symbol of the time of the tick, s.
        tau: Symbol of the time since the tick, s.
        tasks: In the order in which they run.
        rate: x' as an expression of x, z, shared, own, fixed and t. Shape (n,).
        alive: Nonzero while the run is sound; zero or NaN at a tick or at its end loses the run.
        records: The figures.
        signals: What a trace keeps at each tick after the tasks, by name, each a column.
        period: Duration of a tick, s.
        substeps: Runge-Kutta steps in a tick.

    Raises:
        ValueError: a task's period or the number of steps is not positive, a shape is wrong, or an expression depends
            on what it may not.
    """

    x: Any
    z: Any
    shared: Any
    own: Any
    draws: Any
    fixed: Any
    t: Any
    tau: Any
    tasks: tuple[Task, ...]
    rate: Any
    alive: Any
    records: tuple[Record, ...]
    signals: Mapping[str, Any]
    period: float
    substeps: int

    def __post_init__(self) -> None:
        counts = [self.substeps, *(task.every for task in self.tasks)]
        if not (self.period > 0 and all(isinstance(c, int) and c > 0 for c in counts)):
            raise ValueError(f"periods and steps are positive whole numbers of ticks: got {self.period}, {counts}")
        sizes, everything = self.sizes, "xzslvftd"
        for task in self.tasks:
            self._check("a task", task.after, sizes["z"], everything.replace("d", ""))
        self._check("the rate", self.rate, sizes["x"], "xzslft")
        self._check("alive", self.alive, 1, everything)
        for record in self.records:
            self._check(f'record "{record.name}"', record.value, 1, everything)
        for name, value in self.signals.items():
            self._check(f'signal "{name}"', value, None, everything)

    def _check(self, what: str, value: Any, rows: int | None, letters: str) -> None:
        """A column of so many rows, of symbols from some groups."""
        import casadi as ca

        value = ca.SX(value)
        if value.shape[1] != 1 or (rows is not None and value.shape[0] != rows):
            raise ValueError(f"{what} is a column of {'any' if rows is None else rows} rows: got {value.shape}")
        known = {s.__hash__() for letter in letters for s in ca.symvar(ca.SX(self.groups[letter]))}
        strangers = [str(s) for s in ca.symvar(value) if s.__hash__() not in known]
        if strangers:
            raise ValueError(f"{what} depends on {', '.join(letters)} alone: got {', '.join(strangers)}")

    @property
    def groups(self) -> dict[str, Any]:
        """The symbols by the letter that names them in compiled code."""
        return {
            "x": self.x, "z": self.z, "s": self.shared, "l": self.own, "v": self.draws, "f": self.fixed,
            "t": self.t, "d": self.tau,
        }  # fmt: skip

    @property
    def sizes(self) -> dict[str, int]:
        """Number of symbols in each group."""
        return {letter: symbols.numel() for letter, symbols in self.groups.items()}

    def signal_rows(self) -> dict[str, slice]:
        """Where each signal lies in a trace."""
        rows, first = {}, 0
        for name, value in self.signals.items():
            rows[name] = slice(first, first + value.numel())
            first += value.numel()
        return rows
