"""All obligations of a member, decided.

Obligations: plant, non-vacuity, reference, authority, adaptation, rounding, accuracy, and those of the certificate.
Must fail: lower limits, a shorter stroke, a tighter requirement, a faster adaptation than the rate allows.
"""

from __future__ import annotations

from fractions import Fraction

from .arithmetic import symmetric
from .claim import Claim
from .effects import effects_of, mirrored
from .impulse import Impulse
from .limits import IDLE, LEAST_EFFECT, LEAST_LOAD, ROUNDING, NotProvedError
from .loop import Loop
from .obligation import Obligation, Use, below, decided, downward, milli, percent, upward


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
