"""What rivals share: they command accelerations, and the joints' own models turn them into torques or currents."""

from __future__ import annotations

from typing import Any


def per_acceleration(law: Any, x: Any) -> Any:
    """Torque or current that a unit of acceleration takes on the nominal plant: mass over gain of the second row."""
    import casadi as ca

    plant = law.plant
    nominal = ca.DM(list(plant.values().values()))
    following = [j for j, target in enumerate(plant.targets) if target == 1]
    source = plant.x[following[0]] if following else plant.u[0]
    gain, mass = ca.substitute([ca.jacobian(plant.force[1], source), plant.mass[1]], [plant.p], [nominal])
    symbols = [plant.x, plant.u, plant.w]
    gain = ca.substitute([gain], symbols, [x, ca.SX.zeros(plant.u.numel()), ca.SX.zeros(plant.w.numel())])[0]
    return mass / gain


def commanded(law: Any, x: Any, r: Any, load: Any, feedback: Any) -> tuple[Any, Any]:
    """The virtual control of the second row for an acceleration, limited, and how much of the latter is left.

    Args:
        law: The law of the joint, for its plant and its modelling term: rivals foresee what it foresees.
        x: Measured states. Shape (n,).
        r: Reference position … jerk. Shape (4,).
        load: Foreseen load.
        feedback: Wanted acceleration beside what the modelling term gives.

    Returns:
        Torque or current inside the plant's limit, and the acceleration that it stands for.
    """
    import casadi as ca

    plant = law.plant
    following = [j for j, target in enumerate(plant.targets) if target == 1]
    signal = plant.states[following[0]] if following else plant.inputs[0]
    limit = next(entry.value for entry in plant.limits if signal in entry.signals)
    scale = per_acceleration(law, x)
    term = law.terms(x, r, ca.DM(list(plant.values().values())), load)[1]
    value = ca.fmin(ca.fmax(term + scale * feedback, -limit), limit)
    return value, (value - term) / scale
