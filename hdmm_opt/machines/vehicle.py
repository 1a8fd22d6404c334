"""A skid-steered vehicle on four wheels with a hydraulic motor in each (P-5, P-12): body in the plane, slope, slip.

With v_i the speed of the rim of wheel i at (x_i, y_i), and V, U, r the body's speeds ahead, to the left and about the
vertical, in its own axes:

    s_i' = v_i - V + r y_i - |v_i| s_i / l,    t_i' = -(U + r x_i) - |v_i| t_i / l,    k_i = |(s_i, t_i)| / l
    (X_i, Y_i) = mu_i N_i sin(C atan(B k - E (B k - atan B k))) (s_i, t_i) / (l k) + d (s_i', t_i')
    m (V' - U r) = sum X - m g sin a cos h,    m (U' + V r) = sum Y + m g sin a sin h
    I r' = sum (x_i Y_i - y_i X_i)

s and t are how far a tyre is strained along and across: its slip is that over the relaxation length l, a form that does
not divide by a speed (Pacejka 2012, ch. 7). a is the slope, h the heading away from straight uphill. The wheel asks the
rim for X_i + f N_i. Loads N_i move with slope and accelerations: quasi-static, the forces they follow from taken at the
loads of the slope alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import casadi as ca

from ..plants import Limit, Parameter
from ..plants.hydraulic_wheel import PLANT
from .body import Body, BodyModel, Signal
from .free import free

#: The wheels: ahead or behind, left or right.
WHEELS = {"front_left": (1, 1), "front_right": (1, -1), "rear_left": (-1, 1), "rear_right": (-1, -1)}
GRAVITY = 9.81
#: Over which rolling resistance turns round, m/s; slip below which its direction fades.
SPEED, LEAST = 0.02, 1e-6
BODY = {
    "mass": Parameter(value=6650.0, unit="kg", source="table", meaning="mass of the vehicle"),
    "height": Parameter(value=1.2, unit="m", meaning="height of the centre of mass"),
    "wheelbase": Parameter(value=2.0, unit="m", meaning="from axle to axle"),
    "track": Parameter(value=1.95, unit="m", meaning="from side to side"),
    "yaw_inertia": Parameter(value=5500.0, unit="kg m^2", meaning="inertia about the vertical"),
    "relaxation": Parameter(value=0.3, unit="m", meaning="relaxation length of a tyre"),
    "tyre_damping": Parameter(value=500.0, unit="N s/m", meaning="damping of a tyre", loss=True),
    "stiffness_factor": Parameter(value=5.0, unit="1", source="public", meaning="B of the magic formula: 5 on snow"),
    "shape_factor": Parameter(value=2.0, unit="1", source="public", meaning="C of the magic formula"),
    "curvature_factor": Parameter(value=1.0, unit="1", source="public", meaning="E of the magic formula", loss=True),
    "rolling": Parameter(value=0.05, unit="1", meaning="rolling resistance: 0.05 on snow, 0.03 on ice", loss=True),
}
STATES = {"x": "m", "y": "m", "heading": "rad", "ahead": "m/s", "aside": "m/s", "yaw_rate": "rad/s"}


def vehicle_body(q: Mapping[str, Parameter]) -> Body:
    """The body on four wheels.

    Args:
        q: Its numbers by name, as in `BODY`.
    """
    p = {name: entry.value for name, entry in q.items()}
    x, v, s = ca.SX.sym("x", len(STATES) + 8), ca.SX.sym("v", 4), ca.SX.sym("s", 5)
    rate, asked, shown = _motion(p, x, v, s)
    slips = {f"slip.{wheel}": "1" for wheel in WHEELS}
    signals = (
        Signal(name="slope", unit="rad", value=0.0, range=(-0.5, 0.5), meaning="slope along the x axis, uphill"),
        *(Signal(name=f"{wheel}.grip", unit="1", value=0.3, range=(0.02, 1.5), meaning="largest force over load")
          for wheel in WHEELS),
    )  # fmt: skip
    return Body(
        states=(*STATES, *(f"{way}.{wheel}" for way in ("along", "across") for wheel in WHEELS)),
        units=(*STATES.values(), *["m"] * 8), signals=signals, parameters=dict(q),
        met=tuple(f"{wheel}.traction" for wheel in WHEELS),
        rate=ca.Function("rate", [x, v, s], [rate]), loads=ca.Function("loads", [x, v, s], [asked]),
        outputs=ca.Function("shown", [x, v, s], [shown]), output_names=slips,
        start=lambda speeds, ground: _start(p, speeds, ground), holds=lambda ground: _held(p, ground)[1],
    )  # fmt: skip


def _motion(p: Mapping[str, float], x: Any, v: Any, s: Any) -> tuple[Any, Any, Any]:
    """States', what the ground asks of each rim, and the slip of each wheel."""
    heading, ahead, aside, turn = x[2], x[3], x[4], x[5]
    along, across = x[6:10], x[10:14]
    at = [(a * p["wheelbase"] / 2, b * p["track"] / 2) for a, b in WHEELS.values()]
    slides = [(v[i] - ahead + turn * y, -(aside + turn * d)) for i, (d, y) in enumerate(at)]
    fade = [ca.fabs(v[i]) / p["relaxation"] for i in range(4)]
    strained = ca.vertcat(
        *(slides[i][0] - fade[i] * along[i] for i in range(4)), *(slides[i][1] - fade[i] * across[i] for i in range(4))
    )
    uphill, weight = p["mass"] * GRAVITY * ca.sin(s[0]), p["mass"] * GRAVITY * ca.cos(s[0])
    pull = -uphill * ca.cos(heading), uphill * ca.sin(heading)
    still = _loads(p, weight, -pull[0], -pull[1])
    forces = [_tyre(p, s[1 + i] * still[i], along[i], across[i]) for i in range(4)]
    loads = _loads(p, weight, sum(f[0] for f in forces), sum(f[1] for f in forces))
    forces = [_tyre(p, s[1 + i] * loads[i], along[i], across[i]) for i in range(4)]
    damping = p["tyre_damping"]
    forces = [(f[0] + damping * strained[i], f[1] + damping * strained[4 + i]) for i, f in enumerate(forces)]
    moment = sum(d * f[1] - y * f[0] for f, (d, y) in zip(forces, at, strict=True))
    rate = ca.vertcat(
        ahead * ca.cos(heading) - aside * ca.sin(heading),
        ahead * ca.sin(heading) + aside * ca.cos(heading),
        turn,
        (sum(f[0] for f in forces) + pull[0]) / p["mass"] + aside * turn,
        (sum(f[1] for f in forces) + pull[1]) / p["mass"] - ahead * turn,
        moment / p["yaw_inertia"],
        strained,
    )
    asked = ca.vertcat(*(f[0] + p["rolling"] * loads[i] * ca.tanh(v[i] / SPEED) for i, f in enumerate(forces)))
    return rate, asked, along / p["relaxation"]


