"""Fault-tolerant control by time-delay estimation, a nonsingular fast terminal sliding mode and super-twisting.

    s = ω (e + k_1 |e|² sgn e + k_2 |e'|^g sgn e'),   e = q_d - q,   g = 1.4
    ν = q_d'' + |e'|^(2-g) sgn(e') (1 + 2 k_1 |e|)/(g k_2) + K_1 |s|^½ sgn s + z,   z' = K_2 sgn s
    a_j = a_{j-1} + ρ (ν_j - (q'_j - q'_{j-1})/T)

The last command and the last acceleration stand for everything unknown: load, coupling, fault. Finite-time
convergence is claimed for continuous time where the estimate's error has a bounded rate; sampled, a ball of the order
of T. ρ is the share of the nominal inertia that the estimate uses; 0 < ρ M̂/M < 2 is needed. Not covered: noise, which
the difference of speeds over a period amplifies by 1/T, saturation (the integral is frozen there), and actuator lag.

The structure is that of Van et al., the estimate with a constant inertia that of Kali et al.; k_1 = 0.5, and
k_2 = e_0^(1-g) ω^(-g) with e_0 = 0.02.

References:
    Van, Ge and Ren (2017), Finite time fault tolerant control for robot manipulators using time delay estimation and
    continuous nonsingular fast terminal sliding mode control, IEEE Transactions on Cybernetics 47(7), 1681-1693;
    Kali, Saad and Benjelloun (2017), ICINCO, for the constant inertia.
"""

from __future__ import annotations

from typing import Any

from .outer import commanded

#: Exponent g, k_1, and the error e_0 at which both parts of the sliding variable weigh the same.
EXPONENT, LINEAR, TYPICAL = 1.4, 0.5, 0.02


class TimeDelay:
    """The law for all joints, with gains shared by them.

    Args:
        joints: Number of joints.
    """

    #: Name, lowest and highest value of each gain; searched on a logarithmic scale.
    GAINS = (("omega", 3.0, 60.0), ("rho", 0.01, 1.0), ("K_1", 0.05, 10.0), ("K_2", 0.02, 20.0))

    def __init__(self, joints: int) -> None:
        import casadi as ca

        self.states = 3 * joints
        self.symbols = ca.SX.sym("time_delay", len(self.GAINS))

    def step(self, loop: Any, seen: list[Any], r: list[Any], foreseen: Any, states: Any) -> tuple[list[Any], Any]:
        """Virtual controls of all joints; last commands, last speeds and integrals after a period."""
        import casadi as ca

        omega, share, first, second = (self.symbols[k] for k in range(4))
        curved = TYPICAL ** (1 - EXPONENT) * omega ** (-EXPONENT)
        commands, after = [], []
        for i, law in enumerate(loop.laws):
            last, speed, integral = (states[3 * i + k] for k in range(3))
            error, rate = r[i][0] - seen[i][0], r[i][1] - seen[i][1]
            size = ca.sqrt(rate**2 + 1e-20)
            sliding = omega * (error + LINEAR * ca.fabs(error) * error + curved * size ** (EXPONENT - 1) * rate)
            twist = ca.sign(sliding) * ca.sqrt(ca.fabs(sliding))
            reach = size ** (1 - EXPONENT) * rate * (1 + 2 * LINEAR * ca.fabs(error)) / (EXPONENT * curved)
            wanted = r[i][2] + reach + first * twist + integral
            measured = (seen[i][1] - speed) / loop.period
            # a modelling term that holds the reference's acceleration takes its part of the command
            asked = last + share * (wanted - measured)
            command, given = commanded(law, seen[i], r[i], foreseen[i], asked)
            held = ca.fabs(asked - given) > 1e-9
            commands.append(command)
            after += [given, seen[i][1], integral + ca.if_else(held, 0, loop.period * second * ca.sign(sliding))]
        return commands, ca.vertcat(*after)
