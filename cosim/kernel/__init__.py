"""The compiled executor of plans: finds its library and binds a run to it.

The library is part of an installed wheel; in a checkout it is compiled into the cache when FMUs are
built. Without one, runs use the executor in Python, which gives the same numbers, bit for bit.
"""

from __future__ import annotations

import ctypes as ct
import hashlib
import os
import platform
import sys
import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..instance import Instance
from ..plan import Plan

SOURCE = Path(__file__).with_name("kernel.c")
_P, _I64, _I32, _D = ct.c_void_p, ct.c_int64, ct.c_int32, ct.c_double
_TYPES = (
    "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Boolean",
)  # fmt: skip
_TYPE_CODES = {**{name: code for code, name in enumerate(_TYPES)}, "Boolean2": 6}


class _Call(ct.Structure):
    _fields_ = (
        ("get", _P), ("set", _P), ("references", _P), ("buffer", _P), ("slots", _P),
        ("n_references", _I64), ("n_values", _I64), ("type", _I32), ("version", _I32),
    )  # fmt: skip


class _Member(ct.Structure):
    _fields_ = (
        ("component", _P), ("step", _P), ("first_output", _I64), ("last_output", _I64),
        ("first_input", _I64), ("last_input", _I64), ("version", _I32), ("stopped", _I32),
    )  # fmt: skip


class _Run(ct.Structure):
    _fields_ = (
        ("members", _P), ("calls", _P), ("values", _P), ("operations", _P), ("n_operations", _I64),
        ("times", _P), ("step", _D), ("external", _P), ("external_slot", _P), ("n_external", _I64),
        ("copy_source", _P), ("copy_target", _P), ("copy_gain", _P), ("copy_offset", _P),
        ("record_source", _P), ("record_gain", _P), ("record_offset", _P), ("n_record", _I64),
        ("every", _I64), ("row", _I64), ("rows", _P), ("bond_index", _P), ("bond_output", _P),
        ("bond_input", _P), ("bond_sign", _P), ("bond_previous", _P), ("bond_energy", _P),
        ("n_bond_terms", _I64), ("index", _I64), ("failed_operation", _I64), ("failed_call", _I64),
        ("failed_status", _I64),
    )  # fmt: skip


def library_name() -> str:
    """File name of the library for this source and this machine."""
    digest = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine().lower()
    )
    suffix = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
    return f"kernel-{digest}-{machine}-{platform.system().lower()}{suffix}"


def cache_folder() -> Path:
    """Where a checkout keeps the library that it compiled."""
    root = os.environ.get("COSIM_CACHE")
    if root:
        return Path(root) / "kernel"
    try:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "cosim"
    except RuntimeError:  # no home directory
        base = Path(tempfile.gettempdir()) / "cosim-cache"
    return base / "kernel"


@lru_cache(maxsize=1)
def _load(path: str) -> Any:
    library = ct.CDLL(path)
    library.cosim_run.argtypes, library.cosim_run.restype = [_P, _I64], ct.c_int
    library.cosim_size.argtypes, library.cosim_size.restype = [ct.c_int], _I64
    sizes = [library.cosim_size(what) for what in range(3)]
    expected = [ct.sizeof(kind) for kind in (_Run, _Member, _Call)]
    if sizes != expected:
        raise OSError(f"{path}: its structures have sizes {sizes}, expected {expected}")
    return library


def find() -> Path | None:
    """The library, None if this machine has none."""
    for folder in (SOURCE.parent / "lib", cache_folder()):
        path = folder / library_name()
        if path.is_file():
            return path
    return None


