"""The variables of an FMU in the order of their value references."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..model import Model
from ..quantity import Quantity

METHODS = {
    "rk4": (1, "explicit Runge-Kutta, order 4, fixed step"),
    "rodas3": (2, "linearly implicit with exact Jacobian, order 3, L-stable, fixed step"),
    "dopri5": (3, "explicit Dormand-Prince 5(4), error-controlled"),
    "rodas3_adaptive": (4, "linearly implicit, order 3(2), error-controlled"),
    "rosw3_adaptive": (
        5,
        "linearly implicit with a Jacobian that is kept, order 3(2), error-controlled",
    ),
}
"""Internal solvers: value of `solver.method` and meaning."""

Part = Literal["time", "state", "derivative", "input", "output", "parameter", "discrete", "solver"]


@dataclass(frozen=True)
class Entry:
    """One scalar variable; its index in the layout is its value reference.

    Attributes:
        name: as in the model description.
        part: which section of the layout.
        quantity: declaration (unit, bounds, text).
        start: start value.
        strength: name of the strength of the effect that it belongs to, "" if to none.
        stiff: whether it is the strength of an effect whose state may be stiff (`Effect.stiff`).
    """

    name: str
    part: Part
    quantity: Quantity
    start: float = 0.0
    strength: str = ""
    stiff: bool = False


def _derivative_unit(unit: str) -> str:
    numerator, _, denominator = unit.partition("/")
    inside = denominator.strip("()")
    return f"{numerator}/({inside}.s)" if inside else f"{numerator}/s"


def solver_entries(model: Model) -> list[Entry]:
    """The parameters of the internal solver; they exist in the layout of every FMU."""
    solver = model.solver
    method = Quantity(
        "method",
        "1",
        "solver inside the FMU",
        start=METHODS[solver.method][0],
        minimum=1,
        maximum=len(METHODS),
    )
    step = Quantity(
        "step", "s", "largest internal step", start=solver.step, minimum=1e-9, maximum=1e3
    )
    tolerance = Quantity(
        "tolerance",
        "1",
        "relative local error of an error-controlled solver",
        start=solver.tolerance,
        minimum=1e-14,
        maximum=1.0,
    )
    return [
        Entry(f"solver.{item.name}", "solver", item, item.starts()[0])
        for item in (method, step, tolerance)
    ]


def owners(entries: list[Entry]) -> list[int]:
    """Per state the value reference of the strength of its effect, 0 if it has none."""
    reference = {entry.name: index for index, entry in enumerate(entries)}
    return [
        reference[entry.strength] if entry.strength else 0
        for entry in entries
        if entry.part == "state"
    ]


def stiff(entries: list[Entry]) -> list[int]:
    """Value references of the strengths of effects whose states are stiff, but for `lags`."""
    return [k for k, entry in enumerate(entries) if entry.stiff and entry.quantity.unit != "s"]


def lags(entries: list[Entry]) -> list[int]:
    """Value references of strengths that are the time constant of their effect's state."""
    return [k for k, entry in enumerate(entries) if entry.stiff and entry.quantity.unit == "s"]


def layout(model: Model) -> list[Entry]:
    """All variables: time, states, derivatives, inputs, outputs, parameters, sampled, solver."""
    time = Quantity("time", "s", "simulation time")
    entries = [Entry("time", "time", time)]
    states = model.of_role("state")
    entries += [Entry(v.name, "state", v.quantity, v.start, v.of_effect) for v in states]
    entries += [
        Entry(
            f"der({v.name})",
            "derivative",
            Quantity(
                v.quantity.name,
                _derivative_unit(v.quantity.unit),
                f"time derivative of: {v.quantity.text}",
            ),
        )
        for v in states
    ]
    entries += [Entry(v.name, "input", v.quantity, v.start) for v in model.of_role("input")]
    entries += [Entry(v.name, "output", v.quantity) for v in model.of_role("output")]
    entries += [
        Entry(v.name, "parameter", v.quantity, v.start, stiff=v.name in model.stiff)
        for v in model.of_role("parameter")
    ]
    entries += [Entry(v.name, "discrete", v.quantity, v.start) for v in model.of_role("discrete")]
    return entries + solver_entries(model)
