"""Re-prove a gain file from the file alone: `python checker.py gains.json`.

A second program. It imports nothing but Python's standard library and trusts no number that the producer derived: from
the assumptions, the gains and the model in the file it encloses the closed loop in rational interval arithmetic with
outward rounding, builds every inequality itself, and decides each exactly. What it takes as given is the statement: the
plant and the law as operation lists, the assumptions, the study.

Exit status: 0 everything proved, 1 something is not, 2 a file that cannot be read.

Assembled from the parts in stability/checking, in this order:

limits: What a gain file must prove, and how large it may be.

  Must fail: an obligation left out, another law or kind of certificate, a file beyond these sizes.

arithmetic: Intervals of fractions, rounded outwards to a number of bits.

  Theorem: the fundamental theorem of interval arithmetic (Moore 1966); every operation holds the range of what it
  encloses.

forms: Linear forms with interval coefficients: what plant and law share cancels.

  Theorem: affine forms with a symbol for each nonlinear value (Stolfi and de Figueiredo 1997); derivatives by the
  chain rule. Must fail: an operation list that reads what is not there, a sign or a term of it changed.

fixed: Intervals on a fixed grid, rounded outwards: ranges and derivatives of large operation lists.

  Theorem: as `arithmetic`; the same enclosures on whole numbers, an order of magnitude faster.

parsing: Numbers, hashes and operation lists of a file, refused where they are malformed.

  Must fail: numbers in other forms, doubled keys, changed content, unknown operators, indices that come later.

shape: Rules for what may stand at a place of a file.

  Must fail: unknown or missing keys, numbers as text, text that is no plain text, more entries than a file of ours has.

grammar: Every key that a file may have, and what stands at it; whatever else stands in a file is refused.

  Must fail: a key more, a key less, another kind of value, at every place of a file.

claim: The statement about one member as data.

reference: Bounds of a reference for all t from its control points.

  Theorem: a spline lies in the hull of its control points (de Boor 1978), a piece of it in that of its Bezier points,
  found by blossoms (Ramshaw 1989). Must fail: jumps, a moving end, other
  bounds.

statement: What a file says more than once, and what it records, against the study and the proof.

  Must fail: units, sources, meanings and nominal values that are not the study's, requirements that are not met,
  records that the proof excludes, golden vectors that repeat each other.

structure: What the rows of a model are beyond their operations: a position and its rate, a chain to it, whole limits.

  Must fail: a second state that is not the first one's rate, a row that nothing depends on, a limit that leaves out a
  state of its unit, golden vectors that test nothing.

course: The reference of a file is the study's: its places, pauses, durations and limits.

  Theorem: as `reference`. Must fail: another waypoint, another duration, a move beyond a limit, a last
  segment that is not the study's.

reading: Reads what a file says of a member, and refuses what is not the study's.

  Must fail: an assumption narrower than the study, a gain outside its range, a law that reads what it cannot know, a
  plant that does not feel what the study states.

balance: What a mode carries in the motion that is asked for, as the only other row that reads it says.

  Theorem: in M x' = g b + Σ c s + c_0 + what is left, with g, c and c_0 constant and signals s of bounded rate,
  b* = (M r' - Σ c s - c_0) / g is one of them, and around it what is left acts alone. Must fail: an effect without a
  sign, a row that two modes balance, what may change counted as constant.

targets: What rows track: sums of signals, a balance, or quotients of a load and a constant.

  Must fail: a signal without a bounded rate; it is refused where the loop is made.

loop: The closed loop around the moving operating point, with the input as it is held.

  Theorem: interval enclosures of every coefficient (docs/proof.md). Must fail: a sign of plant or law, a smaller box,
  more noise, a demand that a network cannot meet.

matrices: Matrices in fixed point with one bound on all their errors, and exact inverses.

  Theorem: |a b - a' b'| <= |a| |b - b'| + |a - a'| |b| + |a - a'| |b - b'|; the remainder of an exponential's series.

jitter: An input that acts earlier or later than it should.

  Theorem: while another input acts than the nominal one, for a time of at most the jitter, z' differs by b times the
  change of the input and by what the uncertainty makes of that; so z is kicked by at most an integral of e^{|a| s}.
  Must fail: a larger jitter, one that is longer than the delay.

lag: Rows that only follow what is commanded, with a time constant that is not known exactly.

  Theorem: with M = M0/(1 + δ), δ constant, z' = (1 + δ) s + ..., and e = δ ζ, ζ' = a ζ + s, the rest z - e obeys the
  row without δ s (docs/proof.md). Must fail: a row that reads anything else, that is measured, that does not contract.

lead: Sections of lead between the error of an input's row and its proportional part.

  Theorem: o = r e + (1 - r) w and w <- p w + (1 - p) e with r = (a + T)/(f + T), p = f/(f + T) are backward differences
  of (1 + a s)/(1 + f s). Must fail: other times, a section less, a state that is left out.

turn: One control period of the whole sampled loop: plant, load networks and pending inputs as one exact map.

  Theorem: variation of constants. Must fail: another delay, a network or a pending input left out.

sums: Integrals over a sub-step, and sums of bounds, in whole numbers rounded up.

  Theorem: ∫|f| = |∫f| where f keeps its sign. Where f(z) = 0, |f(r)| is at most the integral of |f'| from z to r, and

      ∫|f| <= ∫_z^h |f'(s)| (h - s) ds + ∫_0^z |f'(s)| s ds,

  with the derivative |f'(z)| (2z - h) by z: it is largest at an end. Must fail: a slope left out.

responses: L1 norms of the impulse responses of a sampled loop.

  Theorem: Khammash and Pearson (1991); Bamieh, Dahleh and Pearson (1993) for a kernel of two times; docs/proof.md for
  the sums. Must fail: coordinates in which a period does not contract, fewer periods, a smaller weight.

obligation: One verdict, and the verdicts on a file; bounds and margins in few digits that hold.

impulse: The impulse-response certificate.

  Theorem: sup y <= y0 + Λ S sup y with Λ S s < s for some s > 0 gives sup y <= (I - Λ S)^-1 y0 (Khammash and Pearson
  1991; Dahleh and Diaz-Bobillo 1995, ch. 7). Obligations: contraction, small gain, invariance, accuracy. Must fail: a
  smaller box, less of what acts, a faster decay.

golden: Golden vectors follow from the gains and the law, to float accuracy.

effects: Whether a plant and a coupling feel what the study states.

  Two floats that differ are a witness that they do; nothing is proved of how much. Obligation: plant. Must fail: a
  plant that multiplies its load by 0, a parameter without effect, backlash without one in the mirror image of the set
  too, a machine that is the same for every payload.

obligations: All obligations of a member, decided.

  Obligations: plant, non-vacuity, reference, authority, adaptation, rounding, accuracy, and those of the certificate.
  Must fail: lower limits, a shorter stroke, a tighter requirement, a faster adaptation than the rate allows.

member: A member of a machine: read, decided, and compared with what the file records.

motion: The motion of all members over slices of time.

  Obligation: motion. Must fail: knots that differ, more slices than a file of ours.

coupling: What members do to each other.

  Theorem: mean value theorem over slices and first exit from the guarantees; the accelerations by contraction
  (Banach; docs/machine.md). Obligations: guarantees, loads, coupling, output. Must fail: a heavier load, a smaller
  guarantee, a narrower assumption on a load, a smaller bound on the output.

requirements: What a study requires beside the error, as far as it is proved: settling; peaks and RMS of what drives.

  Theorem: an output at a time is its operating point there, with what the deviations are bounded by from that time
  on, under one demand φ* of the load networks; the mean of a square is at most that of its suprema over slices of
  time; M x' = g u - c x with c > 0 keeps |x| below its start and sup|g u| / c. Must fail: a smaller peak or RMS than
  this, an earlier settling time, an output that is not the member's.

shared: What members draw on together: an output of each adds up, and there is only so much.

  Theorem: the sum of the amounts is at most the sum of the largest ones, each over the whole motion. Must fail: less to
  draw on, a member whose output is not told or is in another unit.

watch: What shuts a machine down does not act while the assumptions hold: on errors, inputs and first states.

  Theorem: a measured error is at most the certified one and the sensor's; an input and a measured state are inside
  their certified ranges. Of what a monitor estimates nothing is decided. Must fail: a monitor with less room than that.

command: The command: files in, verdicts out.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import math
import operator
import os
import re
import stat
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from itertools import pairwise, product
from pathlib import Path
from typing import Any

# --- limits ---

SCHEMA = "hdmm-opt/gains/2"
#: What must be proved of each member for its law and its kind of certificate; a file that leaves one out is refused.
REQUIRED = {
    "rac": {
        "impulse": (
            "plant", "non-vacuity", "reference", "contraction", "small gain", "invariance", "authority", "adaptation",
            "rounding", "accuracy",
        ),
    }
}  # fmt: skip
MAX_BYTES, MAX_DIGITS, MAX_EXPONENT, MAX_OPERATIONS, MAX_ROWS, MAX_COEFFICIENTS = 2_000_000, 60, 60, 12_000, 8, 1_000
#: Cells of a certificate, states of a loop with all that it remembers and of a block, groups of periods summed.
MAX_CELLS, MAX_ORDER, MAX_BLOCK, MAX_GROUPS = 64, 24, 4, 400
#: Largest number of periods in a group, and of periods of delay.
MAX_GROUP, MAX_DELAY = 2_000, 8
#: Sections of lead of an input.
MAX_LEADS = 4
#: A parameter that may change in a run: faults take effectiveness.
VARYING = "effectiveness"
#: A range of an assumption is that of the study to this share: it is written rounded outwards.
ROUND = Fraction(1, 10**12)
#: A place is met and a duration kept to this share of its size and a picometre or picosecond; a limit to that share.
MET, FLOOR = Fraction(1, 10**9), Fraction(1, 10**12)
#: The parameter that may be felt beyond the certified set alone: a contact that stays.
IDLE = "backlash"
#: An effect of what a study states, relative to all that moves a row, below which it counts for none.
LEAST_EFFECT = Fraction(1, 10**9)
#: The same of a load: relative to all that moves a row, and to the loads of a machine.
LEAST_LOAD = Fraction(1, 10**4)
#: A member moves the output by at least this much per unit of its position, m/m or m/rad.
LEAST_SLOPE = 0.05
#: Interval products that all members and the coupling of a machine may take, and each of members that nothing joins;
#: files of ours take up to half.
MAX_PRODUCTS, MAX_COUPLED = 200_000, 4_000_000
#: Members of a machine, and slices of time that its motion may be cut into.
MAX_MEMBERS, MAX_SLICES = 8, 1_000
#: Names of the parameter that holds a member's own part of the bodies' inertia.
CARRIED = ("load_mass", "load_inertia")
#: Parts of the ranges of speed and load in which the answer of an acceleration to a load is bounded.
SPEED_PARTS, LOAD_PARTS = 48, 4
#: Relative width given to every gain, so that the proof holds for its decimal, its float64 and its float32.
ROUNDING = Fraction(1, 2**23)
BITS, MAX_SHIFT = 96, 3_000
#: Fixed-point bits of matrices, terms of an exponential's series, and its largest norm.
FIXED, TERMS, MAX_NORM = 160, 120, 20
#: Fractional bits of the fixed-point intervals of a coupling, and bits beyond which nothing is proved.
SCALE, MAX_FIXED = 160, 1_000
#: A unit, such as "kg m^2", "N m" or "rad/s".
UNIT_TEXT = re.compile(r"1|[A-Za-z]{1,4}(\^[2-4])?( [A-Za-z]{1,4}(\^[2-4])?){0,3}(/[A-Za-z]{1,4}(\^[2-4])?)?")
NAME, NUMBER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}"), re.compile(r"-?[0-9]+(/[0-9]+|(\.[0-9]+)?([eE][+-]?[0-9]+)?)")


class UnreadableError(Exception):
    """The file is not a well-formed gain file."""


class NotProvedError(Exception):
    """A bound does not exist."""


def need(condition: bool, message: str) -> None:
    """Raise `UnreadableError` unless the condition holds."""
    if not condition:
        raise UnreadableError(message)


# --- arithmetic ---

Interval = tuple[Fraction, Fraction]
ZERO: Interval = (Fraction(0), Fraction(0))
ONE: Interval = (Fraction(1), Fraction(1))


def down(x: Fraction) -> Fraction:
    """The largest number of BITS bits that is not above x."""
    numerator, denominator = x.numerator, x.denominator
    shift = BITS - (abs(numerator).bit_length() - denominator.bit_length())
    if abs(shift) > MAX_SHIFT:
        raise NotProvedError("a bound leaves the range of numbers that the checker handles")
    if denominator.bit_length() <= BITS and abs(numerator).bit_length() <= BITS:
        return x
    if shift >= 0:
        return Fraction((numerator << shift) // denominator, 1 << shift)
    return Fraction((numerator // (denominator << -shift)) << -shift)


def up(x: Fraction) -> Fraction:
    """The smallest number of BITS bits that is not below x."""
    return -down(-x)


def symmetric(radius: Fraction) -> Interval:
    """[-radius, radius]."""
    return -abs(radius), abs(radius)


def add(a: Interval, b: Interval) -> Interval:
    """Sum."""
    return down(a[0] + b[0]), up(a[1] + b[1])


def neg(a: Interval) -> Interval:
    """Negative."""
    return -a[1], -a[0]


class Work:
    """Counts interval products, so that no file can keep the checker busy for long."""

    def __init__(self) -> None:
        self.left = 0

    def begin(self, allowed: int) -> None:
        """Allow so many products from here on."""
        self.left = allowed

    def one(self, cost: int = 1) -> None:
        """Count a product, or what costs as much as so many."""
        self.left -= cost
        if self.left < 0:
            raise NotProvedError("the model is larger than this checker takes on")


WORK = Work()


def mul(a: Interval, b: Interval) -> Interval:
    """Product."""
    WORK.one()
    if a[0] == a[1] == 0 or b[0] == b[1] == 0:
        return ZERO
    ends = (a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])
    return down(min(ends)), up(max(ends))


def inverse(a: Interval) -> Interval:
    """Reciprocal."""
    if a[0] <= 0 <= a[1]:
        raise NotProvedError("a divisor can vanish in the assumed box")
    return down(1 / a[1]), up(1 / a[0])


def square(a: Interval) -> Interval:
    """Range of x²."""
    low, high = sorted((abs(a[0]), abs(a[1])))
    return (Fraction(0) if a[0] <= 0 <= a[1] else down(low * low)), up(high * high)


def root(x: Fraction, upwards: bool) -> Fraction:
    """A rational bound on the square root."""
    WORK.one(4)
    if x < 0:
        raise NotProvedError("a square root of a negative number in the assumed box")
    shift = 2 * max(0, BITS - (x.numerator.bit_length() - x.denominator.bit_length()) // 2)
    scaled = (x.numerator << shift) // x.denominator
    return Fraction(math.isqrt(scaled) + (1 if upwards else 0), 1 << (shift // 2)) + (
        Fraction(1, 1 << (shift // 2)) if upwards else 0
    )


def exponential(x: Fraction) -> Interval:
    """Enclosure of exp(x) by a Taylor sum on |x| <= 1/2 and repeated squaring."""
    halvings = 0
    while abs(x) > Fraction(1, 2):
        x, halvings = x / 2, halvings + 1
    term, total = Fraction(1), Fraction(1)
    for k in range(1, 24):
        term = down(term * x / k)
        total = down(total + term)
    error = 2 * abs(term) + Fraction(1, 2 ** (BITS - 8))
    value = (down(total - error), up(total + error))
    for _ in range(halvings):
        value = (down(value[0] * value[0]), up(value[1] * value[1]))
    return value


def tanh_point(x: Fraction) -> Interval:
    """Enclosure of tanh at one number."""
    if abs(x) > 40:
        edge = 1 - Fraction(1, 2**100)
        return (edge, Fraction(1)) if x > 0 else (Fraction(-1), -edge)
    if abs(x) < Fraction(1, 2**40):  # x - x³ <= tanh x <= x for x >= 0, and odd
        return (down(x - x**3), up(x)) if x >= 0 else (down(x), up(x - x**3))
    low, high = exponential(down(2 * x))[0], exponential(up(2 * x))[1]
    return down(1 - 2 / (low + 1)), up(1 - 2 / (high + 1))


#: What a tanh costs, in products.
TANH_WORK = 100


def tanh(a: Interval) -> Interval:
    """Range of tanh."""
    WORK.one(TANH_WORK)
    return tanh_point(a[0])[0], tanh_point(a[1])[1]


def magnitude(a: Interval) -> Fraction:
    """Largest absolute value."""
    return max(abs(a[0]), abs(a[1]))


def intersect(a: Interval, b: Interval) -> Interval:
    """Intersection of two enclosures of the same quantity."""
    return max(a[0], b[0]), min(a[1], b[1])


# --- forms ---

Form = dict[str, Interval]


def plus(*forms: Form) -> Form:
    """Sum of forms."""
    result: Form = {}
    for form in forms:
        WORK.one(len(form) // 8)
        for symbol, value in form.items():
            result[symbol] = add(result[symbol], value) if symbol in result else value
    return result


def over(form: Form, ranges: dict[str, Interval]) -> Interval:
    """Range of a form over ranges of its symbols."""
    total = ZERO
    for symbol, value in form.items():
        total = add(total, mul(value, ranges[symbol]))
    return total


def times(form: Form, factor: Interval) -> Form:
    """A form scaled by an interval."""
    return {symbol: mul(value, factor) for symbol, value in form.items()}


@dataclass(frozen=True)
class Node:
    """Value of an operation: identity (equal operations share one), form and range."""

    key: int
    form: Form
    range: Interval


@dataclass
class Table:
    """Ranges of all symbols, definitions of the derived ones, oldest first, and how many maxima no range decides."""

    ranges: dict[str, Interval] = field(default_factory=lambda: {"": ONE})
    definitions: dict[str, Form] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    keys: dict[tuple[Any, ...], int] = field(default_factory=dict)
    undecided: int = 0

    def key(self, *operation: Any) -> int:
        """A number for an operation; the same for the same operator on the same arguments."""
        return self.keys.setdefault(operation, len(self.keys))

    def copy(self) -> Table:
        """A table of its own with the same symbols."""
        return Table(dict(self.ranges), dict(self.definitions), dict(self.names), dict(self.keys), self.undecided)

    def over(self, form: Form) -> Interval:
        """Range of a form."""
        return over(form, self.ranges)

    def node(self, key: int, form: Form, natural: Interval) -> Node:
        """A value whose range is the better of two enclosures."""
        return Node(key, form, intersect(natural, self.over(form)))

    def fresh(self, key: int, definition: Form, natural: Interval) -> Node:
        """A nonlinear value: a symbol of its own, the same for the same operation."""
        if key not in self.names:
            name = self.names[key] = f"n{len(self.names)}"
            self.ranges[name], self.definitions[name] = natural, definition
        return Node(key, {self.names[key]: ONE}, natural)

    def expand(self, form: Form, keep: str = "#") -> Form:
        """Replace derived symbols by their definitions, newest first."""
        for symbol in reversed(list(self.definitions)):
            if symbol in form and not symbol.startswith(keep):
                WORK.one(len(form) // 8)
                rest = {s: v for s, v in form.items() if s != symbol}
                form = plus(rest, times(self.definitions[symbol], form[symbol]))
        return form


def walk(
    program: dict[str, Any], read: Callable[[str], Any], const: Callable[[Fraction], Any], apply: Any
) -> list[Any]:
    """Run an operation list in any arithmetic; returns every entry."""
    table: list[Any] = []
    WORK.one(len(program["operations"]) // 64)
    for name, *arguments in program["operations"]:
        if name == "input":
            table.append(read(arguments[0]))
        elif name == "const":
            table.append(const(Fraction(arguments[0])))
        else:
            table.append(apply(name, *(table[i] for i in arguments)))
    return table


def linear(program: dict[str, Any], inputs: dict[str, Node], table: Table) -> list[Node]:
    """Outputs of an operation list in linear forms."""

    def const(value: Fraction) -> Node:
        return Node(table.key("const", value), {"": (value, value)}, (value, value))

    def apply(operator: str, a: Node, b: Node | None = None) -> Node:
        arguments = [a.key] if b is None else [a.key, b.key]
        key = table.key(operator, *(arguments if operator in ("sub", "div") else sorted(arguments)))
        if operator == "neg":
            return table.node(key, times(a.form, (Fraction(-1), Fraction(-1))), neg(a.range))
        if operator == "tanh":
            return table.fresh(key, {"": tanh(a.range)}, tanh(a.range))
        if operator == "sqrt":
            bounds = root(a.range[0], False), root(a.range[1], True)
            return table.fresh(key, {"": bounds}, bounds)
        if b is None:
            return multiply(table.key("mul", a.key, a.key), a, a)
        if operator == "add":
            return table.node(key, plus(a.form, b.form), add(a.range, b.range))
        if operator == "sub":
            return table.node(key, plus(a.form, times(b.form, neg(ONE))), add(a.range, neg(b.range)))
        if operator == "max":
            if apart(a.range, b.range):
                return a if a.range[0] >= b.range[1] else b
            table.undecided += 1
            return table.fresh(key, between(a.form, b.form), greater(a.range, b.range))
        if operator == "div":
            form, natural = times(a.form, inverse(b.range)), mul(a.range, inverse(b.range))
            return (table.node if set(b.form) <= {""} else table.fresh)(key, form, natural)
        return multiply(key, a, b)

    def multiply(key: int, a: Node, b: Node) -> Node:
        natural = square(a.range) if a.key == b.key else mul(a.range, b.range)
        for one, other in ((a, b), (b, a)):
            if set(one.form) <= {""}:
                return table.node(key, times(other.form, one.form.get("", ZERO)), natural)
        wide, narrow = (a, b) if magnitude(a.range) >= magnitude(b.range) else (b, a)
        if outside(narrow.form) and not outside(wide.form):
            wide, narrow = narrow, wide
        return table.fresh(key, times(narrow.form, wide.range), natural)

    entries = walk(program, inputs.__getitem__, const, apply)
    return [entries[i] for i in program["outputs"]]


def greater(a: Interval, b: Interval) -> Interval:
    """Range of the larger of two numbers."""
    return max(a[0], b[0]), max(a[1], b[1])


def apart(a: Interval, b: Interval) -> bool:
    """Whether ranges decide which of two numbers is the larger."""
    return a[0] >= b[1] or b[0] >= a[1]


def between(a: Form, b: Form) -> Form:
    """All forms between two: max(a, b) = b + s (a - b) with s from 0 to 1."""
    return plus(b, times(plus(a, times(b, neg(ONE))), (Fraction(0), Fraction(1))))


def outside(form: Form) -> bool:
    """Whether a form is of what comes from outside alone, a disturbance: it then scales the other factor."""
    return all(symbol[:2] in ("", "d:", "w:") for symbol in form)


def derivative(program: dict[str, Any], ranges: dict[str, Interval], tangents: dict[str, Form]) -> Form:
    """Directional derivative of the first output, enclosed over the ranges of the inputs."""
    two = (Fraction(2), Fraction(2))

    def apply(operator: str, a: tuple[Interval, Form], b: tuple[Interval, Form] | None = None) -> Any:
        (x, dx), (y, dy) = a, b if b is not None else a
        if operator == "neg":
            return neg(x), times(dx, neg(ONE))
        if operator == "tanh":
            value = tanh(x)
            slope = add(ONE, neg(square(value)))
            return value, times(dx, (max(slope[0], Fraction(0)), min(slope[1], Fraction(1))))
        if operator == "sqrt":
            value = root(x[0], False), root(x[1], True)
            return value, times(dx, inverse(mul(two, value)))
        if operator == "sq":
            return square(x), times(dx, mul(two, x))
        if operator == "add":
            return add(x, y), plus(dx, dy)
        if operator == "sub":
            return add(x, neg(y)), plus(dx, times(dy, neg(ONE)))
        if operator == "mul":
            return mul(x, y), plus(times(dx, y), times(dy, x))
        if operator == "max":
            if apart(x, y):
                return (x, dx) if x[0] >= y[1] else (y, dy)
            return greater(x, y), between(dx, dy)
        ratio = mul(x, inverse(y))
        return ratio, times(plus(dx, times(dy, neg(ratio))), inverse(y))

    entries = walk(program, lambda n: (ranges[n], tangents.get(n, {})), lambda c: ((c, c), {}), apply)
    return entries[program["outputs"][0]][1]


# --- fixed ---

Fixed = tuple[int, int]
#: A value and its derivatives by the name of the direction.
Slope = tuple[Fixed, dict[str, Fixed]]
UNIT: Fixed = (1 << SCALE, 1 << SCALE)
NONE: Fixed = (0, 0)
#: What a tanh costs, in products.
TANH_COST = 300
#: What a sine and a cosine of one number cost, in products.
TURN_COST = 27


def to_fixed(a: Interval) -> Fixed:
    """An interval of fractions, rounded outwards."""
    return (a[0].numerator << SCALE) // a[0].denominator, -((-a[1].numerator << SCALE) // a[1].denominator)


def from_fixed(a: Fixed) -> Interval:
    """The same interval in fractions."""
    return Fraction(a[0], 1 << SCALE), Fraction(a[1], 1 << SCALE)


def fixed_product(a: Fixed, b: Fixed) -> Fixed:
    """Product, rounded outwards."""
    WORK.one()
    (p, q), (r, s) = a, b
    if p >= 0:
        low, high = (p * r if r >= 0 else q * r), (q * s if s >= 0 else p * s)
    elif q <= 0:
        low, high = (p * s if s >= 0 else q * s), (q * r if r >= 0 else p * r)
    elif r >= 0:
        low, high = p * s, q * s
    elif s <= 0:
        low, high = q * r, p * r
    else:
        low, high = min(p * s, q * r), max(p * r, q * s)
    if max(low.bit_length(), high.bit_length()) > MAX_FIXED:
        raise NotProvedError("a bound leaves the range of numbers that the checker handles")
    return low >> SCALE, -(-high >> SCALE)


def fixed_inverse(a: Fixed) -> Fixed:
    """Reciprocal."""
    if a[0] <= 0 <= a[1]:
        raise NotProvedError("a divisor can vanish in the assumed box")
    WORK.one()
    one = 1 << 2 * SCALE
    return one // a[1], -(-one // a[0])


def fixed_square(a: Fixed) -> Fixed:
    """Range of x²."""
    low, high = sorted((abs(a[0]), abs(a[1])))
    return fixed_product((0 if a[0] <= 0 <= a[1] else low, high), (0 if a[0] <= 0 <= a[1] else low, high))


def fixed_root(a: Fixed) -> Fixed:
    """Range of the square root."""
    if a[0] < 0:
        raise NotProvedError("a square root of a negative number in the assumed box")
    WORK.one(2 + a[1].bit_length() // 16)
    return math.isqrt(a[0] << SCALE), math.isqrt(a[1] << SCALE) + 1


def fixed_turn(x: int) -> tuple[Fixed, Fixed]:
    """Enclosures of the sine and the cosine of one number: Taylor sums on |x| <= 1/2, doubling of the angle.

    Each of 28 terms is cut to the grid and moved by the cuts before it: within 2^-150 together; the rest of the series
    is below 2^-28 / 28! < 2^-125. Both, and what halving drops of the angle, are inside the room of 2^-88.
    """
    if abs(x) > 100 << SCALE:
        raise NotProvedError("an angle of the machine is beyond 100 rad")
    WORK.one(TURN_COST)
    doublings = 0
    while abs(x) > 1 << (SCALE - 1):
        x, doublings = x >> 1, doublings + 1
    term, sums = 1 << SCALE, [1 << SCALE, 0]
    for k in range(1, 28):
        term = (term * x >> SCALE) // k
        sums[k % 2] += -term if k % 4 > 1 else term
    room = 1 << (SCALE - 88)
    cosine, sine = ((v - room, v + room) for v in sums)
    for _ in range(doublings):
        sine, cosine = fixed_product((2 << SCALE, 2 << SCALE), fixed_product(sine, cosine)), fixed_square(sine)
        cosine = (1 << SCALE) - 2 * cosine[1], (1 << SCALE) - 2 * cosine[0]
    return sine, cosine


def fixed_sincos(a: Fixed) -> tuple[Fixed, Fixed]:
    """Ranges of sine and cosine.

    By value and slope at the middle with a curvature of at most 1; where the other one keeps its sign, by the ends.
    """
    one, middle = 1 << SCALE, (a[0] + a[1]) >> 1
    radius = max(a[1] - middle, middle - a[0])
    sine, cosine = fixed_turn(middle)
    bend = fixed_product((radius, radius), (radius, radius))[1] // 2 + 1

    def around(value: Fixed, slope: Fixed) -> Fixed:
        reach = fixed_product(slope, (-radius, radius))
        return max(-one, value[0] + reach[0] - bend), min(one, value[1] + reach[1] + bend)

    sines, cosines = around(sine, cosine), around(cosine, (-sine[1], -sine[0]))
    (first, last), keeps = (fixed_turn(a[0]), fixed_turn(a[1])), lambda b: not b[0] <= 0 <= b[1]
    if keeps(cosines):
        sines = max(sines[0], min(first[0][0], last[0][0])), min(sines[1], max(first[0][1], last[0][1]))
    if keeps(sines):
        cosines = max(cosines[0], min(first[1][0], last[1][0])), min(cosines[1], max(first[1][1], last[1][1]))
    return sines, cosines


def fixed_tanh(a: Fixed) -> Fixed:
    """Range of tanh."""
    WORK.one(TANH_COST)
    low, high = (tanh_point(Fraction(end, 1 << SCALE)) for end in a)
    return to_fixed((low[0], high[1]))


def slopes(program: dict[str, Any], ranges: dict[str, Interval], tangents: dict[str, dict[str, Interval]]) -> list[Any]:
    """Range of every output and its derivatives along named directions, over the ranges of the inputs.

    Args:
        program: Operation list.
        ranges: Range of each input.
        tangents: Derivatives of the inputs along each direction.

    Returns:
        A pair for each output, in fractions.
    """
    inputs = {name: to_fixed(value) for name, value in ranges.items()}
    moving = {name: {d: to_fixed(v) for d, v in along.items()} for name, along in tangents.items()}

    def const(value: Fraction) -> Slope:
        WORK.one(1 + value.denominator.bit_length() // 64)
        return to_fixed((value, value)), {}

    entries = walk(program, lambda name: (inputs[name], moving.get(name, {})), const, _slope)
    return [
        (from_fixed(value), {d: from_fixed(v) for d, v in along.items()})
        for value, along in (entries[index] for index in program["outputs"])
    ]


def _slope(operator: str, a: Slope, b: Slope | None = None) -> Slope:
    """One operation and its derivatives."""
    x, dx = a
    WORK.one(1 + len(dx) + (len(b[1]) if b is not None else 0))
    if b is not None:
        return _slope_of_two(operator, a, b)
    if operator == "neg":
        return (-x[1], -x[0]), {d: (-v[1], -v[0]) for d, v in dx.items()}
    if operator == "sq":
        return fixed_square(x), _scaled(dx, (2 * x[0], 2 * x[1]))
    if operator == "sqrt":
        value = fixed_root(x)
        return value, _scaled(dx, fixed_inverse((2 * value[0], 2 * value[1]))) if dx else {}
    if operator == "tanh":
        value, one = fixed_tanh(x), 1 << SCALE
        square = fixed_square(value)
        return value, _scaled(dx, (max(0, one - square[1]), min(one, one - square[0])))
    sine, cosine = fixed_sincos(x)
    return (sine, _scaled(dx, cosine)) if operator == "sin" else (cosine, _scaled(dx, (-sine[1], -sine[0])))


def _slope_of_two(operator: str, a: Slope, b: Slope) -> Slope:
    (x, dx), (y, dy) = a, b
    if operator == "add":
        return (x[0] + y[0], x[1] + y[1]), _together(dx, dy)
    if operator == "sub":
        return (x[0] - y[1], x[1] - y[0]), _together(dx, {d: (-v[1], -v[0]) for d, v in dy.items()})
    if operator == "mul":
        return fixed_product(x, y), _together(_scaled(dx, y), _scaled(dy, x))
    back = fixed_inverse(y)
    ratio = fixed_product(x, back)
    return ratio, _scaled(_together(dx, _scaled(dy, (-ratio[1], -ratio[0]))), back)


def _scaled(along: dict[str, Fixed], factor: Fixed) -> dict[str, Fixed]:
    return {d: fixed_product(v, factor) for d, v in along.items()}


def _together(first: dict[str, Fixed], second: dict[str, Fixed]) -> dict[str, Fixed]:
    if not second:
        return first
    found = dict(first)
    for d, v in second.items():
        old = found.get(d)
        found[d] = v if old is None else (old[0] + v[0], old[1] + v[1])
    return found


# --- parsing ---

def wrong_schema(found: Any) -> str:
    """What to say to a file of another kind or version."""
    if found is None:
        return f'it names no schema, and a gain file names "{SCHEMA}"; write one with design'
    known = {"hdmm-opt/gains/1": "hdmm-opt 0.1 reads it", "hdmm-opt/rejected/2": "a refused design left it, not proved"}
    old = known.get(found if isinstance(found, str) else "", "use the release that wrote the file")
    return f'this release reads "{SCHEMA}": got {str(found)[:60]!r}; {old}'


def number(value: Any, what: str) -> Fraction:
    """A number of the file as an exact rational."""
    need(
        not isinstance(value, bool) and isinstance(value, int | Fraction | str),
        f"{what} must be a number: got {value!r:.60}",
    )
    if isinstance(value, str):
        return rational(value, what)
    return Fraction(value)


def rational(text: str, what: str = "a number") -> Fraction:
    """Parse decimal or p/q text with bounded length and exponent."""
    need(len(text) <= MAX_DIGITS, f"{what} has over {MAX_DIGITS} digits")
    need(NUMBER.fullmatch(text) is not None, f"{what} must be a finite number: got {text[:40]!r}")
    exponent = text.lower().partition("e")[2] or "0"
    need(abs(int(exponent)) <= MAX_EXPONENT, f"{what} has an exponent beyond {MAX_EXPONENT}: {text[:40]}")
    need(not text.endswith("/0"), f"{what} divides by zero")
    value = Fraction(text)
    return value


def numbers(value: Any, count: int, what: str) -> list[Fraction]:
    """A list of numbers of a given length."""
    need(isinstance(value, list) and len(value) == count, f"{what} must list {count} numbers")
    return [number(entry, what) for entry in value]


def parse(text: str) -> dict[str, Any]:
    """JSON with exact decimals, no NaN, no doubled keys."""
    need(len(text) <= MAX_BYTES, f"a gain file has at most {MAX_BYTES} bytes")

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        need(len({key for key, _ in items}) == len(items), "an object has the same key twice")
        return dict(items)

    def constant(name: str) -> Any:
        raise UnreadableError(f"{name} is not a number that a gain file may hold")

    try:
        data = json.loads(
            text, parse_float=rational, parse_int=rational, parse_constant=constant, object_pairs_hook=pairs
        )
    except json.JSONDecodeError as error:
        what = "it looks like a study: run design on it" if text.lstrip()[:1] in ("[", "#") else "write it with design"
        raise UnreadableError(f"not a complete JSON file: {error.msg} at line {error.lineno}; {what}") from None
    except RecursionError:
        raise UnreadableError("the JSON is nested too deeply") from None
    need(isinstance(data, dict), "a gain file is a JSON object")
    return data


def digest(text_or_data: Any, *leave_out: str) -> str:
    """SHA-256 of canonical JSON (sorted keys, no spaces, floats as Python prints them), without some top-level keys."""
    data = json.loads(text_or_data) if isinstance(text_or_data, str) else text_or_data
    kept = {key: value for key, value in data.items() if key not in leave_out}
    canonical = json.dumps(kept, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def check_digests(text: str) -> None:
    """Refuse a file whose content does not match the hashes it carries."""
    plain = json.loads(text)
    parts = [("study", plain.get("study"))]
    members = plain.get("members")
    need(isinstance(members, list) and all(isinstance(m, dict) for m in members), "the members are missing")
    parts += [(f"the reference of {m.get('name')!r:.40}", m.get("reference")) for m in members]
    for part, section in parts:
        need(isinstance(section, dict), f"{part} is missing; write the file again with design")
        same = section.get("sha256") == digest(section, "sha256")
        need(same, f"{part} was changed after the file was written (sha256 differs)")
    whole = plain.get("sha256") == digest(plain, "sha256", "provenance")
    need(whole, "the file was changed after it was written (sha256 differs)")


def valid_program(program: Any, what: str, *, turning: bool = False) -> dict[str, Any]:
    """Structure of an operation list: known operators, sines and cosines or maxima, arguments that come earlier."""
    need(isinstance(program, dict) and isinstance(program.get("operations"), list), f"{what} must be an operation list")
    operations, arity = (
        program["operations"],
        {"neg": 1, "sq": 1, "sqrt": 1, "tanh": 1, "add": 2, "sub": 2, "mul": 2, "div": 2},
    )
    arity |= {"sin": 1, "cos": 1} if turning else {"max": 2}
    need(0 < len(operations) <= MAX_OPERATIONS, f"{what} must have 1 to {MAX_OPERATIONS} operations")
    clean: list[list[Any]] = []
    for k, entry in enumerate(operations):
        need(
            isinstance(entry, list) and len(entry) >= 2 and isinstance(entry[0], str),
            f"{what}: operation {k} is malformed",
        )
        operator, *arguments = entry
        if operator in ("input", "const"):
            need(
                len(arguments) == 1 and isinstance(arguments[0], str), f"{what}: operation {k} needs one name or number"
            )
            if operator == "const":
                rational(arguments[0], what)
        else:
            need(operator in arity and len(arguments) == arity[operator], f"{what}: unknown operation {operator!r:.30}")
            arguments = [index(a, k, what) for a in arguments]
        clean.append([operator, *arguments])
    outputs = [index(o, len(clean), what) for o in program.get("outputs", [])]
    need(bool(outputs), f"{what} has no output")
    names = list(dict.fromkeys(arguments[0] for operator, *arguments in clean if operator == "input"))
    need(sorted(program["inputs"]) == sorted(names), f"{what} does not list the inputs that it has")
    return {"operations": clean, "outputs": outputs}


def index(value: Any, end: int, what: str) -> int:
    """A whole number in [0, end)."""
    need(
        isinstance(value, Fraction) and value.denominator == 1 and 0 <= value < end, f"{what}: an index is out of range"
    )
    return int(value)


def reads(program: dict[str, Any], outputs: Iterable[int] | None = None) -> set[str]:
    """Names of the inputs that some outputs depend on."""
    needed, names = set(program["outputs"] if outputs is None else outputs), set()
    for k in range(len(program["operations"]) - 1, -1, -1):
        if k in needed:
            operator, *arguments = program["operations"][k]
            if operator == "input":
                names.add(arguments[0])
            elif operator != "const":
                needed.update(arguments)
    return names


def only(program: dict[str, Any], outputs: list[int]) -> dict[str, Any]:
    """The program of some entries alone."""
    needed = set(outputs)
    for k in range(len(program["operations"]) - 1, -1, -1):
        operator, *arguments = program["operations"][k]
        if k in needed and operator not in ("input", "const"):
            needed.update(arguments)
    place = {old: new for new, old in enumerate(sorted(needed))}
    made = []
    for old in sorted(needed):
        operator, *arguments = program["operations"][old]
        made.append([operator, *(arguments if operator in ("input", "const") else (place[k] for k in arguments))])
    return {"operations": made, "outputs": [place[k] for k in outputs]}


# --- shape ---

#: Refuses a value at a place of the file that it does not fit.
Rule = Callable[[Any, str], None]


def entry_of(fixed: dict[str, Rule], optional: dict[str, Rule] | None = None) -> Rule:
    """An object with these keys, and none but them."""
    may = optional or {}

    def rule(value: Any, where: str) -> None:
        need(isinstance(value, dict), f"{where} must be an object")
        for key in value:
            need(key in fixed or key in may, f"unknown key {where}.{key!r:.40}")
        for key in fixed:
            need(key in value, f"{where}.{key} is missing")
        for key, part in value.items():
            (fixed.get(key) or may[key])(part, f"{where}.{key}")

    return rule


def named(part: Rule, largest: int = 64) -> Rule:
    """An object with names for keys."""

    def rule(value: Any, where: str) -> None:
        need(isinstance(value, dict) and len(value) <= largest, f"{where} must be an object of at most {largest}")
        for key, inner in value.items():
            need(all(NAME.fullmatch(word) for word in key.split(".")), f"a key of {where} must be a plain name")
            part(inner, f"{where}.{key}")

    return rule


def listed(part: Rule, low: int, high: int) -> Rule:
    """A list."""

    def rule(value: Any, where: str) -> None:
        good = isinstance(value, list) and low <= len(value) <= high
        need(good, f"{where} must list {low} to {high} entries" if low < high else f"{where} must list {low} entries")
        for k, inner in enumerate(value):
            part(inner, f"{where}[{k}]")

    return rule


def some(*words: str) -> Rule:
    """One of some words."""

    def rule(value: Any, where: str) -> None:
        need(isinstance(value, str) and value in words, f"{where} must be one of {', '.join(words)}: got {value!r:.40}")

    return rule


def maybe(part: Rule) -> Rule:
    """Null or a value."""

    def rule(value: Any, where: str) -> None:
        if value is not None:
            part(value, where)

    return rule


def plain_number(value: Any, where: str) -> None:
    """A JSON number."""
    need(isinstance(value, Fraction), f"{where} must be a number: got {value!r:.40}")


def positive(value: Any, where: str) -> None:
    """A number above zero."""
    need(isinstance(value, Fraction) and value > 0, f"{where} must be a number above 0: got {value!r:.40}")


def share(value: Any, where: str) -> None:
    """A number that is not negative."""
    need(isinstance(value, Fraction) and value >= 0, f"{where} must be a number from 0 on: got {value!r:.40}")


def whole(value: Any, where: str) -> None:
    """A whole number that is not negative."""
    good = isinstance(value, Fraction) and value.denominator == 1 and value >= 0
    need(good, f"{where} must be a whole number: got {value!r:.40}")


def ratio(value: Any, where: str) -> None:
    """An exact number, as text."""
    need(isinstance(value, str), f"{where} must be an exact number in a string: got {value!r:.40}")


def flag(value: Any, where: str) -> None:
    """True or false."""
    need(isinstance(value, bool), f"{where} must be true or false: got {value!r:.40}")


def text(value: Any, where: str) -> None:
    """A line of text."""
    need(isinstance(value, str) and len(value) <= 400, f"{where} must be a line of text")


def name(value: Any, where: str) -> None:
    """A plain identifier."""
    need(
        isinstance(value, str) and NAME.fullmatch(value) is not None, f"{where} must be a plain name: got {value!r:.40}"
    )


def unit(value: Any, where: str) -> None:
    """A unit and nothing else."""
    good = isinstance(value, str) and UNIT_TEXT.fullmatch(value) is not None
    need(good, f"{where} must be a unit: got {value!r:.40}")


def target(value: Any, where: str) -> None:
    """What a row tracks."""
    if isinstance(value, dict):
        need(len(value) <= 8, f"{where} has at most 8 signals")
        for key, share in value.items():
            for part in key.split("/", 1):
                name(part, where)
            plain_number(share, where)
    elif not isinstance(value, Fraction):
        some("reference", "zero", "balance")(value, where)


def operation(value: Any, where: str) -> None:
    """An operator with its arguments; `parsing` reads them."""
    need(isinstance(value, list) and 2 <= len(value) <= 3, f"{where} must be an operation")


def versions(value: Any, where: str) -> None:
    """Versions of packages by name."""
    need(isinstance(value, dict) and len(value) <= 32, f"{where} must be an object")
    for package, version in value.items():
        text(package, where)
        text(version, where)


def plain_text(value: Any) -> None:
    """Refuse control characters, lone surrogates and other text that a terminal does not print as it stands."""
    if isinstance(value, dict):
        for key, part in value.items():
            plain_text(key)
            plain_text(part)
    elif isinstance(value, list):
        for part in value:
            plain_text(part)
    elif isinstance(value, str) and not value.isprintable():
        raise UnreadableError(f"a text of the file is not plain text: {value!a:.60}")


# --- grammar ---

MODELLING = ("mechanics", "friction", "resistance", "back_emf", "decoupling", "flow")
RANGE = entry_of({}, dict.fromkeys(("value", "min", "max"), plain_number))
SOURCE = some("table", "derived", "public", "assumed")
HASH = text
PAIR = listed(plain_number, 2, 2)
TRIPLE = listed(plain_number, 3, 3)
LIMIT = entry_of({"value": positive, "unit": unit, "source": SOURCE})
STROKES = {key: PAIR for key in ("stroke_m", "stroke_rad", "stroke_m_s", "stroke_rad_s")}
CONSTANT = entry_of({"value": plain_number, "unit": unit, "tolerance": plain_number, "source": SOURCE, "meaning": text})
DRIVE = entry_of(
    {
        "parameters": named(CONSTANT),
        "limits": named(LIMIT),
    },
    {"ratings": named(LIMIT), "least_effectiveness": plain_number, "bundled": listed(text, 0, 64), **STROKES},
)  # fmt: skip
NOTHING = named(text, 0)
COURSE = listed(PAIR, 1, 1_000)
FAULT = entry_of(
    {"share": plain_number, "start_s": plain_number, "rate_1_s": plain_number, "stuck": listed(plain_number, 0, 2)},
    {"kind": some("actuator", "bias", "noise", "frozen", "blocked"), "size": plain_number},
)
SCENARIO = {
    "name": text, "disturbances": named(COURSE), "parameters": named(plain_number), "noise": plain_number,
    "bias": plain_number, "initial": plain_number, "quantisation": plain_number, "faults": named(FAULT),
}  # fmt: skip
GROUND = {"ground": named(COURSE)}
MOTION_LIMITS = entry_of(
    {},
    {**dict.fromkeys(("speed_m_s", "acceleration_m_s2", "jerk_m_s3"), plain_number),
     **dict.fromkeys(("torque_nm", "current_a", "voltage_v"), plain_number),
     **dict.fromkeys(("speed", "acceleration", "jerk"), listed(plain_number, 1, MAX_MEMBERS))},
)  # fmt: skip

REQUIREMENTS = (
    "settling_time_s", "peak_torque_nm", "rms_torque_nm", "peak_current_a", "rms_current_a", "peak_voltage_v",
)  # fmt: skip
STUDY = entry_of(
    {
        "study": entry_of({"name": text, "publication": text, "summary": text}),
        "plant": entry_of(
            {"model": text, "parameters": NOTHING, "ratings": NOTHING, "limits": NOTHING,
             "joints": named(DRIVE, MAX_MEMBERS), "locked": named(plain_number)},
            {"body": named(CONSTANT), "shared": named(LIMIT),
             "level": name, "sensor": name, "urdf": text, "tip_m": TRIPLE, "least_lever_m_rad": plain_number},
        ),
        "uncertainty": entry_of({
            "disturbances": named(entry_of({"range": PAIR, "course": some("constant", "any"), "unit": unit},
                                           {"rate": positive}), 8),
            "noise": named(plain_number), "initial": named(plain_number),
        }, {"resolution": named(plain_number)}),
        "reference": entry_of(
            {"kind": some("quintic", "bspline"), "coordinates": some("members"),
             "waypoints": listed(listed(plain_number, 1, MAX_MEMBERS), 2, 50),
             "durations_s": listed(plain_number, 0, 49), "dwell_s": plain_number, "objective": some("time", "energy"),
             "pace": positive, "jerk_weight": share, "longest_s": positive, "spans": whole},
            {"limits": MOTION_LIMITS},
        ),
        "controller": entry_of(
            {"law": text, "modelling": listed(some(*MODELLING), 0, 8), "rate_hz": plain_number,
             "rates_hz": named(plain_number), "delay_s": share,
             "gains": NOTHING, "members": named(named(RANGE))},
            {"observer": entry_of({}, {"bandwidth_rad_s": plain_number}), "jitter_s": positive,
             "monitor": entry_of({"error": positive, "limits": named(PAIR)})},
        ),
        "requirements": entry_of(
            {"tracking_error_m": plain_number, "member_error": named(plain_number)},
            dict.fromkeys((*REQUIREMENTS, "settling_band_m"), positive),
        ),
        "tuning": entry_of(
            {"method": some("jaya", "tlbo", "random", "gradient"), "population": whole, "iterations": whole,
             "seed": whole,
             "weights": entry_of(dict.fromkeys(("rms_error", "certified_bound", "itae", "effort"), share))},
            {"seconds": positive},
        ),
        "validation": entry_of({"transient_s": plain_number, "monte_carlo": whole, "falsify": whole,
                                "worst_case": flag, "scenarios": listed(entry_of(SCENARIO, GROUND), 1, 200)}),
        "sha256": HASH,
    }
)  # fmt: skip
PROGRAM = entry_of({"inputs": listed(text, 0, 200), "operations": listed(operation, 1, MAX_OPERATIONS),
                    "outputs": listed(whole, 1, 64)})  # fmt: skip
EXACT = listed(ratio, 1, MAX_ROWS)
MIDDLE: dict[str, Rule] = dict.fromkeys(("force", "drive"), listed(EXACT, 1, MAX_ROWS))
CERTIFICATE = entry_of(
    {"kind": text, "half_widths": EXACT, "input_bound": EXACT,
     "networks": listed(entry_of(dict.fromkeys(("row", "low", "high", "middle", "bound"), ratio) | {"row": name}),
                        0, MAX_ROWS),
     "split": listed(whole, 1, MAX_ROWS),
     "cells": listed(entry_of({"columns": listed(listed(ratio, 1, MAX_ORDER), 1, MAX_ORDER),
                               "blocks": listed(whole, 1, MAX_ORDER), "groups": listed(whole, 1, MAX_GROUPS),
                               "growth": ratio}, MIDDLE), 1, MAX_CELLS),
     "envelope": entry_of({"rate": ratio, "ultimate": EXACT})},
    dict.fromkeys(("guarantee", "observed"), listed(ratio, 3, 3)) | MIDDLE | {
        "parts": named(whole, MAX_ROWS), "lags": listed(name, 1, MAX_ROWS),
    },
)  # fmt: skip
MEMBER = entry_of(
    {
        "name": name,
        "model": entry_of({
            "rows": listed(entry_of({"state": name, "unit": unit, "target": target, "controlled": flag}), 1, MAX_ROWS),
            "input_map": listed(whole, 1, MAX_ROWS), "inputs": listed(name, 1, MAX_ROWS), "plant": PROGRAM,
            "law": listed(PROGRAM, 1, MAX_ROWS),
            "limits": listed(entry_of({"name": name, "signals": listed(name, 1, MAX_ROWS)}), 1, 16),
            "first": some("position", "speed"),
            "outputs": named(entry_of({"unit": unit, "program": PROGRAM}), 8),
        }, {"leads": whole}),
        "nominal": named(plain_number),
        "gains": listed(entry_of({"name": name, "value": plain_number, "unit": text, "min": plain_number,
                                  "max": plain_number, "meaning": text}), 1, 64),
        "assumptions": listed(entry_of({"name": text, "lower": plain_number, "upper": plain_number, "unit": unit,
                                        "source": text}), 1, 128),
        "reference": entry_of({
            "segments": listed(entry_of({"degree": whole, "knots": listed(plain_number, 12, MAX_COEFFICIENTS + 6),
                                         "coefficients": listed(plain_number, 6, MAX_COEFFICIENTS)}), 1, 200),
            "derivative_bounds": listed(entry_of({"name": name, "unit": unit, "lower": plain_number,
                                                  "upper": plain_number}), 4, 4),
            "sha256": HASH,
        }),
        "certificate": CERTIFICATE,
        "golden": listed(entry_of(
            dict.fromkeys(("x", "r", "theta", "phi", "u", "theta_next", "phi_next"), listed(plain_number, 1, MAX_ROWS)),
            {"load": listed(plain_number, 1, 1),
             **dict.fromkeys(("lead", "lead_next"), listed(plain_number, 1, MAX_LEADS * MAX_ROWS))}), 20, 100),
    },
    {"observer": entry_of({"first": plain_number, "second": plain_number})},
)  # fmt: skip
COUPLING = entry_of({"members": listed(name, 1, MAX_MEMBERS), "loads": PROGRAM, "place": PROGRAM, "halvings": whole,
                     "envelope": entry_of({"output": ratio})})  # fmt: skip
OBLIGATION = entry_of(
    {"name": text, "member": text, "verdict": some("proved")}, {"statement": text, "margin": plain_number, "unit": text}
)
RECORDED = maybe(plain_number)
FIGURES = entry_of({
    **dict.fromkeys(("maximum_error_m", "largest_error_m", "rms_error_m", "settling_time_s", "itae", "limit_use",
                     "diverged_s"), RECORDED),
    "members": named(entry_of({
        **dict.fromkeys(("largest_error", "maximum_error", "rms_error", "limit_use", "peak_input", "energy_j"),
                        RECORDED),
        "peaks": named(RECORDED), "rms": named(RECORDED), "estimates": listed(RECORDED, 0, 2),
    }, {"travel": RECORDED})),
}, {"met_use": RECORDED, "spread": RECORDED, "stopped_s": RECORDED})  # fmt: skip
VALIDATION = entry_of({
    "requirements": listed(entry_of({"name": text, "required": plain_number, "simulated": plain_number,
                                     "certified": maybe(plain_number)}), 1, 32),
    "scenarios": listed(entry_of({"name": text, "figures": FIGURES}), 1, 200),
    "worst_case": maybe(entry_of({"scenario": entry_of({**SCENARIO, "seed": whole}, GROUND), "figures": FIGURES})),
    "monte_carlo": maybe(entry_of({"runs": whole, "met": whole})),
    "simulated_runs": whole, "integration_error_m": plain_number, "largest_error_m": plain_number,
    "largest_error_after_transient_m": plain_number,
    "members": named(entry_of(
        {"largest_error": plain_number, "largest_error_after_transient": plain_number, "unit": unit},
        {"estimates": listed(plain_number, 2, 2)})),
})  # fmt: skip
PROVENANCE = entry_of(
    {}, {"versions": versions, "seed": whole, "budget": some("quick", "full"), "evaluations": whole,
         "search_runs": whole, "wall_time_s": plain_number, "threads": whole, "cpus": maybe(whole)},
)  # fmt: skip
FILE = entry_of({
    "schema": text, "study": STUDY, "members": listed(MEMBER, 1, MAX_MEMBERS), "couplings": listed(COUPLING, 0, 1),
    "obligations": listed(OBLIGATION, 0, 200), "validation": VALIDATION, "provenance": PROVENANCE, "sha256": HASH,
})  # fmt: skip


def shaped(data: dict[str, Any]) -> None:
    """Refuse a file with any other keys or kinds of values."""
    plain_text(data)
    FILE(data, "file")


# --- claim ---

@dataclass(frozen=True)
class Gain:
    """Gains of one controlled row and times of its leads, as intervals; bound and start of its network, as numbers."""

    beta: Interval
    epsilon: Interval
    delta: Interval
    sigma: Interval
    gamma: Interval
    lead: Interval
    smooth: Interval
    capacity: Fraction
    preload: Fraction


@dataclass(frozen=True)
class Cell:
    """What a file says of the loop for a part of the ranges: middles of J and B, coordinates, groups, weight."""

    force: list[list[Fraction]]
    drive: list[list[Fraction]]
    columns: list[list[Fraction]]
    blocks: list[int]
    groups: list[int]
    growth: Fraction


@dataclass(frozen=True)
class Claim:
    """Everything that the checker reads from a file."""

    name: str
    rows: list[dict[str, Any]]
    input_map: list[int]
    inputs: list[str]
    plant: dict[str, Any]
    law: list[dict[str, Any]]
    parameters: dict[str, Interval]
    disturbances: dict[str, Interval]
    nominal: dict[str, Fraction]
    reference: list[Interval]
    noise: list[Fraction]
    initial: list[Fraction]
    period: Fraction
    delay: Fraction
    gains: list[tuple[Fraction, ...]]
    split: list[int]
    cells: list[Cell]
    half_widths: list[Fraction]
    input_bound: list[Fraction]
    demand: list[Interval]
    middle: list[Fraction]
    network_bound: list[Fraction]
    ultimate: list[Fraction]
    limits: list[dict[str, Any]]
    stroke: Interval
    accuracy: Fraction
    transient: Fraction
    feedforward: dict[str, tuple[Interval, Interval]] = field(default_factory=dict)
    first: str = "position"
    rest: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))
    observer: tuple[Fraction, ...] = ()
    jitter: Fraction = Fraction(0)
    shown: list[Fraction] = field(default_factory=list)
    leads: int = 0
    parts: dict[str, int] = field(default_factory=dict)
    lags: list[int] = field(default_factory=list)

    @property
    def measured(self) -> list[Fraction]:
        """Bounds on the errors of what the controller knows of the states: measured, or by an observer."""
        return [*self.shown[:2], *self.noise[2:]] if self.observer else self.noise

    @property
    def controlled(self) -> list[int]:
        """Indices of the rows with gains."""
        return [i for i, row in enumerate(self.rows) if row["controlled"]]

    @property
    def networks(self) -> list[int]:
        """Indices of the rows with a load network."""
        return [i for i, gain in zip(self.controlled, self.gains, strict=True) if gain[4] > 0]

    def places_of_leads(self, row: int) -> list[int]:
        """Which of all sections of lead act on the error of a row; those of an input stand together."""
        if row not in self.input_map:
            return []
        first = self.leads * self.input_map.index(row)
        return list(range(first, first + self.leads))

    @property
    def whole(self) -> int:
        """Whole periods of the computing delay."""
        return int(self.delay / self.period)

    @property
    def share(self) -> Fraction:
        """The rest of the delay as a share of the period."""
        return self.delay / self.period - self.whole

    @property
    def pending(self) -> int:
        """Samples whose inputs are still to act."""
        return self.whole + (self.share > 0 or self.jitter > 0)


def cell_of(entry: dict[str, Any], middle: dict[str, Any], n: int, m: int) -> Cell:
    """One cell of a certificate of n rows and m inputs; how large it must be is decided where the loop is built.

    The middles of J and B are in `middle`, an entry that all cells may share.
    """
    columns = entry["columns"]
    need(isinstance(columns, list) and 1 <= len(columns) <= MAX_ORDER, f"coordinates are of 1 to {MAX_ORDER} states")
    blocks = [index(v, MAX_BLOCK + 1, "a block") for v in entry["blocks"]]
    need(min(blocks) >= 1 and sum(blocks) == len(columns), "the blocks do not cover the coordinates")
    groups = [index(v, MAX_GROUP + 1, "a group of periods") for v in entry["groups"]]
    need(1 <= len(groups) <= MAX_GROUPS and min(groups) >= 1, f"1 to {MAX_GROUPS} groups of periods are summed")
    growth = number(entry["growth"], "growth")
    need(growth >= 1, "the weight of a period is 1 or more")
    force, drive = (
        [numbers(row, size, key) for row in listed_of(middle[key], n, key)]
        for key, size in (("force", n), ("drive", m))
    )
    return Cell(force, drive, [numbers(row, len(columns), "coordinates") for row in columns], blocks, groups, growth)


def listed_of(value: Any, count: int, what: str) -> list[Any]:
    """A list of a given length."""
    need(isinstance(value, list) and len(value) == count, f"{what} must have {count} rows")
    return value


# --- reference ---

#: What a piece of a spline costs, in products.
PIECE_COST = 200


def reference_bounds(reference: dict[str, Any]) -> list[Interval]:
    """Position … jerk of the splines, from their control points; refuses jumps and a moving end."""
    hulls: list[list[Fraction]] = [[], [], [], []]
    previous: list[Fraction] | None = None
    clock = Fraction(0)
    need(isinstance(reference["segments"], list) and len(reference["segments"]) > 0, "the reference has no segment")
    for segment in reference["segments"]:
        count = len(segment["coefficients"])
        need(segment["degree"] == 5 and 6 <= count <= MAX_COEFFICIENTS, "a segment is a spline of degree 5")
        knots = numbers(segment["knots"], count + 6, "knots")
        points = numbers(segment["coefficients"], count, "coefficients")
        need(knots[0] == knots[5] and knots[-1] == knots[-6], "a segment's knots must be clamped")
        need(knots == sorted(knots), "knots must not decrease")
        need(all(a < b for a, b in pairwise(knots[5 : count + 1])), "inner knots must increase")
        need(knots[0] == clock, "the segments must follow each other in time, from 0 on")
        clock = knots[-1]
        ends: list[tuple[Fraction, Fraction]] = []
        for order in range(4):
            hulls[order] += points
            ends.append((points[0], points[-1]))
            degree = 5 - order
            points = [
                degree * (b - a) / (knots[j + degree + 1] - knots[j + 1]) for j, (a, b) in enumerate(pairwise(points))
            ]
            knots = knots[1:-1]
        need(previous is None or previous == [e[0] for e in ends[:3]], "the reference jumps between segments")
        previous = [e[1] for e in ends[:3]]
    need(previous is not None and previous[1] == previous[2] == 0, "the reference must end at rest")
    for hull, stated in zip(hulls, reference["derivative_bounds"], strict=True):
        room = Fraction(1, 10**8) * max(map(abs, hull))
        low, high = number(stated["lower"], "a bound") - room, number(stated["upper"], "a bound") + room
        close = low <= min(hull) <= low + 2 * room and high - 2 * room <= max(hull) <= high
        need(close, "the stated derivative bounds are not those of the splines")
    at_rest = [[], *([Fraction(0)] for _ in range(3))]
    return [(min(h + zero), max(h + zero)) for h, zero in zip(hulls, at_rest, strict=True)]


def ranges_on(
    knots: list[Fraction], points: list[Fraction], span: int, ends: tuple[Fraction, Fraction]
) -> list[Interval]:
    """Hulls of the Bezier points of position … jerk of a spline on a part of a span, by blossoms (Ramshaw 1989)."""
    WORK.one(PIECE_COST)
    degree = 5
    curve = [
        blossom(knots, points, span, [ends[0]] * (degree - k) + [ends[1]] * k) for k in range(degree + 1)
    ]  # fmt: skip
    found = []
    for order in range(4):
        found.append((down(min(curve)), up(max(curve))))
        curve = [(degree - order) * (b - a) / (ends[1] - ends[0]) for a, b in pairwise(curve)]
    return found


def blossom(knots: list[Fraction], points: list[Fraction], span: int, arguments: list[Fraction]) -> Fraction:
    """The symmetric multi-affine form of a spline's piece."""
    degree = len(arguments)
    values = points[span - degree : span + 1]
    for level, t in enumerate(arguments):
        following = []
        for j in range(degree - level):
            first = knots[span - degree + level + 1 + j]
            last = knots[span + 1 + j]
            share = (t - first) / (last - first)
            following.append(values[j] + share * (values[j + 1] - values[j]))
        values = following
    return values[0]


