"""Accelerations of members that a coupling joins.

They solve ``M_i a_i = h_i(x_i, u_i, w_i)``, ``w = F(x, v, a, d) - m a``. The system is linear but for the direction in
which screws and gears lose, so that a few Newton steps from the reference's acceleration solve it; tests measure what
they leave.
"""

from __future__ import annotations

from typing import Any

from ..machines.machine import Machine
from ..plants import Plant

#: Newton steps for the accelerations.
ROUNDS = 3


def accelerations(machine: Machine, x: Any, u: Any, p: Any, disturbances: Any, guess: Any) -> tuple[Any, Any]:
    """The members' accelerations, and their loads w_i, at given states.

    Args:
        machine: A machine with a coupling.
        x: States of each plant, a list of columns.
        u: Applied inputs of each plant; a list of columns.
        p: Parameters of each plant, a list of columns.
        disturbances: The machine's disturbances. Shape (d,).
        guess: Accelerations to start from. Shape (n,).

    Returns:
        Two SX columns. Shape (n,).
    """
    import casadi as ca

    n, plants = len(machine.members), machine.plants
    position = ca.vertcat(*(part[0] if plant.first == "position" else 0 for part, plant in zip(x, plants, strict=True)))
    speed = ca.vertcat(*(part[plant.accelerating] for part, plant in zip(x, plants, strict=True)))
    a = ca.SX.sym("a", n)
    forces = machine.forces(position, speed, a, disturbances)
    inertia = ca.jacobian(forces, a)
    rest = ca.substitute([forces], [a], [ca.SX.zeros(n)])[0]
    own = ca.vertcat(*(p[i][list(plant.parameters).index(plant.carried)] for i, plant in enumerate(plants)))
    coupling = inertia - ca.diag(own)
    direct = [_direct(plant, u[i], x[i], p[i]) for i, plant in enumerate(plants)]
    current = ca.SX(guess)
    load = rest + coupling @ current
    for _ in range(ROUNDS):
        columns = []
        for i, plant in enumerate(plants):
            row, symbol = plant.accelerating, ca.SX.sym("w")
            value = plant.at(x=x[i], u=ca.SX.zeros(len(plant.inputs)), w=symbol, p=p[i])[row] + direct[i]
            slope = ca.jacobian(value, symbol)
            columns.append(ca.substitute([value, slope, plant.mass[row]], [symbol, plant.p], [load[i], p[i]]))
        value, slope, mass = (ca.vertcat(*part) for part in zip(*columns, strict=True))
        # mass a = value + slope (rest + coupling a - load)
        current = ca.solve(ca.diag(mass) - ca.diag(slope) @ coupling, value + slope * (rest - load))
        load = rest + coupling @ current
    return current, load


def _direct(plant: Plant, u: Any, x: Any, p: Any) -> Any:
    """What the input adds to the accelerating row beside what it does at zero input."""
    import casadi as ca

    zero, w, row = ca.SX.zeros(len(plant.inputs)), ca.SX.zeros(len(plant.disturbances)), plant.accelerating
    return plant.at(x=x, u=u, w=w, p=p)[row] - plant.at(x=x, u=zero, w=w, p=p)[row]
