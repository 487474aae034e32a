"""CasADi functions of a variant: for C code, for plain Python, and as oracle in tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

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


class Functions:
    """The functions of a variant over `(t, x, z, u, p)`, each made when it is asked for.

    Shapes: x (nx), z (nz) sampled values, u (nu), p (np), y (ny).

    Args:
        model: a finished one; it does not change any more.
        often: Jacobian and directional derivatives are asked for often, so that it is worth finding
            what their parts compute alike, which takes most of the time to make them.
    """

    def __init__(self, model: Model, *, often: bool = True) -> None:
        self._often = often
        self._roles = {r: model.of_role(r) for r in ("state", "discrete", "input", "parameter")}
        self._clocks, self._outputs, self._t = model.clocks, model.of_role("output"), model.time
        self._x, self._z, self._u, self._p = (_stack(group) for group in self._roles.values())
        self._xdot = _column([model.derivatives[v.name] for v in self._roles["state"]])
        self._y = _column([variable.symbol for variable in self._outputs])
        self._arguments = [self._t, self._x, self._z, self._u, self._p]
        self._begins = model.solver.method in BEGINS_WITH_DERIVATIVES

    @cached_property
    def outputs(self) -> ca.Function:
        """`-> (xdot, y)`."""
        return self._function("f_outputs", [self._xdot, self._y])

    @cached_property
    def quick_outputs(self) -> tuple[int, ...]:
        """Indices of the outputs that take next to nothing to compute, states above all."""
        large = self.outputs.n_instructions() > LARGE
        return _quick(self._y, self._arguments) if large else ()

    @cached_property
    def quick(self) -> ca.Function:
        """`->` those outputs; without the derivatives, on which energies and forces hang."""
        few = list(self.quick_outputs)
        return self._function("f_quick", [self._y[few] if few else ca.SX(0, 1)])

    @cached_property
    def _coupled(self) -> tuple[ca.Function, tuple[int, ...]]:
        account = (E_STORED.name, P_IN.name, P_LOSS.name)
        some = tuple(
            k for k, v in enumerate(self._outputs)
            if v.name not in account or k in self.quick_outputs
        )  # fmt: skip
        reused = self._xdot if self._begins else ca.SX(0, 1)
        chosen = self._y[list(some)] if some else ca.SX(0, 1)
        return self._function("f_coupled", [reused, chosen]), some

    @property
    def coupled(self) -> ca.Function:
        """`-> (xdot, y)`: all outputs but the energy account, which couples nothing.

        xdot is empty where the solver does not begin a step with it.
        """
        return self._coupled[0]

    @cached_property
    def coupled_outputs(self) -> tuple[int, ...]:
        """Their indices; none if they are hardly cheaper than all."""
        whole = self.outputs.n_instructions()
        spared = whole - self.coupled.n_instructions()
        return () if whole < SMALL or spared < WORTHWHILE * whole else self._coupled[1]

    @cached_property
    def derivatives(self) -> ca.Function:
        """`-> xdot`."""
        return self._function("f_derivatives", [self._xdot])

    @cached_property
    def _jacobian(self) -> Any:
        return ca.jacobian(self._xdot, self._x)

    @cached_property
    def jacobian(self) -> ca.Function:
        """`-> (xdot, d xdot/dx as nonzeros, d xdot/dt)`."""
        by_time = ca.jacobian(self._xdot, self._t)
        parts = [self._xdot, _nonzeros(self._jacobian), by_time]
        return self._function("f_jacobian", parts, alike=self._often)

    @cached_property
    def jacobian_pattern(self) -> tuple[tuple[int, int], ...]:
        """(row, column) of the nonzeros."""
        rows, columns = self._jacobian.sparsity().get_triplet()
        return tuple(zip(rows, columns, strict=True))

    @cached_property
    def directional(self) -> ca.Function:
        """`(t, x, z, u, p, dt, dx, dz, du, dp) -> (dxdot, dy)`."""
        seeds = [ca.SX.sym(f"d_{k}", item.numel()) for k, item in enumerate(self._arguments)]
        along, all_of = ca.vertcat(*seeds), ca.vertcat(*self._arguments)
        tangent = ca.jtimes(ca.vertcat(self._xdot, self._y), all_of, along)
        split = self._xdot.numel()
        parts = [tangent[:split], tangent[split:]]
        return self._function("f_directional", parts, seeds, alike=self._often)

    @cached_property
    def updates(self) -> tuple[ca.Function, ...]:
        """Per clock `-> z` after the tick."""
        return tuple(
            self._function(f"f_update{index}", [_update(clock, self._roles["discrete"])])
            for index, clock in enumerate(self._clocks)
        )

    @cached_property
    def updated(self) -> tuple[tuple[int, ...], ...]:
        """Per clock the elements of z that its tick replaces."""
        names = [v.name for v in self._roles["discrete"]]
        return tuple(
            tuple(index for index, name in enumerate(names) if name in clock.updates)
            for clock in self._clocks
        )

    @cached_property
    def periods(self) -> ca.Function:
        """`p -> periods of the clocks`."""
        periods = _column([clock.period for clock in self._clocks])
        return ca.Function("f_periods", [self._p], [ca.densify(periods)])

    @cached_property
    def output_dependencies(self) -> dict[str, tuple[str, ...]]:
        """Output -> names of the states, inputs and sampled values that it depends on."""
        return self._dependencies(self._y, [v.name for v in self._outputs])

    @cached_property
    def derivative_dependencies(self) -> dict[str, tuple[str, ...]]:
        """State -> the same of its derivative."""
        return self._dependencies(self._xdot, [v.name for v in self._roles["state"]])

    def _dependencies(self, expression: Any, names: list[str]) -> dict[str, tuple[str, ...]]:
        known = ca.vertcat(self._x, self._u, self._z, self._t)
        groups = [self._roles[role] for role in ("state", "input", "discrete")]
        known_names = [*(v.name for group in groups for v in group), "time"]
        sparsity = ca.jacobian_sparsity(expression, known) if names else None
        found: dict[str, list[str]] = {name: [] for name in names}
        if sparsity is not None:
            for row, column in zip(*sparsity.get_triplet(), strict=True):
                found[names[row]].append(known_names[column])
        return {name: tuple(items) for name, items in found.items()}

    def _function(
        self, name: str, results: list[Any], extra: list[Any] | None = None, *, alike: bool = True
    ) -> ca.Function:
        # structural zeros are written too: the C code and the Python twin index densely
        dense = [ca.densify(r) for r in results]
        # what parts compute alike is computed once, with the same numbers
        return ca.Function(name, self._arguments + (extra or []), ca.cse(dense) if alike else dense)


def _stack(variables: list[Declared]) -> Any:
    return ca.vertcat(*[variable.symbol for variable in variables]) if variables else ca.SX(0, 1)


def _column(expressions: list[Any]) -> Any:
    return ca.vertcat(*expressions) if expressions else ca.SX(0, 1)


def _update(clock: Clock, discrete: list[Declared]) -> Any:
    return _column([clock.updates.get(v.name, v.symbol) for v in discrete])


def build_functions(model: Model) -> Functions:
    """Build all functions of a finished model at once, for threads that share them.

    Raises:
        ValueError: an expression uses a symbol that nobody declared.
    """
    functions = Functions(model)
    for name, member in vars(Functions).items():
        if isinstance(member, cached_property):
            getattr(functions, name)
    return functions


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
        self.functions = Functions(model, often=False)
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
        from scipy.integrate import solve_ivp  # takes long, and commands that build FMUs need none

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