# --- statement ---

#: Meaning of a gain by its kind.
MEANINGS = {
    "beta": "proportional gain", "epsilon": "adaptation gain", "delta": "adaptation rate",
    "sigma": "leakage of the adaptation", "gamma": "gain of the load network",
    "phi": "largest estimate of the load network", "preload": "estimate of the load network at the start",
}  # fmt: skip
#: The same of the leads of an input.
TIMES = {"lead": "time of each section of lead", "smooth": "time of their filters"}
#: Key of a stroke by the unit of the first state.
STROKE = {"m": "stroke_m", "rad": "stroke_rad", "m/s": "stroke_m_s", "rad/s": "stroke_rad_s"}


def stroke_of(section: dict[str, Any], unit: str) -> Any:
    """The range of the first state, in its unit."""
    need(unit in STROKE, f"the first state must be in {', '.join(STROKE)}: got {unit!r:.20}")
    given = [key for key in STROKE.values() if key in section]
    need(given == [STROKE[unit]], f"the study must give {STROKE[unit]}, and no other stroke")
    return section[STROKE[unit]]


def consistent(data: dict[str, Any], entry: dict[str, Any], claim: Claim) -> None:
    """Refuse facts about a member that contradict each other."""
    study = data["study"]
    section = study["plant"]["joints"][claim.name]
    units = {row["state"]: row["unit"] for row in claim.rows}
    _units(claim, units)
    _nominal(claim, section, study)
    _assumed(entry, claim, study, section, units)
    _gains(entry, claim, units)
    _terms(claim, study)
    _bundled(section)
    derivatives, own = ["", "/s", "/s^2", "/s^3"], claim.rows[0]["unit"].removesuffix("/s")
    first = 1 if claim.rows[0]["unit"].endswith("/s") else 0
    names = ("position", "speed", "acceleration", "jerk")
    for k, bound in enumerate(entry["reference"]["derivative_bounds"]):
        unit = own + [*derivatives, "/s^4"][first + k]
        need((bound["name"], bound["unit"]) == (names[k], unit), f"derivative {k} of the reference is in {unit}")


