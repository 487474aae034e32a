"""Checks of what algorithms are asked for."""

from __future__ import annotations

from ..errors import InputError, ValueRangeError
from ..system.system import System


def positive(name: str, value: float) -> float:
    """The value of an option that must be a positive number."""
    if not isinstance(value, (int, float)) or not 0.0 < value < float("inf"):
        raise ValueRangeError(f"option {name} = {value!r} must be a positive number")
    return float(value)


def refuse_without_states(system: System, algorithm: str, variable: bool = False) -> None:
    """Algorithms that repeat steps need FMUs that can return to a saved state.

    Raises:
        InputError: which FMUs cannot.
    """
    unable = [
        f"{member.name} ({member.reference})"
        for member in system.members.values()
        if not member.description.can("canGetAndSetFMUState")
    ]
    if unable:
        raise InputError(
            f"algorithm {algorithm!r} repeats steps, but these FMUs declare that they cannot "
            f"return to a saved state: {', '.join(unable)}; take jacobi or gauss_seidel, with "
            "extrapolation = 1 for second order"
        )
    fixed = [
        f"{member.name} ({member.reference})"
        for member in system.members.values()
        if not member.description.can("canHandleVariableCommunicationStepSize")
    ]
    if variable and fixed:
        raise InputError(
            f"algorithm {algorithm!r} changes the step, but these FMUs declare that they cannot "
            f"follow: {', '.join(fixed)}; take iterated, jacobi or gauss_seidel"
        )
