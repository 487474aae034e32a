"""Operations of a plan as instructions of the compiled executor, and what they may leave out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...fmu.instance import Instance
from ..plan import Mean, Op, Plan
from . import structures


class Code(IntEnum):
    """Operations of the compiled executor."""

    EXTERNAL = 0
    RECORD = 1
    COPY = 2
    SCALE = 3
    CALL2 = 4
    CALL3 = 5
    CONVERT_SET = 6
    CONVERT_GET = 7
    STEP2 = 8
    STEP3 = 9
    ENERGY = 10
    SOLVE = 11
    NOTE = 12
    EXTRAPOLATE = 13
    SUBSTEP = 14
    HOLD = 15
    SET_DERIVATIVES = 16
    WATCHED2 = 17
    WATCHED3 = 18
    MOVE = 19
    UNSEEN = 20


_STEPS = {2: Code.STEP2, 3: Code.STEP3}
_WATCHED = {2: Code.WATCHED2, 3: Code.WATCHED3}
"""By FMI version."""


class Fetched(NamedTuple):
    """Numbers of calls, first and behind the last: of every step, and of what is only recorded."""

    always: tuple[int, int]
    only_recorded: tuple[int, int] = (0, 0)


def instructions(
    plan: Plan,
    rows: NDArray[np.int64],
    spans: dict[tuple[Op, int], tuple[int, int]],
    calls: Sequence[structures.Call],
    instances: Sequence[Instance],
    told: Mapping[tuple[int, int], tuple[int, int]],
    fewer: Mapping[int, Fetched] | None = None,
) -> list[tuple[int, int, int]]:
    """The operations of these rows, in order; neighbours of one kind become one.

    Args:
        plan: whose rows they are.
        rows: what is done.
        spans: per set or get operation and instance the first of its calls and behind the last.
        calls: all calls.
        instances: the FMUs.
        told: the same of the calls that give derivatives of inputs.
        fewer: per row other calls than those of `spans`.
    """
    found: list[tuple[int, int, int]] = []
    alone = 0  # up to here operations are not joined: an UNSEEN counts them

    def add(code: Code, first: int, last: int) -> None:
        if len(found) > alone and found[-1][0] == code and found[-1][2] == first:
            found[-1] = (code, found[-1][1], last)
        else:
            found.append((code, first, last))

    def called(op: Op, span: tuple[int, int]) -> None:
        for index in range(*span):
            code = Code.CALL2 if calls[index].version == 2 else Code.CALL3
            if calls[index].slots:
                code = Code.CONVERT_SET if op is Op.SET else Code.CONVERT_GET
            add(code, index, index + 1)

    layout = plan.layout

    def extrapolated(number: int) -> set[int]:
        """Slots that the operation behind this one sets anyway."""
        behind = rows[number + 1].tolist() if number + 1 < len(rows) else [Op.COPY, 0, 0]
        if behind[0] != Op.EXTRAPOLATE:
            return set()
        return {mean.target for mean in plan.means[behind[1] : behind[2]]}

    plain = (layout.copy_gain == 1.0) & (layout.copy_offset == 0.0)
    for number, row in enumerate(rows.tolist()):
        op, a, b = Op(row[0]), row[1], row[2]
        if op is Op.COPY:
            overwritten = extrapolated(number)
            for index in range(a, b):
                if int(layout.copy_target[index]) in overwritten:
                    continue
                add(Code.COPY if plain[index] else Code.SCALE, index, index + 1)
        elif op is Op.STEP:
            codes = _WATCHED if instances[a].watched else _STEPS
            add(codes[instances[a].binding.version], a, a + 1)
        elif op is Op.SET_DERIVATIVES:
            add(Code.SET_DERIVATIVES, *told[a, b])
        elif op is Op.SUBSTEP:
            kind = 2 * instances[a].watched + (instances[a].binding.version == 3)
            found.append((Code.SUBSTEP, a, 4 * b + kind))
        elif op in (Op.SET, Op.GET):
            always, only_recorded = (fewer or {}).get(number, Fetched(spans[op, a]))
            called(op, always)
            if range(*only_recorded):
                later = int(Op.RECORD not in rows[number:, 0])  # by the next step
                found.append((Code.UNSEEN, 0, later))
                alone = len(found)
                called(op, only_recorded)
                found[alone - 1] = (Code.UNSEEN, len(found) - alone, later)
                alone = len(found)
        else:
            found.append((Code[op.name], a, b))
    return found


def carried(plan: Plan) -> bool:
    """Whether the outputs that a step ends with are those that the next one notes for its bonds.

    So it is if energy is added after the last get call, and noted before the first one.
    """
    codes = plan.step[:, 0].tolist()
    gets = [index for index, code in enumerate(codes) if code in (Op.GET, Op.SOLVE)]
    notes = [index for index, code in enumerate(codes) if code == Op.RECORD]
    sums = [index for index, code in enumerate(codes) if code == Op.ENERGY]
    return (
        len(notes) == len(sums) == 1
        and notes[0] < min(gets, default=len(codes))
        and sums[0] > max(gets, default=-1)
    )


def needed(plan: Plan) -> dict[int, list[int]]:
    """Which slots the get operations of a communication step must fill.

    Per row of `plan.step` that fetches outputs which the same step fetches again, those that are
    read in between. What only the later one is asked for need not be computed twice.
    """
    layout = plan.layout
    live = set(range(int(layout.outputs[-1, 1])))  # after a step anybody may look at anything
    sources, recorded = layout.copy_source.tolist(), layout.record_source.tolist()
    bonded, means = layout.bond_output.tolist(), [mean.source for mean in plan.means]
    read: dict[Op, Callable[[int, int], list[int]]] = {
        Op.COPY: lambda a, b: sources[a:b],
        Op.EXTRAPOLATE: lambda a, b: means[a:b],
        Op.NOTE: lambda a, b: means,
        Op.RECORD: lambda a, b: recorded + bonded,
        Op.ENERGY: lambda a, b: bonded,
    }
    silent = (Op.EXTERNAL, Op.SET, Op.STEP, Op.SUBSTEP, Op.HOLD, Op.SET_DERIVATIVES)
    found: dict[int, list[int]] = {}
    for number in reversed(range(len(plan.step))):
        op, a, b = Op(plan.step[number, 0]), int(plan.step[number, 1]), int(plan.step[number, 2])
        if op is Op.GET:
            own = range(*layout.outputs[a].tolist())
            if not live.issuperset(own):
                found[number] = [slot for slot in own if slot in live]
            live.difference_update(own)
        elif op in read:
            live.update(read[op](a, b))
        elif op not in silent:  # a loop reads and fetches what it likes
            live.update(range(int(layout.outputs[-1, 1])))
    return found


def only_recorded(plan: Plan) -> set[int]:
    """Slots of outputs that a recording shows, and that nothing else asks for."""
    layout = plan.layout
    outputs = set(range(int(layout.outputs[-1, 1])))
    if plan.loops:  # a loop reads what it likes
        return set()
    asked = {*layout.copy_source.tolist(), *layout.bond_output.tolist()}
    return outputs - asked - {mean.source for mean in plan.means}


def stretches(slots: Sequence[int]) -> list[tuple[int, int]]:
    """First and behind the last of each stretch of numbers that follow each other."""
    found: list[tuple[int, int]] = []
    for slot in slots:
        if found and found[-1][1] == slot:
            found[-1] = (found[-1][0], slot + 1)
        else:
            found.append((slot, slot + 1))
    return found


def alike(means: Sequence[Mean]) -> list[int]:
    """Per mean how many from it on are done in one way, and belong to one instance."""

    def kind(mean: Mean) -> tuple[int, int, bool, bool, bool]:
        return mean.instance, mean.order, mean.ahead, mean.moving, mean.bonded

    found = [1] * len(means)
    for index in reversed(range(len(means) - 1)):
        if kind(means[index]) == kind(means[index + 1]):
            found[index] = found[index + 1] + 1
    return found
