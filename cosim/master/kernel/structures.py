"""What a run is made of, as `run.h` has it: arrays of numbers and addresses, for the library."""

from __future__ import annotations

import ctypes as ct

from ...fmu.intermediate import Group, Update

P, D = ct.c_void_p, ct.c_double
I64, I32, I8 = ct.c_int64, ct.c_int32, ct.c_int8


class Call(ct.Structure):
    """As in `run.h`."""

    _fields_ = (
        ("component", P), ("function", P), ("references", P), ("buffer", P), ("slots", P),
        ("n_references", I64), ("n_values", I64), ("type", I32), ("version", I32),
        ("warned", I64),
    )  # fmt: skip


class Member(ct.Structure):
    """As in `run.h`."""

    _fields_ = (
        ("component", P), ("step", P), ("work", P), ("reached", D), ("warned", I64),
        ("modes", I64), ("get_state", P), ("set_state", P), ("free_state", P), ("state", P),
        ("update", P),
    )  # fmt: skip


class Instruction(ct.Structure):
    """As in `run.h`."""

    _fields_ = (("operation", I64), ("first", I64), ("last", I64))


class Copy(ct.Structure):
    """As in `run.h`."""

    _fields_ = (("gain", D), ("offset", D), ("source", I64), ("target", I64))


class Term(ct.Structure):
    """As in `run.h`."""

    _fields_ = (
        ("sign", D), ("previous", D), ("held", D), ("output", I64),
        ("input", I64), ("bond", I64), ("mean", I64),
    )  # fmt: skip


class Loop(ct.Structure):
    """As in `run.h`."""

    _fields_ = (
        ("sources", P), ("inverse", P), ("valid", P), ("floor", P), ("work", P),
        ("tolerance", D), ("increment", D), ("n", I64), ("first", I64), ("last", I64),
    )  # fmt: skip


class Mean(ct.Structure):
    """As in `run.h`."""

    _fields_ = (
        ("gain", D), ("offset", D), ("source", I32), ("target", I32), ("alike", I32),
        ("order", I8), ("ahead", I8), ("moving", I8), ("bonded", I8),
    )  # fmt: skip


class Derivatives(ct.Structure):
    """As in `run.h`."""

    _fields_ = (
        ("component", P), ("function", P), ("references", P), ("orders", P), ("values", P),
        ("n", I64),
    )  # fmt: skip


class Run(ct.Structure):
    """As in `run.h`."""

    _fields_ = (
        ("members", P), ("calls", P), ("values", P), ("instructions", P),
        ("n_instructions", I64), ("n_members", I64), ("times", P), ("now", D),
        ("size", D), ("step", D), ("end", D), ("bounded", D),
        ("external", P), ("external_slot", P), ("n_external", I64), ("copies", P),
        ("records", P),
        ("n_record", I64), ("every", I64), ("row", I64), ("rows", P), ("terms", P),
        ("bond_energy", P), ("bond_turnover", P), ("n_terms", I64),
        ("final", I64), ("carried", I64),
        ("index", I64), ("next_record", I64), ("sparse", I64), ("last", I64),
        ("loops", P), ("means", P), ("history", P),
        ("past", P), ("n_means", I64),
        ("average", P), ("slope", P), ("curve", P), ("derivatives", P),
        ("at", P), ("failed_loop", I64), ("failed_call", I64), ("failed_member", I64),
        ("failed_derivatives", I64),
    )  # fmt: skip


RUN_SIZE = ct.sizeof(Run)
ALL = (Run, Member, Call, Instruction, Copy, Term, Loop, Mean, Derivatives, Update, Group)
