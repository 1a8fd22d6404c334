"""The closed loop around the moving operating point, with the input as it is held.

Theorem: interval enclosures of every coefficient (docs/proof.md). Must fail: a sign of plant or law, a smaller box,
more noise, a demand that a network cannot meet.
"""

from __future__ import annotations

from fractions import Fraction

from .arithmetic import ONE, ZERO, Interval, add, down, inverse, magnitude, mul, neg, symmetric, up
from .balance import SETTLE, Balance, inside, widened
from .claim import Claim, Gain
from .forms import Form, Node, Table, derivative, linear, over, plus, times
from .limits import VARYING, NotProvedError, need
from .parsing import only, reads
from .targets import SIGNALS, joined, placed, rate_of


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
