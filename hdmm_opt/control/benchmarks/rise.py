"""RISE, the robust integral of the sign of the error, joint by joint.

    e_1 = q_d - q,   e_2 = e_1' + α_1 e_1,   a = k e_2 + v,   v' = k α_2 e_2 + β sgn(e_2)

Continuous; semi-globally asymptotic where the disturbance and its derivative are bounded, with β above what both ask,
α_1, α_2 > 1/2, and k large enough for the initial error. Faults that come on smoothly are such disturbances; a loss of
effectiveness scales the input. Its proof does not cover the onset itself, saturation (the integral is frozen while it
would push further outwards), sampling, noise, and effectiveness 0.

References:
    Xian, Dawson, de Queiroz and Chen (2004), A continuous asymptotic tracking control strategy for uncertain nonlinear
    systems, IEEE Transactions on Automatic Control 49(7), 1206-1211; Fischer, Kan, Kamalapurkar and Dixon (2014),
    Saturated RISE feedback control for a class of second-order nonlinear systems, ibid. 59(4), 1094-1099.
"""

from __future__ import annotations

from typing import Any

from .outer import commanded


class Rise:
    """The law for all joints, with gains shared by them; k and β per unit of inertia.

    Args:
        joints: Number of joints.
    """

    #: Name, lowest and highest value of each gain; searched on a logarithmic scale.
    GAINS = (("alpha_1", 1.0, 60.0), ("alpha_2", 1.0, 60.0), ("k", 5.0, 500.0), ("beta", 1e-3, 100.0))

    def __init__(self, joints: int) -> None:
        import casadi as ca

        self.states = joints
        self.symbols = ca.SX.sym("rise", len(self.GAINS))

    def step(self, loop: Any, seen: list[Any], r: list[Any], foreseen: Any, states: Any) -> tuple[list[Any], Any]:
        """Virtual controls of all joints, and the integrals after a period."""
        import casadi as ca

        first, second, stiff, sign = (self.symbols[k] for k in range(4))
        commands, after = [], []
        for i, law in enumerate(loop.laws):
            filtered = r[i][1] - seen[i][1] + first * (r[i][0] - seen[i][0])
            wanted = stiff * filtered + states[i]
            command, given = commanded(law, seen[i], r[i], foreseen[i], wanted)
            growth = stiff * second * filtered + sign * ca.sign(filtered)
            outwards = ca.logic_and(ca.fabs(wanted - given) > 1e-9, (wanted - given) * growth > 0)
            commands.append(command)
            after.append(states[i] + loop.period * ca.if_else(outwards, 0, growth))
        return commands, ca.vertcat(*after)