def _units(claim: Claim, units: dict[str, str]) -> None:
    """A limit is in the unit of what it limits; a rate in that of what it is the rate of."""
    amplitude = claim.limits[0]["unit"]
    for limit in claim.limits:
        for signal in limit["signals"]:
            need(
                limit["unit"] == units.get(signal, amplitude),
                f"the limit on {limit['name']} has the unit of no {signal}",
            )
    for row in claim.rows:  # a lag carries out what is commanded
        if row["target"] in claim.input_map:
            need(row["unit"] == amplitude, f"the input must be in the unit of {row['state']}, {row['unit']}")
    first, second = claim.rows[0], claim.rows[1] if len(claim.rows) > 1 else None
    if claim.first == "position" and second is not None:
        need(second["unit"] == f"{first['unit']}/s", f"{second['state']} must be in {first['unit']}/s")
    fits = first["unit"].endswith("/s") == (claim.first == "speed")
    need(fits, f"a {claim.first} cannot be in {first['unit']}")


def _nominal(claim: Claim, section: dict[str, Any], study: dict[str, Any]) -> None:
    """What the law takes for the plant are the study's values; for a load, one of its range."""
    for name, value in claim.nominal.items():
        if name in section["parameters"]:
            stated = number(section["parameters"][name]["value"], name)
            need(value == stated, f"the nominal value of {name} is not the study's")
        elif name in claim.parameters:
            low, high = claim.parameters[name]
            need(low <= value <= high, f"the nominal value of {name} is outside its range")
        else:
            given = study["uncertainty"]["disturbances"].get(name)
            low, high = claim.disturbances[name] if given is None else [number(v, name) for v in given["range"]]
            unknown = given is None and value == 0  # the load of a coupling that the law does not know
            need(unknown or low <= value <= high, f"the nominal value of {name} is outside its range")


def _assumed(
    entry: dict[str, Any], claim: Claim, study: dict[str, Any], section: dict[str, Any], units: dict[str, str]
) -> None:
    """Units and sources of the assumptions."""
    load = {name: d["unit"] for name, d in study["uncertainty"]["disturbances"].items()}
    for given in entry["assumptions"]:
        kind, _, name = given["name"].partition(".")
        stated = section["parameters"].get(name)
        if kind == "parameter" and stated is not None:
            wanted = stated["unit"], stated["source"]
        elif kind == "parameter":  # effectiveness, or a member's own part of the inertia of a machine's bodies
            wanted = ("1", given["source"]) if name not in CARRIED else (given["unit"], "derived")
            need(given["source"] in ("derived", "assumed"), f"{given['name']} has another source")
        elif kind in ("noise", "initial"):
            wanted = units[name], "study"
        elif kind == "feedforward_rate":
            own = next(e["unit"] for e in entry["assumptions"] if e["name"] == f"feedforward.{name}")
            wanted = f"{own}/s", "study"
        else:
            wanted = load.get(name, given["unit"]), "study"
        need((given["unit"], given["source"]) == wanted, f"{given['name']} must be in {wanted[0]}, source {wanted[1]}")


def _gains(entry: dict[str, Any], claim: Claim, units: dict[str, str]) -> None:
    """Units and meanings of the gains: β maps Q to what the row asks for, ε θ̂ has the unit of β."""
    order = [f"{kind}_{k + 1}" for k in range(len(claim.controlled)) for kind in MEANINGS]
    led = [k for k, row in enumerate(claim.controlled) if claim.leads and row in claim.input_map]
    order += [f"{kind}_{k + 1}" for k in led for kind in TIMES]
    need([gain["name"] for gain in entry["gains"]] == order, "the gains stand in another order")
    for gain in entry["gains"]:
        kind, _, place = gain["name"].partition("_")
        row = claim.controlled[int(place) - 1]
        state = claim.rows[row]["state"]
        following = [units[r["state"]] for r in claim.rows if r["target"] == row]
        control = following[0] if following else claim.limits[0]["unit"]
        ratio = f"({control})/({units[state]})"
        unit = {"beta": ratio, "epsilon": f"sqrt({ratio}/s)/({units[state]})", "delta": "1", "sigma": "1/s",
                "gamma": f"{ratio}/s", "phi": control, "preload": control}.get(kind, "s")  # fmt: skip
        need(gain["unit"] == unit, f"{gain['name']} must be in {unit}")
        meaning = f"{ {**MEANINGS, **TIMES}[kind] } of subsystem {place} ({state})"
        need(gain["meaning"] == meaning, f"{gain['name']} means something else")


def _terms(claim: Claim, study: dict[str, Any]) -> None:
    """A law without modelling terms knows nothing but the rate of its reference."""
    modelling = study["controller"]["modelling"]
    need(len(set(modelling)) == len(modelling), "a modelling term stands twice")
    need(all(NAME.fullmatch(term) for term in modelling), "a modelling term must be a plain name")
    known = any(read.startswith("nominal.") for term in claim.law for read in reads(term))
    need(not modelling or known, "the study names modelling terms, and the law models nothing")
    for k, term in enumerate(claim.law if not modelling else []):
        allowed = {"r1"} if k == 0 and claim.first == "position" else set()
        need(reads(term) <= allowed, "the law models something, and the study names no modelling term")


def _runs(data: dict[str, Any], certified: dict[str, Fraction]) -> None:
    """Recorded runs without a fault are sound, inside what is proved, and no worse than what is said to be met."""
    study, shown = data["study"]["validation"], data["validation"]
    told = {row["name"]: row["simulated"] for row in shown["requirements"]}
    runs = [r["figures"] for s, r in zip(study["scenarios"], shown["scenarios"], strict=True) if not s["faults"]]
    runs = [run_ for run_ in runs if "met_use" not in run_ or run_["met_use"] is None or run_["met_use"] <= 1]
    runs += [shown["worst_case"]["figures"]] if shown["worst_case"] is not None else []
    for run_ in runs:
        need(run_["diverged_s"] is None and run_["maximum_error_m"] is not None, "a recorded run was lost")
        need(0 <= run_["maximum_error_m"] <= certified["tracking_error_m"], "a recorded run passes what is proved")
        need(
            run_["maximum_error_m"] <= run_["largest_error_m"] <= shown["largest_error_m"],
            "a record is not the largest",
        )
        need(0 <= run_["limit_use"] <= 1, "a recorded run passes a limit")
        for name, own in run_["members"].items():
            need(name in shown["members"], "records are of the members")
            limit = next(iter(data["study"]["plant"]["joints"][name]["limits"].values()))["value"]
            need(
                own["peak_input"] is not None and own["peak_input"] <= limit * (1 + MET),
                "a recorded input passes its limit",
            )
            for key, value in own.items():
                if isinstance(value, Fraction) and key != "energy_j":
                    need(value >= 0, f"{key} must not be negative")
            for group, before in (("peaks", "peak"), ("rms", "rms")):
                for output, unit in (("torque", "nm"), ("current", "a")):
                    met, value = told.get(f"{before}_{output}_{unit}"), own[group].get(output)
                    if met is not None and value is not None and rotary(data, name, output):
                        need(value <= met, f"a recorded run passes {before}_{output}_{unit}")


def rotary(data: dict[str, Any], name: str, output: str) -> bool:
    """Whether a member's torque is in N m: that of a sliding joint is a force, and no requirement on torque."""
    rows = next(entry["model"]["rows"] for entry in data["members"] if entry["name"] == name)
    limit = next(iter(data["study"]["plant"]["joints"][name]["limits"].values()))
    return output == "current" or any(row["unit"] == "N m" for row in rows) or limit["unit"] in ("N m", "V")


def _bundled(section: dict[str, Any]) -> None:
    """What a study left to the bundled machine is named once, and there."""
    given = section.get("bundled", [])
    known = {*section["parameters"], *section.get("ratings", {}), *(f"{name} limit" for name in section["limits"])}
    known |= {f"{name} tolerance" for name in section["parameters"]}
    need(
        len(set(given)) == len(given) and set(given) <= {*known, "stroke"}, "bundled names what the study does not have"
    )


def met(data: dict[str, Any], certified: dict[str, Fraction]) -> None:
    """Refuse requirements that are not the study's or not met, and records that the proof excludes.

    Args:
        data: The file.
        certified: What is proved, by the name of the requirement.
    """
    kept = ("member_error", "settling_band_m")
    wanted = {key: value for key, value in data["study"]["requirements"].items() if key not in kept}
    if len(data["members"]) > 1:
        wanted |= {f"member_error.{k}": v for k, v in data["study"]["requirements"]["member_error"].items()}
    rows = data["validation"]["requirements"]
    need([row["name"] for row in rows] == list(wanted), "the requirements are not those of the study")
    for row in rows:
        name, limit, seen = row["name"], number(row["required"], "required"), number(row["simulated"], "simulated")
        need(limit == number(wanted[name], name), f"{name} is required otherwise in the study")
        need(0 <= seen <= limit, f"{name} is not met by the recorded runs")
        if name in certified:
            need(row["certified"] is not None, f"{name} is proved, and the file does not say so")
            told = number(row["certified"], "certified")
            need(certified[name] <= told <= limit, f"{name} states another bound than is proved")
            need(seen <= told, f"a recorded run passes what is proved of {name}")
        else:
            need(row["certified"] is None, f"{name} is stated as proved, and is not")
    _records(data, certified)


def _records(data: dict[str, Any], certified: dict[str, Fraction]) -> None:
    """Records that the proof excludes, or that contradict each other."""
    shown, study = data["validation"], data["study"]
    late = number(shown["largest_error_after_transient_m"], "largest_error_after_transient_m")
    need(
        0 <= late <= number(shown["largest_error_m"], "largest_error_m"), "an error after the transient is the largest"
    )
    need(late <= certified["tracking_error_m"], "a recorded run passes what is proved of the output")
    need(set(shown["members"]) == {entry["name"] for entry in data["members"]}, "records are of the members")
    for entry in data["members"]:
        own = shown["members"][entry["name"]]
        need(own["unit"] == entry["model"]["rows"][0]["unit"], "a record is in the unit of its member")
        ends = [number(own[key], key) for key in ("largest_error_after_transient", "largest_error")]
        need(0 <= ends[0] <= ends[1], "an error after the transient is larger than the largest")
        bound = certified.get(f"member_error.{entry['name']}", certified["tracking_error_m"])
        need(ends[0] <= bound, f"a recorded run passes what is proved of {entry['name']}")
        watched = study["controller"].get("observer") is not None
        need(("estimates" in own) == watched, "estimates are recorded where there is an observer, and only there")
        for seen, bound in zip(own.get("estimates", []), entry["certificate"].get("observed", []), strict=False):
            inside = number(seen, "an estimate") <= number(bound, "observed")
            need(inside, f"a recorded estimate of {entry['name']} passes what is proved")
    names = [scenario["name"] for scenario in study["validation"]["scenarios"]]
    need([run["name"] for run in shown["scenarios"]] == names, "the recorded scenarios are not those of the study")
    _runs(data, certified)
    drawn, asked = shown["monte_carlo"], study["validation"]
    need(drawn is None or drawn["met"] == drawn["runs"], "a random run missed a requirement")
    need(bool(asked["monte_carlo"]) <= (drawn is not None), "the study asks for random runs, and none are recorded")
    need(
        asked["worst_case"] <= (shown["worst_case"] is not None),
        "the study asks for a worst case, and none is recorded",
    )
    count = drawn["runs"] if drawn is not None else 0
    need(count <= shown["simulated_runs"], "more random runs are recorded than runs")
    need(number(shown["integration_error_m"], "integration_error_m") >= 0, "an error must not be negative")


# --- structure ---

def well_formed(claim: Claim) -> None:
    """Refuse a model whose states are not what their names, units and limits say."""
    _kinematic(claim)
    _connected(claim)
    units = {row["state"]: row["unit"] for row in claim.rows}
    for limit in claim.limits[1:]:
        alike = {state for state, unit in units.items() if unit == limit["unit"]}
        limited = {
            signal for other in claim.limits[1:] if other["unit"] == limit["unit"] for signal in other["signals"]
        }
        need(limited == alike, f"the limits in {limit['unit']} must be about every state in {limit['unit']}")


def _kinematic(claim: Claim) -> None:
    """The second state is the rate of a first position, and the law knows that of the reference."""
    if claim.first == "speed" or len(claim.rows) == 1:
        return
    operations, outputs = claim.plant["operations"], claim.plant["outputs"]
    one = operations[outputs[0]][0] == "const" and float(operations[outputs[0]][1]) == 1.0
    kinematic = operations[outputs[len(claim.rows)]] == ["input", claim.rows[1]["state"]]
    need(kinematic and one, f"{claim.name}: the first state's rate is not the second state")
    need(claim.rows[1]["target"] == 0, f"{claim.name}: the second state does not follow the first")
    term = claim.law[0]
    rate = term["operations"][term["outputs"][0]] == ["input", "r1"]
    need(rate, f"{claim.name}: the first modelling term is not the reference's rate")


def _connected(claim: Claim) -> None:
    """Every state moves the first one, by way of others or itself."""
    n, states = len(claim.rows), [row["state"] for row in claim.rows]
    read = [reads(claim.plant, [claim.plant["outputs"][n + i]]) for i in range(n)]
    reached, fresh = {0}, [0]
    while fresh:
        row = fresh.pop()
        more = [j for j in range(n) if states[j] in read[row] and j not in reached]
        reached.update(more)
        fresh += more
    lost = [states[j] for j in range(n) if j not in reached]
    need(not lost, f"nothing depends on the state {', '.join(lost)}")


