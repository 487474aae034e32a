"""What variables may be used for: given a value before a run, connected."""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import ConnectError, GraphError
from ..fmu.variables import Variable


def need_settable(where: str, instance: str, variables: Iterable[Variable]) -> None:
    """Refuse what cannot be given a value before a run.

    A local variable whose FMU states a start value counts as one that takes it, whether or not it
    says so by `initial`: many FMUs leave that out.

    Raises:
        GraphError: an element is calculated, constant or structural.
    """
    for variable in variables:
        name, causality = f"{instance}.{variable.name}", variable.causality
        if variable.variability == "constant":
            raise GraphError(f"{where}: {name} is constant and cannot be given a value")
        if causality == "structuralParameter":
            raise GraphError(
                f"{where}: {name} is a structural parameter; arrays have the sizes that its "
                f"start value {variable.start[:1]} gives, so it cannot be set"
            )
        calculated = causality in ("output", "independent", "calculatedParameter")
        if calculated and variable.initial not in ("exact", "approx"):
            raise GraphError(
                f"{where}: {name} is {_article(causality)} and cannot be given a value"
            )
        if causality == "local" and variable.initial == "calculated" and not variable.start:
            raise GraphError(
                f"{where}: {name} is a local variable that its FMU calculates (initial "
                "'calculated', no start value), so it cannot be given a value; set what it "
                "follows from"
            )


def need_end(what: str, owner: tuple[str, str], variables: Iterable[Variable], wanted: str) -> None:
    """Refuse variables that cannot be the end `wanted` (`output` or `input`) of a connection.

    A calculated parameter is an output, too, which changes with what it is calculated from.

    Args:
        what: is refused, for the error text.
        owner: name and reference of the instance.
        variables: of it.
        wanted: causality.

    Raises:
        ConnectError: an element is something else.
    """
    for variable in variables:
        calculated = wanted == "output" and variable.causality == "calculatedParameter"
        if variable.causality != wanted and not calculated:
            raise ConnectError(
                f"{what}: {owner[0]}.{variable.name} is {_article(variable.causality)} of "
                f"{owner[1]}, not an {wanted}; write the output first"
            )


def _article(causality: str) -> str:
    """A causality with its article."""
    return ("an " if causality[0] in "aeiou" else "a ") + causality
