"""Extrapolated inputs, which follow the polynomial through the last values of their source, and
sub-steps.

`mean_of_step` and `derivatives_at_begin` have the polynomial; kernel/kernel.c has the same numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..arguments import need_table, need_whole
from ..errors import UnknownNameError, ValueRangeError, listing
from ..fmu.description import Description
from ..fmu.variables import Variable
from ..system.system import System
from .plan import PARTS, Layout, Mean, Op

Rows = list[tuple[int, ...]]


def smooth(system: System, layout: Layout) -> NDArray[np.bool_]:
    """Per copy, whether both ends are continuous in time."""
    ends = zip(layout.copy_source.tolist(), layout.copy_target.tolist(), strict=True)
    return np.array(
        [all(continuous(system.declaration(layout.names[end])) for end in pair) for pair in ends],
        dtype=np.bool_,
    )


def continuous(variable: Variable) -> bool:
    """Whether a variable is a number that is continuous in time."""
    return variable.type in ("Float64", "Float32") and variable.variability == "continuous"


def means(
    system: System,
    layout: Layout,
    order: int,
    stepped: Sequence[str] | None = None,
    inner: Mapping[str, int] | None = None,
) -> tuple[list[Mean], dict[int, tuple[int, int]]]:
    """The extrapolated inputs, and per instance which of them are its own.

    Args:
        system, layout: what is run.
        order: of the polynomial.
        stepped: instances in the order in which they step, None if they step side by side.
        inner: instances whose inputs do not move and that go several inner steps instead.
    """
    need_whole("the order of extrapolation", order)
    if order not in (0, 1, 2):
        raise ValueRangeError(f"extrapolation of order {order!r}: must be 0, 1 or 2")
    position = {name: index for index, name in enumerate(layout.instances)}
    parts = inner or {}
    rank = {name: index for index, name in enumerate(stepped or ())}
    followed = smooth(system, layout)
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
            ahead = bool(rank) and rank[giver] < rank[name] and all_move(description, passed)
            taker, target = system.members[name].description, int(layout.copy_target[index])
            if order and followed[index]:
                found.append(
                    Mean(
                        source,
                        target,
                        float(layout.copy_gain[index]),
                        float(layout.copy_offset[index]),
                        order,
                        ahead,
                        position[name],
                        taker.moves(taker.whole(layout.names[target][len(name) + 1 :]))
                        or parts.get(name, 1) > 1,
                        taker.fmi == 2 and parts.get(name, 1) == 1,
                        target in bonded,
                        parts.get(name, 1),
                    )
                )
        spans[position[name]] = (begin, len(found))
    return found, spans


def all_move(description: Description, inputs: Sequence[str]) -> bool:
    """Whether an FMU's inputs can move within a step; of FMI 3 those that are continuous."""
    variables = [description.whole(name) for name in inputs]
    return all(description.moves(v) for v in variables if description.fmi == 2 or continuous(v))


def set_derivatives(
    found: Sequence[Mean], spans: Mapping[int, tuple[int, int]], index: int
) -> Rows:
    """The operation that tells an instance of FMI 2 how its inputs move, if it can use it."""
    first, last = spans[index]
    able = first < last and found[first].moving and found[first].told
    return [(Op.SET_DERIVATIVES, first, last)] if able else []


def factors(
    system: System, given: Mapping[str, int] | None, option: str = "substeps"
) -> dict[str, int]:
    """Steps per communication step of each instance.

    Raises:
        UnknownNameError, ValueRangeError: what was asked for makes no sense.
    """
    found = dict.fromkeys(system.members, 1)
    need_table(option, given or {}, f"{option} = {{ motor = 4 }}")
    for name, factor in (given or {}).items():
        if name not in found:
            raise UnknownNameError(
                f"{option}: there is no instance {name!r}; {listing(found, name)}"
            )
        if not isinstance(factor, int) or isinstance(factor, bool) or not 1 <= factor < 1000:
            raise ValueRangeError(f"{option} of {name}: {factor!r} is not a number from 1 to 999")
        found[name] = factor
    return found