def different(vectors: list[dict[str, Any]], claim: Claim) -> None:
    """Refuse golden vectors that repeat each other in what the law reads, or that never move a result."""
    named = {name for term in claim.law for name in reads(term)} | {"r0"}
    kept = [k for k in range(4) if f"r{k}" in named]
    seen = {
        (tuple(v["x"]), tuple(v["r"][k] for k in kept), tuple(v["theta"]), tuple(v["phi"]), tuple(v.get("lead", ())))
        for v in vectors
    }
    need(len(seen) == len(vectors), "golden vectors must differ in what the law reads")
    need(len({tuple(v["u"]) for v in vectors}) > len(vectors) // 2, "golden vectors must move the input")


# --- course ---

def follows(data: dict[str, Any], entry: dict[str, Any], claim: Claim, which: int) -> None:
    """Refuse a reference that is not the study's.

    Args:
        data: The file.
        entry: The entry of a member.
        claim: The statement about it.
        which: Its place among the members.
    """
    section = data["study"]["reference"]
    count = len(data["members"])
    places = [numbers(place, count, "a waypoint")[which] for place in section["waypoints"]]
    pause, pace = number(section["dwell_s"], "dwell_s"), number(section["pace"], "pace")
    need(0 < pace <= 1 and pause >= 0, "the pace must be in (0, 1], a pause not negative")
    segments = entry["reference"]["segments"]
    moves = segments[1::2] if pause > 0 else segments
    still = segments[::2] if pause > 0 else []
    need(len(moves) == len(places) - 1, f"the reference must make {len(places) - 1} moves: got {len(moves)}")
    need(not pause or len(still) == len(places), "the reference must rest before, between and after its moves")
    for segment, place in zip(still, places, strict=False):
        knots, points = _of(segment)
        need(_close(knots[-1] - knots[0], pause), f"the reference must rest for {float(pause):g} s")
        need(len(set(points)) == 1 and _close(points[0], place), f"the reference must rest at {float(place):g}")
    durations = section["durations_s"]
    timed = section["kind"] == "quintic" or section["objective"] == "energy"
    need(len(durations) == (len(moves) if timed else 0), "the study does not give the durations of the moves")
    for k, segment in enumerate(moves):
        knots, points = _of(segment)
        need(_close(points[0], places[k]) and _close(points[-1], places[k + 1]), f"move {k + 1} misses its waypoints")
        at_rest = points[0] == points[1] == points[2] and points[-1] == points[-2] == points[-3]
        need(at_rest, f"move {k + 1} is not from rest to rest")
        need(section["kind"] != "quintic" or _quintic(knots, points), f"move {k + 1} is not a quintic")
        lasted = (knots[-1] - knots[0]) * pace
        if timed:
            need(
                _close(lasted, number(durations[k], "a duration")), f"move {k + 1} lasts another time than the study's"
            )
        else:
            need(lasted <= number(section["longest_s"], "longest_s") * (1 + MET), f"move {k + 1} lasts too long")
    lasted = number(segments[-1]["knots"][-1], "a knot")
    need(claim.transient < lasted, "the transient outlasts the reference")
    _limited(section, claim, segments, which, count if data["couplings"] else 1)


def _of(segment: dict[str, Any]) -> tuple[list[Fraction], list[Fraction]]:
    count = len(segment["coefficients"])
    return numbers(segment["knots"], count + 6, "knots"), numbers(segment["coefficients"], count, "coefficients")


def _close(value: Fraction, wanted: Fraction) -> bool:
    return abs(value - wanted) <= MET * abs(wanted) + FLOOR


def _quintic(knots: list[Fraction], points: list[Fraction]) -> bool:
    """Whether the control points are those of 10 s³ - 15 s⁴ + 6 s⁵: its symmetric multi-affine form at the knots."""
    begin, lasted, way = knots[0], knots[-1] - knots[0], points[-1] - points[0]
    for k, point in enumerate(points):
        sums = [Fraction(1), *[Fraction(0)] * 5]  # elementary symmetric polynomials of five knots
        for knot in knots[k + 1 : k + 6]:
            share = (knot - begin) / lasted
            sums = [sums[0], *(now + share * before for before, now in pairwise(sums))]
        if abs(points[0] + way * (sums[3] - 3 * sums[4] + 6 * sums[5]) - point) > MET * abs(way):
            return False
    return True


def _limited(section: dict[str, Any], claim: Claim, segments: list[dict[str, Any]], which: int, count: int) -> None:
    """The study's limits on speed, acceleration and jerk: by control points, or where these pass them by spans."""
    given = section.get("limits")
    if given is None:
        return
    first = 1 if claim.first == "position" else 0
    single = {"speed_m_s": first, "acceleration_m_s2": first + 1, "jerk_m_s3": first + 2}
    each = {"speed": 1, "acceleration": 2, "jerk": 3}
    wrong = sorted(set(given) & set(each if count == 1 else single))
    need(not wrong, f"reference.limits.{'; '.join(wrong)} has no place in this machine")
    need(count == 1 or claim.first == "position", "the limits of several members are those of positions")
    for key, order in (single if count == 1 else each).items():
        if key not in given:
            need(count > 1, f"reference.limits.{key} is missing")
            continue
        limit = number(given[key], key) if count == 1 else numbers(given[key], count, key)[which]
        need(limit > 0, f"{key} must be positive")
        if not _inside(claim.reference[order], limit):
            kept = all(_inside(piece[order], limit) for segment in segments for piece in _pieces(segment))
            need(kept, f"the reference passes reference.limits.{key}")


def _inside(found: Interval, limit: Fraction) -> bool:
    return max(-found[0], found[1]) <= limit * (1 + MET)


def _pieces(segment: dict[str, Any]) -> list[list[Interval]]:
    knots, points = _of(segment)
    spans = [k for k in range(5, len(knots) - 6) if knots[k] < knots[k + 1]]
    return [ranges_on(knots, points, k, (knots[k], knots[k + 1])) for k in spans]


# --- reading ---

def read(data: dict[str, Any], entry: dict[str, Any], coupled: bool) -> Claim:
    """Read and cross-check the statement about a member: study, assumptions, gains, model, certificate."""
    try:
        return _read(data, entry, coupled)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        raise UnreadableError(f"a part of the gain file is missing or has the wrong type: {error}") from None


def _read(data: dict[str, Any], entry: dict[str, Any], coupled: bool) -> Claim:
    study, certificate, model = data["study"], entry["certificate"], entry["model"]
    controller, section = study["controller"], study["plant"]["joints"][entry["name"]]
    law = controller["law"]
    need(law in REQUIRED, f"unknown law {law!r:.40}; known: {', '.join(REQUIRED)}")
    kind = certificate["kind"]
    need(kind in REQUIRED[law], f"unknown certificate kind {kind!r:.40}; known: {', '.join(REQUIRED[law])}")
    rows, controlled, input_map = rows_of(model)
    need(model["first"] in ("position", "speed"), "the first state is a position or a speed")
    n, m, states = len(rows), len(model["inputs"]), [row["state"] for row in rows]
    plant = valid_program(model["plant"], "the plant")
    terms = [valid_program(term, "a modelling term") for term in model["law"]]
    need(len(plant["outputs"]) == 2 * n and len(terms) == len(controlled), "the model does not fit the rows")
    assumed = assumptions(entry["assumptions"], study, section, states, coupled)
    nominal = {name: number(value, "a nominal value") for name, value in entry["nominal"].items()}
    limits = limits_of(model, section, states)
    check_names(model, plant, terms, assumed, nominal, limits, states)
    rate = number(controller.get("rates_hz", {}).get(entry["name"], controller["rate_hz"]), "rate_hz")
    watched = observer_of(controller, entry, rate, terms, rows) if rate > 0 else ()
    transient = number(study["validation"]["transient_s"], "transient_s")
    need(rate > 0 and transient >= 0, "the control rate must be positive, the transient not negative")
    split = [index(v, MAX_CELLS + 1, "split") for v in certificate["split"]]
    parts = {name: index(v, MAX_CELLS + 1, "parts") for name, v in certificate.get("parts", {}).items()}
    cut = set(parts) <= set(assumed["parameter"]) - {"effectiveness"} and min(parts.values(), default=2) > 1
    need(cut, "only ranges of constants are cut into parts, and into two or more")
    cells = [cell_of(cell, cell if parts else certificate, n, m) for cell in certificate["cells"]]
    alone = all(("force" in c, "drive" in c) == (bool(parts), bool(parts)) for c in certificate["cells"])
    need(
        alone and ("force" in certificate, "drive" in certificate) == (not parts, not parts),
        "the middles of a loop are stated once: of each cell where constants are cut, else of all",
    )
    covered = len(split) == n and min(split) >= 1 and len(cells) == math.prod([*split, *parts.values()])
    need(covered, "the cells do not cover the inertias and the constants that are cut")
    leads = index(model["leads"], MAX_LEADS + 1, "a number of leads") if "leads" in model else 0
    need(leads > 0 or "leads" not in model, "a model without leads does not name them")
    tracked = {rows[i]["target"] for i in controlled} & set(input_map)
    need(not (leads and tracked), "a row with leads is tracked by no row under the law")
    gains = gains_of(entry["gains"], controlled, input_map if leads else [], study, entry["name"])
    own = [states[i] for i, gain in zip(controlled, gains, strict=True) if gain[4] > 0]
    lags = [states.index(name) if name in states else -1 for name in certificate.get("lags", [])]
    following = all(i >= 0 and isinstance(rows[i]["target"], int) and i not in controlled for i in lags)
    need(following and len(set(lags)) == len(lags), "a lag is of a row without law that follows another")
    networks = certificate["networks"]
    need([given["row"] for given in networks] == own, "the networks are not those of the gains")
    delay = number(controller["delay_s"], "delay_s")
    need(delay * rate <= MAX_DELAY, f"a computing delay is of at most {MAX_DELAY} periods")
    jitter = number(controller.get("jitter_s", Fraction(0)), "jitter_s")
    need(0 <= jitter <= delay and 2 * jitter * rate < 1, "jitter is at most the delay, and less than half a period")
    need(not watched or gains[0][4] == 0, "a row with an observer has no load network")
    need(
        ("observed" in certificate) == bool(watched), "what an observer shows is bounded where there is one, only there"
    )
    stroke = numbers(stroke_of(section, str(rows[0]["unit"])), 2, "stroke")
    return Claim(
        name=entry["name"], rows=rows, input_map=input_map, inputs=model["inputs"], plant=plant, law=terms,
        parameters=assumed["parameter"], disturbances=assumed["disturbance"], nominal=nominal,
        reference=reference_bounds(entry["reference"]),
        noise=[magnitude(assumed["noise"][s]) for s in states],
        initial=[magnitude(assumed["initial"][s]) for s in states],
        period=1 / rate, delay=delay, gains=gains, split=split, parts=parts, cells=cells,
        half_widths=numbers(certificate["half_widths"], n, "half_widths"),
        input_bound=numbers(certificate["input_bound"], m, "input_bound"),
        demand=[(number(given["low"], "low"), number(given["high"], "high")) for given in networks],
        middle=[number(given["middle"], "middle") for given in networks],
        network_bound=[number(given["bound"], "bound") for given in networks],
        ultimate=numbers(certificate["envelope"]["ultimate"], n, "ultimate"),
        limits=limits, stroke=(stroke[0], stroke[1]), accuracy=accuracy_of(study, entry["name"]),
        transient=transient,
        feedforward={name: (v, assumed["feedforward_rate"][name]) for name, v in assumed["feedforward"].items()},
        first=model["first"], rest=rest_of(entry["reference"]["segments"], study["reference"]["dwell_s"]),
        jitter=jitter, leads=leads, lags=lags, observer=watched,
        shown=numbers(certificate["observed"], 3, "observed") if watched else [],
    )  # fmt: skip


def observer_of(
    controller: dict[str, Any], entry: dict[str, Any], rate: Fraction, terms: list[dict[str, Any]],
    rows: list[dict[str, Any]],
) -> tuple[Fraction, ...]:  # fmt: skip
    """l_1 and l_2 of a member's observer, which are those of the study's bandwidth; nothing where it has none."""
    asked = controller.get("observer")
    need(("observer" in entry) == (asked is not None), "members have an observer where the study asks for one")
    if asked is None:
        return ()
    first, second = (number(entry["observer"][key], f"the observer's {key}") for key in ("first", "second"))
    bandwidth = number(asked["bandwidth_rad_s"], "bandwidth_rad_s") if "bandwidth_rad_s" in asked else None
    need(bandwidth is None or bandwidth > 0, "an observer's bandwidth is positive")
    away = 1.0 if bandwidth is None else -math.expm1(-float(bandwidth / rate))
    wanted = away * (2 - away), away**2 * float(rate)
    close = all(abs(float(g) - w) <= 1e-6 * w for g, w in zip((first, second), wanted, strict=True))
    need(close and 0 < first <= 1 and second > 0, "the observer's gains are not those of its bandwidth")
    good = len(rows) > 1 and rows[1]["target"] == 0 and rows[0]["controlled"]
    need(good, "an observer estimates the first state and the one that answers to it")
    speed = [terms[0]["operations"][k] for k in terms[0]["outputs"]]
    need(speed == [["input", "r1"]], "an observer is around the reference: the first modelling term must be its speed")
    return first, second


def rest_of(segments: list[dict[str, Any]], pause: Any) -> tuple[Fraction, Fraction]:
    """Where the reference rests at first and for how long; that it does, `course.follows` decides."""
    if not number(pause, "dwell_s") > 0:
        return Fraction(0), Fraction(0)
    knots = [number(v, "a knot") for v in segments[0]["knots"]]
    return number(segments[0]["coefficients"][0], "a coefficient"), knots[-1] - knots[0]


def rows_of(model: dict[str, Any]) -> tuple[list[dict[str, Any]], list[int], list[int]]:
    """The subsystems, indices of those with gains, and the row of each input."""
    rows = model["rows"]
    n, m = len(rows), len(model["inputs"])
    need(1 <= n <= MAX_ROWS and 1 <= m <= n, f"1 to {MAX_ROWS} rows are needed: got {n}")
    for i, row in enumerate(rows):
        target = row["target"]
        if isinstance(target, dict):
            need(row["controlled"] is False, "a row under the law tracks the reference, zero, or a row")
            row["target"] = {name: number(share, "a row's target") for name, share in target.items()}
        elif target == "balance":
            need(row["controlled"] is False, "a row under the law tracks the reference, zero, or a row")
        elif target not in ("reference", "zero"):
            row["target"] = index(target, i, "a row's target")
            need(rows[row["target"]]["controlled"] is True, "a row's target must be a controlled row")
        need(
            isinstance(row["controlled"], bool) and isinstance(row["state"], str), "a row needs a state and controlled"
        )
        need(printable(row["unit"]), "a row's unit must be printable text")
    need(rows[0]["target"] == "reference", "the first row must track the reference")
    controlled = [i for i, row in enumerate(rows) if row["controlled"]]
    input_map = [index(d, n, "an input's row") for d in model["input_map"]]
    good = len(input_map) == m and all(rows[d]["controlled"] for d in input_map)
    need(good, "each input must be the control of a controlled row")
    return rows, controlled, input_map


def limits_of(model: dict[str, Any], section: dict[str, Any], states: list[str]) -> list[dict[str, Any]]:
    """The study's limits on the signals that the model names for each; the first is the amplitude limit."""
    limits, given = model["limits"], section["limits"]
    known = {*states, *model["inputs"]}
    need(limits and [x["name"] for x in limits] == list(given), "the limits of the model are not those of the study")
    need(all(x["signals"] and set(x["signals"]) <= known for x in limits), "a limit names an unknown signal")
    need(all(printable(value["unit"]) for value in given.values()), "a limit's unit must be printable text")
    need(set(limits[0]["signals"]) == set(model["inputs"]), "the first limit must be the amplitude limit of the inputs")
    return [
        {"name": x["name"], "signals": x["signals"], "unit": given[x["name"]]["unit"],
         "value": number(given[x["name"]]["value"], "a limit")}
        for x in limits
    ]  # fmt: skip


def check_names(
    model: dict[str, Any], plant: dict[str, Any], terms: list[dict[str, Any]], assumed: dict[str, dict[str, Interval]],
    nominal: dict[str, Fraction], limits: list[dict[str, Any]], states: list[str],
) -> None:  # fmt: skip
    """Refuse a model that reads what has no assumption, or a law that reads what a controller cannot know."""
    parameters = assumed["parameter"]
    inertias = reads(plant, plant["outputs"][: len(states)])
    need(inertias <= set(parameters) - {"effectiveness"}, "an inertia depends on more than constant parameters")
    signals = ["r0", "r1", "r2", "r3", "constant"]
    listed = [*states, *model["inputs"], *parameters, *assumed["disturbance"], *signals]
    for name in (*listed, *nominal, *(str(limit["name"]) for limit in limits)):
        need(isinstance(name, str) and NAME.fullmatch(name) is not None, "a name must be a plain identifier")
    need(len(set(listed)) == len(listed), "a name stands for two different signals")
    need(reads(plant) <= set(listed) - set(signals), "the plant reads a name without an assumption")
    unread = {*parameters, *assumed["disturbance"]} - reads(plant)
    need(not unread, f"the plant does not use {', '.join(sorted(unread))}, which the study states")
    foreseen = {*nominal, *assumed["feedforward"]}
    for term in terms:  # r3, the jerk, has no bounded rate
        allowed = {*states, "r0", "r1", "r2", *(f"nominal.{name}" for name in foreseen)}
        need(reads(term) <= allowed, "a modelling term reads what a controller cannot know")


def gains_of(
    entries: list[dict[str, Any]], controlled: list[int], led: list[int], study: dict[str, Any], name: str
) -> list[tuple[Fraction, ...]]:
    """β, ε, δ, σ, γ, Φ, φ̂(0), a and f of each controlled row, inside the ranges of the file and of the study."""
    kinds = ("beta", "epsilon", "delta", "sigma", "gamma", "phi", "preload")
    given = {entry["name"]: number(entry["value"], entry["name"]) for entry in entries}
    names = [f"{kind}_{k + 1}" for k in range(len(controlled)) for kind in kinds]
    names += [f"{kind}_{k + 1}" for k, row in enumerate(controlled) if row in led for kind in TIMES]
    need(set(given) == set(names) and len(entries) == len(names), "the gains do not fit the subsystems")
    gains = [tuple(given.get(f"{kind}_{k + 1}", Fraction(0)) for kind in (*kinds, *TIMES))
             for k in range(len(controlled))]  # fmt: skip
    good = all(b > 0 and e >= 0 and d > 0 and s > 0 and g >= 0 and phi >= abs(p) * (g > 0) >= 0 <= min(times)
               for b, e, d, s, g, phi, p, *times in gains)  # fmt: skip
    need(good, "gains must be positive, and a preload inside phi")
    ranges = study["controller"]["members"][name]
    need(set(ranges) == set(names), f"the ranges of the gains of {name} are not those of its gains")
    fixed = all(set(r) in ({"value"}, {"min", "max"}) for r in ranges.values())
    need(fixed, "a gain has either a value, or min and max")
    for entry in entries:
        key, value = entry["name"], given[entry["name"]]
        wanted = ranges[key]
        low, high = wanted.get("value", wanted.get("min")), wanted.get("value", wanted.get("max"))
        need((low, high) == (entry["min"], entry["max"]), f"the range of {key} is not the study's")
        need(number(low, key) <= value <= number(high, key), f"{key} is outside the range of the study")
    return gains


def accuracy_of(study: dict[str, Any], name: str) -> Fraction:
    """The required bound on a member's error: its own, or where it is the only one that of the machine."""
    own = study["requirements"].get("member_error", {})
    need(name in own or len(study["plant"]["joints"]) == 1, f"the study requires no error of {name}")
    return number(own.get(name, study["requirements"]["tracking_error_m"]), "the required error")


def assumptions(
    entries: list[dict[str, Any]], study: dict[str, Any], section: dict[str, Any], states: list[str], coupled: bool
) -> dict[str, dict[str, Interval]]:
    """The assumptions by kind; each must cover what the study states.

    What a coupling does to a member is decided by obligations of its own.
    """
    kinds = ("parameter", "disturbance", "noise", "initial", "feedforward", "feedforward_rate")
    found: dict[str, dict[str, Interval]] = {kind: {} for kind in kinds}
    for entry in entries:
        kind, _, name = entry["name"].partition(".")
        bounds = number(entry["lower"], entry["name"]), number(entry["upper"], entry["name"])
        need(kind in found and name not in found[kind], f"unknown or doubled assumption {entry['name']!r:.60}")
        need(bounds[0] <= bounds[1], f"{entry['name']}: lower > upper")
        found[kind][name] = bounds
    need(
        set(found["noise"]) == set(found["initial"]) == set(states), "noise and initial errors are those of the states"
    )
    foreseen = set(found["feedforward"])
    need(foreseen == set(found["feedforward_rate"]), "a foreseen disturbance needs a range and a range of its rate")
    need(foreseen <= set(found["disturbance"]), "what has a rate must be a disturbance")
    stated = stated_ranges(study, section, states, coupled)
    carried = {name for name in found["parameter"] if coupled and name in CARRIED}
    listed = {name for kind, name, _, _ in stated if kind == "parameter"}
    need(listed == set(found["parameter"]) - carried, "the parameters are not those of the study")
    for kind, name, low, high in stated:
        need(name in found[kind], f"the assumption {kind}.{name} is missing")
        bounds = found[kind][name]
        need(low <= high, f"the study's range of {name} is upside down")
        need(bounds[0] <= low and high <= bounds[1], f"the assumption {kind}.{name} is narrower than the study's")
        room = ROUND * max(abs(low), abs(high))
        need(low - bounds[0] <= room and bounds[1] - high <= room, f"the assumption {kind}.{name} is not the study's")
    if not coupled:
        disturbed = {name for kind, name, _, _ in stated if kind == "disturbance"}
        need(disturbed == set(found["disturbance"]), "the disturbances are not those of the study")
        rated = {name for kind, name, _, _ in stated if kind == "feedforward"}
        need(rated == foreseen, "the disturbances with a rate are not those of the study")
    return found


def stated_ranges(
    study: dict[str, Any], section: dict[str, Any], states: list[str], coupled: bool
) -> list[tuple[str, str, Fraction, Fraction]]:
    """Kind, name and range of everything that the study states of a member."""
    uncertainty, stated = study["uncertainty"], []
    for name, entry in section["parameters"].items():
        value = number(entry["value"], name)
        spread = abs(value) * number(entry["tolerance"], name)
        stated.append(("parameter", name, value - spread, value + spread))
    if "least_effectiveness" in section:
        least = number(section["least_effectiveness"], "least_effectiveness")
        need(0 <= least <= 1, "an actuator delivers between nothing and all of its torque")
        stated.append(("parameter", "effectiveness", least, Fraction(1)))
    for name, entry in {} if coupled else uncertainty["disturbances"].items():
        low, high = numbers(entry["range"], 2, name)
        if "rate" not in entry:
            stated.append(("disturbance", name, low, high))
            continue
        rate = number(entry["rate"], f"the rate of {name}")
        need(rate > 0, f"the rate of {name} must be positive")
        stated += [("disturbance", name, Fraction(0), Fraction(0)), ("feedforward", name, low, high),
                   ("feedforward_rate", name, -rate, rate)]  # fmt: skip
    observed = study["controller"].get("observer") is not None
    for kind in ("noise", "initial"):
        given = uncertainty.get(kind, {})
        for k, state in enumerate(states):
            need(state in given, f"the study does not say {kind} of {state}")
            value = number(given[state], f"{kind} of {state}")
            need(value >= 0, f"{kind} of {state} must not be negative")
            if kind == "noise" and "resolution" in uncertainty:
                step = number(uncertainty["resolution"].get(state, Fraction(0)), f"the resolution of {state}")
                need(step >= 0, f"the resolution of {state} must not be negative")
                value += step / 2
            need(not (kind == "noise" and k == 1 and observed) or value == 0, f"{state} is estimated, not measured")
            stated.append((kind, state, -value, value))
    return stated


def printable(unit: Any) -> bool:
    """Whether it is a unit and nothing else."""
    return isinstance(unit, str) and UNIT_TEXT.fullmatch(unit) is not None


# --- balance ---

#: The range of b* is widened by this share of its size; it settles in so many steps.
WIDER, SETTLE = Fraction(1, 10**6), 12


class Balance:
    """A row in balance: b* in signals and a constant, and what the row feels besides, without deviations."""

    def __init__(
        self, raw: Form, own: str, mass: Interval, moving: Form, signals: Collection[str], table: Table
    ) -> None:
        self.met: Form = {}
        self.left: Form = {}
        self.steady = {own, *signals}
        for symbol, c in raw.items():
            if symbol in self.steady or not symbol:
                self._count(symbol, c)
            elif symbol[0] not in "Qe":
                self._split(table.expand({symbol: ONE}), c)
        self._split(moving, neg(mass))
        effect = self.met.pop(own, ZERO)
        if effect[0] <= 0 <= effect[1]:
            raise NotProvedError("what a mode carries has no effect of a known sign")
        self.value = times(self.met, neg(inverse(effect)))

    def _count(self, symbol: str, part: Interval) -> None:
        self.met[symbol] = add(self.met.get(symbol, ZERO), part)

    def _split(self, form: Form, factor: Interval) -> None:
        """Of what may change, the middle counts as constant, and the rest is left."""
        rest: Form = {}
        for symbol, c in form.items():
            if symbol in self.steady or not symbol:
                middle = down((c[0] + c[1]) / 2)
                self._count(symbol, mul(factor, (middle, middle)))
                rest[symbol] = mul(factor, add(c, (-middle, -middle)))
            elif symbol[0] not in "Qe":
                rest[symbol] = mul(factor, c)
        self.left = plus(self.left, rest)

    def range(self, ranges: dict[str, Interval]) -> Interval:
        """Where b* is for ranges of the signals."""
        return over(self.value, ranges)

    def rate(self, rates: dict[str, Interval]) -> Interval:
        """How fast b* moves for rates of the signals."""
        return over({s: c for s, c in self.value.items() if s}, rates)


def widened(span: Interval) -> Interval:
    """A range with a little room."""
    room = up(WIDER * max(abs(span[0]), abs(span[1])))
    return span[0] - room, span[1] + room


def inside(inner: Interval, outer: Interval) -> bool:
    """Whether one range is in another."""
    return outer[0] <= inner[0] and inner[1] <= outer[1]


# --- targets ---

#: Derivatives of the reference that have a bounded rate.
SIGNALS = ("r0", "r1", "r2")


def placed(row: dict[str, Any]) -> dict[str, Fraction]:
    """Coefficients of the signals whose sum is the target of a row that follows no other."""
    target = row["target"]
    if isinstance(target, dict):
        return target
    if target == "balance":
        return {f"@{row['state']}": Fraction(1)}
    return {"r0": Fraction(1)} if target == "reference" else {}


def rate_of(row: dict[str, Any]) -> Form:
    """The rate of the target of a row that tracks nothing but the reference."""
    return {f"r{int(s[1]) + 1}": (v, v) for s, v in placed(row).items()}


def joined(program: dict[str, Any], names: set[str]) -> dict[str, Any]:
    """An operation list with the quotients of two inputs that are named "A/B" as inputs of their own."""
    operations = program["operations"]
    read = {k: operation[1] for k, operation in enumerate(operations) if operation[0] == "input"}
    made = []
    for operation in operations:
        name = "/".join(str(read.get(k, "")) for k in operation[1:]) if operation[0] == "div" else ""
        made.append(["input", name] if name in names else operation)
    return {**program, "operations": made}


# --- loop ---

class Loop:
    """M_i z_i' = sum_j J_ij z_j + sum_k B_ik v_k + d_i + M_i φ*_j' around the operating point x*(t).

    The symbols Q are the deviations z = x - x*, the symbols e the inputs v, the symbols p the demands φ* of the load
    networks. x* follows from the reference and the demands: the term of a tracked row must not read a state.
    """

    def __init__(self, claim: Claim, inflate: Fraction) -> None:
        tracked = {row["target"] for row in claim.rows if isinstance(row["target"], int)}
        states = {row["state"] for row in claim.rows}
        for i, term in zip(claim.controlled, claim.law, strict=True):
            need(i not in tracked or not states & reads(term), "the modelling term of a tracked row reads a state")
        self.claim, self.table = claim, Table()
        self.gain: dict[int, Gain] = {}
        for i, values in zip(claim.controlled, claim.gains, strict=True):
            wide = [(v * (1 - inflate), v * (1 + inflate)) for v in (*values[:5], *values[7:])]
            self.gain[i] = Gain(*wide, capacity=values[5], preload=values[6])
        self.term = dict(zip(claim.controlled, claim.law, strict=True))
        self.half: dict[int, Interval] = {}
        self.model: dict[int, Form] = {}
        self.nodes: dict[str, Node] = {}
        self._inputs()
        self._rows()

    def _inputs(self) -> None:
        claim, table = self.claim, self.table
        fixed = {f"nominal.{name}": (value, value) for name, value in claim.nominal.items()}
        for name, bounds in {**fixed, **claim.parameters}.items():
            self._stated(name, bounds, changing=name == VARYING)
        for name, bounds in claim.disturbances.items():
            self._stated(name, bounds, changing=True)
        for name, (bounds, _) in claim.feedforward.items():
            table.ranges[f"w:{name}"] = bounds
            if name not in claim.nominal:
                self._name(f"nominal.{name}", {f"w:{name}": ONE})
            self._name(name, plus({f"w:{name}": ONE}, self.nodes[name].form))
        self.rated, self.quotients = dict(claim.feedforward), set()
        for row in claim.rows:
            for name in placed(row):
                if "/" in name and name not in self.quotients:
                    self._quotient(name, *name.split("/", 1))
        for k, bounds in enumerate(claim.reference):
            table.ranges[f"r{k}"] = bounds
            self._name(f"r{k}", {f"r{k}": ONE})
        for i, radius in enumerate(claim.half_widths):
            table.ranges[f"Q{i}"] = symmetric(radius)
        self.balances = {i: self._balanced(i) for i, row in enumerate(claim.rows) if row["target"] == "balance"}
        for i, bounds in zip(claim.networks, claim.demand, strict=True):
            table.ranges[f"p{i}"] = bounds
        for k, error in enumerate(claim.input_bound):
            table.ranges[f"e{k}"] = symmetric(error)
        for i, row in enumerate(claim.rows):
            self._name(row["state"], plus({f"Q{i}": ONE}, self.target(i)))
        for i in self.gain:
            self._control(i)
        for k, (name, row) in enumerate(zip(claim.inputs, claim.input_map, strict=True)):
            self._name(name, plus(self.kappa(row), {f"e{k}": ONE}))

    def _balanced(self, i: int) -> int:
        """What row i carries so that the only other row that reads it moves as is asked for; returns that row."""
        claim, n, state = self.claim, len(self.claim.rows), self.claim.rows[i]["state"]
        outputs = claim.plant["outputs"]
        reading = [j for j in range(n) if j != i and state in reads(claim.plant, [outputs[n + j]])]
        need(len(reading) == 1, f"a state balances the only other row that reads it: {len(reading)} read {state}")
        (k,) = reading
        row, own, span = claim.rows[k], f"w:@{state}", ZERO
        need(row["target"] in ("reference", "zero"), "a balance is of a row that tracks the reference")
        program = only(joined(claim.plant, self.quotients), [outputs[k], outputs[n + k]])
        for _ in range(SETTLE):
            table = self.table.copy()
            table.ranges[own] = span
            nodes = dict(self.nodes)
            for j, form in ((i, {own: ONE}), (k, {s: (v, v) for s, v in placed(row).items()})):
                whole = plus({f"Q{j}": ONE}, form)
                nodes[claim.rows[j]["state"]] = Node(
                    table.key("input", claim.rows[j]["state"]), whole, table.over(whole)
                )
            need(reads(program) <= set(nodes), "a row in balance reads a state that is not in it")
            mass, force = linear(program, nodes, table)
            found = Balance(force.form, own, mass.range, rate_of(row), self._rates(), table)
            needed = found.range(table.ranges)
            if inside(needed, span):
                self.table.ranges[own] = span
                self.rated[f"@{state}"] = span, found.rate(self._rates())
                return k
            span = widened(needed)
        raise NotProvedError(f"what {state} carries does not settle")

    def _rates(self) -> dict[str, Interval]:
        """Rates of the signals whose rate is bounded."""
        changes = {f"r{k}": self.claim.reference[k + 1] for k in range(3)}
        return changes | {f"w:{name}": change for name, (_, change) in self.rated.items()}

    def _quotient(self, name: str, load: str, parameter: str) -> None:
        """A disturbance of bounded rate over a constant, which is another one."""
        claim = self.claim
        known = load in claim.feedforward and parameter in claim.parameters and parameter != VARYING
        need(known, "a target divides a disturbance of bounded rate by a constant")
        by = inverse(claim.parameters[parameter])
        span, rate = (mul(part, by) for part in claim.feedforward[load])
        self.quotients.add(name)
        self.rated[name], self.table.ranges[f"w:{name}"] = (span, rate), span
        self._stated(name, mul(claim.disturbances[load], by), changing=True)
        self._name(name, plus({f"w:{name}": ONE}, self.nodes[name].form))

    def _name(self, name: str, form: Form) -> None:
        self.nodes[name] = Node(self.table.key("input", name), form, self.table.over(form))

    def _stated(self, name: str, bounds: Interval, *, changing: bool) -> None:
        """What may change at any time is a symbol of its own, so that the coefficients of others are constant."""
        if bounds[0] == bounds[1]:
            self.nodes[name] = Node(self.table.key("const", bounds[0]), {"": bounds}, bounds)
        elif changing:
            self.table.ranges[f"d:{name}"] = bounds
            self._name(name, {f"d:{name}": ONE})
        else:
            self.nodes[name] = Node(self.table.key("input", name), {"": bounds}, bounds)

    def target(self, i: int) -> Form:
        """The operating value of state i."""
        target = self.claim.rows[i]["target"]
        if isinstance(target, int):
            return self.kappa(target)
        shares = placed(self.claim.rows[i]).items()
        return plus({}, *(times(self._signal(name), (share, share)) for name, share in shares))

    def _signal(self, name: str) -> Form:
        """A derivative of the reference, one; or a disturbance, its middle where its rate has no bound."""
        if name == "constant":
            return {"": ONE}
        if name in SIGNALS:
            return {name: ONE}
        if name in self.rated:
            return {f"w:{name}": ONE}
        need(name in self.claim.disturbances, "what a row tracks is made of r0, r1, r2, constant and disturbances")
        low, high = self.nodes[name].range
        middle = down((low + high) / 2)
        return {"": (middle, middle)}

    def _driven(self, i: int) -> int:
        """The row that what carries out κ_i acts in: row i, or where that does not read it, the only one that does."""
        claim, n = self.claim, len(self.claim.rows)
        found = [row["state"] for row in claim.rows if row["target"] == i]
        follower = found[0] if found else claim.inputs[claim.input_map.index(i)]
        read = [reads(claim.plant, [claim.plant["outputs"][n + j]]) for j in range(n)]
        reading = [j for j, row in enumerate(claim.rows) if row["state"] != follower and follower in read[j]]
        return i if i in reading or len(reading) != 1 else reading[0]

    def kappa(self, i: int) -> Form:
        """The operating value of row i's control: m_i, less φ*_i where it has a network."""
        self._control(i)
        return plus(self.model[i], {f"p{i}": neg(ONE)}) if i in self.claim.networks else self.model[i]

    def _control(self, i: int) -> None:
        """θ̂_i in [0, ε(R+N)²/(2σ)], the gain b in [½β, ½B], the modelling term."""
        if i in self.half:
            return
        gain = self.gain[i]
        theta = up(gain.epsilon[1] * (self._error(i) + self.noise(i)) ** 2 / (2 * gain.sigma[0]))
        self.half[i] = down(gain.beta[0] / 2), up((gain.beta[1] + gain.epsilon[1] * theta) / 2)
        need(reads(self.term[i]) <= set(self.nodes), "a modelling term reads a state that comes later")
        self.model[i] = linear(self.term[i], self.nodes, self.table)[0].form

    def _error(self, i: int) -> Fraction:
        """Bound on |Q_i|: z_i, what its target asks for, and what its network misses."""
        claim, target = self.claim, self.claim.rows[i]["target"]
        if not isinstance(target, int):
            return claim.half_widths[i]
        missed = claim.network_bound[claim.networks.index(target)] if target in claim.networks else Fraction(0)
        return claim.half_widths[i] + self.half[target][1] * self._error(target) + missed

    def noise(self, i: int) -> Fraction:
        """Bound on the error of the Q_i that the controller computes."""
        target, own = self.claim.rows[i]["target"], self.claim.measured[i]
        if not isinstance(target, int):
            return own
        return own + up(self.half[target][1] * self.noise(target) + self.term_noise(target))

    def term_noise(self, i: int) -> Fraction:
        """What measurement errors make of a modelling term."""
        shaken = {r["state"]: {"": symmetric(n)} for r, n in zip(self.claim.rows, self.claim.measured, strict=True)}
        return magnitude(derivative(self.term[i], self._ranges(), shaken).get("", ZERO))

    def _ranges(self) -> dict[str, Interval]:
        ranges = {name: node.range for name, node in self.nodes.items()}
        for row, noise in zip(self.claim.rows, self.claim.measured, strict=True):
            if row["state"] in ranges:
                ranges[row["state"]] = add(ranges[row["state"]], symmetric(noise))
        return ranges

    def _rows(self) -> None:
        claim, table, n = self.claim, self.table, len(self.claim.rows)
        values = linear(joined(claim.plant, self.quotients), self.nodes, table)
        self.mass = [value.range for value in values[:n]]
        if min(mass[0] for mass in self.mass) <= 0:
            raise NotProvedError("an inertia can vanish inside the assumptions")
        raw = [value.form for value in values[n:]]
        forces = [table.expand(form) for form in raw]
        moving = {r["state"]: times(f, inverse(m)) for r, f, m in zip(claim.rows, forces, self.mass, strict=True)}
        moving |= {f"r{k}": {f"r{k + 1}": ONE} for k in range(3)}
        moving |= {f"nominal.{name}": {"": rate} for name, (_, rate) in claim.feedforward.items()}
        self.virtual: dict[int, Form] = {}
        self.closed: list[Form] = []
        self.disturbance: list[Fraction] = []
        self.demand: list[Interval] = []
        self.demand_rate: list[Fraction] = []
        self.settled: list[Fraction] = []
        self.met: dict[int, tuple[Form, Interval]] = {}
        places = [claim.rest[0], Fraction(0), Fraction(0), Fraction(0)]
        self.resting: dict[str, Interval] = {f"r{k}": (place, place) for k, place in enumerate(places)}
        rates: list[Form] = []
        for i, row in enumerate(claim.rows):
            target = row["target"]
            own = {} if isinstance(target, int) else placed(row)
            known = {k: moving[k] if k in SIGNALS else {"": self.rated.get(k, (ZERO, ZERO))[1]} for k in own}
            parts = [times(known[k], (share, share)) for k, share in own.items()]
            rates.append(self.virtual[target] if isinstance(target, int) else plus({}, *parts))
            self.closed.append(plus(forces[i], times(rates[i], neg(self.mass[i]))))
            if i in self.gain:
                self.virtual[i] = table.expand(derivative(self.term[i], self._ranges(), moving))
        places = {i: self._driven(i) for i in claim.networks}
        held = [*places.values(), *self.balances.values()]
        need(len(set(held)) == len(held), "a row is held by one load network or one mode")
        carried = {k: self._carried(i, raw[k], self.mass[k]) for i, k in self.balances.items()}
        left = {place: self._demanded(i, place, raw[place], rates[place]) for i, place in places.items()} | carried
        for i, form in enumerate(self.closed):
            self.disturbance.append(left[i] if i in left else magnitude(self._left(form)))

    def _carried(self, i: int, raw: Form, mass: Interval) -> Fraction:
        """What is left of a row that the state of row i balances; what that carries at rest."""
        own, row = f"w:@{self.claim.rows[i]['state']}", self.claim.rows[self.balances[i]]
        found = Balance(raw, own, mass, rate_of(row), self._rates(), self.table)
        settled = inside(found.range(self.table.ranges), self.table.ranges[own])
        need(
            settled and inside(found.rate(self._rates()), self.rated[own[2:]][1]), "what a mode carries does not settle"
        )
        self.resting[own] = found.range({**self.table.ranges, **self.resting})
        return magnitude(self._left(found.left))

    def _left(self, form: Form, known: dict[str, Interval] | None = None) -> Interval:
        """Range of what is neither a deviation nor an input, where some ranges may be known better."""
        left = {s: c for s, c in form.items() if s[:1] not in ("Q", "e")}
        return over(left, {**self.table.ranges, **(known or {})})

    def _demanded(self, i: int, row: int, raw: Form, rate: Form) -> Fraction:
        """What φ*_i meets of the row that it acts in, and how fast; returns the disturbance that is left.

        Only constant coefficients count: those of the force before nonlinear operations are replaced by what bounds
        them, and of those of the target's rate, which may change, their middles.
        """
        claim, table = self.claim, self.table
        place = claim.networks.index(i)
        changes = self._rates()
        centres = {s: down((c[0] + c[1]) / 2) for s, c in rate.items() if s in changes}
        shift = {s: (c, c) for s, c in centres.items()}
        met = plus({s: c for s, c in raw.items() if s in changes}, times(shift, neg(self.mass[row])))
        middle = {"": (claim.middle[place], claim.middle[place])}
        level = table.over(plus(met, middle))
        change = magnitude(over(met, changes))
        drive, constant = neg(raw.get(f"p{i}", ZERO)), True
        if not drive[0] > 0:
            drive, constant = neg(self.closed[row].get(f"p{i}", ZERO)), False
        if not drive[0] > 0:
            raise NotProvedError(f"the load network of row {i + 1} has no effect of a known sign")
        known = {*changes, f"p{i}"} if constant else {*changes}
        rest = table.expand({s: c for s, c in raw.items() if s not in known})
        late = plus(rate, times(shift, neg(ONE)))
        rest = plus(rest, times(late, neg(self.mass[row])), times(middle, neg(ONE)))
        least = drive[0]
        if not constant:  # where the effect of φ̂ may change, φ* is for its middle
            centre = down((drive[0] + drive[1]) / 2)
            around = max(drive[1] - centre, centre - drive[0])
            drive = centre, centre
            rest = plus({s: c for s, c in rest.items() if s != f"p{i}"},
                        {"": symmetric(around * magnitude(mul(level, inverse(drive))))})  # fmt: skip
        left = magnitude(self._left(rest))
        # what stands beside a foreseen load is of others that move: at rest it is not there
        rested = magnitude(self._left(rest, dict.fromkeys((f"d:{name}" for name in claim.feedforward), ZERO)))
        for j, other in enumerate(claim.rows):  # a mode may rest beside what it carries, as far as it may begin
            if not other["controlled"] and not isinstance(other["target"], int):
                rested += up(magnitude(self.closed[row].get(f"Q{j}", ZERO)) * claim.initial[j])
        self.demand.append(mul(level, inverse(drive)))
        self.met[i] = plus(met, middle), drive
        still = over(plus(met, middle), {**table.ranges, **self.resting})
        self.resting[f"p{i}"] = mul(still, inverse(drive))
        self.demand_rate.append(up(change / drive[0]))
        self.settled.append(up(rested / least))
        return left

    def entry(self, i: int, j: int) -> Interval:
        """J_ij."""
        return self.closed[i].get(f"Q{j}", ZERO)

    def late(self, k: int) -> Fraction:
        """What the modelling term of input k changes until it acts."""
        return (self.claim.period + self.claim.delay + self.claim.jitter) * self.drift(k)

    def drift(self, k: int) -> Fraction:
        """Bound on the rate of the modelling term of input k."""
        return magnitude(self.table.over(self.virtual[self.claim.input_map[k]]))

    def size(self, name: str, deviations: list[Fraction], *, resting: bool) -> Fraction:
        """Bound on |input| as commanded, or on |state|, for bounds on |z| and |v|, in motion or at rest at first."""
        claim, n = self.claim, len(self.claim.rows)
        known = {**self.table.ranges, **(self.resting if resting else {})}
        known |= {f"Q{i}": symmetric(r) for i, r in enumerate(deviations[:n])}
        if name in claim.inputs:
            k = claim.inputs.index(name)
            return magnitude(over(self.kappa(claim.input_map[k]), known)) + deviations[n + k]
        i = next(i for i, row in enumerate(claim.rows) if row["state"] == name)
        return magnitude(over(self.target(i), known)) + deviations[i]


# --- matrices ---

Matrix = list[list[Fraction]]
#: Whole numbers in units of 2^-FIXED.
Whole = list[list[int]]


def dot(row: Iterable[Fraction], column: Iterable[Fraction]) -> Fraction:
    """Sum of products; most matrices here are sparse."""
    return sum((a * b for a, b in zip(row, column, strict=True) if a and b), Fraction(0))


def identity(count: int) -> Matrix:
    """Unit matrix."""
    return [[Fraction(int(i == j)) for j in range(count)] for i in range(count)]


def inverse_of(matrix: Matrix) -> Matrix:
    """Exact inverse by Gauss-Jordan elimination."""
    n = len(matrix)
    work = [[*row, *unit] for row, unit in zip(matrix, identity(n), strict=True)]
    for i in range(n):
        pivot = next((k for k in range(i, n) if work[k][i] != 0), None)
        if pivot is None:
            raise NotProvedError("the coordinates of the certificate are singular")
        work[i], work[pivot] = work[pivot], work[i]
        work[i] = [value / work[i][i] for value in work[i]]
        for k in range(n):
            if k != i and work[k][i] != 0:
                factor = work[k][i]
                work[k] = [a - factor * b for a, b in zip(work[k], work[i], strict=True)]
    return [row[n:] for row in work]


@dataclass(frozen=True)
class Ball:
    """A matrix in units of 2^-FIXED, every entry within `error` of what it stands for."""

    rows: Whole
    error: int

    def __matmul__(self, other: Ball) -> Ball:
        columns = list(zip(*other.rows, strict=True))
        rows = [[sum(map(operator.mul, row, column)) >> FIXED for column in columns] for row in self.rows]
        size = max((sum(map(abs, row)) for row in self.rows), default=0)
        other_size = max((sum(map(abs, column)) for column in columns), default=0)
        error = size * other.error + other_size * self.error + len(other.rows) * self.error * other.error
        return Ball(rows, (error >> FIXED) + 2)

    def __add__(self, other: Ball) -> Ball:
        pairs = zip(self.rows, other.rows, strict=True)
        return Ball([[a + b for a, b in zip(p, q, strict=True)] for p, q in pairs], self.error + other.error)

    def __sub__(self, other: Ball) -> Ball:
        pairs = zip(self.rows, other.rows, strict=True)
        return Ball([[a - b for a, b in zip(p, q, strict=True)] for p, q in pairs], self.error + other.error)

    def beside(self, other: Ball) -> Ball:
        """Columns of both."""
        pairs = zip(self.rows, other.rows, strict=True)
        return Ball([[*p, *q] for p, q in pairs], max(self.error, other.error))

    def over(self, other: Ball) -> Ball:
        """Rows of both."""
        return Ball([*self.rows, *other.rows], max(self.error, other.error))

    def part(self, rows: slice, columns: slice) -> Ball:
        """Some rows and columns."""
        return Ball([row[columns] for row in self.rows[rows]], self.error)

    def sizes(self) -> Whole:
        """Bounds on the entries without sign."""
        return [[abs(v) + self.error for v in row] for row in self.rows]


def ball(matrix: Sequence[Sequence[Fraction]]) -> Ball:
    """A matrix of fractions."""
    return Ball([[(v.numerator << FIXED) // v.denominator for v in row] for row in matrix], 1)


def nothing(rows: int, columns: int) -> Ball:
    """Zeros."""
    return Ball([[0] * columns for _ in range(rows)], 0)


def eye(count: int) -> Ball:
    """Unit matrix."""
    return Ball([[int(i == j) << FIXED for j in range(count)] for i in range(count)], 0)


def times_up(first: Whole, second: Whole) -> Whole:
    """Product of matrices that are not negative, rounded up."""
    columns = list(zip(*second, strict=True))
    return [[(sum(map(operator.mul, row, column)) >> FIXED) + 1 for column in columns] for row in first]


def exponential_of(matrix: Matrix) -> Ball:
    """exp(matrix).

    The remainder of the series is below 20^121/121! < 2^-140. Entries are cut to 2^-160, and terms to the same in each
    of 120 products of at most 300 entries; both grow by no more than exp(20) < 2^29: below 2^-114 together.
    """
    if max(sum(map(abs, row), Fraction(0)) for row in matrix) > MAX_NORM or len(matrix) > 300:
        raise NotProvedError("the plant is too fast for the control period of this certificate")
    sparse = [[(j, (v.numerator << FIXED) // v.denominator) for j, v in enumerate(row) if v] for row in matrix]
    term = eye(len(matrix)).rows
    total = [list(row) for row in term]
    width = range(len(matrix))
    for k in range(1, TERMS + 1):
        term = [[(sum(a * term[j][c] for j, a in row) >> FIXED) // k for c in width] for row in sparse]
        total = [[a + b for a, b in zip(old, new, strict=True)] for old, new in zip(total, term, strict=True)]
        if k > MAX_NORM and not any(abs(v) > 1 for row in term for v in row):
            break
    return Ball(total, 1 << (FIXED - 113))


# --- jitter ---

class Jitter:
    """For a change of 1 of each input: kicks to z, and |z'| meanwhile; what a kick makes of z until it is over.

    `changed` is the part of a change that the modelling terms make. Everything is in units of the box.
    """

    def __init__(self, turn: Any) -> None:
        claim, n = turn.claim, turn.n
        late, size = claim.jitter / claim.period, [[abs(v) for v in row] for row in turn.a]
        block = [[late * v for v in (*row, *unit)] for row, unit in zip(size, identity(n), strict=True)]
        forward = exponential_of([*block, *[[Fraction(0)] * (2 * n)] * n]).part(slice(0, n), slice(None))
        grown = [[up(Fraction(v, 1 << FIXED)) for v in row] for row in forward.sizes()]
        self.grown, area = [row[:n] for row in grown], [row[n:] for row in grown]
        more = turn.more
        worse = [[turn.change[i] * size[i][j] + more[i] * turn.a_spread[i][j] for j in range(n)] for i in range(n)]
        for place, i, share in turn.lags.followed:
            for row, own, spread in zip(worse, more, turn.a_spread, strict=True):
                row[place] += share * own * spread[i]
        driven = [[more[i] * (abs(v) + w) for v, w in zip(turn.b[i], turn.b_spread[i], strict=True)] for i in range(n)]
        grows = inverse_of(_combined(identity(n), _times(area, worse), -1))
        if min(v for row in grows for v in row) < 0:  # not the sum of a series
            raise NotProvedError("the uncertainty is too large for this jitter")
        self.kicks = [[up(v) for v in row] for row in _times(grows, _times(area, driven))]
        self.sudden = _combined(driven, _times(_combined(size, worse, 1), self.kicks), 1)
        sizes = zip(range(turn.m), claim.input_bound, strict=True)
        self.changed = [up(claim.period * turn.loop.drift(k) / bound) for k, bound in sizes]


def _times(left: Matrix, right: Matrix) -> Matrix:
    columns = list(zip(*right, strict=True))
    return [[dot(row, column) for column in columns] for row in left]


def _combined(left: Sequence[Sequence[Fraction]], right: Matrix, sign: int) -> Matrix:
    return [[a + sign * b for a, b in zip(*rows, strict=True)] for rows in zip(left, right, strict=True)]


# --- lag ---

class Lags:
    """Gives a turn another state ζ for each lag: δ s_i acts as δ ζ would, added to z_i wherever that is read.

    `followed` holds the place of each ζ among the states, the row that it follows, and the largest |δ| of that.
    """

    def __init__(self, turn: Any) -> None:
        claim = turn.claim
        self.rows, self.plain, count = claim.lags, len(claim.rows), len(claim.lags)
        n, none = self.plain, [Fraction(0)] * count
        turn.more = [1 + v for v in turn.change] + [Fraction(1)] * count
        self.followed = [(n + k, i, turn.change[i]) for k, i in enumerate(claim.lags)]
        for rows in (turn.a, turn.a_spread):
            rows[:] = [[*row, *none] for row in rows]
        for place, i, share in self.followed:
            alone = all(turn.loop.entry(i, j) == ZERO and turn.a[i][j] == 0 for j in range(n) if j != i)
            need(alone and turn.a[i][i] < 0, "a lag reads nothing but what it follows")
            for j in range(n):
                turn.a_spread[j][place] += up(abs(turn.a[j][i]) * share) if j != i else 0
            own = [*turn.a[i][:n], *none]
            own[place] = turn.a[i][i]
            turn.a.append(own)
            turn.a_spread.append([Fraction(0)] * (n + count))
            turn.a_spread[-1][place] = up(abs(turn.a[i][i]) * share)
            turn.b.append(list(turn.b[i]))
            turn.b_spread.append([Fraction(0)] * turn.m)
        for i in claim.lags:
            turn.change[i] = Fraction(0)
        turn.change += none
        turn.push += none

    def unread(self, rows: list[list[Interval]]) -> None:
        """Refuse a controller that reads a lag."""
        need(all(row[i] == ZERO for row in rows for i in self.rows), "a lag is not measured")

    def spaced(self, row: list[Interval]) -> list[Interval]:
        """A row over (z, …) with a place for the states of lags after z."""
        return [*row[: self.plain], *[ZERO] * len(self.rows), *row[self.plain :]]


# --- lead ---

def sections(
    error: list[Interval], gain: Gain, period: Fraction, places: list[int]
) -> tuple[list[Interval], list[list[Interval]]]:
    """What the last section gives, and what each w is at the next sample, over all that the controller knows."""
    every = inverse(_more(gain.smooth, period))
    direct, rest = mul(_more(gain.lead, period), every), mul(add(gain.smooth, neg(gain.lead)), every)
    kept, new, following = mul(gain.smooth, every), mul((period, period), every), []
    for place in places:
        following.append([mul(v, new) for v in error])
        following[-1][place] = add(following[-1][place], kept)
        error = [mul(v, direct) for v in error]
        error[place] = add(error[place], rest)
    return error, following


def _more(time: Interval, period: Fraction) -> Interval:
    return time[0] + period, time[1] + period


# --- turn ---

#: Sub-steps of a period for outputs.
PHASES = 5


def split_of(rows: list[list[Interval]]) -> tuple[Matrix, Matrix]:
    """Middles of intervals, and distances of the ends from them."""
    middle = [[down((low + high) / 2) for low, high in row] for row in rows]
    pairs = zip(rows, middle, strict=True)
    return middle, [[up(max(v[1] - m, m - v[0])) for v, m in zip(row, own, strict=True)] for row, own in pairs]


class Turn:
    """The loop of constant numbers for a part of the ranges, and what it leaves out.

    Everything is in units of the box: z_i of half_widths_i, v_k of input_bound_k, φ̂ - φ* of network_bound_q, time of
    the period. Z holds z, ζ of lags, φ̂ - φ*, the states of an observer, those of leads, and the pending inputs, newest
    first; columns of maps are over Z, then pulses on the new inputs, on the networks, on the leads and on what the
    observer sees, kicks of jitter to the states, and measurement errors of the states.
    """

    def __init__(self, claim: Claim, loop: Loop, cell: Cell, masses: list[Interval]) -> None:
        self.claim, self.loop = claim, loop
        self.n, self.m, self.q = len(claim.rows) + len(claim.lags), len(claim.inputs), len(claim.networks)
        self.w = 2 if claim.observer else 0
        self.filters = claim.leads * self.m
        self.first = self.n + self.q + self.w + self.filters
        self.order = self.first + self.m * claim.pending
        self.kicked, self.turns = (self.n, self.m) if claim.jitter > 0 else (0, 0)
        self.width = self.m + self.q + self.filters + self.w + self.kicked + self.n
        self.columns = self.order + self.width
        self._plant(cell, masses)
        self.more: list[Fraction] = []
        self.lags = Lags(self)
        self._controller()
        self._observer()
        self.jitter = Jitter(self) if claim.jitter > 0 else None
        self._flow()
        self._phases()
        self._sample()

    def _plant(self, cell: Cell, masses: list[Interval]) -> None:
        """a, b and how far they may be from the truth; μ; known bounds on what acts."""
        claim, loop, n, m = self.claim, self.loop, len(self.claim.rows), self.m
        mass = [down(2 / (1 / low + 1 / high)) for low, high in masses]
        self.change = [up(max(m0 / low - 1, 1 - m0 / high)) for m0, (low, high) in zip(mass, masses, strict=True)]
        rate = [claim.period / (m0 * r) for m0, r in zip(mass, claim.half_widths, strict=True)]

        def scaled(found: Interval, taken: Fraction, factor: Fraction) -> tuple[Fraction, Fraction]:
            return taken * factor, up(max(found[1] - taken, taken - found[0], Fraction(0)) * factor)

        force = [[scaled(loop.entry(i, j), cell.force[i][j], rate[i] * claim.half_widths[j]) for j in range(n)]
                 for i in range(n)]  # fmt: skip
        drive = [[scaled(loop.closed[i].get(f"e{k}", ZERO), cell.drive[i][k], rate[i] * claim.input_bound[k])
                  for k in range(m)] for i in range(n)]  # fmt: skip
        (self.a, self.a_spread), (self.b, self.b_spread) = (
            ([[v[0] for v in row] for row in part], [[v[1] for v in row] for row in part]) for part in (force, drive)
        )
        self.late = [up(loop.late(k) / claim.input_bound[k]) for k in range(m)]
        self.push = [
            up((1 + self.change[i]) * (loop.disturbance[i] * rate[i] + sum(
                ((abs(self.b[i][k]) + self.b_spread[i][k]) * self.late[k] for k in range(m)), Fraction(0))))
            for i in range(n)
        ]  # fmt: skip
        pairs = zip(loop.demand_rate, claim.network_bound, strict=True)
        self.moving = [up(claim.period * r / bound) for r, bound in pairs]

    def _controller(self) -> None:
        """The discrete part over (ẑ, c, w): middles and distances from them; how Z(0) follows from Q(0) and φ̂(0)."""
        claim, loop, n, q = self.claim, self.loop, len(self.claim.rows), self.q
        filtered = [claim.half_widths[row] for row in claim.input_map for _ in range(claim.leads)]
        scale = [*claim.half_widths, *claim.network_bound, *filtered]
        own = claim.networks

        def action(i: int, error: list[Interval]) -> list[Interval]:
            """-b_i times an error, less c_i."""
            row = [mul(neg(loop.half[i]), v) for v in error]
            if i in own:
                row[n + own.index(i)] = add(row[n + own.index(i)], (Fraction(-1), Fraction(-1)))
            return row

        def error(i: int) -> list[Interval]:
            """Q_i."""
            row, target = [ZERO] * len(scale), claim.rows[i]["target"]
            row[i] = (Fraction(1), Fraction(1))
            if not isinstance(target, int):
                return row
            return [add(v, neg(w)) for v, w in zip(row, action(target, error(target)), strict=True)]

        acts, smooths = [], []
        for k, i in enumerate(claim.input_map):
            places = [n + q + place for place in claim.places_of_leads(i)]
            ahead, following = sections(error(i), loop.gain[i], claim.period, places)
            acts.append(_in_units(action(i, ahead), scale, claim.input_bound[k]))
            smooths += [_in_units(row, scale, claim.half_widths[i]) for row in following]
        learns = []
        for j, i in enumerate(own):
            rate = mul(loop.gain[i].gamma, _point(claim.period / claim.network_bound[j]))
            learns.append([mul(mul(rate, v), _point(s)) for v, s in zip(error(i), scale, strict=True)])
        self.lags.unread([*acts, *learns, *smooths])
        acts, learns, smooths = ([self.lags.spaced(row) for row in part] for part in (acts, learns, smooths))
        (self.act, self.act_spread), (self.learn, self.learn_spread) = split_of(acts), split_of(learns)
        self.smooth, self.smooth_spread = split_of(smooths)
        starts = []
        for i, row in enumerate(claim.rows):
            start, target = [ZERO] * (n + q), row["target"]
            start[i] = _point(Fraction(1))
            if isinstance(target, int):
                start[target] = mul(neg(loop.gain[target].beta), _point(Fraction(1, 2)))
                if target in own:
                    start[n + own.index(target)] = _point(Fraction(-1))
            starts.append(_in_units(start, scale[: n + q], claim.half_widths[i]))
        starts = [self.lags.spaced(row) for row in starts] + [[ZERO] * (self.n + q) for _ in claim.lags]
        self.start, self.start_spread = split_of(starts)
        self.noise = [up(v / r) for v, r in zip(claim.noise, claim.half_widths, strict=True)]
        self.noise += [Fraction(0)] * len(claim.lags)
        self.blur = [up(loop.term_noise(row) / claim.input_bound[k]) for k, row in enumerate(claim.input_map)]

    def _observer(self) -> None:
        """What the controller sees of z, over the columns; what is bounded of an observer, and rounding of its gains.

        x̂ = ξ + l_1 (y - ξ), ŝ = η + l_2 (y - ξ); bounded are the errors of both, and y - ξ.
        """
        claim, unit, noise = self.claim, identity(self.columns), self.columns - self.n
        self.seen = [_sum(unit[i], unit[noise + i]) for i in range(self.n)]
        self.shown: Matrix = []
        self.blind: list[Fraction] = []
        if not claim.observer:
            return
        per = claim.half_widths[0] / claim.half_widths[1]
        gains, place, pulse = (
            (claim.observer[0], claim.observer[1] * per),
            self.n + self.q,
            noise - self.kicked - self.w,
        )
        missed = [v - w for v, w in zip(self.seen[0], unit[place], strict=True)]
        for i, gain in enumerate(gains):
            self.seen[i] = _sum(unit[place + i], [gain * v for v in missed], unit[pulse + i])
        errors = [[v - w for v, w in zip(self.seen[i], unit[i], strict=True)] for i in range(2)]
        scale = *claim.half_widths[:2], claim.half_widths[0]
        sizes = [r / bound for r, bound in zip(scale, claim.shown, strict=True)]
        self.shown = [[v * size for v in row] for row, size in zip([*errors, missed], sizes, strict=True)]
        self.blind = [up(ROUNDING * gain / sizes[2]) for gain in gains]
        self.ahead = [[Fraction(1), claim.period / per], [Fraction(0), Fraction(1)]]

    def _flow(self) -> None:
        """(z, p)' = flow (z, p) + (b, 0) held; p is what each demand moves since the last sample."""
        claim, n, m, q = self.claim, self.n, self.m, self.q
        width = n + q
        bounds = claim.network_bound
        pairs, own = list(zip(claim.input_map, claim.input_bound, strict=True)), list(enumerate(claim.networks))
        self.direct = [[Fraction(int(row == i)) * bounds[j] / size for j, i in own] for row, size in pairs]
        self.flow = [[Fraction(0)] * width for _ in range(width)]
        self.sources = [[Fraction(int(i == j)) for j in range(width)] for i in range(width)]
        for i in range(n):
            self.flow[i][:n] = self.a[i]
            for j, row in enumerate(claim.networks):
                self.flow[i][n + j] = sum((self.b[i][k] * self.direct[k][j] for k in range(m)), Fraction(0))
                if i < len(claim.rows) and claim.rows[i]["target"] == row:
                    self.sources[i][n + j] = bounds[j] / claim.half_widths[i]

    def turned(self) -> Matrix:
        """How much the inputs change that act in a period, over the columns; only with jitter."""
        if not self.kicked:
            return []
        old, new = self._waited(self.claim.whole + 1), self._waited(self.claim.whole)
        return [[v - w for v, w in zip(*rows, strict=True)] for rows in zip(new, old, strict=True)]

    def held(self, k: int) -> Ball:
        """The input computed k samples ago, over the columns."""
        return ball(self._waited(k))

    def _waited(self, k: int) -> Matrix:
        if k:
            place = self.first + self.m * (k - 1)
            return identity(self.columns)[place : place + self.m]
        return [self._computed(row, self.order + i) for i, row in enumerate(self.act)]

    def _computed(self, row: list[Fraction], own: int) -> list[Fraction]:
        """What the controller makes of what it sees and of its networks, with a pulse of its own, over the columns."""
        made = [dot(row[: self.n], column) for column in zip(*self.seen, strict=True)]
        for j, value in enumerate(row[self.n :]):
            # the states of an observer stand between networks and leads
            made[self.n + j + (self.w if j >= self.q else 0)] += value
        made[own] += 1
        return made

    def _phases(self) -> None:
        """(z, p) and the held input at both ends of every sub-step, over the columns."""
        claim, n, m, q = self.claim, self.n, self.m, self.q
        before = [(claim.share, self.held(claim.whole + 1), False)] if claim.share > 0 else []
        parts = [*before, (1 - claim.share, self.held(claim.whole), bool(self.kicked))]
        whole = [[*row, *(self.b[i] if i < n else [Fraction(0)] * m)] for i, row in enumerate(self.flow)]
        whole += [[Fraction(0)] * (n + q + m) for _ in range(m)]
        x = Ball([[int(i == j and i < n) << FIXED for j in range(self.columns)] for i in range(n + q)], 0)
        self.steps: list[Fraction] = []
        self.ends: list[tuple[Ball, Ball, Ball]] = []
        for share, acting, switched in parts:
            if switched:
                place = self.columns - self.n - self.kicked
                kick = Ball(
                    [[int(c == place + i and i < n) << FIXED for c in range(self.columns)] for i in range(n + q)], 0
                )
                x = x + kick
            pieces = max(1, round(PHASES * share))
            length = share / pieces
            forward = exponential_of([[v * length for v in row] for row in whole])
            free, driven = (
                forward.part(slice(0, n + q), slice(0, n + q)),
                forward.part(slice(0, n + q), slice(n + q, None)),
            )
            for _ in range(pieces):
                following = free @ x + driven @ acting
                self.ends.append((x, following, acting))
                self.steps.append(length)
                x = following
        self.end = x

    def _sample(self) -> None:
        """Z at the next sample over the columns; how (z, p) at the end of a period enters it; what Z(0) is made of."""
        claim, n, m, q, order = self.claim, self.n, self.m, self.q, self.order
        fold = [[Fraction(0)] * (n + q) for _ in range(order)]
        kept = [[Fraction(0)] * self.columns for _ in range(order)]
        for i in range(n):
            fold[i][i] = Fraction(1)
        for j in range(q):
            fold[n + j][n + j] = Fraction(-1)
            kept[n + j] = self._computed(self.learn[j], order + m + j)
            kept[n + j][n + j] += 1
        for j, row in enumerate(self.smooth):
            kept[n + q + self.w + j] = self._computed(row, order + m + q + j)
        for i in range(self.w):
            kept[n + q + i] = [dot(self.ahead[i], column) for column in zip(*self.seen[:2], strict=True)]
        moved = ball(kept)
        for k in range(claim.pending):
            for i in range(m):
                fold[self.first + m * k + i][n:] = self.direct[i]
            held = self.held(k)
            for i in range(m):
                moved.rows[self.first + m * k + i] = held.rows[i]
        self.fold = ball(fold)
        self.image = self.fold @ self.end + moved
        # Z(0) over Q(0), c(0), measurement errors, errors of the modelling terms
        width = 2 * n + q + m
        unit = identity(width)
        begin = [[*row, *[Fraction(0)] * (n + m)] for row in self.start]
        first = [_sum(row, noise) for row, noise in zip(begin, unit[n + q : 2 * n + q], strict=True)]
        if self.w:  # an observer starts from the first measurement, and at the reference's speed
            first[1] = [Fraction(0)] * width
        begin = [*begin, *unit[n : n + q], *first[: self.w], *[[Fraction(0)] * width] * self.filters]
        for _ in range(claim.pending):
            for k, row in enumerate(self.act):
                made = [dot(row[:n], column) for column in zip(*first, strict=True)]
                for j in range(q):
                    made[n + j] += row[n + j]
                begin.append(_sum(made, unit[2 * n + q + k]))
        self.begin = ball(begin)

    def started(self) -> tuple[list[Fraction], list[Fraction]]:
        """What Z(0) is made of, and bounds on what is not known of its coefficients.

        A network starts at its preload under any demand of the range, or where it rested before.
        """
        claim, n, q = self.claim, self.n, self.q
        first = [up(v / r) for v, r in zip(claim.initial, claim.half_widths, strict=True)]
        first += [Fraction(0)] * len(claim.lags)
        for j, i in enumerate(claim.networks):
            (low, high), preload = claim.demand[j], self.loop.gain[i].preload
            away = max(abs(preload - low), abs(high - preload)) + ROUNDING * abs(preload)
            first.append(up(max(away, self.loop.settled[j]) / claim.network_bound[j]))
        loose = [dot(row, first) for row in self.start_spread]
        size = [dot(map(abs, row), first) for row in self.start]
        unsure = [up(v) for v in loose] + [Fraction(0)] * q + [up(v) for v in loose[: self.w]]
        unsure += [Fraction(0)] * self.filters
        felt = [z + w + noise for z, w, noise in zip(size, loose, self.noise, strict=True)] + first[n:]
        felt += [Fraction(0)] * self.filters
        held = [up(dot(map(abs, self.act[k][:n]), loose) + dot(self.act_spread[k], felt)) for k in range(self.m)]
        return [*first, *self.noise, *self.blur], unsure + held * claim.pending


def _sum(*rows: list[Fraction]) -> list[Fraction]:
    return [sum(column, Fraction(0)) for column in zip(*rows, strict=True)]


def _in_units(row: list[Interval], units: list[Fraction], own: Fraction) -> list[Interval]:
    """A row over other units, in its own."""
    return [mul(v, _point(unit / own)) for v, unit in zip(row, units, strict=True)]


def _point(value: Fraction) -> Interval:
    return value, value


# --- sums ---

WHOLE = 1 << FIXED


def integrals_of(flow: Matrix, length: Fraction) -> tuple[Ball, Ball, Ball]:
    """exp(flow h), and the integrals of exp(flow r) and of (h - r) exp(flow r) over 0 <= r <= h."""
    n = len(flow)
    block = [[*(v * length for v in row), *(length * int(i == j) for j in range(n)), *[Fraction(0)] * n]
             for i, row in enumerate(flow)]  # fmt: skip
    block += [[*[Fraction(0)] * 2 * n, *(length * int(i == j) for j in range(n))] for i in range(n)]
    whole = exponential_of([*block, *([Fraction(0)] * 3 * n for _ in range(n))]).part(slice(0, n), slice(None))
    first, second, third = (whole.part(slice(None), slice(k * n, (k + 1) * n)) for k in range(3))
    return first, second, third


class Piece:
    """f = rows times exp(flow r) times the sources over a sub-step: exact areas, and bounds on ∫|f| where f has a zero.

    Entrywise |exp(flow r)| <= exp(least r), and f' = rows flow exp(flow r) sources.
    """

    def __init__(self, turn: Turn, length: Fraction) -> None:
        flow, sources = turn.flow, ball(turn.sources)
        self.forward, area, _ = integrals_of(flow, length)
        self.area = area @ sources
        least = [[v if i == j else abs(v) for j, v in enumerate(row)] for i, row in enumerate(flow)]
        _, once, late = integrals_of(least, length)
        whole = Ball([[v * length.numerator // length.denominator for v in row] for row in once.rows], once.error + 1)
        self.size, after, before = (times_up(part.sizes(), sources.sizes()) for part in (once, late, whole - late))
        self.slope = times_up(ball([[abs(v) for v in row] for row in flow]).sizes(), larger(after, before))
        grown = [[max(v, Fraction(0)) * length if i == j else v * length for j, v in enumerate(row)]
                 for i, row in enumerate(least)]  # fmt: skip
        self.ceiling = exponential_of(grown).sizes()

    def integral(self, rows: Ball) -> Whole:
        """Bounds on ∫|rows exp(flow r) sources| dr."""
        return larger((rows @ self.area).sizes(), times_up(rows.sizes(), self.slope))


def through(rows: Ball, blocks: list[Ball], ends: list[int]) -> Ball:
    """Rows times a block-diagonal matrix."""
    parts = [rows.part(slice(None), slice(a, b)) @ block for a, b, block in zip(ends, ends[1:], blocks, strict=False)]
    made = parts[0]
    for part in parts[1:]:
        made = made.beside(part)
    return made


def length_of(values: list[int]) -> int:
    """Euclidean norm, rounded up."""
    return abs(values[0]) if len(values) == 1 else math.isqrt(sum(v * v for v in values)) + 1


def norm_of(block: Whole) -> int:
    """Spectral norm of a block of one or two rows, rounded up; of a larger one the bound by its rows and columns."""
    if len(block) == 1:
        return abs(block[0][0])
    if len(block) > 2:
        sums = [max(sum(map(abs, line)) for line in way) for way in (block, zip(*block, strict=True))]
        return math.isqrt(sums[0] * sums[1]) + 1
    (a, b), (c, d) = block
    total, product = a * a + b * b + c * c + d * d, abs(a * d - b * c)
    # the largest σ² is half of t + sqrt(t² - 4 det²)
    return math.isqrt((total + math.isqrt(max(total * total - 4 * product * product, 0)) + 1) // 2 + 1) + 1


def larger(first: Whole, second: Whole) -> Whole:
    """The larger of each pair of entries."""
    return [[max(a, b) for a, b in zip(x, y, strict=True)] for x, y in zip(first, second, strict=True)]


def added(*parts: Whole) -> Whole:
    """Sum of matrices."""
    return [[sum(values) for values in zip(*rows, strict=True)] for rows in zip(*parts, strict=True)]


def times_ratio(part: Whole, numerator: int, denominator: int = 1) -> Whole:
    """A matrix times a ratio, rounded up."""
    return [[-(-v * numerator // denominator) for v in row] for row in part]


def scaled_up(value: int, factor: Fraction) -> int:
    """A number times a ratio, rounded up."""
    return -(-value * factor.numerator // factor.denominator)


class Weighted:
    """Sums or largest values over groups, plain and with weights."""

    def __init__(self, rows: int, columns: int) -> None:
        self.sums = [[[0] * columns for _ in range(rows)] for _ in range(2)]

    def add(self, found: Whole, weight: int) -> None:
        """Add a group."""
        self.sums = [added(self.sums[0], found), added(self.sums[1], times_ratio(found, weight, WHOLE))]

    def keep(self, found: Whole, weight: int) -> None:
        """Keep what a group has that is larger."""
        self.sums = [larger(self.sums[0], found), larger(self.sums[1], times_ratio(found, weight, WHOLE))]


# --- responses ---

#: Sub-steps of a period for sources.
PARTS = 3
#: Grid of the coordinates of a file.
SHORTER = 1 << 48
#: Bits that norms are rounded up by, to keep exact inverses short.
SHORT = FIXED - 64


class Responses:
    """The norms of a loop, plain and weighted; the columns of `rest` are over ρ and the rates of the demands."""

    def __init__(self, turn: Turn, cell: Cell) -> None:
        need(len(cell.columns) == turn.order, f"the loop has {turn.order} states with all that it remembers")
        self.turn, self.cell = turn, cell
        self.pieces: dict[Fraction, Piece] = {}
        self._coordinates()
        self._instants()
        self._groups()

    def _piece(self, length: Fraction) -> Piece:
        if length not in self.pieces:
            self.pieces[length] = Piece(self.turn, length)
        return self.pieces[length]

    def _coordinates(self) -> None:
        """Λ, the blocks of V^-1 F V; N, bounds on the norms of all its blocks; and what Λ leaves out."""
        turn, cell = self.turn, self.cell
        # any coordinates will do: short ones have an inverse that is soon found
        rounded = [[Fraction(round(v * SHORTER), SHORTER) for v in row] for row in cell.columns]
        self.back, columns = ball(inverse_of(rounded)), ball(rounded)
        self.columns = columns
        order = turn.order
        inside = self.back @ turn.image.part(slice(0, order), slice(0, order)) @ columns
        self.ends = [sum(cell.blocks[:k]) for k in range(len(cell.blocks) + 1)]
        self.diagonal = []
        count = len(cell.blocks)
        self.norms, self.missed = ([[0] * count for _ in range(count)] for _ in range(2))
        for i in range(count):
            for j in range(count):
                part = inside.part(slice(*self.ends[i : i + 2]), slice(*self.ends[j : j + 2]))
                room = 2 * inside.error
                if i == j:
                    self.diagonal.append(part.rows)
                    self.norms[i][i], self.missed[i][i] = norm_of(part.rows) + room, room
                else:
                    self.norms[i][j] = self.missed[i][j] = length_of([v for row in part.rows for v in row]) + room
        self.norms = [[-(-v >> SHORT) << SHORT for v in row] for row in self.norms]
        ways = [self._reach(Fraction(1)), self._reach(cell.growth)]
        self.reach = [way[0] for way in ways]
        self.astray = [way[1] for way in ways]
        # with d = (I - g N)^-1 1 it is g N d = d - 1
        self.spare = min(Fraction(WHOLE, sum(row)) for row in self.reach[1])

    def _reach(self, growth: Fraction) -> tuple[Whole, Whole]:
        """(I - g N)^-1, and (I - g N)^-1 g E (I - g N)^-1 with E for what Λ leaves out."""
        count = len(self.norms)
        grown = [[-growth * Fraction(v, WHOLE) + int(i == j) for j, v in enumerate(row)]
                 for i, row in enumerate(self.norms)]  # fmt: skip
        found = inverse_of(grown)
        # a matrix that is not negative has a spectral radius below 1 where I - N has an inverse that is not negative
        if min(v for row in found for v in row) < 0 or not all(grown[i][i] > 0 for i in range(count)):
            raise NotProvedError("the loop does not contract in the coordinates of its certificate")
        reach = [[scaled_up(WHOLE, v) for v in row] for row in found]
        missed = times_ratio(self.missed, growth.numerator, growth.denominator)
        return reach, times_up(times_up(reach, missed), reach)

    def _instants(self) -> None:
        """Rows of the outputs (z, s, v) at both ends of every sub-step, each once; of c, w and an observer's."""
        turn, n, m, q = self.turn, self.turn.n, self.turn.m, self.turn.q
        flow = ball([[*row] for row in turn.flow[:n]])
        direct = ball([[Fraction(0)] * n + row for row in turn.direct])
        self.outputs = 2 * n + m
        self.cx = Ball([*eye(n + q).rows[:n], *flow.rows, *direct.rows], 1)
        entry = Ball([*nothing(n, m).rows, *ball(turn.b).rows, *eye(m).rows], 1)
        made: list[Ball] = []
        index: dict[tuple[int, int], int] = {}
        self.pairs: list[tuple[int, int]] = []
        for begin, end, acting in turn.ends:
            ends = []
            for x in (begin, end):
                key = (id(x), id(acting))
                if key not in index:
                    index[key] = len(made)
                    made.append(self.cx @ x + entry @ acting)
                ends.append(index[key])
            self.pairs.append((ends[0], ends[1]))
        rows = [row for part in made for row in part.rows]
        self.count = len(rows)
        places = [*range(n, n + q), *range(turn.first - turn.filters, turn.first)]
        remembered = [[Fraction(int(c == place)) for c in range(turn.columns)] for place in places]
        chosen = ball([*remembered, *turn.shown, *turn.turned()])
        self.rows = Ball([*rows, *chosen.rows], max(chosen.error, *(part.error for part in made)))

    def _groups(self) -> None:
        """Everything that acts in earlier periods, group by group; then the tail, and the period of the output."""
        turn, cell, order = self.turn, self.cell, self.turn.order
        fold, start = self.back @ turn.fold, self.back @ turn.begin
        acting = self.back @ turn.image.part(slice(0, order), slice(order, None))
        grid = _Grid(self, self._piece(Fraction(1, PARTS)), fold)
        apart, start_apart = self.across(self.stepped(acting)), self.across(self.stepped(start))
        row = self.rows.part(slice(None), slice(0, order)) @ self.columns
        blocks, count, first = self._powers(max(cell.groups)), len(row.rows), self.lengths(row)
        rest, felt, begun = (Weighted(count, width) for width in (len(turn.sources), turn.width, len(start.rows[0])))
        weight, weights = WHOLE, self._weights(max(cell.groups))
        for p in cell.groups:
            sizes, (power, total) = self.lengths(row), blocks[p]
            summed = through(row, total, self.ends)
            weight = (weight * weights[p] >> FIXED) + 1
            rest.add(grid.integrals(row, summed, sizes, p), weight)
            direct, largest = (summed @ acting).sizes(), (row @ start).sizes()
            if p > 1:
                direct = larger(direct, times_ratio(times_up(sizes, apart), p * (p - 1), 2))
                largest = added(largest, times_ratio(times_up(sizes, start_apart), p - 1))
            felt.add(direct, weight)
            begun.keep(largest, scaled_up(weight, 1 / cell.growth))
            row = through(row, power, self.ends)
        last = self.lengths(row)
        now, given = self._current(), self._given()
        (area, held), entry = grid.tail(), self.across(acting)
        unsure = [[scaled_up(WHOLE, v)] for v in turn.started()[1]]
        unknown = self.bounded(times_up(self.back.sizes(), unsure))
        self.sums = []
        for k, growth in enumerate((Fraction(1), cell.growth)):
            strayed = times_up(first, self.astray[k])
            final = added(times_ratio(last, weight, WHOLE) if k else last, strayed)
            tail = times_ratio(times_up(final, self.reach[k]), growth.numerator, growth.denominator)
            off = times_ratio(strayed, growth.numerator, growth.denominator)
            whole = added(rest.sums[k], now, times_up(tail, area), times_up(off, held))
            acted = added(felt.sums[k], given, times_up(tail, entry), times_up(off, entry))
            settling = self._settling(self.across(start), k)
            known = larger(added(begun.sums[k], times_up(off, self.across(start))), times_up(final, settling))
            more = times_up(first, self._settling(unknown, k))
            found = self._between(acted)
            # a kick may be over after the next sample, or begin before the one that it is counted after
            for row in found if turn.kicked else []:
                for j in range(turn.n):
                    row[turn.width - 2 * turn.n + j] += scaled_up(row[turn.width - turn.n + j], growth)
            self.sums.append((self._between(whole, own=True), found,
                              self._between([[*x, *y] for x, y in zip(known, more, strict=True)])))  # fmt: skip

    def _settling(self, entry: Whole, k: int) -> Whole:
        """D with x <= d and g N d <= d: bounds g^j N^j x for all j."""
        growth = self.cell.growth if k else Fraction(1)
        grown = times_ratio(self.norms, growth.numerator, growth.denominator)
        ahead = [
            [max(a - b, 0) for a, b in zip(x, y, strict=True)]
            for x, y in zip(times_up(grown, entry), entry, strict=True)
        ]
        return added(entry, times_up(self.reach[k], ahead))

    def _powers(self, largest: int) -> dict[int, tuple[list[Ball], list[Ball]]]:
        """Λ^p and 1 + Λ + … + Λ^(p-1) for every size of a group."""
        wanted, found = set(self.cell.groups), {}
        power = [eye(len(block)) for block in self.diagonal]
        total = [nothing(len(block), len(block)) for block in self.diagonal]
        blocks = [Ball(block, 0) for block in self.diagonal]
        for p in range(1, largest + 1):
            total = [t + w for t, w in zip(total, power, strict=True)]
            power = [w @ b for w, b in zip(power, blocks, strict=True)]
            if p in wanted:
                found[p] = power, total
        return found

    def _weights(self, largest: int) -> list[int]:
        """growth^p, rounded up."""
        growth, found = scaled_up(WHOLE, self.cell.growth), [WHOLE]
        for _ in range(largest):
            found.append((found[-1] * growth >> FIXED) + 1)
            if found[-1] >> 2 * FIXED:
                raise NotProvedError("the weight of the transient is too large for these periods")
        return found

    def lengths(self, rows: Ball) -> Whole:
        """Norms by block of rows over y."""
        ends, error = self.ends, 2 * rows.error
        return [[length_of(row[a:b]) + error for a, b in pairwise(ends)] for row in rows.rows]

    def across(self, columns: Ball) -> Whole:
        """Norms by block of columns over y."""
        return self.bounded(columns.sizes())

    def bounded(self, sizes: Whole) -> Whole:
        """The same of bounds on their entries."""
        ends = self.ends
        return [[length_of([row[c] for row in sizes[a:b]]) for c in range(len(sizes[0]))]
                for a, b in pairwise(ends)]  # fmt: skip

    def stepped(self, columns: Ball) -> Ball:
        """(Λ - 1) times columns."""
        rows, error = [], 0
        for block, first in zip(self.diagonal, self.ends, strict=False):
            part = Ball(block, 0) @ columns.part(slice(first, first + len(block)), slice(None))
            rows, error = [*rows, *part.rows], max(error, part.error)
        return Ball(rows, error) - columns

    def _given(self) -> Whole:
        """What acts on the outputs at once; while jitter decides which input acts, z is otherwise by a kick at most."""
        turn, n, size = self.turn, self.turn.n, self.outputs
        found = self.rows.part(slice(None), slice(turn.order, None)).sizes()
        place = turn.width - n - turn.kicked
        for r in range(self.count if turn.kicked else 0):
            if r % size < n:
                for j, value in enumerate(turn.jitter.grown[r % size] if turn.jitter else []):
                    found[r][place + j] += scaled_up(WHOLE, value)
        return found

    def _current(self) -> Whole:
        """What acts in the period of the output, before it."""
        turn, size = self.turn, self.outputs
        pieces = [self._piece(h) for h in turn.steps]
        found = [[0] * len(turn.sources) for _ in self.rows.rows]
        written: set[int] = set()
        for j in range(len(turn.steps)):
            rows, total = self.cx, [[0] * len(turn.sources) for _ in range(size)]
            for i in range(j, -1, -1):
                total = added(total, pieces[i].integral(rows))
                rows = rows @ pieces[i].forward
            ends = [self.pairs[j][1]] + ([self.pairs[j + 1][0]] if j + 1 < len(turn.steps) else [])
            for place in ends:
                if place not in written:
                    written.add(place)
                    found[place * size : (place + 1) * size] = total
        # what the demands move while the input before still acts
        late = turn.claim.jitter / turn.claim.period
        for r in range(self.count if turn.kicked else 0):
            for j in range(turn.q if r % size >= 2 * turn.n else 0):
                found[r][turn.n + j] += scaled_up(WHOLE, late * turn.direct[r % size - 2 * turn.n][j])
        return found

    def _between(self, values: Whole, *, own: bool = False) -> Whole:
        """The largest over all phases, from both ends of each sub-step, with h²/8 of the curvature between them."""
        turn, n, q, size = self.turn, self.turn.n, self.turn.q, self.outputs
        width = len(values[0])
        best = [[0] * width for _ in range(size)]
        bend = (self.cx @ ball(turn.flow)).sizes()
        for (early, late), h in zip(self.pairs, turn.steps, strict=True):
            a, b = (values[place * size : (place + 1) * size] for place in (early, late))
            speed = [*a[n : 2 * n], *[[0] * width for _ in range(q)]]
            speed = added(speed, ball(turn.sources).sizes()) if own else speed
            curved = times_up(times_up(bend, self._piece(h).ceiling), speed)
            square = scaled_up(WHOLE, h * h / 8)
            more = [[(v * square >> FIXED) + 1 for v in row] for row in curved]
            best = larger(best, added(larger(a, b), more))
        return [*best, *values[self.count :]]


class _Grid:
    """Sub-steps of a period for sources, in coordinates y."""

    def __init__(self, responses: Responses, piece: Piece, fold: Ball) -> None:
        self.responses, self.piece = responses, piece
        self.parts: list[tuple[Ball, Ball, Whole]] = []
        for _ in range(PARTS):
            self.parts.append((fold, fold @ piece.area, responses.across(responses.stepped(fold))))
            fold = fold @ piece.forward

    def tail(self) -> tuple[Whole, Whole]:
        """Bounds by block on the integrals over a period of all that acts, with its signs and without."""
        bounded, areas, sizes = self.responses.bounded, [], []
        for inward, area, _ in self.parts:
            within = inward.sizes()
            areas.append(larger(self.responses.across(area), bounded(times_up(within, self.piece.slope))))
            sizes.append(bounded(times_up(within, self.piece.size)))
        return added(*areas), added(*sizes)

    def integrals(self, row: Ball, summed: Ball, sizes: Whole, p: int) -> Whole:
        """Bounds on the integrals of a group of p periods, over a period."""
        total: Whole = []
        for inward, area, apart in self.parts:
            here = (row @ inward).sizes()
            change = times_up(sizes, apart) if p > 1 else [[0] * len(here[0])] * len(here)
            moved = [[a + (p - 1) * b for a, b in zip(x, y, strict=True)] for x, y in zip(here, change, strict=True)]
            bound = times_up(moved, self.piece.slope)
            if p > 1:
                half = times_up(change, self.piece.size)
                bound = [
                    [a + (p - 1) * b // 2 + 1 for a, b in zip(x, y, strict=True)]
                    for x, y in zip(bound, half, strict=True)
                ]
            found = larger((summed @ area).sizes(), [[p * v for v in line] for line in bound])
            total = added(total, found) if total else found
        return total


# --- obligation ---

@dataclass(frozen=True)
class Obligation:
    """One verdict."""

    name: str
    statement: str
    margin: float
    unit: str
    verdict: str
    remedy: str = ""
    member: str = ""


@dataclass(frozen=True)
class Use:
    """What is certified of a limit: share is the certified size over the limit."""

    member: str
    name: str
    share: float


@dataclass(frozen=True)
class Report:
    """The verdict on one file: status 0 proved, 1 not proved, 2 unreadable.

    `uses` are the shares of the limits, `bundled` what the study left to the bundled machine `model`, `assumed` what
    has no source, `records` what of a draft's records contradicts the study or the proof; `required` are the study's
    requirements, with what is proved of each, or None where it is simulated only.
    """

    file: str
    status: int
    message: str
    obligations: list[Obligation] = field(default_factory=list)
    uses: list[Use] = field(default_factory=list)
    bundled: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    model: str = ""
    records: str = ""
    required: dict[str, tuple[float, float | None]] = field(default_factory=dict)


def decided(name: str, statement: str, margin: Fraction, unit: str, remedy: str, *, member: str = "",
            strict: bool = True) -> Obligation:  # fmt: skip
    """An obligation, proved where its margin is positive, or zero where that is enough."""
    good = margin > 0 or (margin == 0 and not strict)
    size = Fraction(10) ** 300
    shown = below(max(-size, min(size, margin)))
    return Obligation(name, statement, shown, unit, "proved" if good else "undecided", "" if good else remedy, member)


def below(x: Fraction) -> float:
    """A float that is not above x."""
    found = float(x)
    return math.nextafter(found, -math.inf) if Fraction(found) > x else found


def above(x: Fraction) -> float:
    """A float that is not below x, nor is its shortest decimal."""
    found = float(x)
    while min(Fraction(found), Fraction(repr(found))) < x:
        found = math.nextafter(found, math.inf)
    return found


def downward(x: Fraction | float, digits: int = 4) -> str:
    """A margin in few digits, not above it."""
    return _rounded(Fraction(x), digits, ROUND_FLOOR)


def upward(x: Fraction | float, digits: int = 4) -> str:
    """A bound in few digits, not below it."""
    return _rounded(Fraction(x), digits, ROUND_CEILING)


def _rounded(x: Fraction, digits: int, rounding: str) -> str:
    context = Context(prec=digits, rounding=rounding)
    return f"{float(context.divide(Decimal(x.numerator), Decimal(x.denominator))):.{digits}g}"


def milli(bound: Fraction, unit: str) -> str:
    """A bound in thousandths of its unit, four digits, rounded up."""
    return f"{upward(1000 * bound)} m{unit}"


def percent(share: Fraction | float, *, up: bool) -> str:
    """A share in percent, three digits, rounded up or down."""
    return f"{upward(100 * Fraction(share), 3) if up else downward(100 * Fraction(share), 3)} %"


# --- impulse ---

#: What a guess is made for is enlarged by this share, so that the exact inequality is strict.
ROOM = Fraction(1, 1 << 30)


class Bounded:
    """One cell: what y = (z, s, v, c, w, an observer's) reaches, and how fast what a start makes of it shrinks."""

    def __init__(self, turn: Turn, cell: Cell) -> None:
        self.turn, self.cell = turn, cell
        found = Responses(turn, cell)
        self.spare = found.spare
        plain, weighted = ([_fractions(part) for part in sums] for sums in found.sums)
        self.reads, pulses = self._reads()
        n, m = turn.n, turn.m
        self.gain = [self._gain(sums) for sums in (plain, weighted)]
        forced = [dot(row[:n], turn.push) + dot(row[n:], turn.moving) for row in plain[0]]
        forced = [v + dot(row, [*pulses, *turn.noise]) for v, row in zip(forced, plain[1], strict=True)]
        first = [*turn.started()[0], Fraction(1)]
        begun = [[dot(row, first) for row in sums[2]] for sums in (plain, weighted)]
        whole = bounded(self.gain[0], [a + b for a, b in zip(forced, begun[0], strict=True)])
        acted = [dot(row, whole) + push for row, push in zip(self.reads[:n], turn.push, strict=True)]
        moved = [dot(row[n:], turn.moving) for row in turn.sources[:n]]
        rates = [up(s + r + p) for s, r, p in zip(whole[n : 2 * n], acted, moved, strict=True)]
        if turn.jitter:
            changes = [v + w for v, w in zip(whole[-m:], turn.jitter.changed, strict=True)]
            rates = [up(v + dot(row, changes)) for v, row in zip(rates, turn.jitter.sudden, strict=True)]
        self.rates = self._joined(rates)[: len(turn.claim.rows)]
        self.forced = self._read(bounded(self.gain[0], forced))
        self.whole, self.amplitude = self._read(whole), self._read(bounded(self.gain[1], begun[1]))
        n = len(turn.claim.rows)
        self.inputs = [v + late for v, late in zip(self.whole[2 * n : 2 * n + m], turn.late, strict=True)]
        after = 2 * n + m + turn.q
        self.missed = self.whole[2 * n + m : after]
        after += turn.filters
        self.missed += self.whole[after : after + len(turn.shown)]

    def _joined(self, reached: list[Fraction]) -> list[Fraction]:
        """Bounds with z as it is, of bounds on y or on rates."""
        found = list(reached)
        for place, i, share in self.turn.lags.followed:
            found[i] = up(found[i] + share * reached[place])
        return found

    def _read(self, reached: list[Fraction]) -> list[Fraction]:
        """Bounds on y with z as it is, and without what only lags have."""
        n, whole, found = len(self.turn.claim.rows), self.turn.n, self._joined(reached)
        return [*found[:n], *found[whole : whole + n], *found[2 * whole :]]

    def _reads(self) -> tuple[Matrix, list[Fraction]]:
        """S: |ρ| and the pulses on inputs, networks, leads and an observer over y; and what of them is known."""
        turn, n, m, q = self.turn, self.turn.n, self.turn.m, self.turn.q
        rest = [Fraction(0)] * (len(turn.shown) + turn.turns)
        kicks, changed = (turn.jitter.kicks, turn.jitter.changed) if turn.jitter else ([], [])
        nothing = [Fraction(0)] * (q + turn.filters) + rest
        reads = []
        for i in range(n):
            more = turn.more[i]
            row = [more * v for v in turn.a_spread[i]]
            row += [turn.change[i] * int(i == j) for j in range(n)]
            reads.append([*row, *(more * v for v in turn.b_spread[i]), *nothing])
        known = list(turn.blur) + [Fraction(0)] * (q + turn.filters + turn.w) + [dot(row, changed) for row in kicks]
        errors = [size / r for size, r in zip(turn.claim.measured, turn.claim.half_widths, strict=True)]
        errors += [Fraction(0)] * len(turn.claim.lags)
        for k, row in enumerate([*turn.act_spread, *turn.learn_spread, *turn.smooth_spread]):
            reads.append([*row[:n], *[Fraction(0)] * (n + m), *row[n:], *rest])
            known[k] += dot(row[:n], errors)
        ahead = [Fraction(0)] * (len(reads[0]) - turn.turns)
        for gain in turn.blind:
            reads.append([*ahead[:-1], gain, *[Fraction(0)] * turn.turns])
        reads += [[*ahead, *row] for row in kicks]
        for row in reads:
            for place, i, share in turn.lags.followed:
                row[place] += share * row[i]
        return [[up(v) for v in row] for row in reads], [up(v) for v in known]

    def _gain(self, sums: list[Matrix]) -> Matrix:
        """Λ S."""
        n, count = self.turn.n, self.turn.width - self.turn.n
        columns = list(zip(*self.reads, strict=True))
        return [
            [up(dot([*rest[:n], *pulses[:count]], column)) for column in columns]
            for rest, pulses in zip(sums[0], sums[1], strict=True)
        ]

    def contracts(self) -> Fraction:
        """1 - max (Λ S s)_i / s_i for an s > 0 in which the gain is small, of both sums."""
        return min(1 - max(dot(row, s) / own for row, own in zip(gain, s, strict=True)) for gain in self.gain
                   for s in [bounded(gain, [Fraction(1)] * len(gain))])  # fmt: skip


def _fractions(part: Whole) -> Matrix:
    return [[up(Fraction(v, 1 << FIXED)) for v in row] for row in part]


def bounded(gain: Matrix, known: list[Fraction]) -> list[Fraction]:
    """Y > 0 with known + gain y < y: nothing larger satisfies y <= known + gain y. The guess is of floats."""
    count, room = len(known), ROOM * (max(known) or 1)
    known = [k + room for k in known]
    if max(*known, *(v for row in gain for v in row)) > MOST:
        raise NotProvedError("the uncertainty is too large for this loop: its gain is not small")
    work = [[float(int(i == j) - v) for j, v in enumerate(row)] + [float(k)] for i, (row, k) in
            enumerate(zip(gain, known, strict=True))]  # fmt: skip
    for i in range(count):
        pivot = max(range(i, count), key=lambda k: abs(work[k][i]))
        work[i], work[pivot] = work[pivot], work[i]
        if not abs(work[i][i]) > 0:
            break
        work[i] = [v / work[i][i] for v in work[i]]
        for k in range(count):
            if k != i:
                factor = work[k][i]
                work[k] = [a - factor * b for a, b in zip(work[k], work[i], strict=True)]
    if all(0 < row[-1] < 1e300 for row in work):
        guess = [up(Fraction(row[-1])) for row in work]
        if all(k - room + dot(row, guess) < own for row, own, k in zip(gain, guess, known, strict=True)):
            return guess
    raise NotProvedError("the uncertainty is too large for this loop: its gain is not small")


class Impulse:
    """Verdicts on a member: each cell of the ranges by itself."""

    def __init__(self, claim: Claim, loop: Loop) -> None:
        self.claim, self.loop = claim, loop
        for cell in claim.cells:
            rows, substeps = (PHASES + 1) * (2 * len(claim.rows) + 1), PARTS * len(cell.groups)
            order = len(cell.columns)
            WORK.one(
                (rows * substeps * order * (len(claim.rows) + 1) + 8 * max(cell.groups) * order + 20 * order**3) // COST
            )
        pieces = self._pieces()
        # what φ* and b* are is told by middles of ranges: in every piece they are others
        self.loops = [own for _, own in pieces]
        parts = [
            (part, own, list(masses))
            for part, own in pieces
            for masses in product(*map(parts_of, own.mass, claim.split))
        ]
        cells = zip(claim.cells, parts, strict=True)
        self.cells = [Bounded(Turn(part, own, cell, masses), cell) for cell, (part, own, masses) in cells]
        self.later: dict[int, list[Fraction]] = {}

    def _pieces(self) -> list[tuple[Claim, Loop]]:
        """The statement with every combination of parts of the constants that are cut, the last one running fastest."""
        claim = self.claim
        if not claim.parts:
            return [(claim, self.loop)]
        cuts = [parts_of(claim.parameters[name], count) for name, count in claim.parts.items()]
        chosen = [dict(zip(claim.parts, ranges, strict=True)) for ranges in product(*cuts)]
        pieces = [replace(claim, parameters={**claim.parameters, **part}) for part in chosen]
        return [(piece, Loop(piece, ROUNDING)) for piece in pieces]

    def contraction(self) -> Fraction:
        """How far the slowest cell is from not contracting, with the weight of its transient."""
        return min(cell.spare for cell in self.cells)

    def small_gain(self) -> Fraction:
        """1 less the gain of what is uncertain."""
        return min(cell.contracts() for cell in self.cells)

    def invariance(self) -> Fraction:
        """Deviations, inputs, networks and demands stay inside the box in which the model was bounded."""
        claim, spare = self.claim, []
        for cell in self.cells:
            spare += [1 - v for v in (*cell.whole[: len(claim.rows)], *cell.inputs, *cell.missed)]
        for loop in (self.loop, *self.loops):
            for found, taken in zip(loop.demand, claim.demand, strict=True):
                size = max(abs(end) for end in taken) or Fraction(1)
                spare += [(found[0] - taken[0]) / size, (taken[1] - found[1]) / size]
        return min(spare)

    def estimates(self) -> list[Fraction]:
        """Bounds on |φ̂| of the rows with a network."""
        pairs = zip(self.claim.demand, self.claim.network_bound, strict=True)
        return [max(abs(low), abs(high)) + bound for (low, high), bound in pairs]

    def _after(self, time: Fraction) -> list[Fraction]:
        """Bounds on y from a time on, in units of the box."""
        periods = int(time / self.claim.period)
        if periods not in self.later:
            found = []
            for cell in self.cells:
                left = 1 / _power(cell.cell.growth, periods)
                parts = zip(cell.forced, cell.amplitude, cell.whole, strict=True)
                found.append([min(forced + left * start, whole) for forced, start, whole in parts])
            self.later[periods] = [max(column) for column in zip(*found, strict=True)]
        return self.later[periods]

    def sizes(self, time: Fraction) -> list[Fraction]:
        """Bounds on |z| and on |v|, as commanded, from a time on."""
        claim, after, n, m = self.claim, self._after(time), len(self.claim.rows), len(self.claim.inputs)
        late = [max(cell.turn.late[k] for cell in self.cells) for k in range(m)]
        moved = [*after[:n], *(v + w for v, w in zip(after[2 * n : 2 * n + m], late, strict=True))]
        whole = [*claim.half_widths, *claim.input_bound]
        return [min(up(v * r), r) for v, r in zip(moved, whole, strict=True)]

    def ultimate(self, i: int) -> Fraction:
        """Bound on |z_i| from the end of the transient on."""
        return self.sizes(self.claim.transient)[i]

    def largest(self, name: str) -> Fraction:
        """Bound on |input| as commanded, or on |state|: the start while the reference rests, what is left in motion."""
        claim = self.claim
        whole = [*claim.half_widths, *claim.input_bound]
        if not claim.rest[1] > 0:
            return max(loop.size(name, whole, resting=False) for loop in self.loops)
        moving = self.sizes(claim.rest[1])
        sizes = [(loop.size(name, moving, resting=False), loop.size(name, whole, resting=True)) for loop in self.loops]
        return max(max(pair) for pair in sizes)

    def norm(self, signals: list[str]) -> Fraction:
        """Bound on the norm of inputs as commanded, or of states."""
        return root(up(sum((self.largest(s) ** 2 for s in signals), Fraction(0))), True)

    def speed(self, i: int) -> Fraction:
        """Bound on |z_i'| for all t."""
        return up(max(cell.rates[i] for cell in self.cells) * self.claim.half_widths[i] / self.claim.period)

    def rate(self) -> Fraction:
        """A bound from below on the rate at which what a start makes shrinks, 1/s: ln g >= 2 (g - 1)/(g + 1)."""
        least = min(cell.cell.growth for cell in self.cells)
        return 2 * (least - 1) / (least + 1) / self.claim.period


def parts_of(whole: Interval, count: int) -> list[Interval]:
    """A range in parts that cover it: of about equal ratios where it is positive, of equal widths elsewhere."""
    low, high = whole
    if low > 0:
        ratio = float(high / low)
        cuts = [down(low * Fraction(ratio ** (k / count))) for k in range(1, count)]
    else:
        cuts = [down(low + (high - low) * k / count) for k in range(1, count)]
    return list(pairwise([low, *(min(max(cut, low), high) for cut in cuts), high]))


#: A power that is larger than this counts as this.
MOST = Fraction(1 << 256)
#: What a product of a summation costs, in products of intervals.
COST = 40


def _power(base: Fraction, exponent: int) -> Fraction:
    """base^exponent for base >= 1, rounded down."""
    found, bits = Fraction(1), FIXED
    for bit in bin(exponent)[2:]:
        found = found * found * (base if bit == "1" else 1)
        found = min(Fraction((found.numerator << bits) // found.denominator, 1 << bits), MOST)
    return found


# --- golden ---

def golden_agree(vectors: Any, claim: Claim) -> bool:
    """The recorded input/output vectors follow from the gains and the law, to float accuracy."""
    need(isinstance(vectors, list) and 20 <= len(vectors) <= 100, "golden must hold 20 to 100 vectors")
    WORK.one(len(vectors) * sum(len(term["operations"]) for term in claim.law) // 8)
    pairs = [_golden_one(vector, claim) for vector in vectors]
    for column in zip(*pairs, strict=True):
        size = max((abs(found) for found, _ in column), default=0.0)
        if not all(math.isfinite(a) and abs(a - float(b)) <= SHARE * size + TINIEST for a, b in column):
            return False
    return True


#: Agreement that is asked for, as a share of the largest value of a component, and of values that are all zero.
SHARE, TINIEST = 1e-9, 1e-300


def _golden_one(vector: dict[str, Any], claim: Claim) -> list[tuple[float, Any]]:
    """What follows and what is recorded, for every component."""
    n, k = len(claim.rows), len(claim.controlled)
    x, r, theta, phi = (
        [float(v) for v in numbers(vector[key], count, "golden")]
        for key, count in (("x", n), ("r", 4), ("theta", k), ("phi", k))
    )
    named = {row["state"]: value for row, value in zip(claim.rows, x, strict=True)}
    named |= {f"r{j}": value for j, value in enumerate(r)}
    named |= {f"nominal.{name}": float(value) for name, value in claim.nominal.items()}
    known = [name for name in claim.feedforward if name not in claim.nominal]
    foreseen = numbers(vector.get("load", []), len(known), "golden")
    named |= {f"nominal.{name}": float(value) for name, value in zip(known, foreseen, strict=True)}
    remembered = [float(v) for v in numbers(vector.get("lead", []), claim.leads * len(claim.inputs), "golden")]
    period, led = float(claim.period), list(remembered)
    virtual: dict[int, float] = {}
    following, errors = [], []
    for j, i in enumerate(claim.controlled):
        target = claim.rows[i]["target"]
        goal = r[0] if target == "reference" else 0.0 if target == "zero" else virtual[target]
        beta, epsilon, delta, sigma, *_, lead, smooth = (float(g) for g in claim.gains[j])
        error, program = x[i] - goal, claim.law[j]
        term = walk(program, named.__getitem__, float, float_apply)[program["outputs"][0]]
        acting = error
        for place in claim.places_of_leads(i):
            w, every = remembered[place], smooth + period
            led[place] = (smooth * w + period * acting) / every
            acting = ((lead + period) * acting + (smooth - lead) * w) / every
        virtual[i] = -(beta + epsilon * theta[j]) * acting / 2 + term - phi[j]
        errors.append(error)
        step = epsilon * delta * error * error / 2 - delta * sigma * theta[j]
        following.append(theta[j] + period * step)
    asked = [virtual[row] for row in claim.input_map]
    norm, limit = math.hypot(*asked), float(claim.limits[0]["value"])
    wanted = [value * (limit / max(norm, limit)) for value in asked]
    learned = []
    for j, i in enumerate(claim.controlled):
        gamma, capacity, own = float(claim.gains[j][4]), float(claim.gains[j][5]), _input_of(claim, i)
        held = abs(asked[own]) > abs(wanted[own]) and -errors[j] * asked[own] > 0
        step = 0.0 if held else period * gamma * errors[j]
        learned.append(min(max(phi[j] + step, -capacity), capacity))
    pairs = list(zip(wanted, numbers(vector["u"], len(wanted), "golden"), strict=True))
    pairs += zip(following, numbers(vector["theta_next"], k, "golden"), strict=True)
    pairs += zip(learned, numbers(vector["phi_next"], k, "golden"), strict=True)
    pairs += zip(led, numbers(vector.get("lead_next", []), len(led), "golden"), strict=True)
    return pairs


def _input_of(claim: Claim, row: int) -> int:
    """The input at the end of the chain that a row begins."""
    following = next((j for j in claim.controlled if claim.rows[j]["target"] == row), None)
    return claim.input_map.index(row) if following is None else _input_of(claim, following)


def float_apply(operator: str, a: float, b: float = 0.0) -> float:
    """Operations in floats."""
    simple = {"add": a + b, "sub": a - b, "mul": a * b, "neg": -a, "sq": a * a, "max": max(a, b)}
    if operator in simple:
        return simple[operator]
    if operator in ("sin", "cos"):
        return math.sin(a) if operator == "sin" else math.cos(a)
    return a / b if operator == "div" else math.tanh(a) if operator == "tanh" else math.sqrt(a)


# --- effects ---

#: Shares of the certified size of every state and input at which a plant is looked at.
SHARES = (-1.0, -0.5, -0.1, -0.01, -0.001, 0.0, 0.001, 0.01, 0.1, 0.5, 1.0)


def effects_of(claim: Claim, ranges: dict[str, Interval]) -> dict[str, Fraction]:
    """The effect on a plant, relative to its row, of going through each stated range inside the certified set.

    A number without a range is moved by a percent; one that is zero is left out.

    Args:
        claim: The statement.
        ranges: Range of every state and input over the certified set.
    """
    stated = {**claim.parameters, **claim.disturbances}
    for name, (value, _) in claim.feedforward.items():
        stated[name] = value[0] + stated[name][0], value[1] + stated[name][1]
    middle = {name: float((low + high) / 2) for name, (low, high) in stated.items()}
    points = [{name: _clipped(low, high, share) for name, (low, high) in ranges.items()} for share in SHARES]
    rates = [_rates(claim, {**middle, **point}) for point in points]
    size = [max(max(abs(r[i]) for r in rates), 1e-300) for i in range(len(claim.rows))]
    found: dict[str, Fraction] = {}
    for name, (low, high) in stated.items():
        ends = _ends(low, high)
        if ends is None:
            continue
        seen = 0.0
        for point in points:
            one, other = (_rates(claim, {**middle, **point, name: end}) for end in ends)
            seen = max(seen, *(abs(a - b) / s for a, b, s in zip(one, other, size, strict=True)))
        found[name] = Fraction(seen)
    return found


def mirrored(ranges: dict[str, Interval]) -> dict[str, Interval]:
    """Where every state has its other sign: a backlash is felt there whose contact never opens in the certified set."""
    return {name: (-high, -low) for name, (low, high) in ranges.items()}


def _clipped(low: Fraction, high: Fraction, share: float) -> float:
    """A share of the largest size of a range, where it lies inside it; else the end that is nearer."""
    wanted = share * max(abs(float(low)), abs(float(high)))
    return min(max(wanted, float(low)), float(high))


def _ends(low: Fraction, high: Fraction) -> tuple[float, float] | None:
    if low < high:
        return float(low), float(high)
    return (float(low), float(low) * 1.01) if low else None


def _rates(claim: Claim, values: dict[str, float]) -> list[float]:
    n, entries = len(claim.rows), run(claim.plant, values.__getitem__)
    return [entries[n + i] / entries[i] for i in range(n)]


def run(program: dict[str, Any], read: Callable[[str], float]) -> list[float]:
    """Outputs of an operation list in floats."""
    WORK.one(1 + len(program["operations"]) // 16)
    try:
        entries = walk(program, read, float, float_apply)
    except (ArithmeticError, ValueError):
        raise NotProvedError("the model has no value at its operating points") from None
    return [entries[i] for i in program["outputs"]]


def felt(
    program: dict[str, Any], middle: dict[str, float], ranges: Mapping[str, Iterable[Any]]
) -> dict[str, list[float]]:
    """How much each output of an operation list changes over a range of each of its inputs, others at their middle."""
    found = {}
    for name, ends in ranges.items():
        one, other = (run(program, {**middle, name: float(end)}.__getitem__) for end in ends)
        found[name] = [abs(a - b) for a, b in zip(one, other, strict=True)]
    return found


# --- obligations ---

def authority(claim: Claim, loop: Loop, verdict: Impulse) -> list[tuple[Fraction, str, str]]:
    """Distance of each limited norm from its limit over the certified set; then the stroke."""
    result = []
    for limit in claim.limits:
        result.append((limit["value"] - verdict.norm(limit["signals"]), str(limit["unit"]), str(limit["name"])))
    position = loop.nodes[claim.rows[0]["state"]].range
    unit = str(claim.rows[0]["unit"])
    result.append((min(position[0] - claim.stroke[0], claim.stroke[1] - position[1]), unit, "stroke"))
    return result


def adaptation(claim: Claim, loop: Loop, verdict: Impulse) -> tuple[Fraction, str]:
    """1 - T_s δσ keeps sampled θ̂ >= 0; |φ̂| < Φ keeps every network from its bound. The smaller one, and what it is."""
    slack = [(1 - claim.period * g.delta[1] * g.sigma[1], "theta stays 0 or more") for g in loop.gain.values()]
    for i, size in zip(claim.networks, verdict.estimates(), strict=True):
        state, capacity = claim.rows[i]["state"], loop.gain[i].capacity * (1 - ROUNDING)
        used = percent(size / capacity, up=True) if capacity > 0 else "more than all"
        slack.append(
            (1 - size / capacity if capacity > 0 else Fraction(-1), f"phi of {state} uses {used} of its bound")
        )
    return min(slack)


def vacuity(claim: Claim) -> Fraction:
    """1 where everything that must be positive is, and -1 elsewhere."""
    may_be_zero = [*claim.noise, *claim.initial, claim.delay]
    positive = [claim.period, claim.accuracy, *claim.half_widths, *claim.input_bound, *claim.network_bound]
    positive += claim.shown
    positive += [limit["value"] for limit in claim.limits] + [claim.stroke[1] - claim.stroke[0]]
    return Fraction(-1 if min(positive) <= 0 or min(may_be_zero) < 0 else 1)


def obligations(claim: Claim) -> tuple[list[Obligation], Loop, Impulse]:
    """Decide every obligation of the law; with the closed loop, and the verdicts on it."""
    made: list[Obligation] = []

    def state(name: str, statement: str, margin: Fraction, unit: str, remedy: str, strict: bool = True) -> None:
        made.append(decided(name, statement, margin, unit, remedy, member=claim.name, strict=strict))

    anew = "a certificate made for these gains and assumptions: run design again"
    statement = "the box is not empty, and no limit is zero"
    state("non-vacuity", statement, vacuity(claim), "1", "positive limits and bounds")
    if made[0].verdict != "proved":
        raise NotProvedError("the certificate is about an empty set (obligation non-vacuity)")
    loop = Loop(claim, ROUNDING)
    verdict = Impulse(claim, loop)
    ranges = {row["state"]: loop.nodes[row["state"]].range for row in claim.rows}
    box = [*claim.half_widths, *claim.input_bound]
    ranges |= {name: symmetric(loop.size(name, box, resting=False)) for name in claim.inputs}
    effects = effects_of(claim, ranges)
    spare = {name: v / (LEAST_LOAD if name in claim.disturbances else LEAST_EFFECT) for name, v in effects.items()}
    beyond = ""
    idle = spare.get(IDLE, 1) < 1 and not loop.table.undecided
    if idle and effects_of(claim, mirrored(ranges))[IDLE] >= LEAST_EFFECT:
        del spare[IDLE]
        beyond = f", {IDLE} where the certified set does not reach"
    weakest = min(spare, key=spare.__getitem__, default="")
    loads = "".join(
        f"{name} moves its row by {percent(effects[name], up=False)}, "
        for name in claim.disturbances
        if name in effects
    )
    statement = f"the plant feels everything that the study states: {loads}{weakest} is felt least{beyond}"
    margin = min(spare.values(), default=Fraction(2)) - 1
    state("plant", statement, margin, "1", f"a plant that feels {weakest}")
    span = claim.reference[0]
    inside = min(span[0] - claim.stroke[0], claim.stroke[1] - span[1])
    statement = "the reference is continuous to its acceleration, ends at rest and stays inside the stroke"
    unit = str(claim.rows[0]["unit"])
    state("reference", statement, inside, unit, f"waypoints {float(-inside):.3g} {unit} further inside the stroke")
    statement = f"from period to period what a start makes shrinks at {downward(verdict.rate())} 1/s or more"
    state("contraction", statement, verdict.contraction(), "1", anew)
    delayed = f", {upward(claim.delay, 3)} s late" if claim.delay else ""
    statement = f"the loop at {float(1 / claim.period):g} Hz{delayed} bears what is uncertain of it"
    state("small gain", statement, verdict.small_gain(), "1", f"a faster rate, or {anew}")
    state("invariance", "no trajectory from the initial set leaves the assumed box", verdict.invariance(), "1", anew)
    slack, unit, which = min(authority(claim, loop, verdict), key=lambda entry: entry[0] / scale(claim, entry[2]))
    used = percent(1 - slack / scale(claim, which), up=True)
    statement = f"every limit holds over the certified set; the tightest is {which}, of which {used} are used"
    state("authority", statement, slack, unit, f"a limit on {which} that is {float(-slack) * 1.001:.4g} {unit} wider")
    spare, statement = adaptation(claim, loop, verdict)
    faster = max(float(g.delta[1] * g.sigma[1]) for g in loop.gain.values())
    remedy = f"a rate of at least {faster:.4g} Hz, and a larger phi"
    state("adaptation", f"no adaptive state reaches its bounds: {statement}", spare, "1", remedy, False)
    statement = "everything here holds for the gains as decimal, float64 and float32"
    state("rounding", statement, ROUNDING, "1", "what the other obligations need")
    error = verdict.ultimate(0)
    unit = str(claim.rows[0]["unit"])
    statement = f"from {upward(claim.transient, 6)} s on the tracking error is at most {milli(error, unit)}"
    remedy = f"a requirement of {milli(max(error, claim.ultimate[0]), unit)}"
    state("accuracy", statement, claim.accuracy - error, unit, remedy, False)
    for i, stated in enumerate(claim.ultimate):
        if stated < verdict.ultimate(i):
            raise NotProvedError(f"the envelope states a smaller bound on row {i + 1} than can be proved")
    return made, loop, verdict


def scale(claim: Claim, name: str) -> Fraction:
    """The size of a limit, to compare margins of different units: half the way for the stroke."""
    half = (claim.stroke[1] - claim.stroke[0]) / 2
    return next((limit["value"] for limit in claim.limits if limit["name"] == name), half)


def uses(claim: Claim, loop: Loop, verdict: Impulse) -> list[Use]:
    """The share of every limit that is certified to be used at most."""
    return [
        Use(claim.name, name, -below(slack / scale(claim, name) - 1))
        for slack, _, name in authority(claim, loop, verdict)
    ]


# --- member ---

@dataclass(frozen=True)
class Member:
    """A member of a machine with its verdicts, and the tube of position, speed, acceleration that it gives for all t.

    The tube is None where the certificate gives none.
    """

    name: str
    claim: Claim
    loop: Loop
    made: list[Obligation]
    reached: tuple[Fraction, Fraction, Fraction] | None
    verdict: Impulse
    used: list[Use]
    failed: str


def check_member(data: dict[str, Any], which: int, coupled: bool) -> Member:
    """Re-prove one member under its own assumptions."""
    entry = data["members"][which]
    claim = read(data, entry, coupled)
    need(not (coupled and 0 in claim.networks), "a first row with a load network is of a member that nothing links")
    need(not (coupled and claim.parts), "only a member that nothing links has constants that are cut")
    consistent(data, entry, claim)
    follows(data, entry, claim, which)
    well_formed(claim)
    different(entry["golden"], claim)
    made, loop, verdict = obligations(claim)
    agree = golden_agree(entry["golden"], claim)
    seen = number(data["validation"]["members"][claim.name]["largest_error"], "largest_error")
    need(seen >= 0, "largest_error must not be negative")
    rate = number(entry["certificate"]["envelope"]["rate"], "rate")
    required = REQUIRED[data["study"]["controller"]["law"]][entry["certificate"]["kind"]]
    need(sorted(o.name for o in made) == sorted(required), "the checker has not decided what the law needs")
    failed = ""
    wrong = [o for o in made if o.verdict != "proved"]
    if wrong:
        failed = f"{wrong[0].name} (margin {downward(wrong[0].margin)} {wrong[0].unit})"
    elif not rate <= verdict.rate():
        failed = "the envelope states a faster rate"
    elif not agree:
        failed = "the golden vectors do not follow from the gains and the law"
    elif seen > claim.half_widths[0]:
        failed = "the recorded simulation leaves the certified envelope"
    tube = tube_of(claim, verdict) if len(claim.rows) > accelerating(claim) else None
    return Member(claim.name, claim, loop, made, tube, verdict, uses(claim, loop, verdict), failed)


def tube_of(claim: Claim, verdict: Impulse) -> tuple[Fraction, Fraction, Fraction]:
    """Bounds on the deviations of position, speed and acceleration for all t; no position where a speed comes first."""
    row = accelerating(claim)
    position = claim.half_widths[0] if row else Fraction(0)
    return position, claim.half_widths[row], verdict.speed(row)


def accelerating(claim: Claim) -> int:
    """The row whose state's rate is an acceleration."""
    return 1 if claim.first == "position" else 0


# --- motion ---

def cut(a: Interval, count: int) -> list[Interval]:
    """Parts of an interval that cover it."""
    ends = [a[0] + (a[1] - a[0]) * Fraction(k, count) for k in range(count + 1)]
    return list(pairwise(ends))


def slices(together: list[Any], halvings: Any) -> Iterable[list[list[Interval]]]:
    """Ranges of position … jerk of every member over slices of time: pieces between knots, each halved some times."""
    parts = 2 ** index(halvings, 9, "halvings")
    need(len({len(segments) for segments in together}) == 1, "the references of the members have different segments")
    count = sum(
        parts if len(segment["coefficients"]) > 6 else 1
        for segment in together[0] for a, b in pairwise(segment["knots"]) if a < b
    )  # fmt: skip
    need(count <= MAX_SLICES, f"the motion is cut into {count} slices, more than {MAX_SLICES}")
    for segments in zip(*together, strict=True):
        knots = [number(k, "a knot") for k in segments[0]["knots"]]
        for segment in segments[1:]:
            need(segment["knots"] == segments[0]["knots"], "the references of the members have different knots")
        points = [[number(c, "a coefficient") for c in segment["coefficients"]] for segment in segments]
        for span in range(5, len(knots) - 6):
            low, high = knots[span], knots[span + 1]
            if low == high:
                continue
            pieces = 1 if len(points[0]) == 6 else parts
            for k in range(pieces):
                ends = low + (high - low) * Fraction(k, pieces), low + (high - low) * Fraction(k + 1, pieces)
                yield [ranges_on(knots, own, span, ends) for own in points]


# --- coupling ---

#: Step of a difference quotient of the output.
NUDGE = 1e-4


class Coupling:
    """What the members of a machine do to each other over slices of time; see `docs/machine.md`.

    The load of member i is ``w_i = F_i(x, v, a, d) - m_i a_i`` with the machine's disturbances d. On every slice it is
    foreseen along the reference at the middle of d, and its deviation bounded by the mean value theorem while all
    members keep their tubes.
    """

    def __init__(self, data: dict[str, Any], entry: dict[str, Any], members: list[Member]) -> None:
        self.members, self.count = members, len(members)
        study = data["study"]
        self.loads = valid_program(entry["loads"], "the loads", turning=True)
        self.place = valid_program(entry["place"], "the output", turning=True)
        self.signals = [
            (f"{letter}{j}", j, order) for j, member in enumerate(members)
            for order, letter in enumerate("xva" if member.claim.first == "position" else "va")
        ]  # fmt: skip
        inputs = [name for name, _, _ in self.signals]
        self.disturbed = {
            name: tuple(numbers(given["range"], 2, name))
            for name, given in study["uncertainty"]["disturbances"].items()
        }  # fmt: skip
        for name, (low, high) in self.disturbed.items():
            need(NAME.fullmatch(name) is not None and name not in inputs, "a disturbance needs a name of its own")
            need(low <= high, f"the range of {name} is upside down")
            constant = study["uncertainty"]["disturbances"][name]["course"] == "constant"
            need(constant, f"{name} of a machine is constant in a run")
        need(len(self.loads["outputs"]) == self.count, "each member needs a load")
        need(reads(self.loads) <= {*inputs, *self.disturbed}, "the loads read a name that no member has")
        unread = set(self.disturbed) - reads(self.loads)
        need(not unread, f"the loads do not use {', '.join(sorted(unread))}, which the study states")
        places = {name for name in inputs if name[0] == "x"}
        need(reads(self.place) <= places, "the output reads a name that no member has")
        need(bool(reads(self.place)), "the output must read a position")
        self.own = [self._own(member) for member in members]
        self.foreseeing = "mechanics" in study["controller"]["modelling"]
        for member in members:
            claim = member.claim
            need(set(claim.feedforward) == set(claim.disturbances), "a member of a coupling has one load, with a rate")
            need(len(claim.disturbances) == 1, "a member of a coupling has one disturbance, its load")
            known = not set(claim.feedforward) & set(claim.nominal)
            need(known == self.foreseeing, "what the members foresee is not what the law models")
        self.load = [next(iter(member.claim.disturbances)) for member in members]
        self.guarantee = [guarantee_of(data, member.name) for member in members]
        self.stated = number(entry["envelope"]["output"], "the bound on the output")
        self.required = number(study["requirements"]["tracking_error_m"], "tracking_error_m")
        named = {m["name"]: m["reference"]["segments"] for m in data["members"]}
        self.slices = list(slices([named[m.name] for m in members], entry["halvings"]))
        self.slopes: list[list[Fraction]] = [[Fraction(0)] * self.count for _ in members]

    def _own(self, member: Member) -> Fraction:
        """The inertia of the bodies that a member's own model carries."""
        names = [name for name in CARRIED if name in member.claim.parameters]
        need(len(names) == 1, f"{member.name}: the plant must carry a part of the machine's inertia")
        low, high = member.claim.parameters[names[0]]
        need(low == high, f"{member.name}: its part of the machine's inertia must be a number")
        return low

    def obligations(self) -> list[Obligation]:
        """Decide what joins the members."""
        made = []
        statement = f"the references of all {self.count} members share their knots"
        made.append(decided("motion", statement, Fraction(len(self.slices)), "slices", "references of one duration"))
        worst, which = self._loads()
        payloads = self._felt()
        statement = (
            f"{payloads}what the members do to each other is inside what each was proved under; the tightest is {which}"
        )
        remedy = "smaller guarantees, or gains that are proved under more load"
        made.append(decided("loads", statement, worst, "1", remedy))
        statement = "inside the guarantees the accelerations follow from the loads in one way: the coupling contracts"
        remedy = "less coupling between the members, or more inertia of the actuators"
        made.append(decided("coupling", statement, self._well_posed(), "1", remedy))
        bound = self.output([member.verdict.ultimate(0) for member in self.members])
        if self.stated < bound:
            raise NotProvedError("the envelope states a smaller bound on the output than can be proved")
        settled = upward(self.members[0].claim.transient, 6)
        moved = ", ".join(f"{slope:.3g} m/{member.claim.rows[0]['unit']} of {member.name}"
                          for slope, member in zip(self._reach(), self.members, strict=True))  # fmt: skip
        statement = f"from {settled} s on the output, which moves by up to {moved}, is within {milli(bound, 'm')}"
        made.append(decided("output", statement, self.required - bound, "m", f"a requirement of {milli(bound, 'm')}"))
        return made

    def _felt(self) -> str:
        """What the disturbances do to the loads; refuses loads that feel neither them nor the other members."""
        middle = {name: float(low + high) / 2 for name, (low, high) in self.disturbed.items()}
        part = self.slices[len(self.slices) // 2]
        middle |= {name: float(sum(part[j][order])) / 2 for name, j, order in self.signals}
        size = max(max(map(abs, run(self.loads, middle.__getitem__))), 1e-300)
        text = ""
        for name, changes in felt(self.loads, middle, self.disturbed).items():
            low, high = self.disturbed[name]
            share = Fraction(max(changes) / size)
            need(low == high or share > LEAST_LOAD, f"the loads do not change with {name}")
            text += f"{name} changes the loads by up to {percent(share, up=False)}; " if low < high else ""
        for j, member in enumerate(self.members if self.count > 1 else ()):
            ranges = {name: (middle[name], middle[name] + NUDGE) for name, k, _ in self.signals if k == j}
            others = [max(c for i, c in enumerate(v) if i != j) for v in felt(self.loads, middle, ranges).values()]
            need(max(others) > float(LEAST_EFFECT) * size, f"no load of another member feels {member.name}")
        return text

    def _reach(self) -> list[float]:
        """How much the output moves with each member's position at most, of some slices of the motion."""
        found = [0.0] * self.count
        for part in self.slices[:: max(1, len(self.slices) // 16)]:
            middle = {f"x{j}": float(sum(part[j][0])) / 2 for j in range(self.count)}
            for j in range(self.count):
                name = f"x{j}"
                if self.members[j].claim.first == "position":
                    changes = felt(self.place, middle, {name: (middle[name], middle[name] + NUDGE)}).get(name, [0.0])
                    found[j] = max(found[j], sum(c * c for c in changes) ** 0.5 / NUDGE)
        for j, member in enumerate(self.members):
            seen = found[j] >= LEAST_SLOPE or member.claim.first == "speed"
            need(seen, f"the output hardly moves with {member.name}: {found[j]:.3g} m per unit")
        return found

    def _ranges(self, part: list[list[Interval]], half_widths: list[tuple[Fraction, ...]]) -> dict[str, Interval]:
        return {
            name: add(part[j][order], symmetric(half_widths[j]["xva".index(name[0])]))
            for name, j, order in self.signals
        }

    def _loads(self) -> tuple[Fraction, str]:
        """The smallest spare of what the joints assume of their loads, relative to its size; and where."""
        nothing = [(Fraction(0),) * 3] * self.count
        middle: dict[str, Interval] = {
            name: ((low + high) / 2, (low + high) / 2) for name, (low, high) in self.disturbed.items()
        }
        half = {name: (high - low) / 2 for name, (low, high) in self.disturbed.items()}
        spare: list[tuple[Fraction, str]] = []
        for part in self.slices:
            along = {name: {"t": part[j][order + 1]} for name, j, order in self.signals}
            foreseen = slopes(self.loads, {**self._ranges(part, nothing), **middle}, along)
            around = {**self._ranges(part, self.guarantee), **self.disturbed}
            moved = slopes(self.loads, around, {name: {name: ONE} for name in around})
            for i, member in enumerate(self.members):
                size, along_own = Fraction(0), f"a{i}"
                for name, slope in {along_own: ZERO, **moved[i][1]}.items():
                    if name in half:
                        size = up(size + magnitude(slope) * half[name])
                        continue
                    j = int(name[1:])
                    if name == along_own:
                        slope = add(slope, neg((self.own[i], self.own[i])))
                    if name[0] == "a":
                        self.slopes[i][j] = max(self.slopes[i][j], magnitude(slope))
                    size = up(size + magnitude(slope) * self.guarantee[j]["xva".index(name[0])])
                own = (self.own[i], self.own[i])
                order = 1 + accelerating(member.claim)
                load = add(foreseen[i][0], neg(mul(own, part[i][order])))
                rate = add(foreseen[i][1].get("t", ZERO), neg(mul(own, part[i][order + 1])))
                spare.append((self._inside(i, load, rate, size), member.name))
        return min(spare)

    def _inside(self, i: int, load: Interval, rate: Interval, size: Fraction) -> Fraction:
        """How much room the assumptions of a member leave to its load on a slice."""
        claim = self.members[i].claim
        assumed = claim.disturbances[self.load[i]]
        known = claim.feedforward[self.load[i]]
        foreseen = all(o[0] <= a[0] and a[1] <= o[1] for a, o in ((load, known[0]), (rate, known[1])))
        foreseen = foreseen and known[1][0] <= 0 <= known[1][1]  # after its end the reference rests
        inner = add(ZERO if foreseen else symmetric(2 * magnitude(assumed)), symmetric(size))
        return min(inner[0] - assumed[0], assumed[1] - inner[1]) / max(magnitude(assumed), Fraction(1, 10**9))

    def _well_posed(self) -> Fraction:
        """1 - max N s / s for N_ij = sup|dw_i/da_j| sup|da_j/dw_j|: positive where the map of the loads contracts."""
        answers = [self._answer(i) for i in range(self.count)]
        matrix = [[v * answers[j] for j, v in enumerate(row)] for row in self.slopes]
        shape = [Fraction(1)] * self.count
        for _ in range(60):
            shape = [down(dot(row, shape) + Fraction(1, 10**6)) for row in matrix]
            largest = max(shape)
            shape = [down(v / largest) + Fraction(1, 10**9) for v in shape]
        return 1 - max(dot(row, shape) / own for row, own in zip(matrix, shape, strict=True))

    def _answer(self, i: int) -> Fraction:
        """How much the acceleration of a member moves with its load, at most."""
        member, name = self.members[i], self.load[i]
        claim, loop = member.claim, member.loop
        row = accelerating(claim)
        program = {**claim.plant, "outputs": [claim.plant["outputs"][len(claim.rows) + row]]}
        ranges = {key: node.range for key, node in loop.nodes.items()}
        rate, worst, least, most = claim.rows[row]["state"], Fraction(0), -Fraction(10**9), Fraction(10**9)
        # friction that changes sides with power makes the slope depend on speed and load: small parts of both
        for speed, load in product(cut(ranges[rate], SPEED_PARTS), cut(ranges[name], LOAD_PARTS)):
            found = slopes(program, {**ranges, rate: speed, name: load}, {name: {"w": ONE}})
            slope = found[0][1].get("w", ZERO)
            worst, least, most = max(worst, magnitude(slope)), max(least, slope[1]), min(most, slope[0])
        inertia = {**claim.plant, "outputs": [claim.plant["outputs"][row]]}
        carried = next(key for key in CARRIED if key in claim.parameters)
        weight = derivative(inertia, ranges, {carried: {"": ONE}}).get("", ZERO)
        need(weight[0] > 0, f"{member.name}: the plant does not carry its part of the machine's inertia")
        # what a load does without friction is what the own part of the inertia does: -dh/dw = dM/dm
        matches = most <= -weight[0] and -weight[1] <= least
        need(matches, f"{member.name}: the load does not enter the plant as its part of the machine's inertia does")
        return up(worst / loop.mass[row][0])

    def output(self, half_widths: list[Fraction]) -> Fraction:
        """Bound on the distance of the output from its reference while |x_i - r_i| <= half_widths_i."""
        worst = Fraction(0)
        for part in self.slices:
            ranges = {f"x{j}": add(part[j][0], symmetric(radius)) for j, radius in enumerate(half_widths)
                      if self.members[j].claim.first == "position"}  # fmt: skip
            moved = slopes(self.place, ranges, {name: {name: ONE} for name in ranges})
            sizes = [
                sum((magnitude(v) * half_widths[int(name[1:])] for name, v in along.items()), ZERO[0])
                for _, along in moved
            ]
            worst = max(worst, up(sum((size * size for size in sizes), ZERO[0])))
        return root(worst, True)


def guarantee_of(data: dict[str, Any], name: str) -> tuple[Fraction, ...]:
    """The tube that a member guarantees for all t."""
    entry = next(m for m in data["members"] if m["name"] == name)
    return tuple(numbers(entry["certificate"]["guarantee"], 3, "a guarantee"))


def guarantees_kept(data: dict[str, Any], members: list[Member]) -> Obligation:
    """Each member's proof reaches no more than it guarantees."""
    kept = []
    for member in members:
        need(member.reached is not None, f"{member.name}: a guarantee needs a sampled certificate")
        told = guarantee_of(data, member.name)
        pairs = list(zip(member.reached or (), told, strict=True))[0 if member.claim.first == "position" else 1 :]
        kept += [1 - got / said if said > 0 else Fraction(-1) for got, said in pairs]
    statement = "each member keeps what it guarantees of position, speed and acceleration"
    return decided("guarantees", statement, min(kept), "1", "a certificate made for these gains")


# --- requirements ---

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


# --- shared ---

def drawn_together(data: dict[str, Any], members: list[Member]) -> list[Obligation]:
    """Decide that what the members draw on together is there."""
    made = []
    for name, limit in data["study"]["plant"].get("shared", {}).items():
        total = Fraction(0)
        for entry, member in zip(data["members"], members, strict=True):
            own = outputs_of(entry["model"], member)
            need(name in own, f"{member.name} does not tell its {name}, which all draw on together")
            need(own[name][0] == limit["unit"], f"the {name} of {member.name} must be in {limit['unit']}")
            total += root(up(largest_of(entry, member, own[name][1])), True)
        most = number(limit["value"], name)
        statement = f"all {len(members)} members together take up to {upward(total)} {limit['unit']} of {name}"
        remedy = f"{upward(total)} {limit['unit']} of {name}, or a slower motion"
        made.append(decided("supply", statement, most - total, limit["unit"], remedy, strict=False))
    return made


# --- watch ---

def quiet(data: dict[str, Any], members: list[Member]) -> list[Obligation]:
    """Decide that the monitor of a study never acts inside the assumptions, as far as it measures what it watches."""
    monitor = data["study"]["controller"].get("monitor")
    return [] if monitor is None else [_quiet(monitor, member) for member in members]


def _quiet(monitor: dict[str, Any], member: Member) -> Obligation:
    claim = member.claim
    error = number(monitor["error"], "the monitored error")
    unit = str(claim.rows[0]["unit"])
    met = claim.half_widths[0] + claim.measured[0]
    least, told = 1 - met / error, [f"an error of {upward(met)} of {upward(error)} {unit}"]
    estimated, unmeasured = [], [row["state"] for k, row in enumerate(claim.rows) if k and not row["controlled"]]
    wrong = {row["state"]: size for row, size in zip(claim.rows, claim.measured, strict=True)}
    limits = {limit["name"]: limit for limit in claim.limits}
    for name, span in monitor["limits"].items():
        need(name in limits and len(limits[name]["signals"]) == 1, f"{name} is no limit on one signal of {claim.name}")
        low, high = numbers(span, 2, name)
        need(low < high, f"the monitored range of {name} is upside down")
        (signal,) = limits[name]["signals"]
        if signal in unmeasured:
            estimated.append(name)
            continue
        found = symmetric(member.verdict.norm([signal]) + wrong.get(signal, Fraction(0)))
        least = min(least, 2 * min(found[0] - low, high - found[1]) / (high - low))
        told.append(f"{name} within {upward(found[1])}")
    rest = f"; of {', '.join(estimated)}, which it estimates, nothing is decided" if estimated else ""
    statement = f"inside the assumptions the monitor does not act: it sees at most {', '.join(told)}{rest}"
    remedy = f"wider ranges of the monitor, an error of {upward(met)} {unit} among them"
    return decided("monitor", statement, Fraction(least), "1", remedy, member=claim.name)


# --- command ---

def check_text(text: str, file: str = "", *, recorded: bool = True) -> Report:
    """Re-prove a gain file given as text.

    Args:
        text: The file.
        file: Its name, for the report.
        recorded: Whether what the file records of the obligations must be what is found.

    Returns:
        Status 0 proved, 1 not proved, 2 unreadable; with one line and the obligations.
    """
    try:
        data = parse(text)
        need(data.get("schema") == SCHEMA, wrong_schema(data.get("schema")))
        shaped(data)
        check_digests(text)
        report = check_machine(data, file, recorded)
        differs = remembered(data, report) if recorded and not report.status else ""
        return replace(report, status=1, message=f"not proved: {differs}") if differs else report
    except UnreadableError as error:
        return Report(file, 2, f"unreadable: {error}")
    except NotProvedError as error:
        return Report(file, 1, f"not proved: {error}")
    except RecursionError:
        return Report(file, 2, "unreadable: the file is nested too deeply")
    except (KeyError, TypeError, AttributeError, IndexError, ValueError, ArithmeticError) as error:
        return Report(file, 2, f"unreadable: a part of the gain file is missing or malformed: {error!r:.120}")


def remembered(data: dict[str, Any], report: Report) -> str:
    """What the file records otherwise than it is found; empty where nothing."""
    told = data["obligations"]
    for found, row in zip(report.obligations, told, strict=False):
        for key in ("name", "member", "statement", "unit", "verdict"):
            if row.get(key) != getattr(found, key):
                return f"the file records another {key} of {found.name}"
        if not isinstance(row.get("margin"), Fraction) or float(row["margin"]) != found.margin:
            return f"the file records another margin of {found.name}"
    if len(told) < len(report.obligations):
        return f"the file leaves out the obligation {report.obligations[len(told)].name}"
    return "" if len(told) == len(report.obligations) else "the file records an obligation that there is not"


def check_machine(data: dict[str, Any], file: str, recorded: bool = True) -> Report:
    """Re-prove each member by itself, then what the members assume of each other."""
    names = [entry["name"] for entry in data["members"]]
    need(0 < len(names) <= MAX_MEMBERS and len(set(names)) == len(names), f"a machine has 1 to {MAX_MEMBERS} members")
    need(all(isinstance(name, str) and NAME.fullmatch(name) for name in names), "a member's name must be an identifier")
    need(set(names) == set(data["study"]["plant"]["joints"]), "the members are not those of the study")
    study, states = data["study"], {row["state"] for entry in data["members"] for row in entry["model"]["rows"]}
    for where, given, known in (
        ("controller.members", study["controller"]["members"], set(names)),
        ("controller.rates_hz", study["controller"].get("rates_hz", {}), set(names)),
        ("requirements.member_error", study["requirements"].get("member_error", {}), set(names)),
        ("uncertainty.noise", study["uncertainty"].get("noise", {}), states),
        ("uncertainty.resolution", study["uncertainty"].get("resolution", {}), states),
        ("uncertainty.initial", study["uncertainty"].get("initial", {}), states),
    ):
        need(set(given) <= known, f"the study's {where} names something that the file does not have")
    need(list(study["plant"]["joints"]) == names, "the members stand in another order than in the study")
    need(not set(study["plant"]["locked"]) & set(names), "a member that moves is not locked")
    couplings = data["couplings"]
    need(isinstance(couplings, list) and len(couplings) <= 1, "a machine has one coupling, or none")
    need(all(entry["members"] == names for entry in couplings), "a coupling is of all members in their order")
    made: list[Obligation] = []
    WORK.begin(MAX_PRODUCTS)
    members = []
    for which in range(len(names)):
        if not couplings:  # each is by itself, and costs what a file of its own would
            WORK.begin(MAX_PRODUCTS)
        member = check_member(data, which, bool(couplings))
        made += member.made
        if member.failed:
            where = f"{member.name}: " if len(names) > 1 else ""
            return Report(file, 1, f"not proved: {where}{member.failed}", made)
        members.append(member)
    return check_together(data, members, made, file, recorded)


def check_together(
    data: dict[str, Any], members: list[Member], made: list[Obligation], file: str, recorded: bool
) -> Report:
    """What joins the members: guarantees and coupling; and the bound on the output."""
    WORK.begin(MAX_COUPLED)
    if data["couplings"]:
        made.append(guarantees_kept(data, members))
    coupling = Coupling(data, data["couplings"][0], members) if data["couplings"] else None
    made += coupling.obligations() if coupling is not None else []
    made += [*drawn_together(data, members), *quiet(data, members)]
    wrong = [o for o in made if o.verdict != "proved"]
    if wrong:
        text = f"{wrong[0].name} (margin {downward(wrong[0].margin)} {wrong[0].unit})"
        return Report(file, 1, f"not proved: {text}", made)
    units = {str(member.claim.rows[0]["unit"]) for member in members}
    need(coupling is not None or len(units) == 1, "the first states of members without a coupling have one unit")
    worst = max(member.claim.ultimate[0] for member in members)
    proved = {"tracking_error_m": worst if coupling is None else coupling.stated}
    if len(members) > 1:
        proved |= {f"member_error.{m.name}": m.claim.ultimate[0] for m in members}
    proved |= beyond_error(data, members, coupling)
    records = ""
    written, required = {name: above(bound) for name, bound in proved.items()}, {}
    for row in data["validation"]["requirements"]:
        required[row["name"]] = float(row["required"]), written.get(row["name"])
        if not recorded:
            row["certified"] = Fraction(written[row["name"]]) if row["name"] in written else None
    try:
        met(data, proved)
    except UnreadableError as error:
        if recorded:
            raise
        records = str(error)
    reach = [member.claim.half_widths[0] for member in members]
    inside = max(reach) if coupling is None else coupling.output(reach)
    need(0 <= number(data["validation"]["largest_error_m"], "largest_error_m"), "an error must not be negative")
    if number(data["validation"]["largest_error_m"], "largest_error_m") > inside:
        return Report(file, 1, "not proved: the recorded simulation leaves the certified envelope", made)
    settled = upward(members[0].claim.transient, 6)
    bound = milli(proved["tracking_error_m"], units.pop() if coupling is None else "m")
    of = "" if len(members) == 1 else f" of each of {len(members)} members"
    of = of if coupling is None else f" of the output, all {len(members)} members together"
    message = f"proved: |tracking error{of}| <= {bound} from {settled} s on"
    used = [use for member in members for use in member.used]
    return Report(file, 0, message, made, used, *unsourced(data), data["study"]["plant"]["model"], records, required)


def unsourced(data: dict[str, Any]) -> tuple[list[str], list[str]]:
    """What the study left to the bundled machine, and what is assumed."""
    joints = data["study"]["plant"]["joints"]
    bundled, assumed = [], []
    for member, section in joints.items():
        before = f"{member}." if len(joints) > 1 else ""
        bundled += [before + name for name in section.get("bundled", [])]
        for kind, after in (("parameters", ""), ("ratings", ""), ("limits", " limit")):
            entries = section.get(kind, {}).items()
            assumed += [before + name + after for name, entry in entries if entry["source"] == "assumed"]
    body = data["study"]["plant"].get("body", {}).items()
    assumed += [f"body.{name}" for name, entry in body if entry["source"] == "assumed"]
    return bundled, assumed


def check_file(path: Path) -> Report:
    """Re-prove one file."""
    shown = plainly(str(path))
    shown = shown if len(shown.split()) <= 1 and ": " not in shown else repr(" ".join(shown.split()))
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(handle, "rb") as stream:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                return Report(shown, 2, "unreadable: it is no regular file")
            content = stream.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            return Report(shown, 2, f"unreadable: a gain file has at most {MAX_BYTES} bytes")
        return check_text(content.decode("utf-8-sig"), shown)
    except UnicodeDecodeError:
        return Report(shown, 2, "unreadable: it is not UTF-8 text")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "no such file"
        return Report(shown, 2, f"unreadable: {reason}")


def plainly(text: str) -> str:
    """Text without anything that a terminal would not print as it stands."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def main(arguments: list[str] | None = None) -> int:
    """Check files: for each a verdict, with -v one line an obligation."""
    parser = argparse.ArgumentParser(description="Re-prove gain files from the files alone.")
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--json", action="store_true", help="print the verdicts as JSON")
    parser.add_argument("-v", "--verbose", action="store_true", help="show every obligation")
    options = parser.parse_args(arguments)
    reports = [check_file(path) for path in options.files]
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        show(reports, as_json=options.json, verbose=options.verbose)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return max(report.status for report in reports)


def show(reports: list[Report], *, as_json: bool, verbose: bool = False) -> None:
    """Print the verdicts."""
    if as_json:
        kinds = ("obligations", "uses")
        rows = [{**r.__dict__, **{k: [e.__dict__ for e in getattr(r, k)] for k in kinds}} for r in reports]
        print(json.dumps(rows, indent=1))
        return
    for report in reports:
        print(f"{report.file}: {plainly(report.message)}")
        for line in (*limit_lines(report), *requirement_lines(report), *source_lines(report)):
            print(f"  {line}")
        for line in obligation_lines(report, everything=verbose):
            print(f"  {line}")


def limit_lines(report: Report) -> list[str]:
    """What is certified of the limits, in lines of a terminal."""
    members = list(dict.fromkeys(use.member for use in report.uses))
    alike: dict[str, list[str]] = {}
    for member in members:
        shares = ", ".join(f"{u.name} {percent(u.share, up=True)}" for u in report.uses if u.member == member)
        alike.setdefault(shares, []).append(member)
    lines = []
    for shares, own in alike.items():
        before = f"{', '.join(own)}: " if len(members) > 1 else ""
        lines += wrapped(f"{before}of its limits at most: {shares}")
    return lines


def requirement_lines(report: Report) -> list[str]:
    """Which requirements are proved, and which are met in simulation only, in lines of a terminal."""
    proved = [
        f"{name} {upward(Fraction(b))} of {limit:g}" for name, (limit, b) in report.required.items() if b is not None
    ]
    seen = [name for name, (_, bound) in report.required.items() if bound is None]
    lines = wrapped(f"proved of what is required: {', '.join(proved)}") if proved else []
    return lines + (wrapped(f"required and simulated only: {', '.join(seen)}") if seen else [])


def source_lines(report: Report) -> list[str]:
    """What the numbers rest on, in lines of a terminal."""
    whose = f"the defaults of {report.model}" if ".py" in report.model else f"of the bundled {report.model}"
    members = list(dict.fromkeys(use.member for use in report.uses))
    lines = wrapped(f"still {whose}: {gathered(report.bundled, members)}") if report.bundled else []
    return lines + (wrapped(f"assumed: {gathered(report.assumed, members)}") if report.assumed else [])


def gathered(names: list[str], members: list[str]) -> str:
    """Names of numbers, each once with the members in brackets that have it."""
    found: dict[str, list[str]] = {}
    for name in names:
        owner, _, key = name.rpartition(".")
        found.setdefault(key, []).append(owner)
    return ", ".join(
        key if own == [""] else f"{key} ({'all' if own == members else ', '.join(own)})" for key, own in found.items()
    )


def obligation_lines(report: Report, *, everything: bool) -> list[str]:
    """Obligations, all or those that fail, in lines of a terminal."""
    many = len({o.member for o in report.obligations if o.member}) > 1
    lines = []
    for o in report.obligations:
        if everything or o.verdict != "proved":
            name = f"{o.member}: {o.name}" if many and o.member else o.name
            unit = "" if o.unit == "1" else f" {o.unit}"
            lines += wrapped(f"{o.verdict} {name}, margin {downward(o.margin)}{unit}: {o.statement}")
            lines += wrapped(f"would pass: {o.remedy}", "    ") if o.remedy else []
    return lines


def wrapped(text: str, indent: str = "") -> list[str]:
    """Lines of at most 78 columns."""
    return textwrap.wrap(text, 76, initial_indent=indent, subsequent_indent=indent + "  ")


if __name__ == "__main__":
    sys.exit(main())
