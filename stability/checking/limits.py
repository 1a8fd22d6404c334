"""What a gain file must prove, and how large it may be.

Must fail: an obligation left out, another law or kind of certificate, a file beyond these sizes.
"""

from __future__ import annotations

import re
from fractions import Fraction

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
