"""All obligations of a member, decided.

Obligations: non-vacuity, reference, authority, adaptation, rounding, accuracy, and those of the certificate's kind.
Must fail: lower limits, a shorter stroke, a tighter requirement, a faster adaptation than the rate allows.
"""

from __future__ import annotations

from fractions import Fraction

from .arithmetic import root, up
from .claim import Claim
from .composition import Composed
from .deviation import Deviation
from .effects import effects_of
from .limits import LEAST_EFFECT, LEAST_LOAD, ROUNDING, NotProvedError
from .loop import Loop
from .obligation import Obligation, Use, below, decided, milli, percent, upward
from .sampled import Held


def judge(claim: Claim, inflate: Fraction) -> tuple[Loop, Composed | Held]:
    """The closed loop for all gains within a relative distance, and the verdicts on it."""
    if claim.kind == "sampled":
        moved = Deviation(claim, inflate)
        return moved, Held(claim, moved)
    loop = Loop(claim, inflate)
    return loop, Composed(claim, loop)


def holds(claim: Claim, loop: Loop, verdict: Composed | Held) -> bool:
    """All obligations that depend on the gains."""
    return (
        verdict.contracts()
        and verdict.invariance() > 0
        and all(slack > 0 for slack, _, _ in authority(claim, loop))
        and verdict.sampling()[1] > 0
        and adaptation(claim, loop) >= 0
        and verdict.ultimate(0) <= claim.accuracy
    )


def holds_within(claim: Claim, inflate: Fraction) -> bool:
    """The same for every gain within a relative distance."""
    try:
        return holds(claim, *judge(claim, inflate))
    except NotProvedError:
        return False


def authority(claim: Claim, loop: Loop) -> list[tuple[Fraction, str, str]]:
    """Distance of each limited norm from its limit over the certified set; then the stroke."""
    result = []
    for limit in claim.limits:
        norm = root(up(sum((loop.signal(s) ** 2 for s in limit["signals"]), Fraction(0))), True)
        result.append((limit["value"] - norm, str(limit["unit"]), str(limit["name"])))
    position = loop.nodes[claim.rows[0]["state"]].range
    unit = str(claim.rows[0]["unit"])
    result.append((min(position[0] - claim.stroke[0], claim.stroke[1] - position[1]), unit, "stroke"))
    return result


def adaptation(claim: Claim, loop: Loop) -> Fraction:
    """1 - T_s δσ keeps sampled θ̂ >= 0; δσ >= μ wherever θ̂ is part of V."""
    slack = Fraction(1)
    for i, gain in loop.gain.items():
        slack = min(slack, 1 - claim.period * gain.delta[1] * gain.sigma[1])
        if claim.kind == "composition" and claim.leak[i] > 0:
            slack = min(slack, gain.delta[0] * gain.sigma[0] / claim.decay - 1)
    return slack


def vacuity(claim: Claim) -> Fraction:
    """The smallest ratio of what must be inside to what holds it, turned into a margin."""
    may_be_zero = [*claim.noise, *claim.initial]
    positive = [claim.decay, claim.period, claim.accuracy, *claim.half_widths]
    positive += [v for cell in claim.cells for v in (*cell.reach, *cell.start, *cell.shape)]
    for name, values in {**claim.vectors, "input_bound": claim.input_bound}.items():
        (may_be_zero if name == "leak" or (name, claim.kind) == ("input_bound", "composition") else positive).extend(
            values
        )
    positive += [limit["value"] for limit in claim.limits] + [claim.stroke[1] - claim.stroke[0]]
    if min(positive) <= 0 or min(may_be_zero) < 0:
        return Fraction(-1)
    if claim.kind == "sampled":
        return Fraction(1)
    return min(1 - initial / radius for initial, radius in zip(claim.initial, claim.half_widths, strict=True))