def inner_factors(
    system: System,
    inner_steps: Mapping[str, int] | None,
    order: int,
    substeps: Mapping[str, int] | None = None,
) -> dict[str, int]:
    """Inner steps of each instance, between which it exchanges nothing.

    Raises:
        UnknownNameError, ValueRangeError: what was asked for makes no sense.
    """
    found = factors(system, inner_steps, "inner_steps")
    if max(found.values(), default=1) > 1 and order == 0:
        raise ValueRangeError(
            "inner_steps without extrapolation would move no input; add extrapolation = 1 or 2"
        )
    for name, parts in found.items():
        if parts > 1 and (substeps or {}).get(name, 1) > 1:
            raise ValueRangeError(f"{name} has substeps and inner_steps; take one of them")
        description = system.members[name].description
        moving = [v.name for v in description.of("input") if continuous(v) and description.moves(v)]
        if parts > 1 and moving:
            raise ValueRangeError(
                f"inner_steps of {name}: its FMU lets inputs move within a step "
                f"({', '.join(moving[:3])}); leave it out"
            )
    return found


def inner_rows(
    found: Sequence[Mean], spans: Mapping[int, tuple[int, int]], index: int, parts: int
) -> Rows:
    """An instance's step in inner steps, each with the mean of its inputs over it."""
    rows: Rows = []
    for part in range(parts):
        rows += [(Op.MOVE, place, parts * PARTS + part) for place in range(*spans[index])]
        rows += [(Op.SET, index), whole_or_part(index, parts, part)]
    return rows


def side_by_side(
    layout: Layout,
    parts: Mapping[str, int],
    found: Sequence[Mean],
    spans: Mapping[int, tuple[int, int]],
    inner: Mapping[str, int],
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
            if (m := inner[layout.instances[index]]) > 1:
                rows += inner_rows(found, spans, index, m)
            else:
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


# -- the polynomial --------------------------------------------------------------------------------


def mean_of_step(order: int, ahead: bool, now: float, past: Sequence[float]) -> float:
    """Mean over the step of the polynomial through the last values of a source.

    Args:
        order: 0, 1 or 2; `ahead` asks for 1 or 2.
        ahead: the source has stepped already: `now` is its value at the end of the step.
        now: newest value.
        past: values at the begins of this step and the ones before, newest first.
    """
    if ahead:
        if order == 1:
            return 0.5 * (now + past[0])
        return 0.5 * (now + past[0]) - bend(now, *past[:3]) / 12.0
    if order == 0:
        return past[0]
    if order == 1:
        return 1.5 * past[0] - 0.5 * past[1]
    return past[0] + 0.5 * (past[0] - past[1]) + 5.0 * bend(*past[:4]) / 12.0


def derivatives_at_begin(
    order: int, ahead: bool, now: float, past: Sequence[float], step: float
) -> tuple[float, float]:
    """First and second derivative of the same polynomial at the begin of the step."""
    inverse = 1.0 / step
    if order == 0:
        return 0.0, 0.0
    if order == 1:
        return (now - past[0] if ahead else past[0] - past[1]) * inverse, 0.0
    half, square = 0.5 * inverse, inverse * inverse
    if ahead:
        second = bend(now, *past[:3])
        return (2.0 * (now - past[0]) - second) * half, second * square
    second = bend(*past[:4])
    return (2.0 * (past[0] - past[1]) + second) * half, second * square


def mean_of_part(
    begin: float, slope: float, curve: float, step: float, parts: int, part: int
) -> float:
    """Mean over one of equal parts of a step of the parabola with these values at its begin."""
    width = step / parts
    middle = (part + 0.5) * width
    return begin + middle * slope + (0.5 * middle * middle + width * width / 24.0) * curve


def bend(a: float, b: float, c: float, d: float) -> float:
    """Second difference of the parabola through the last values, newest first.

    Of the last two second differences the one nearer to zero, and zero if their signs differ. Where
    a value moves smoothly they are alike; where it rings or has a kink, a parabola would feed that,
    and the straight line takes its place.
    """
    last, before = a - 2.0 * b + c, b - 2.0 * c + d
    nearer = last if abs(last) < abs(before) else before
    return nearer if last * before > 0.0 else 0.0
