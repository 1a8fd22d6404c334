"""From the symbols of a loop to LLVM code: one function that moves a group of lanes over many ticks.

The instruction lists of the tasks, the rate and the figures are written out in line; what depends on the constants of a
run alone is left for LLVM to move out of the loops. Lanes are independent: a lost one neither slows nor spoils others.

    run(first, count, shared, own, fixed, seeds, state, trace)

with every array of doubles but `seeds`, all row-major with the lanes last: shared (ticks, s) without lanes,
own (ticks, l, lanes), fixed (f, lanes), state (n + d + 1 + records, lanes), trace (ticks, signals, lanes). The row
after the discrete states holds the time at which a run was lost, or infinity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from stability.enclosures.expression import Expression
from stability.enclosures.translation import straight_line

from .inline import inline
from .instructions import Assembler
from .system import System


def compiled_text(system: System, lanes: int, *, trace: bool) -> str:
    """The LLVM module of a loop.

    Args:
        system: The loop.
        lanes: Runs that one call moves together.
        trace: Whether the signals are stored at every tick.

    Raises:
        NotImplementedError: an operation that the compiler does not know; the message names it.
    """
    return _Compiler(system, Assembler(lanes), trace).text()


class _Compiler:
    def __init__(self, system: System, out: Assembler, trace: bool) -> None:
        self.system, self.out, self.trace = system, out, trace
        self.sizes = system.sizes

    def text(self) -> str:
        out, system, sizes = self.out, self.system, self.sizes
        kept = sizes["x"] + sizes["z"]
        cells = kept + 1 + len(system.records)
        fixed = [self.load("%fixed", i) for i in range(sizes["f"])]
        seeds = self._load_seeds()
        boxes = [f"%b{i}" for i in range(cells)]
        for i, box in enumerate(boxes):
            out.write(f"  {box} = alloca {out.real}, align 64")
            out.write(f"  store {out.real} {self.load('%state', i)}, ptr {box}, align 8")
        out.write("  %end = add i64 %first, %count")
        out.write("  br label %tick")
        out.write("tick:")
        out.write("  %k = phi i64 [ %first, %entry ], [ %next, %ticked ]")
        out.write("  %row = sub i64 %k, %first")
        known = {f"f{i}": value for i, value in enumerate(fixed)}
        self._tick(known, boxes[: sizes["x"]], boxes[sizes["x"] : kept], boxes[kept], boxes[kept + 1 :], seeds)
        out.write("  br label %ticked")
        out.write("ticked:")
        out.write("  %next = add i64 %k, 1")
        out.write("  %more = icmp slt i64 %next, %end")
        out.write("  br i1 %more, label %tick, label %done")
        out.write("done:")
        for i, box in enumerate(boxes):
            self.store("%state", i, self.read(box))
        pointers = ("shared", "own", "fixed", "seeds", "state", "trace")
        head = f"define void @run(i64 %first, i64 %count, {', '.join(f'ptr noalias %{p}' for p in pointers)}) {{"
        return "\n".join([*sorted(out.declared), head, "entry:", *out.pool, *out.lines, "  ret void", "}", ""])

    def _tick(
        self, known: dict[str, str], x: list[str], z: list[str], lost: str, figures: list[str], seeds: str
    ) -> None:
        """Columns and draws, tasks, signals, then the integration steps with the figures."""
        out, system, sizes = self.out, self.system, self.sizes
        known = known | {"t0": out.spread(self._scaled("%k", system.period)), "d0": out.const(0.0)}
        known |= {f"s{i}": out.spread(self._scalar("%shared", sizes["s"], i)) for i in range(sizes["s"])}
        known |= {f"l{i}": self.load("%own", i, rows=sizes["l"]) for i in range(sizes["l"])}
        known |= {f"v{i}": self._draw(seeds, i) for i in range(sizes["v"])}
        known |= {f"x{i}": self.read(box) for i, box in enumerate(x)}
        for task in system.tasks:
            self._task(task.every, task.after, known, z)
        known |= {f"z{i}": self.read(box) for i, box in enumerate(z)}
        alive = self._judge(known, lost, known["t0"])
        if self.trace:
            rows = [value for column in system.signals.values() for value in self.values(column, known)]
            for i, value in enumerate(rows):
                self.store("%trace", i, value, rows=len(rows))
        self._record(known, figures, alive, lambda record: True)
        self._steps(known, x, figures, alive)
        end = out.const(system.period)
        after = {f"x{i}": self.read(box) for i, box in enumerate(x)}
        self._judge(known | after | {"d0": end}, lost, out.add(known["t0"], end))

    def _judge(self, known: Mapping[str, str], lost: str, stamp: str) -> str:
        """Note the first time at which a run is not sound; whether it has always been."""
        out = self.out
        (sound,) = self.values(self.system.alive, known)
        before = self.read(lost)
        failed = out.compare("ueq", sound, out.const(0.0))
        first = out.select(out.compare("olt", before, stamp), before, stamp)
        now = out.select(failed, first, before)
        self.keep(lost, now)
        return out.compare("oeq", now, out.const(float("inf")))

    def _task(self, every: int, after: Any, known: dict[str, str], z: list[str]) -> None:
        out = self.out
        if every > 1:
            due, on = out.label("due"), out.label("after")
            rest = out.emit(f"srem i64 %k, {every}")
            out.write(f"  br i1 {out.emit(f'icmp eq i64 {rest}, 0')}, label %{due}, label %{on}")
            out.write(f"{due}:")
        now = known | {f"z{i}": self.read(box) for i, box in enumerate(z)}
        for box, value in zip(z, self.values(after, now), strict=True):
            self.keep(box, value)
        if every > 1:
            out.write(f"  br label %{on}")
            out.write(f"{on}:")

    def _steps(self, known: dict[str, str], x: list[str], figures: list[str], alive: str) -> None:
        """Classical Runge-Kutta steps; the figures between the ticks after each."""
        out, system = self.out, self.system
        steps, h = system.substeps, system.period / system.substeps
        above = out.label("above")
        loop, leave = out.label("step"), out.label("stepped")
        out.write(f"  br label %{above}")
        out.write(f"{above}:")
        out.write(f"  br label %{loop}")
        out.write(f"{loop}:")
        index, following = f"%i.{loop}", f"%n.{loop}"
        out.write(f"  {index} = phi i64 [ 0, %{above} ], [ {following}, %{loop} ]")
        start = [self.read(box) for box in x]

        def rate(at: list[str]) -> list[str]:
            return self.values(system.rate, known | {f"x{i}": value for i, value in enumerate(at)}, quick=True)

        def moved(slope: list[str], by: float) -> list[str]:
            return [out.fma(out.const(by), s, a) for s, a in zip(slope, start, strict=True)]

        k1 = rate(start)
        k2 = rate(moved(k1, h / 2))
        k3 = rate(moved(k2, h / 2))
        k4 = rate(moved(k3, h))
        outer = [out.add(a, b) for a, b in zip(k1, k4, strict=True)]
        inner = [out.add(a, b) for a, b in zip(k2, k3, strict=True)]
        slope = [out.fma(out.const(2.0), i, o) for i, o in zip(inner, outer, strict=True)]
        after = moved(slope, h / 6)
        for box, value in zip(x, after, strict=True):
            self.keep(box, value)
        out.write(f"  {following} = add i64 {index}, 1")
        if any(record.between for record in system.records):
            now = known | {f"x{i}": value for i, value in enumerate(after)}
            now["d0"] = out.spread(self._scaled(following, h))
            self._record(now, figures, alive, lambda record: record.between)
        out.write(f"  br i1 {out.emit(f'icmp slt i64 {following}, {steps}')}, label %{loop}, label %{leave}")
        out.write(f"{leave}:")

    def _record(self, known: dict[str, str], figures: list[str], alive: str, wanted: Callable[[Any], bool]) -> None:
        import casadi as ca

        out = self.out
        chosen = [(box, r) for box, r in zip(figures, self.system.records, strict=True) if wanted(r)]
        if not chosen:
            return
        values = self.values(ca.vertcat(*(record.value for _, record in chosen)), known)
        for (box, record), value in zip(chosen, values, strict=True):
            before = self.read(box)
            if record.kind == "max":
                after = out.select(out.compare("ogt", value, before), value, before)
            else:
                after = out.add(before, value)
            self.keep(box, out.select(alive, after, before))

    def values(self, column: Any, known: Mapping[str, str], *, quick: bool = False) -> list[str]:
        """The elements of a column of symbols, written out in line."""
        return inline(self.out, self._expression(column), known, quick=quick)

    def _expression(self, column: Any) -> Expression:
        import casadi as ca

        groups = self.system.groups
        symbols = ca.vertcat(*groups.values())
        names = tuple(f"{letter}{i}" for letter, group in groups.items() for i in range(group.numel()))
        return straight_line(ca.Function("part", [symbols], [column], {"cse": True}), names)

    def load(self, pointer: str, row: int, rows: int | None = None) -> str:
        """A row of lanes; `rows` to a tick where the array has ticks."""
        return self.out.emit(f"load {self.out.real}, ptr {self._place(pointer, row, rows)}, align 8")

    def store(self, pointer: str, row: int, value: str, rows: int | None = None) -> None:
        """Write a row of lanes."""
        place = self._place(pointer, row, rows)
        self.out.write(f"  store {self.out.real} {value}, ptr {place}, align 8")

    def read(self, box: str) -> str:
        return self.out.emit(f"load {self.out.real}, ptr {box}, align 64")

    def keep(self, box: str, value: str) -> None:
        self.out.write(f"  store {self.out.real} {value}, ptr {box}, align 64")

    def _place(self, pointer: str, row: int, rows: int | None) -> str:
        out = self.out
        if rows is None:
            return out.emit(f"getelementptr double, ptr {pointer}, i64 {row * out.lanes}")
        base = out.emit(f"mul i64 %row, {rows * out.lanes}")
        return out.emit(f"getelementptr double, ptr {pointer}, i64 {out.emit(f'add i64 {base}, {row * out.lanes}')}")

    def _scalar(self, pointer: str, rows: int, row: int) -> str:
        out = self.out
        base = out.emit(f"mul i64 %row, {rows}")
        place = out.emit(f"getelementptr double, ptr {pointer}, i64 {out.emit(f'add i64 {base}, {row}')}")
        return out.emit(f"load double, ptr {place}, align 8")

    def _scaled(self, index: str, unit: float) -> str:
        scalar = Assembler(1)
        return self.out.emit(f"fmul double {self.out.emit(f'sitofp i64 {index} to double')}, {scalar.const(unit)}")

    def _load_seeds(self) -> str:
        return self.out.emit(f"load {self.out.whole}, ptr %seeds, align 8")

    def _draw(self, seeds: str, channel: int) -> str:
        out = self.out
        first = out.emit(f"mul i64 %k, {self.sizes['v']}")
        return out.uniform(seeds, out.spread(out.emit(f"add i64 {first}, {channel + 1}"), "i64"))
