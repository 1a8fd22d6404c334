"""What members do to each other.

Theorem: mean value theorem over slices and first exit from the guarantees; the accelerations by contraction
(Banach; docs/machine.md). Obligations: guarantees, loads, coupling, output. Must fail: a heavier load, a smaller
guarantee, a narrower assumption on a load, a smaller bound on the output.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from typing import Any

from .arithmetic import ONE, ZERO, Interval, add, down, magnitude, mul, neg, root, symmetric, up
from .effects import felt, run
from .fixed import slopes
from .forms import derivative
from .limits import CARRIED, LEAST_EFFECT, LEAST_LOAD, LEAST_SLOPE, LOAD_PARTS, NAME, SPEED_PARTS, NotProvedError, need
from .matrices import dot
from .member import Member, accelerating
from .motion import cut, slices
from .obligation import Obligation, decided, milli, percent, upward
from .parsing import number, numbers, reads, valid_program

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
