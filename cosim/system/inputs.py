"""What drives the open inputs of a system, element by element."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..data.signals import Constant, Signal, SignalVector, as_signal
from ..errors import ConnectError, GraphError, UnknownNameError, listing
from ..fmu.values import check_values
from ..fmu.variables import Variable
from .system import System

Driver = (
    Signal
    | SignalVector
    | float
    | str
    | bytes
    | Callable[[NDArray[np.float64]], ArrayLike]
    | Sequence[Any]
)
"""What drives an input; a sequence has one driver per element of a vector input."""


def overruled(system: System, name: str, driven: Collection[str]) -> str:
    """A note on a variable that has been set, and that is driven with all its elements; "" if not.

    Args:
        system: in which it is.
        name: of the variable.
        driven: full scalar names of what signals drive.
    """
    elements = [system.first_name(element) for element in system.elements(name)]
    if not all(system.driver(element) or element in driven for element in elements):
        return ""
    source = system.driver(elements[0]) or "an input of the run"
    return (
        f"{name} is set, but driven by {source}: what is set counts at most where the "
        "initialization begins"
    )


def spread(system: System, inputs: Mapping[str, Driver]) -> dict[str, Signal]:
    """Signals by full scalar name.

    Args:
        system: whose inputs are driven.
        inputs: open input or tunable parameter, whole or an element -> what drives it. One signal
            for a vector drives all of its elements.

    Raises:
        UnknownNameError: neither an input nor a tunable parameter.
        GraphError: it is driven already.
        ConnectError: another number of signals than elements.
        ValueRangeError: no item of an enumeration.
    """
    signals: dict[str, Signal] = {}
    for name, driver in inputs.items():
        member, variables = system.variables(name)
        for variable in variables:
            _check_causality(system, f"{member.name}.{variable.name}", variable)
        elements = system.elements(name)
        drivers: list[Any] = [driver] * len(elements)
        if isinstance(driver, SignalVector):
            drivers = list(driver.signals)
        elif isinstance(driver, (list, tuple)):
            drivers = list(driver)
        if len(drivers) != len(elements):
            raise ConnectError(
                f"input {name} has {len(elements)} elements, but {len(drivers)} signals are given"
            )
        for alias, single in zip(elements, drivers, strict=True):
            element = system.first_name(alias)
            if element in signals:
                raise GraphError(
                    f"input {element} is given twice"
                    + (f", as {alias}, too" if alias != element else "")
                    + "; drop one of the two"
                )
            source = system.driver(element)
            if source is not None:
                raise GraphError(
                    f"input {element} is already driven by {source}; drop the connection or the "
                    "signal"
                )
            signals[element] = _named(system.declaration(element), element, as_signal(single))
    return signals


def _check_causality(system: System, name: str, variable: Variable) -> None:
    tunable = variable.causality == "parameter" and variable.variability == "tunable"
    if variable.causality != "input" and not tunable:
        raise UnknownNameError(
            f"{name} is not an input but a variable of causality {variable.causality!r} and "
            f"variability {variable.variability!r} (signals drive inputs and tunable parameters); "
            f"{listing(system.open_inputs(), name)}"
        )


def _named(declared: Variable, name: str, signal: Signal) -> Signal:
    """A constant that names an item of an enumeration, as its number."""
    if declared.items and isinstance(signal, Constant):
        scalar = replace(declared, dimensions=())
        (number,) = check_values(f"input {name}", [scalar], signal.value)
        return Constant(number, signal.unit)
    return signal
