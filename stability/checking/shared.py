"""What members draw on together: an output of each adds up, and there is only so much.

Theorem: the sum of the amounts is at most the sum of the largest ones, each over the whole motion. Must fail: less to
draw on, a member whose output is not told or is in another unit.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from .arithmetic import root, up
from .limits import need
from .member import Member
from .obligation import Obligation, decided, upward
from .parsing import number
from .requirements import largest_of, outputs_of


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
