"""The Lyapunov gain condition of a design in words: what decays, how fast, and what each subsystem could lose."""

from __future__ import annotations

from stability import Failure
from stability.certificates.composition import Composition
from stability.certificates.gain_condition import gain_condition

from ..problem import GainSet, Problem
from ..problem.member import Member
from ..problem.problem import Contracts
from .certify import composition


def condition_lines(problem: Problem, gains: GainSet, contracts: Contracts) -> list[str]:
    """A line for each member, under what it assumes of the others.

    Not guaranteed: that it is found wherever it holds; the sampled loop of a gain file is proved without it.
    """
    return [
        f"{problem.prefix(member)}gain condition of the continuous law without load networks: "
        + _told(member, composition(member.under(contracts[member.name].bounds), gains[member.name]))
        for member in problem.members
    ]


def _told(member: Member, found: Composition | Failure) -> str:
    """The weights of V and its rate of decay, or that there are none."""
    if isinstance(found, Failure):
        return "none found"
    told, states = gain_condition(found), [row.state for row in member.model.rows]
    if not told.holds:
        return "undecided"
    weights = ", ".join(f"{w:.3g} ({state})" for w, state in zip(told.weights, states, strict=True))
    spare = ", ".join(f"{v:.3g} ({state})" for v, state in zip(told.margins, states, strict=True))
    return (
        f"V, with w on each ½ M Q², decays at {told.decay:.3g} 1/s or faster outside its ultimate level, w = {weights};"
        f" each subsystem alone could lose {spare} 1/s"
    )
