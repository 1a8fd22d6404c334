"""A monitor beside a law: it watches the error, the input and what it estimates, and shuts the actuator down for good.

States that the law does not measure are estimated by the rows of the nominal plant, driven by the measured first state
and by the inputs that were commanded: for a hydraulic drive the flow that goes in and the speed say what the pressure
is, as fast as the leakage forgets. A sensor that repeats itself for longer than its noise allows has frozen.

Not guaranteed: estimates are as good as the nominal numbers; what is proved of a monitor is in `docs/proof.md`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..plants import Plant

#: Control periods in which a noisy sensor says the same before it counts as frozen.
FROZEN = 50
#: Beside the estimates: the last measurement, how often it was repeated, whether the actuator is shut down.
FLAGS = 3


@dataclass(frozen=True, kw_only=True)
class Monitor:
    """What is watched of one member.

    Attributes:
        error: Largest measured error of the first state, in its unit.
        ranges: Range of an input or of a state by its name; a state that the law does not measure is estimated.
        noisy: Whether the measurement of the first state is noisy, so that one that repeats itself has frozen.
    """

    error: float
    ranges: Mapping[str, tuple[float, float]]
    noisy: bool

    def size(self, plant: Plant) -> int:
        """Number of its discrete states."""
        return len(plant.states) + FLAGS

    def watched(
        self, plant: Plant, before: Any, measured: Any, wanted: Any, u: Any, commanded: Any, nominal: Any, period: float
    ) -> tuple[Any, Any]:
        """Whether the actuator is to be shut down from this period on, and the monitor's states after it.

        Args:
            plant: The plant.
            before: The monitor's states. Shape (n + FLAGS,).
            measured: Measured first state.
            wanted: Its reference.
            u: Inputs that the law commands now. Shape (m,).
            commanded: Inputs that it commanded a period before. Shape (m,).
            nominal: Nominal parameters.
            period: Control period, s.
        """
        import casadi as ca

        n = len(plant.states)
        estimate = ca.vertcat(measured, self._moved(plant, before[:n], commanded, nominal, period)[1:])
        last, count, down = before[n], before[n + 1], before[n + 2]
        count = ca.if_else(ca.fabs(measured - last) > 0, 0, count + 1) if self.noisy else ca.SX(0)
        bad = ca.logic_or(down > 0, ca.fabs(measured - wanted) > self.error)
        bad = ca.logic_or(bad, count >= FROZEN)
        named = {s: estimate[k] for k, s in enumerate(plant.states)} | {s: u[k] for k, s in enumerate(plant.inputs)}
        for name, (low, high) in self.ranges.items():
            bad = ca.logic_or(bad, ca.logic_or(named[name] < low, named[name] > high))
        return bad, ca.vertcat(estimate, measured, count, bad)

    def _moved(self, plant: Plant, x: Any, u: Any, nominal: Any, period: float) -> Any:
        """The nominal plant's states a period later, the first one held: a classical Runge-Kutta step."""
        import casadi as ca

        still = ca.SX.zeros(plant.w.numel())

        def rate(at: Any) -> Any:
            values = [at, u, still, nominal]
            return ca.substitute([plant.rate], [plant.x, plant.u, plant.w, plant.p], values)[0]

        held = ca.vertcat(0, ca.DM.ones(len(plant.states) - 1))
        first = held * rate(x)
        second = held * rate(x + period / 2 * first)
        third = held * rate(x + period / 2 * second)
        fourth = held * rate(x + period * third)
        return x + period / 6 * (first + 2 * second + 2 * third + fourth)
