"""CasADi functions of a variant: for C code, for plain Python, and as oracle in tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from .model import E_STORED, P_IN, P_LOSS, Clock, Declared, Model

Vector = NDArray[np.float64]
QUICK, LARGE = 8, 200
"""Instructions of an output that is computed without the others, and of a function that is worth
it."""

SMALL, WORTHWHILE = 60, 0.1
"""Instructions that are done sooner than the question which of them are needed, and
the part of them that leaving out the energy account must spare."""
BEGINS_WITH_DERIVATIVES = ("rk4", "dopri5", "rosw3_adaptive")
"""Solvers that take the derivatives which came with the outputs."""


@dataclass(frozen=True)
class Functions:
    """The functions of a variant over `(t, x, z, u, p)`.

    Shapes: x (nx), z (nz) sampled values, u (nu), p (np), y (ny).

    Attributes:
        outputs: `-> (xdot, y)`.
        quick: `->` the outputs that take next to nothing to compute, states above all; without
            the derivatives, on which energies and forces hang.
        quick_outputs: their indices.
        coupled: `-> (xdot, y)`: all outputs but the energy account, which couples nothing; xdot is
            empty where the solver does not begin a step with it.
        coupled_outputs: their indices; none if they are hardly cheaper than all.
        derivatives: `-> xdot`.
        jacobian: `-> (xdot, d xdot/dx as nonzeros, d xdot/dt)`.
        jacobian_pattern: (row, column) of the nonzeros.
        directional: `(t, x, z, u, p, dt, dx, dz, du, dp) -> (dxdot, dy)`.
        updates: per clock `-> z` after the tick.
        periods: `p -> periods of the clocks`.
        output_dependencies, derivative_dependencies: per output / derivative the names of the
            states, inputs and sampled values that it depends on.
    """

    outputs: ca.Function
    quick: ca.Function
    quick_outputs: tuple[int, ...]
    coupled: ca.Function
    coupled_outputs: tuple[int, ...]
    derivatives: ca.Function
    jacobian: ca.Function
    jacobian_pattern: tuple[tuple[int, int], ...]
    directional: ca.Function
    updates: tuple[ca.Function, ...]
    periods: ca.Function
    output_dependencies: dict[str, tuple[str, ...]]
    derivative_dependencies: dict[str, tuple[str, ...]]


def _stack(variables: list[Declared]) -> Any:
    return ca.vertcat(*[variable.symbol for variable in variables]) if variables else ca.SX(0, 1)


def _column(expressions: list[Any]) -> Any:
    return ca.vertcat(*expressions) if expressions else ca.SX(0, 1)


def _update(clock: Clock, discrete: list[Declared]) -> Any:
    return _column([clock.updates.get(v.name, v.symbol) for v in discrete])


def build_functions(model: Model) -> Functions:
    """Build the functions of a finished model.

    Raises:
        ValueError: an expression uses a symbol that nobody declared.
    """
    roles = {role: model.of_role(role) for role in ("state", "discrete", "input", "parameter")}
    outputs = model.of_role("output")
    t = model.time
    x, z, u, p = (_stack(roles[role]) for role in ("state", "discrete", "input", "parameter"))
    xdot = _column([model.derivatives[variable.name] for variable in roles["state"]])
    y = _column([variable.symbol for variable in outputs])
    arguments = [t, x, z, u, p]
    jacobian = ca.jacobian(xdot, x)
    pattern = jacobian.sparsity()
    rows, columns = pattern.get_triplet()
    seeds = [ca.SX.sym(f"d_{index}", item.numel()) for index, item in enumerate(arguments)]
    tangent = ca.jtimes(ca.vertcat(xdot, y), ca.vertcat(*arguments), ca.vertcat(*seeds))
    split = xdot.numel()
    known = ca.vertcat(x, u, z, t)
    known_names = [v.name for role in ("state", "input", "discrete") for v in roles[role]]
    known_names.append("time")

    def dependencies(expression: Any, names: list[str]) -> dict[str, tuple[str, ...]]:
        sparsity = ca.jacobian_sparsity(expression, known) if names else None
        found: dict[str, list[str]] = {name: [] for name in names}
        if sparsity is not None:
            for row, column in zip(*sparsity.get_triplet(), strict=True):
                found[names[row]].append(known_names[column])
        return {name: tuple(items) for name, items in found.items()}

    def function(name: str, results: list[Any], extra: list[Any] | None = None) -> ca.Function:
        # what parts compute alike is computed once; structural zeros are written too: the C code
        # and the Python twin index densely
        return ca.Function(
            name, arguments + (extra or []), ca.cse([ca.densify(r) for r in results])
        )

    whole = function("f_outputs", [xdot, y])
    few = _quick(y, arguments) if whole.n_instructions() > LARGE else ()
    account = (E_STORED.name, P_IN.name, P_LOSS.name)
    some = tuple(k for k, v in enumerate(outputs) if v.name not in account or k in few)
    reused = xdot if model.solver.method in BEGINS_WITH_DERIVATIVES else ca.SX(0, 1)
    coupled = function("f_coupled", [reused, y[list(some)] if some else ca.SX(0, 1)])
    spared = whole.n_instructions() - coupled.n_instructions()
    if whole.n_instructions() < SMALL or spared < WORTHWHILE * whole.n_instructions():
        some = ()
    return Functions(
        outputs=whole,
        quick=function("f_quick", [y[list(few)] if few else ca.SX(0, 1)]),
        quick_outputs=few,
        coupled=coupled,
        coupled_outputs=some,
        derivatives=function("f_derivatives", [xdot]),
        jacobian=function("f_jacobian", [xdot, _nonzeros(jacobian), ca.jacobian(xdot, t)]),
        jacobian_pattern=tuple(zip(rows, columns, strict=True)),
        directional=function("f_directional", [tangent[:split], tangent[split:]], seeds),
        updates=tuple(
            function(f"f_update{index}", [_update(clock, roles["discrete"])])
            for index, clock in enumerate(model.clocks)
        ),
        periods=ca.Function(
            "f_periods", [p], [ca.densify(_column([c.period for c in model.clocks]))]
        ),
        output_dependencies=dependencies(y, [v.name for v in outputs]),
        derivative_dependencies=dependencies(xdot, [v.name for v in roles["state"]]),
    )


def _quick(y: Any, arguments: list[Any]) -> tuple[int, ...]:
    """Which outputs take few instructions, loads and stores included."""
    return tuple(
        index
        for index in range(y.numel())
        if ca.Function("f", arguments, [y[index]]).n_instructions() <= QUICK
    )


def build_input_rates(model: Model) -> ca.Function:
    """`(t, x, z, u, p) -> du/dt` by the `input_rate`s of the model; 0 for inputs without one."""
    inputs = model.of_role("input")
    roles = [model.of_role(role) for role in ("state", "discrete", "input", "parameter")]
    arguments = [_stack(role) for role in roles]
    rates = _column([ca.SX(model.input_rates.get(variable.name, 0.0)) for variable in inputs])
    return ca.Function("f_input_rates", [model.time, *arguments], [rates])


def _nonzeros(matrix: Any) -> Any:
    return ca.vertcat(*matrix.nonzeros()) if matrix.nnz() else ca.SX(0, 1)


class Oracle:
    """A variant as a numpy object: named values in, named values out; for tests and for trying out.

    Example:
        >>> oracle = Oracle(build_model("gearbox/ratio"))
        >>> oracle.outputs({"tau_a": 1.0, "w_b": 2.0})["tau_b"]
        9.1503
    """

    def __init__(self, model: Model) -> None:
        self.model = model
        self.functions = build_functions(model)
        self.state_names = [v.name for v in model.of_role("state")]
        self.output_names = [v.name for v in model.of_role("output")]
        self._roles = [model.of_role(role) for role in ("state", "discrete", "input", "parameter")]
        self._input_rates = build_input_rates(model)

    def arguments(self, values: Mapping[str, float] | None = None, t: float = 0.0) -> list[Any]:
        """Arguments `(t, x, z, u, p)`: start values, replaced by `values` where given."""
        values = values or {}
        names = {v.name for group in self._roles for v in group}
        unknown = set(values) - names
        if unknown:
            raise KeyError(f"no variable {', '.join(sorted(unknown))}; there is {', '.join(names)}")
        return [t] + [
            np.array([float(values.get(v.name, v.start)) for v in group]) for group in self._roles
        ]

    def outputs(
        self, values: Mapping[str, float] | None = None, t: float = 0.0
    ) -> dict[str, float]:
        """Outputs by name."""
        _, y = self.functions.outputs(*self.arguments(values, t))
        return dict(zip(self.output_names, np.asarray(y).ravel().tolist(), strict=True))

    def derivatives(
        self, values: Mapping[str, float] | None = None, t: float = 0.0
    ) -> dict[str, float]:
        """State derivatives by state name."""
        xdot = self.functions.derivatives(*self.arguments(values, t))
        return dict(zip(self.state_names, np.asarray(xdot).ravel().tolist(), strict=True))

    def energy_defect(
        self, values: Mapping[str, float] | None = None, t: float = 0.0
    ) -> tuple[float, float]:
        """dE/dt - (P_in - P_loss) and the largest of its terms [W], pointwise.

        Inputs count as held, except those with an `input_rate`.
        """
        args = self.arguments(values, t)
        xdot, y = self.functions.outputs(*args)
        zeros = [np.zeros_like(item) for item in args]
        zeros[3] = np.asarray(self._input_rates(*args)).ravel()
        _, dy = self.functions.directional(*args, 1.0, np.asarray(xdot).ravel(), *zeros[2:])
        index = {name: i for i, name in enumerate(self.output_names)}
        rate = float(dy[index["E_stored"]])
        inflow, loss = float(y[index["P_in"]]), float(y[index["P_loss"]])
        return rate - (inflow - loss), max(abs(rate), abs(inflow), abs(loss))

    def simulate(
        self,
        times: ArrayLike,
        values: Mapping[str, float] | None = None,
        inputs: Callable[[float], Mapping[str, float]] | None = None,
        *,
        rtol: float = 1e-11,
        atol: float = 1e-12,
        method: str = "Radau",
    ) -> dict[str, Vector]:
        """Reference solution by scipy: states and outputs at `times`.

        Args:
            times: increasing times [s].
            values: start values and parameters.
            inputs: smooth functions of time for some inputs; the others stay at `values`.

        Raises:
            ValueError: the model has clocks (scipy knows no ticks) or the solver failed.
        """
        if self.model.clocks:
            raise ValueError("the model has sample clocks; a reference by scipy needs none")
        grid = np.asarray(times, dtype=float)
        base = dict(values or {})

        def args_at(t: float, x: Vector) -> list[Any]:
            args = self.arguments({**base, **(inputs(t) if inputs else {})}, t)
            args[1] = x
            return args

        x0 = self.arguments(base)[1]
        if x0.size:
            result = solve_ivp(
                lambda t, x: np.asarray(self.functions.derivatives(*args_at(t, x))).ravel(),
                (grid[0], grid[-1]),
                x0,
                method=method,
                t_eval=grid,
                rtol=rtol,
                atol=atol,
            )
            if not result.success:
                raise ValueError(result.message)
            states = result.y
        else:
            states = np.zeros((0, grid.size))
        rows = [
            np.asarray(self.functions.outputs(*args_at(t, states[:, k]))[1]).ravel()
            for k, t in enumerate(grid)
        ]
        recorded = dict(zip(self.state_names, states, strict=True))
        recorded.update(zip(self.output_names, np.array(rows).T, strict=True))
        return recorded
