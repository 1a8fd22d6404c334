"""A monitor beside a law: it watches the error, the input and what it estimates, and shuts the actuator down for good.

States that the law does not measure are estimated by the rows of the nominal plant, driven by what is measured and by
the inputs that were commanded: for a hydraulic drive the flow that goes in and the speed say what the pressure is, as
fast as the leakage forgets. So a speed that is not what the flow makes shows as a pressure that cannot be: a sensor
with a bias, one that has frozen while the reference moves, a valve that does not follow.

Not guaranteed: estimates are as good as the nominal numbers; what is proved of a monitor is in `docs/proof.md`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..plants import Plant


@dataclass(frozen=True, kw_only=True)
class Monitor:
    """What is watched of one member.

    Attributes:
        error: Largest measured error of the first state, in its unit.
        ranges: Range of an input or of a state by its name.
    """

    error: float
    ranges: Mapping[str, tuple[float, float]]

    def size(self, plant: Plant) -> int:
        """Number of its discrete states: the estimates, and whether the actuator is shut down."""
        return len(plant.states) + 1

    def watched(
        self, plant: Plant, before: Any, measured: Any, wanted: Any, u: Any, commanded: Any, nominal: Any, period: float
    ) -> tuple[Any, Any]:
        """Whether the actuator is to be shut down from this period on, and the monitor's states after it.

        Args:
            plant: The plant.
            before: The monitor's states. Shape (n + 1,).
            measured: States as measured. Shape (n,).
            wanted: Its reference.
            u: Inputs that the law commands now. Shape (m,).
            commanded: Inputs that it commanded a period before. Shape (m,).
            nominal: Nominal parameters.
            period: Control period, s.
        """
        import casadi as ca

        n = len(plant.states)
        moved, known = self._moved(plant, before[:n], commanded, nominal, period), plant.measured
        estimate = ca.vertcat(*(measured[k] if k in known else moved[k] for k in range(n)))
        bad = ca.logic_or(before[n] > 0, ca.fabs(measured[0] - wanted) > self.error)
        named = {s: estimate[k] for k, s in enumerate(plant.states)} | {s: u[k] for k, s in enumerate(plant.inputs)}
        for name, (low, high) in self.ranges.items():
            bad = ca.logic_or(bad, ca.logic_or(named[name] < low, named[name] > high))
        return bad, ca.vertcat(estimate, bad)

    def _moved(self, plant: Plant, x: Any, u: Any, nominal: Any, period: float) -> Any:
        """The nominal plant's states a period later, measured ones held: a classical Runge-Kutta step."""
        import casadi as ca

        still = ca.SX.zeros(plant.w.numel())

        def rate(at: Any) -> Any:
            values = [at, u, still, nominal]
            return ca.substitute([plant.rate], [plant.x, plant.u, plant.w, plant.p], values)[0]

        held = ca.DM([float(k not in plant.measured) for k in range(len(plant.states))])
        first = held * rate(x)
        second = held * rate(x + period / 2 * first)
        third = held * rate(x + period / 2 * second)
        fourth = held * rate(x + period * third)
        return x + period / 6 * (first + 2 * second + 2 * third + fourth)
