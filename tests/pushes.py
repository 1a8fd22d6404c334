"""A quantity with the toolkit's own bounds, for tests of motions."""

import casadi as ca
import numpy as np

from hdmm_opt.motions.enclosure import enclosure
from trajectories import Quantities


def push(function, lower, upper, count=1):
    """One quantity, "push" in N, of (x, v, a, j) of so many coordinates."""
    curves = [ca.SX.sym(n, count) for n in "xvaj"]
    given = ca.Function("q", curves, [function(*curves)])
    return Quantities(
        function=given, names=("push",), units=("N",), lower=np.array([lower]), upper=np.array([upper]),
        enclose=enclosure(given),
    )  # fmt: skip
