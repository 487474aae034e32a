"""What several algorithms share: extrapolated inputs, sub-steps, checks of their options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..arguments import need_table
from ..errors import InputError, UnknownNameError, ValueRangeError, listing
from ..system.system import System
from .plan import PARTS, Layout, Mean, Op

Rows = list[tuple[int, ...]]


def smooth(system: System, layout: Layout) -> NDArray[np.bool_]:
    """Per copy, whether both ends are continuous in time."""

    def continuous(full: str) -> bool:
        found = system.declaration(full)
        return found.type in ("Float64", "Float32") and found.variability == "continuous"

    ends = zip(layout.copy_source.tolist(), layout.copy_target.tolist(), strict=True)
    return np.array(
        [continuous(layout.names[a]) and continuous(layout.names[b]) for a, b in ends],
        dtype=np.bool_,
    )


def means(
    system: System, layout: Layout, order: int, stepped: Sequence[str] | None = None
) -> tuple[list[Mean], dict[int, tuple[int, int]]]:
    """The extrapolated inputs, and per instance which of them are its own.

    Args:
        system, layout: what is run.
        order: of the polynomial.
        stepped: instances in the order in which they step, None if they step side by side.
    """
    if order not in (0, 1, 2) or isinstance(order, bool):
        raise ValueRangeError(f"extrapolation of order {order!r}: must be 0, 1 or 2")
    position = {name: index for index, name in enumerate(layout.instances)}
    rank = {name: index for index, name in enumerate(stepped or ())}
    continuous = smooth(system, layout)
    moving = {name: interpolates(system, name) for name in layout.instances}
    bonded = set(layout.bond_input.tolist())
    found: list[Mean] = []
    spans: dict[int, tuple[int, int]] = {}
    for name in layout.instances:
        first, last = (int(item) for item in layout.copies[position[name]])
        begin = len(found)
        for index in range(first, last):
            source = int(layout.copy_source[index])
            giver, _, variable = layout.names[source].partition(".")
            description = system.members[giver].description
            passed = description.dependencies.get(
                variable, description.dependencies.get(variable.rpartition("[")[0], ())
            )
            # an output with direct feedthrough is that of the inputs at the end if these move there
            ahead = bool(rank) and rank[giver] < rank[name] and (moving[giver] or not passed)
            if order and continuous[index]:
                found.append(
                    Mean(
                        source,
                        int(layout.copy_target[index]),
                        float(layout.copy_gain[index]),
                        float(layout.copy_offset[index]),
                        order,
                        ahead,
                        position[name],
                        moving[name],
                        int(layout.copy_target[index]) in bonded,
                    )
                )
        spans[position[name]] = (begin, len(found))
    return found, spans


def interpolates(system: System, instance: str) -> bool:
    """Whether an instance's inputs can move within a step (FMI 2's canInterpolateInputs)."""
    description = system.members[instance].description
    return description.fmi == 2 and description.can("canInterpolateInputs")


def set_derivatives(
    found: Sequence[Mean], spans: Mapping[int, tuple[int, int]], index: int
) -> Rows:
    """The operation that tells an instance how its inputs move, if it can use it."""
    first, last = spans[index]
    return [(Op.SET_DERIVATIVES, first, last)] if first < last and found[first].moving else []


def factors(system: System, substeps: Mapping[str, int] | None) -> dict[str, int]:
    """Steps per communication step of each instance.

    Raises:
        UnknownNameError, ValueRangeError: what was asked for makes no sense.
    """
    found = dict.fromkeys(system.members, 1)
    need_table("substeps", substeps or {}, "substeps = { motor = 4 }")
    for name, factor in (substeps or {}).items():
        if name not in found:
            raise UnknownNameError(
                f"substeps: there is no instance {name!r}; {listing(found, name)}"
            )
        if not isinstance(factor, int) or isinstance(factor, bool) or not 1 <= factor < 1000:
            raise ValueRangeError(f"substeps of {name}: {factor!r} is not a number from 1 to 999")
        found[name] = factor
    return found


def side_by_side(
    layout: Layout,
    parts: Mapping[str, int],
    found: Sequence[Mean],
    spans: Mapping[int, tuple[int, int]],
) -> Rows:
    """One communication step in which instances step with inputs from where the others stand.

    Instances with sub-steps exchange at each of theirs; what comes from slower ones is held.
    """
    position = {name: index for index, name in enumerate(layout.instances)}
    rows: Rows = []
    ends: dict[int, Fraction] = {}
    instants = sorted({Fraction(j, n) for n in set(parts.values()) for j in range(n)})
    for instant in [*instants, Fraction(1)]:
        done = [index for index, end in ends.items() if end == instant]
        starting = [position[name] for name, n in parts.items()
                    if instant < 1 and (instant * n).denominator == 1]  # fmt: skip
        rows += [(Op.GET, index) for index in sorted(done)]
        for index in starting:
            first, last = (int(item) for item in layout.copies[index])
            rows.append((Op.COPY, first, last))
            if spans[index][0] < spans[index][1] and parts[layout.instances[index]] == 1:
                rows.append((Op.EXTRAPOLATE, *spans[index]))
        rows += [(Op.SET, index) for index in starting]
        for index in starting:
            if parts[layout.instances[index]] == 1:
                rows += set_derivatives(found, spans, index)
        for index in starting:
            n = parts[layout.instances[index]]
            rows.append(whole_or_part(index, n, int(instant * n)))
            ends[index] = instant + Fraction(1, n)
    return rows


def whole_or_part(index: int, parts: int, part: int) -> tuple[int, ...]:
    """The operation by which an instance steps."""
    return (Op.STEP, index) if parts == 1 else (Op.SUBSTEP, index, parts * PARTS + part)


def without_parts(layout: Layout, parts: Mapping[str, int]) -> Layout:
    """The layout without power bonds of instances with sub-steps.

    Their inputs change within a communication step, so what they take cannot be told from the
    values at its ends.
    """

    def whole(index: int) -> bool:
        bond = layout.bonds[index]
        return all(parts[end.partition(".")[0]] == 1 for end in (bond.first, bond.second))

    kept = [index for index in range(len(layout.bonds)) if whole(index)]
    terms = np.isin(layout.bond_index, kept)
    number = {old: new for new, old in enumerate(kept)}
    return replace(
        layout,
        bonds=tuple(layout.bonds[index] for index in kept),
        bond_index=np.array(
            [number[index] for index in layout.bond_index[terms].tolist()], dtype=np.int64
        ),
        bond_output=layout.bond_output[terms],
        bond_input=layout.bond_input[terms],
        bond_sign=layout.bond_sign[terms],
    )


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