def _loads(p: Mapping[str, float], weight: Any, driven: Any, steered: Any) -> list[Any]:
    """Load of each wheel under all forces of the ground ahead and to the left, N; none below zero."""
    pitched, rolled = p["height"] / (2 * p["wheelbase"]) * driven, p["height"] / (2 * p["track"]) * steered
    return [ca.fmax(weight / 4 - a * pitched - b * rolled, 0) for a, b in WHEELS.values()]


def _tyre(p: Mapping[str, float], largest: Any, along: Any, across: Any) -> tuple[Any, Any]:
    """Forces of a strained tyre along and across, N."""
    slip = ca.sqrt(along**2 + across**2 + (LEAST * p["relaxation"]) ** 2) / p["relaxation"]
    size = largest * _formula(p, slip) / (slip * p["relaxation"])
    return size * along, size * across


def _formula(p: Mapping[str, float], slip: Any) -> Any:
    """The magic formula: share of the largest force at a slip."""
    steep = p["stiffness_factor"] * slip
    return ca.sin(p["shape_factor"] * ca.atan(steep - p["curvature_factor"] * (steep - ca.atan(steep))))


def _held(p: Mapping[str, float], ground: list[float]) -> tuple[float, str]:
    """The slip at which the vehicle stands still on a slope that it climbs, and what the ground cannot hold."""
    slope, grips = ground[0], ground[1:]
    weight = p["mass"] * GRAVITY * math.cos(slope)
    loads = _loads(p, weight, weight * math.tan(slope), 0.0)
    most = sum(grip * float(load) for grip, load in zip(grips, loads, strict=True))
    share = weight * math.tan(slope) / most
    low, high = 0.0, 10.0
    while high - low > 1e-12:  # the formula rises to its largest value, of 1, and falls after
        third = (high - low) / 3
        rising = _formula(p, low + third) < _formula(p, high - third)
        low, high = (low + third, high) if rising else (low, high - third)
    peak, told = (low + high) / 2, ""
    if not abs(share) < (largest := float(_formula(p, peak))):
        steepest = math.degrees(math.atan(abs(math.tan(slope) / share) * largest))
        told = f"holds {steepest:.3g} degrees of slope: got {math.degrees(slope):.3g}"
    low, high = 0.0, peak
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if float(_formula(p, middle)) < abs(share) else (low, middle)
    return math.copysign(low, share), told


def _start(p: Mapping[str, float], speeds: list[float], ground: list[float]) -> list[float]:
    """Rolling straight uphill, every wheel with the slip that holds the slope."""
    slip, _ = _held(p, ground)
    mean = sum(speeds) / 4
    turn = sum(-b * v for v, (_, b) in zip(speeds, WHEELS.values(), strict=True)) / (2 * p["track"])
    return [0.0, 0.0, 0.0, mean * (1 - slip), 0.0, turn, *[slip * p["relaxation"]] * 4, *[0.0] * 4]


#: 63 l/min at 2800 turns a minute, for all wheels.
PUMP = Limit(name="pump", signals=("flow",), value=63 / 6e4, unit="m^3/s", source="table")
MODEL = free("vehicle", PLANT, tuple(WHEELS), BodyModel(defaults=BODY, build=vehicle_body), {"flow": PUMP})