def obligations(claim: Claim) -> tuple[list[Obligation], Loop, Composed | Held]:
    """Decide every obligation of the law; with the closed loop, and the verdicts on it."""
    made: list[Obligation] = []

    def state(name: str, statement: str, margin: Fraction, unit: str, remedy: str, strict: bool = True) -> None:
        made.append(decided(name, statement, margin, unit, remedy, member=claim.name, strict=strict))

    anew = "a certificate made for these gains and assumptions: run design again"
    statement = "the box is not empty, holds the initial errors, and no limit is zero"
    state("non-vacuity", statement, vacuity(claim), "1", "positive limits, and a box larger than the initial errors")
    if made[0].verdict != "proved":
        raise NotProvedError("the certificate is about an empty set (obligation non-vacuity)")
    loop, verdict = judge(claim, ROUNDING)
    ranges = {row["state"]: loop.nodes[row["state"]].range for row in claim.rows}
    ranges |= {name: (-loop.signal(name), loop.signal(name)) for name in claim.inputs}
    effects = effects_of(claim, ranges)
    spare = {name: v / (LEAST_LOAD if name in claim.disturbances else LEAST_EFFECT) for name, v in effects.items()}
    weakest = min(spare, key=spare.__getitem__, default="")
    loads = "".join(
        f"{name} moves its row by {percent(effects[name], up=False)}, "
        for name in claim.disturbances
        if name in effects
    )
    statement = f"the plant feels everything that the study states: {loads}{weakest} is felt least"
    margin = min(spare.values(), default=Fraction(2)) - 1
    state("plant", statement, margin, "1", f"a plant that feels {weakest}")
    span = claim.reference[0]
    inside = min(span[0] - claim.stroke[0], claim.stroke[1] - span[1])
    statement = "the reference is continuous to its acceleration, ends at rest and stays inside the stroke"
    unit = str(claim.rows[0]["unit"])
    state("reference", statement, inside, unit, f"waypoints {float(-inside):.3g} {unit} further inside the stroke")
    name, statement, spare = verdict.contraction()
    state(name, statement, spare, "1/s", anew, False)
    state("invariance", "no trajectory from the initial set leaves the assumed box", verdict.invariance(), "1", anew)
    slack, unit, which = min(authority(claim, loop), key=lambda entry: entry[0] / scale(claim, entry[2]))
    used = percent(1 - slack / scale(claim, which), up=True)
    statement = f"every limit holds over the certified set; the tightest is {which}, of which {used} are used"
    state("authority", statement, slack, unit, f"a limit on {which} that is {float(-slack) * 1.001:.4g} {unit} wider")
    statement, spare = verdict.sampling()
    state("sampling", f"{statement} at {float(1 / claim.period):g} Hz", spare, "1", f"a faster rate, or {anew}")
    statement = "sampled adaptation keeps theta >= 0, and delta sigma >= mu where theta is in V"
    faster = max(float(g.delta[1] * g.sigma[1]) for g in loop.gain.values())
    state("adaptation", statement, adaptation(claim, loop), "1", f"a rate of at least {faster:.4g} Hz", False)
    least = ROUNDING if holds(claim, loop, verdict) else Fraction(-1)
    wider = (step for step in (Fraction(1, 1000), Fraction(1, 10000)) if holds_within(claim, step))
    statement = "everything holds for the gains as decimal, float64 and float32"
    state("rounding", statement, next(wider, least), "1", "what the other obligations need")
    error = verdict.ultimate(0)
    unit = str(claim.rows[0]["unit"])
    statement = f"from {upward(claim.transient, 6)} s on the tracking error is at most {milli(error, unit)}"
    state("accuracy", statement, claim.accuracy - error, unit, f"a requirement of {milli(error, unit)}", False)
    for i, stated in enumerate(claim.ultimate):
        if stated < verdict.ultimate(i):
            raise NotProvedError(f"the envelope states a smaller bound on row {i + 1} than can be proved")
    return made, loop, verdict


def scale(claim: Claim, name: str) -> Fraction:
    """The size of a limit, to compare margins of different units: half the way for the stroke."""
    half = (claim.stroke[1] - claim.stroke[0]) / 2
    return next((limit["value"] for limit in claim.limits if limit["name"] == name), half)


def uses(claim: Claim, loop: Loop) -> list[Use]:
    """The share of every limit that is certified to be used at most."""
    return [Use(claim.name, name, -below(slack / scale(claim, name) - 1)) for slack, _, name in authority(claim, loop)]
