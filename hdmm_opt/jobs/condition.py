"""The Lyapunov gain condition of a design in words: what decays, how fast, and what each subsystem could lose."""

from __future__ import annotations

from stability import Failure
from stability.certificates.gain_condition import GainCondition, gain_condition

from ..problem import GainSet, Problem
from ..problem.member import Member
from ..problem.problem import Contracts
from .certify import composition


def condition_lines(problem: Problem, gains: GainSet, contracts: Contracts) -> list[str]:
    """A line for each member, under what it assumes of the others.

    Not guaranteed: that it is found wherever it holds; the sampled loop of a gain file is proved without it.
    """
    lines = []
    for member in problem.members:
        found = composition(member.under(contracts[member.name].bounds), gains[member.name])
        where = f"{member.name}: " if len(problem.members) > 1 else ""
        if isinstance(found, Failure):
            lines.append(f"{where}gain condition of the continuous law without load networks: none found")
            continue
        told = gain_condition(found)
        if told.holds:
            lines.append(where + _told(member, told))
        else:
            lines.append(f"{where}gain condition of the continuous law without load networks: undecided")
    return lines


def _told(member: Member, found: GainCondition) -> str:
    """The weights of V and its rate of decay."""
    states = [row.state for row in member.model.rows]
    weights = ", ".join(f"{w:.3g} ({state})" for w, state in zip(found.weights, states, strict=True))
    spare = ", ".join(f"{v:.3g} ({state})" for v, state in zip(found.margins, states, strict=True))
    return (
        "gain condition of the continuous law without load networks: V, with w on each ½ M Q², decays at "
        f"{found.decay:.3g} 1/s or faster outside its ultimate level, w = {weights}; each subsystem alone could lose "
        f"{spare} 1/s"
    )
