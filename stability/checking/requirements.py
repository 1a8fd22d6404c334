"""What a study requires beside the error, as far as it is proved: settling; peaks and RMS of what drives.

Theorem: an output at a time is its operating point there, with what the deviations are bounded by from that time
on, under one demand φ* of the load networks; the mean of a square is at most that of its suprema over slices of
time; M x' = g u - c x with c > 0 keeps |x| below its start and sup|g u| / c. Must fail: a smaller peak or RMS than
this, an earlier settling time, an output that is not the member's.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from .arithmetic import ONE, ZERO, Interval, add, intersect, inverse, magnitude, mul, root, symmetric, up
from .coupling import Coupling
from .forms import Node, Table, derivative, linear, over
from .limits import need
from .loop import Loop
from .member import Member
from .parsing import number, numbers, reads, valid_program
from .reference import ranges_on
from .statement import rotary

#: Output -> its unit, and the requirements on its peak and on its RMS.
EFFORTS = {"torque": ("N m", "peak_torque_nm", "rms_torque_nm"), "current": ("A", "peak_current_a", "rms_current_a")}
#: Slices of a rest at the start, and of a move that is one polynomial.
WHOLE_MOVE = 8
#: Slices of a motion at most for peaks and RMS; of a longer one they are simulated only.
MOST_SLICES = 400
#: A settling time is found to this share of what is required: 2^-HALVINGS.
HALVINGS = 8


def beyond_error(data: dict[str, Any], members: list[Member], coupling: Coupling | None) -> dict[str, Fraction]:
    """Bounds on what the study requires beside the errors, by the name of the requirement; without those not proved."""
    given, found = data["study"]["requirements"], {}
    outputs = [outputs_of(entry["model"], member) for entry, member in zip(data["members"], members, strict=True)]
    if "settling_time_s" in given:
        band = number(given.get("settling_band_m", given["tracking_error_m"]), "settling_band_m")
        found["settling_time_s"] = _settled(data, members, coupling, band)
    for output, (unit, *names) in EFFORTS.items():
        if set(names) & set(given):
            pair = zip(names, _effort(data, members, outputs, output, unit), strict=True)
            found |= {name: bound for name, bound in pair if name in given}
    if "peak_voltage_v" in given:
        found["peak_voltage_v"] = _voltage(members)
    limit = {name: number(given[name], name) for name in found}
    return {name: bound for name, bound in found.items() if bound is not None and bound <= limit[name]}


def outputs_of(model: dict[str, Any], member: Member) -> dict[str, tuple[str, dict[str, Any]]]:
    """Unit and operations of a member's outputs; they may read its states, inputs and parameters."""
    claim, found = member.claim, {}
    known = {*(row["state"] for row in claim.rows), *claim.inputs, *claim.parameters}
    for name, entry in model["outputs"].items():
        program = valid_program(entry["program"], f"the output {name}")
        need(len(program["outputs"]) == 1, f"the output {name} is one number")
        need(reads(program) <= known, f"the output {name} reads what is no state, input or parameter")
        need(bool(reads(program) - set(claim.parameters)), f"the output {name} is a constant")
        found[name] = str(entry["unit"]), program
    return found


def _settled(data: dict[str, Any], members: list[Member], coupling: Coupling | None, band: Fraction) -> Fraction | None:
    """The first time of a grid from which the output stays inside the band; None where it is not proved to."""
    lasted = number(data["members"][0]["reference"]["segments"][-1]["knots"][-1], "a knot")

    def inside(time: Fraction) -> bool:
        sizes = [member.verdict.sizes(time)[0] for member in members]
        return (max(sizes) if coupling is None else coupling.output(sizes)) <= band

    if inside(Fraction(0)):
        return Fraction(0)
    late, early = min(number(data["study"]["requirements"]["settling_time_s"], "settling_time_s"), lasted), Fraction(0)
    if not inside(late):
        return None
    for _ in range(HALVINGS):
        middle = (early + late) / 2
        early, late = (early, middle) if inside(middle) else (middle, late)
    return late


def _voltage(members: list[Member]) -> Fraction | None:
    """The largest certified amplitude of inputs in V."""
    driven = [member for member in members if member.claim.limits[0]["unit"] == "V"]
    return max((member.verdict.norm(member.claim.inputs) for member in driven), default=None)


def _effort(
    data: dict[str, Any], members: list[Member], outputs: list[dict[str, tuple[str, dict[str, Any]]]], output: str,
    unit: str,
) -> tuple[Fraction | None, Fraction | None]:  # fmt: skip
    """The largest peak and the largest RMS of an output of all members; None where one does not say what it is."""
    peaks: list[Fraction] = []
    means: list[Fraction] = []
    for entry, member, own in zip(data["members"], members, outputs, strict=True):
        if output not in own or (own[output][0] != unit and rotary(data, member.name, output)):
            return None, None
        if own[output][0] == unit:
            segments = entry["reference"]["segments"]
            if _count(segments) > MOST_SLICES:
                return None, None
            parts = list(_slices(segments, member, own[output][1]))
            whole = sum((lasted for lasted, _ in parts), Fraction(0))
            peaks.append(max(square for _, square in parts))
            means.append(sum((lasted * square for lasted, square in parts), Fraction(0)) / whole)
    return (root(up(max(peaks)), True), root(up(max(means)), True)) if peaks else (None, None)


