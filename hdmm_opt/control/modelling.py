"""What a law may know of its plant: modelling terms, taken from the plant itself term by term.

"mechanics" (acceleration, viscous friction and nominal load, at the reference), "friction" (in addition Coulomb
friction and the direction-dependent loss), "resistance", "back_emf" and "decoupling" (electrical, at the measured
state), and "flow" (the opening of a valve whose oil moves the actuator at the reference's speed, without a load).

Where the speed of the reference changes sign, "friction" jumps with it, and the plant's own friction need not: near
standstill a proof has to allow for both directions. Its use lowers the simulated error and raises the certified one.
"""

from __future__ import annotations

from typing import Any

from ..plants import Plant

#: Electrical modelling terms, and the parameter that carries each.
ELECTRICAL = {"resistance": "resistance", "back_emf": "torque_constant", "decoupling": "inductance"}
#: Parameters of the plant that only the term "friction" compensates.
FRICTION = ("screw_friction", "gear_loss", "coulomb_friction", "stribeck_friction")
#: Modelling terms that a study may ask for.
MODELLING = ("mechanics", "friction", *ELECTRICAL, "flow")
#: Levels at which the input meters oil.
METERED = ("valve", "flow")


def check_modelling(plant: Plant, modelling: tuple[str, ...]) -> None:
    """Refuse terms that are unknown, or that the plant has no row for.

    Raises:
        ValueError: such a term.
    """
    if set(modelling) - {"flow"} and plant.modes:
        raise ValueError(
            'controller.modelling needs a plant whose states are all measured: leave it empty, or "flow" alone'
        )
    for term in modelling:
        if term not in MODELLING:
            raise ValueError(f'controller.modelling knows {", ".join(MODELLING)}: got "{term}"')
        if term == "friction" and "mechanics" not in modelling:
            raise ValueError('modelling term "friction" adds to "mechanics": put "mechanics" beside it')
        if term == "flow" and plant.level not in METERED:
            raise ValueError(f'modelling term "flow" needs an input that meters oil: got plant.level "{plant.level}"')
        if term in ELECTRICAL and plant.level != "voltage":
            raise ValueError(
                f'modelling term "{term}" is electrical and needs plant.level = "voltage": '
                f'got "{plant.level}"; leave the term out'
            )


def modelling_term(
    plant: Plant, modelling: tuple[str, ...], i: int, x: Any, r: Any, nominal: Any, load: Any
) -> Any:  # fmt: skip
    """The modelling term of a row: what its virtual control must be beside the feedback.

    Args:
        plant: The plant.
        modelling: The terms that the law holds.
        i: The row; not the first one of a plant whose first state is a position.
        x: Measured states. Shape (n,).
        r: Reference and its first three derivatives. Shape (4,).
        nominal: Nominal parameters. Shape of plant.p.
        load: Nominal disturbances. Shape of plant.w.
    """
    import casadi as ca

    if i in plant.input_map and plant.level == "voltage":
        left_out = [ELECTRICAL[term] for term in ELECTRICAL if term not in modelling]
        known = [0 if name in left_out else nominal[k] for k, name in enumerate(plant.parameters)]
        no_input = ca.SX.zeros(len(plant.inputs))
        return -plant.at(x=x, u=no_input, w=load, p=ca.vertcat(*known))[i]
    moving = 2 if plant.first == "position" else 1
    at_reference = ca.vertcat(*(r[k] for k in range(moving)), *[0] * (len(plant.states) - moving))
    if i in plant.input_map and plant.level in METERED:
        return plant.demand(i, 0, x=at_reference, w=load, p=nominal) if "flow" in modelling else ca.SX(0)
    if "mechanics" not in modelling:
        return ca.SX(0)
    left_out = () if "friction" in modelling else FRICTION
    known = [0 if name in left_out else nominal[k] for k, name in enumerate(plant.parameters)]
    return plant.demand(i, r[moving], x=at_reference, w=load, p=ca.vertcat(*known))