class Kernel:
    """A run bound to the compiled executor.

    Args:
        plan: what to do in a communication step.
        instances, outputs, inputs: the FMUs and the blocks through which they exchange values.
        values: the run's array of values, which the blocks view.
        times, external: communication points and the external inputs there.
        rows: where observed values go.
        bond_energy: where the bonds' energy goes.
    """

    def __init__(
        self,
        plan: Plan,
        instances: Sequence[Instance],
        outputs: Sequence[Block],
        inputs: Sequence[Block],
        values: NDArray[np.float64],
        times: NDArray[np.float64],
        step: float,
        external: NDArray[np.float64],
        rows: NDArray[np.float64],
        bond_energy: NDArray[np.float64],
        every: int,
    ) -> None:
        path = find()
        if path is None:
            raise FileNotFoundError(library_name())
        self._library = _load(str(path))
        layout = plan.layout
        calls: list[_Call] = []
        self._parts: list[tuple[Instance, Any]] = []
        self._keep: list[Any] = [instances, outputs, inputs]
        members = []
        for index, instance in enumerate(instances):
            spans = []
            for block, span in ((outputs[index], layout.outputs), (inputs[index], layout.inputs)):
                first = len(calls)
                for part in block.parts:
                    calls.append(self._call(instance, block, part, int(span[index, 0])))
                    self._parts.append((instance, part))
                spans += [first, len(calls)]
            version = instance.binding.version
            step_address = instance.functions[f"fmi{version}DoStep"]
            members.append(_Member(instance.address, step_address, *spans, version, 0))
        self._members = (_Member * len(members))(*members)
        self._calls = (_Call * max(len(calls), 1))(*calls)
        self.bond_previous = np.zeros(len(layout.bond_output))
        arrays = {
            "values": values, "operations": plan.step, "times": times, "external": external,
            "external_slot": layout.external, "copy_source": layout.copy_source,
            "copy_target": layout.copy_target, "copy_gain": layout.copy_gain,
            "copy_offset": layout.copy_offset, "record_source": layout.record_source,
            "record_gain": layout.record_gain, "record_offset": layout.record_offset, "rows": rows,
            "bond_index": layout.bond_index, "bond_output": layout.bond_output,
            "bond_input": layout.bond_input, "bond_sign": layout.bond_sign,
            "bond_previous": self.bond_previous, "bond_energy": bond_energy,
        }  # fmt: skip
        for name, array in arrays.items():
            if not array.flags.c_contiguous or array.dtype not in (np.float64, np.int64):
                raise TypeError(f"{name} is not a contiguous array of float64 or int64")
        self._keep.append(arrays)
        self.run = _Run(
            members=ct.addressof(self._members), calls=ct.addressof(self._calls),
            n_operations=len(plan.step), step=step, n_external=external.shape[1],
            n_record=rows.shape[1], every=every, n_bond_terms=len(layout.bond_output),
            **{name: array.ctypes.data for name, array in arrays.items()},
        )  # fmt: skip
        self._plan = plan

    def _call(self, instance: Instance, block: Block, part: Any, base: int) -> _Call:
        direct = part.buffer is block.values
        slots = 0
        if not direct:
            within = np.arange(block.values.size)[part.slots]
            absolute = np.ascontiguousarray(within + base, dtype=np.int64)
            self._keep.append(absolute)
            slots = absolute.ctypes.data
        functions = instance.functions
        return _Call(
            functions[instance.binding.GET[part.type]], functions[instance.binding.SET[part.type]],
            part.references.ctypes.data, part.buffer.ctypes.data, slots, part.references.size,
            part.buffer.size, _TYPE_CODES[part.type], instance.binding.version,
        )  # fmt: skip

    def advance(self, last: int) -> int:
        """Communication steps up to `last`; 0, or the status that ended it."""
        return int(self._library.cosim_run(ct.addressof(self.run), last))

    def restart(self) -> None:
        """Begin again at the first communication point."""
        self.run.index = self.run.row = 0
        self.bond_previous[:] = 0.0
        for member in self._members:
            member.stopped = 0

    def failed(self) -> tuple[int, int, int]:
        """What failed: (operation code, instance, call)."""
        operation, instance, _ = (int(n) for n in self._plan.step[self.run.failed_operation])
        return operation, instance, int(self.run.failed_call)

    def part(self, call: int) -> tuple[Instance, Any]:
        """Instance and block part of a call."""
        return self._parts[call]