def largest_of(entry: dict[str, Any], member: Member, program: dict[str, Any]) -> Fraction:
    """A bound on the square of an output over the whole motion."""
    segments = entry["reference"]["segments"]
    need(_count(segments) <= MOST_SLICES, "an output is bounded over fewer slices of a motion")
    return max(square for _, square in _slices(segments, member, program))


def _count(segments: list[dict[str, Any]]) -> int:
    return sum(max(WHOLE_MOVE, len(segment["coefficients"])) for segment in segments)


def _slices(
    segments: list[dict[str, Any]], member: Member, program: dict[str, Any]
) -> Iterator[tuple[Fraction, Fraction]]:
    """Length of every slice of the motion, and a bound on the square of an output over it."""
    followed = {i: most for i in range(len(member.claim.rows)) if (most := _followed(member, i)) is not None}
    for segment in segments:
        count = len(segment["coefficients"])
        knots, points = numbers(segment["knots"], count + 6, "knots"), numbers(segment["coefficients"], count, "points")
        rests = len(set(points)) == 1
        parts = 1 if rests and knots[0] >= member.claim.transient else WHOLE_MOVE if count == 6 else 1
        still = [(points[0], points[0]), *[ZERO] * 3]
        for span in range(5, count):
            step = (knots[span + 1] - knots[span]) / parts
            for k in range(parts if step > 0 else 0):
                ends = knots[span] + k * step, knots[span] + (k + 1) * step
                reference = still if rests else ranges_on(knots, points, span, ends)
                found = _output(member, program, reference, ends[0], followed)
                yield step, up(magnitude(found) ** 2)


def _output(
    member: Member, program: dict[str, Any], reference: list[Interval], time: Fraction, followed: dict[int, Fraction]
) -> Interval:
    """Range of an output while the reference is in some ranges, from a time on; with bounds on some states."""
    ranges = [_output_of(member, loop, program, reference, time, followed) for loop in member.verdict.loops]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def _output_of(
    member: Member, loop: Loop, program: dict[str, Any], reference: list[Interval], time: Fraction,
    followed: dict[int, Fraction],
) -> Interval:  # fmt: skip
    """The same for the constants of one loop."""
    claim = member.claim
    known = {**loop.table.ranges, **{f"r{k}": bounds for k, bounds in enumerate(reference)}}
    for i, (met, drive) in loop.met.items():
        known[f"p{i}"] = mul(over(met, known), inverse(drive))
    n, sizes = len(claim.rows), member.verdict.sizes(min(time, claim.transient))
    signals = dict(claim.parameters)
    for i, row in enumerate(claim.rows):
        own = add(over(loop.target(i), known), symmetric(sizes[i]))
        signals[row["state"]] = intersect(own, symmetric(followed[i])) if i in followed else own
    for k, (name, row) in enumerate(zip(claim.inputs, claim.input_map, strict=True)):
        signals[name] = add(over(loop.kappa(row), known), symmetric(sizes[n + k]))
    return _values(program, signals)


def _values(program: dict[str, Any], ranges: dict[str, Interval]) -> Interval:
    """Range of the first output of an operation list over ranges of its inputs."""
    table = Table()
    nodes = {name: Node(table.key("input", name), {"": bounds}, bounds) for name, bounds in ranges.items()}
    return linear(program, nodes, table)[0].range


def _followed(member: Member, i: int) -> Fraction | None:
    """Bound for all t on a state that carries out an input with a lag; None where it is something else."""
    claim, loop, row = member.claim, member.loop, member.claim.rows[i]
    target = row["target"]
    if row["controlled"] or target not in claim.input_map:
        return None
    name, state = claim.inputs[claim.input_map.index(target)], row["state"]
    program = {**claim.plant, "outputs": [claim.plant["outputs"][len(claim.rows) + i]]}
    if not reads(program) <= {name, state, *claim.parameters}:
        return None
    largest = member.verdict.largest(name)
    # the ranges hold 0, where the row vanishes: it is its slopes times state and input
    ranges = {signal: node.range for signal, node in loop.nodes.items()}
    ranges |= {state: symmetric(magnitude(ranges[state])), name: symmetric(largest)}
    still = _values(program, {**ranges, state: ZERO, name: ZERO})
    falls, driven = (derivative(program, ranges, {n: {"": ONE}}).get("", ZERO) for n in (state, name))
    if still != ZERO or not falls[1] < 0:
        return None
    return max(_begun(member, i, target), up(magnitude(driven) * largest / -falls[1]))


def _begun(member: Member, i: int, target: int) -> Fraction:
    """Bound on a state at the start: its Q, and the control of its target there."""
    return max(_begun_of(member, loop, i, target) for loop in member.verdict.loops)


def _begun_of(member: Member, loop: Loop, i: int, target: int) -> Fraction:
    """The same for the constants of one loop."""
    claim = member.claim
    known = {**loop.table.ranges, **loop.resting}
    control = magnitude(over(loop.model[target], known)) + loop.half[target][1] * claim.initial[target]
    if target in claim.networks:
        rested = magnitude(known[f"p{target}"]) + loop.settled[claim.networks.index(target)]
        control += max(abs(loop.gain[target].preload), rested)
    return up(claim.initial[i] + control)
