"""Files that would keep a checker busy: well-formed, and larger than any file of ours."""

from fractions import Fraction

import casadi as ca

from hdmm_opt.control.rac import RAC
from hdmm_opt.files.seal import seal, to_text
from hdmm_opt.plants import Limit, Parameter, Plant

ROWS = 8


def wide_plant():
    """Eight rows with an input each, three inertias uncertain."""
    known = {f"m{i}": Parameter(value=1.0 + i / 10, unit="kg", tolerance=0.1 * (i >= 5)) for i in range(ROWS)}
    known |= {f"d{i}": Parameter(value=0.5, unit="1", tolerance=0.1) for i in range(ROWS)}
    x, u, w = ca.SX.sym("x", ROWS), ca.SX.sym("u", ROWS), ca.SX.sym("w")
    p = ca.vertcat(*(ca.SX.sym(name) for name in known))
    coupled = ca.vertcat(*(u[i] - p[ROWS + i] * ca.sum1(x) for i in range(ROWS)))
    return Plant(
        name="wide", level="", states=tuple(f"x{i}" for i in range(ROWS)), state_units=("m",) + ("m/s",) * (ROWS - 1),
        inputs=tuple(f"u{i}" for i in range(ROWS)), input_unit="N", disturbances=("load_force",), parameters=known,
        targets=("reference", *["zero"] * (ROWS - 1)), controlled=(True,) * ROWS, input_map=tuple(range(ROWS)),
        x=x, u=u, w=w, p=p, mass=p[:ROWS], force=coupled + w,
        limits=(Limit(name="all", signals=tuple(f"u{i}" for i in range(ROWS)), value=1e3, unit="N", source="assumed"),),
        stroke=(0.0, 0.8), outputs={}, output_units={},
    )  # fmt: skip


def ratio(value):
    return str(Fraction(str(value)))


def wide(document, split):
    """A file of that plant, whose certificate has cells with long numbers."""
    plant, entry, study = wide_plant(), document["members"][0], document["study"]
    law = RAC(plant=plant)
    limits = [{"name": limit.name, "signals": list(limit.signals)} for limit in plant.limits]
    names = [*plant.states]
    gains = {}
    for k in range(ROWS):
        gains |= {f"beta_{k + 1}": 20.0, f"epsilon_{k + 1}": 1.0, f"delta_{k + 1}": 1.0, f"sigma_{k + 1}": 1.0,
                  f"gamma_{k + 1}": 1.0, f"phi_{k + 1}": 100.0, f"preload_{k + 1}": 0.0}  # fmt: skip
    long = "{}/1000000000000000000000000000"
    order = 24

    def rows(size, width):
        return [[long.format(10**27 * (i == j) + 123456789012345678901234567 * (i + 2 * j + 1) % 10**25)
                 for j in range(width)] for i in range(size)]  # fmt: skip

    cells = 1
    for count in split:
        cells *= count
    vector = [long.format(10**27 + 7 * k) for k in range(ROWS)]
    section = study["plant"]["joints"]["actuator"]
    section["parameters"] = {
        name: {"value": p.value, "unit": p.unit, "tolerance": p.tolerance, "source": "assumed", "meaning": ""}
        for name, p in plant.parameters.items()
    }
    section["limits"] = {"all": {"value": 1e3, "unit": "N", "source": "assumed"}}
    section["bundled"] = []
    study["uncertainty"]["noise"] = dict.fromkeys(names, 1e-6)
    study["uncertainty"]["initial"] = dict.fromkeys(names, 1e-6)
    study["controller"]["modelling"] = []
    study["controller"]["members"]["actuator"] = {name: {"value": v} for name, v in gains.items()}
    spread = {name: (p.value * (1 - p.tolerance), p.value * (1 + p.tolerance)) for name, p in plant.parameters.items()}
    load = study["uncertainty"]["disturbances"]["load_force"]
    entry["model"] = {**law.loop_model().to_data(), "limits": limits, "first": "position"}
    entry["nominal"] = {**plant.values(), "load_force": sum(load["range"]) / 2}
    units = {name: unit for name, unit in zip(names, plant.state_units, strict=True)}
    entry["gains"] = [
        {"name": s.name, "value": gains[s.name], "unit": s.unit, "min": gains[s.name], "max": gains[s.name],
         "meaning": s.meaning} for s in law.schema
    ]  # fmt: skip
    room = 1 + 1e-14
    entry["assumptions"] = [
        *({"name": f"parameter.{name}", "lower": low / (room if low < high else 1), "upper": high * (room if low < high else 1),
           "unit": plant.parameters[name].unit, "source": "assumed"} for name, (low, high) in spread.items()),
        {"name": "disturbance.load_force", "lower": load["range"][0], "upper": load["range"][1], "unit": load["unit"],
         "source": "study"},
        *({"name": f"{kind}.{name}", "lower": -1e-6, "upper": 1e-6, "unit": units[name], "source": "study"}
          for kind in ("noise", "initial") for name in names),
    ]  # fmt: skip
    study["controller"]["delay_s"] = 1 / study["controller"]["rate_hz"]
    study["uncertainty"]["disturbances"]["load_force"].pop("rate", None)
    entry["certificate"] = {
        "kind": "impulse", "half_widths": vector, "input_bound": vector,
        "networks": [{"row": name, "low": "-1", "high": "1", "middle": "0", "bound": "1"} for name in names],
        "force": rows(ROWS, ROWS), "drive": rows(ROWS, ROWS), "split": split,
        "cells": [{"columns": rows(order, order), "blocks": [2] * (order // 2), "groups": [1] * 300 + [1000] * 100,
                   "growth": "100001/100000"}] * cells,
        "envelope": {"rate": "1/20", "ultimate": vector},
    }  # fmt: skip
    entry["golden"] = [
        {
            "x": [float(k)] * ROWS,
            "r": [0.0] * 4,
            "u": [0.0] * ROWS,
            **dict.fromkeys(("theta", "phi", "theta_next", "phi_next"), [0.0] * ROWS),
        }
        for k in range(20)
    ]
    return to_text(seal(document))
