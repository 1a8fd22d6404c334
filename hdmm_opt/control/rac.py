"""Robust adaptive control (RAC) for strict-feedback plants: one definition for any number of subsystems.

    Q_i = x_i - target_i,   κ_i = -(β_i + ε_i θ̂_i) Q_i / 2 + m_i,   θ̂_i' = -δ_i σ_i θ̂_i + ε_i δ_i Q_i² / 2

The target of a row is the reference, zero, or the virtual control κ of another row; the input is the κ of the last
row. The modelling terms m_i are zero in the model-free law, but for m_1 = x_1d' where x_1' = x_2. The model-based law
fills them in from the plant itself, term by term: "mechanics" (acceleration, viscous friction and nominal load, at the
reference), "friction" (in addition Coulomb friction and the direction-dependent loss), and "resistance", "back_emf" and
"decoupling" (electrical, at the measured state).

Where the speed of the reference changes sign, "friction" jumps with it, and the plant's own friction need not: near
standstill a proof has to allow for both directions. Its use lowers the simulated error and raises the certified one.

Source: Heydari Shahna (2025), ch. 4, and P-1, P-4; sampled form derived here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stability import Gains, LoopModel, Row, from_casadi

from ..plants import Plant

#: Electrical modelling terms, and the parameter that carries each.
ELECTRICAL = {"resistance": "resistance", "back_emf": "flux", "decoupling": "inductance"}
#: Parameters of the plant that only the term "friction" compensates.
FRICTION = ("screw_friction", "gear_loss", "coulomb_friction")
#: Modelling terms that a study may ask for.
MODELLING = ("mechanics", "friction", *ELECTRICAL)


@dataclass(frozen=True, kw_only=True)
class RAC:
    """The law for one plant.

    Attributes:
        plant: The plant.
        modelling: Which modelling terms the law holds; see `MODELLING`.

    Raises:
        ValueError: a modelling term that is unknown, or that the plant has no row for.
    """

    plant: Plant
    modelling: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for term in self.modelling:
            if term not in MODELLING:
                raise ValueError(f'controller.modelling knows {", ".join(MODELLING)}: got "{term}"')
            if term == "friction" and "mechanics" not in self.modelling:
                raise ValueError('modelling term "friction" adds to "mechanics": put "mechanics" beside it')
            if term in ELECTRICAL and self.plant.level != "voltage":
                raise ValueError(
                    f'modelling term "{term}" is electrical and needs plant.level = "voltage": '
                    f'got "{self.plant.level}"; leave the term out'
                )

    @property
    def rows(self) -> tuple[Row, ...]:
        """The subsystems, in strict-feedback order."""
        plant = self.plant
        columns = zip(plant.states, plant.state_units, plant.targets, plant.governed, strict=True)
        return tuple(Row(state=s, unit=u, target=t, governed=g) for s, u, t, g in columns)

    @property
    def governed(self) -> tuple[int, ...]:
        """Indices of the rows that carry gains."""
        return tuple(i for i, row in enumerate(self.rows) if row.governed)

    def terms(self, x: Any, r: Any, nominal: Any, load: Any) -> list[Any]:
        """The modelling terms m_i of the governed rows.

        Args:
            x: Measured states. Shape (n,).
            r: Reference position … jerk. Shape (4,).
            nominal: Nominal parameters. Shape of plant.p.
            load: Nominal disturbances. Shape of plant.w.

        Returns:
            One expression for each governed row.
        """
        return [self._term(i, x, r, nominal, load) for i in self.governed]

    def _term(self, i: int, x: Any, r: Any, nominal: Any, load: Any) -> Any:
        import casadi as ca

        if self.rows[i].target == "reference":
            return r[1]
        no_input = ca.SX.zeros(len(self.plant.inputs))
        if i in self.plant.drives and self.plant.level == "voltage":
            left_out = [ELECTRICAL[term] for term in ELECTRICAL if term not in self.modelling]
            known = [0 if name in left_out else nominal[k] for k, name in enumerate(self.plant.parameters)]
            return -self.plant.at(x=x, u=no_input, w=load, p=ca.vertcat(*known))[i]
        if "mechanics" not in self.modelling:
            return ca.SX(0)
        left_out = () if "friction" in self.modelling else FRICTION
        known = [0 if name in left_out else nominal[k] for k, name in enumerate(self.plant.parameters)]
        at_reference = ca.vertcat(r[0], r[1], *[0] * (len(self.rows) - 2))
        return self.plant.demand(i, r[2], x=at_reference, w=load, p=ca.vertcat(*known))

    def step(
        self, x: Any, r: Any, theta: Any, gains: Any, nominal: Any, load: Any, period: float, *,
        given: Mapping[int, Any] | None = None,
    ) -> Any:  # fmt: skip
        """One control period, as expressions.

        Args:
            x: Measured states. Shape (n,).
            r: Reference position … jerk. Shape (4,).
            theta: Adaptive scalars. Shape (k,), k governed rows.
            gains: β, ε, δ, σ a row. Shape (k, 4).
            nominal: Nominal parameters.
            load: Nominal disturbances.
            period: Control period, s.
            given: Virtual controls that another law sets in place of this one's, by row.

        Returns:
            (u, theta after the period, Q): inputs inside the amplitude limit, shape (m,); shape (k,); errors of the
            governed rows, shape (k,). The limit scales the input vector to the norm that the plant allows.
        """
        import casadi as ca

        virtual, errors = self.virtual_controls(x, r, theta, gains, nominal, load, given)
        adapted = []
        for k, error in enumerate(errors):
            _, epsilon, delta, sigma = (gains[k, column] for column in range(4))
            adapted.append(theta[k] + period * (epsilon * delta * error**2 / 2 - delta * sigma * theta[k]))
        u = ca.vertcat(*(virtual[row] for row in self.plant.drives))
        norm = ca.fabs(u) if u.numel() == 1 else ca.norm_2(u)
        limited = u * (self.plant.limits[0].value / ca.fmax(norm, self.plant.limits[0].value))
        return limited, ca.vertcat(*adapted), ca.vertcat(*errors)

    def virtual_controls(
        self,
        x: Any,
        r: Any,
        theta: Any,
        gains: Any,
        nominal: Any,
        load: Any,
        given: Mapping[int, Any] | None = None,
    ) -> tuple[dict[int, Any], list[Any]]:
        """κ_i by row, and Q_i of the governed rows, before the amplitude limit; arguments as in `step`."""
        terms = self.terms(x, r, nominal, load)
        virtual: dict[int, Any] = {}
        errors = []
        for k, i in enumerate(self.governed):
            target = self.rows[i].target
            goal = r[0] if target == "reference" else 0 if target == "zero" else virtual[int(target)]
            errors.append(x[i] - goal)
            virtual[i] = -(gains[k, 0] + gains[k, 1] * theta[k]) * errors[-1] / 2 + terms[k]
            if given is not None and i in given:
                virtual[i] = given[i]
        return virtual, errors

    def step_function(self, period: float) -> Any:
        """`step` as a CasADi function (x, r, theta, gains, nominal, load) -> (u, theta, Q)."""
        import casadi as ca

        n, k = len(self.rows), len(self.governed)
        symbols = [
            ca.SX.sym("x", n),
            ca.SX.sym("r", 4),
            ca.SX.sym("theta", k),
            ca.SX.sym("gains", k, 4),
            ca.SX.sym("nominal", self.plant.p.numel()),
            ca.SX.sym("load", self.plant.w.numel()),
        ]
        names = ["x", "r", "theta", "gains", "nominal", "load"]
        x, r, theta, gains, nominal, load = symbols
        results = self.step(x, r, theta, gains, nominal, load, period)
        return ca.Function("rac", symbols, [*results], names, ["u", "theta_next", "Q"])

    def loop_model(self) -> LoopModel:
        """Plant and law as data for the prover."""
        import casadi as ca

        plant = self.plant
        r, nominal, load = ca.SX.sym("r", 4), ca.SX.sym("nominal", plant.p.numel()), ca.SX.sym("load", plant.w.numel())
        plant_names = (*plant.states, *plant.inputs, *plant.disturbances, *plant.parameters)
        law_names = (*plant.states, "r0", "r1", "r2", "r3", *(f"nominal.{n}" for n in plant.parameters))
        law_names += tuple(f"nominal.{n}" for n in plant.disturbances)
        plant_input = ca.vertcat(plant.x, plant.u, plant.w, plant.p)
        law_input = ca.vertcat(plant.x, r, nominal, load)
        return LoopModel(
            rows=self.rows,
            drives=plant.drives,
            inputs=plant.inputs,
            plant=from_casadi(ca.Function("plant", [plant_input], [ca.vertcat(plant.mass, plant.force)]), plant_names),
            law=tuple(
                from_casadi(ca.Function("term", [law_input], [term]), law_names)
                for term in self.terms(plant.x, r, nominal, load)
            ),
        )


def gain_columns(gains: tuple[Gains, ...]) -> list[list[float]]:
    """Gains as rows β, ε, δ, σ. Shape (k, 4)."""
    return [[g.beta, g.epsilon, g.delta, g.sigma] for g in gains]
