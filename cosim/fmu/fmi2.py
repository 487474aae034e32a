"""The C interface of FMI 2.0 for co-simulation, with the same Python face as `fmi3`."""

from __future__ import annotations

import ctypes as ct
import functools
import importlib.util
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from .archive import Fmu, library_suffix
from .messages import LOGGER2, environment

_P, _I, _D, _S, _U, _Z = ct.c_void_p, ct.c_int, ct.c_double, ct.c_char_p, ct.c_uint32, ct.c_size_t
_CALLOC = ct.CFUNCTYPE(_P, _Z, _Z)
_FREE = ct.CFUNCTYPE(None, _P)


class _Callbacks(ct.Structure):
    _fields_: ClassVar = [
        ("logger", type(LOGGER2)),
        ("allocate", _CALLOC),
        ("free", _FREE),
        ("step_finished", _P),
        ("environment", _P),
    ]


@functools.cache  # a library opened anew is some kilobytes, which would lie between instances
def _allocator() -> tuple[Any, Any]:
    runtime = ct.cdll.msvcrt if sys.platform == "win32" else ct.CDLL(None)
    return _CALLOC(("calloc", runtime)), _FREE(("free", runtime))


@functools.cache
def _formatter() -> Any:
    """The library that formats messages in C, None if this machine has none."""
    found = importlib.util.find_spec("fmpy")
    folder = {"win32": "win64", "darwin": "darwin64"}.get(sys.platform, "linux64")
    if found is None or not found.submodule_search_locations:
        return None
    root = Path(found.submodule_search_locations[0])
    try:
        library = ct.CDLL(str(root / "logging" / folder / f"logging{library_suffix()}"))
        library.addLoggerProxy.argtypes = [_P]
        library.addLoggerProxy.restype = None
    except (OSError, AttributeError):  # no such binary for this machine: unformatted text
        return None
    return library


def _format_in_c(callbacks: _Callbacks) -> Any:
    """Let the logger see formatted text: ctypes cannot read C's variable arguments, fmpy's can."""
    library = _formatter()
    if library is not None:
        library.addLoggerProxy(ct.byref(callbacks))
    return library


_LAST_TIME, _TERMINATED = 2, 3
"""Kinds of fmi2Status: fmi2LastSuccessfulTime and fmi2Terminated."""


class Fmi2:
    """FMI 2.0 functions of one shared library."""

    version = 2
    SIGNATURES: ClassVar[dict[str, tuple[Any, ...]]] = {
        "fmi2SetupExperiment": (_P, _I, _D, _D, _I, _D),
        "fmi2EnterInitializationMode": (_P,),
        "fmi2ExitInitializationMode": (_P,),
        "fmi2Terminate": (_P,),
        "fmi2Reset": (_P,),
        "fmi2DoStep": (_P, _D, _D, _I),
        "fmi2GetReal": (_P, _P, _Z, _P),
        "fmi2SetReal": (_P, _P, _Z, _P),
        "fmi2GetInteger": (_P, _P, _Z, _P),
        "fmi2SetInteger": (_P, _P, _Z, _P),
        "fmi2GetBoolean": (_P, _P, _Z, _P),
        "fmi2SetBoolean": (_P, _P, _Z, _P),
        "fmi2GetString": (_P, _P, _Z, _P),
        "fmi2SetString": (_P, _P, _Z, _P),
    }
    OPTIONAL: ClassVar[dict[str, tuple[Any, ...]]] = {
        "fmi2GetFMUstate": (_P, _P),
        "fmi2SetFMUstate": (_P, _P),
        "fmi2FreeFMUstate": (_P, _P),
        "fmi2SerializedFMUstateSize": (_P, _P, _P),
        "fmi2SerializeFMUstate": (_P, _P, _P, _Z),
        "fmi2DeSerializeFMUstate": (_P, _P, _Z, _P),
        "fmi2GetDirectionalDerivative": (_P, _P, _Z, _P, _Z, _P, _P),
        "fmi2GetBooleanStatus": (_P, _I, _P),
        "fmi2GetRealStatus": (_P, _I, _P),
        "fmi2SetRealInputDerivatives": (_P, _P, _Z, _P, _P),
    }
    STATE = "FMUstate"
    GET: ClassVar[dict[str, str]] = {
        "Float64": "fmi2GetReal",
        "Int32": "fmi2GetInteger",
        "Enumeration2": "fmi2GetInteger",
        "Boolean2": "fmi2GetBoolean",
        "String": "fmi2GetString",
    }
    SET: ClassVar[dict[str, str]] = {key: name.replace("Get", "Set") for key, name in GET.items()}

    def __init__(self, library: Any) -> None:
        self.instantiate_ = library.fmi2Instantiate
        self.instantiate_.argtypes = [_S, _I, _S, _S, _P, _I, _I]
        self.instantiate_.restype = _P
        self.free_ = library.fmi2FreeInstance
        self.free_.argtypes, self.free_.restype = [_P], None

    def instantiate(
        self, fmu: Fmu, name: str, key: int, logging: bool, moved: object
    ) -> tuple[int | None, Any]:
        """Create an instance; returns its address and what must be kept alive.

        Args:
            fmu, name, key, logging: as in `fmi3`.
            moved: not used; FMI 2 is told derivatives of inputs.
        """
        calloc, free = _allocator()
        callbacks = _Callbacks(LOGGER2, calloc, free, None, environment(key))
        proxy = _format_in_c(callbacks)
        resources = (fmu.folder / "resources").resolve().as_uri()
        address = self.instantiate_(
            name.encode(), 1, fmu.description.token.encode(), resources.encode(),
            ct.addressof(callbacks), 0, int(logging),
        )  # fmt: skip
        return address, (callbacks, calloc, free, proxy)

    @staticmethod
    def enter_calls(
        start: float, stop: float | None, tolerance: float | None
    ) -> list[tuple[str, tuple[Any, ...]]]:
        """Calls (after the instance argument) that begin initialization."""
        return [
            (
                "fmi2SetupExperiment",
                (tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0),
            ),
            ("fmi2EnterInitializationMode", ()),
        ]

    @staticmethod
    def values_arguments(references: Any, values: Any) -> tuple[Any, ...]:
        """Arguments of a get or set call, after the instance."""
        return (references.ctypes.data, references.size, values.ctypes.data)

    @staticmethod
    def step_arguments(final: bool) -> tuple[Any, ...]:
        """Arguments of a step after the instance, time and step size; `final`: none goes back."""
        return (int(final),)

    @staticmethod
    def ending(end: float, size: float) -> int:
        """How the last step ended other than by its status: FMI 2 says all by that."""
        return 0

    @staticmethod
    def reached() -> float | None:
        """The time that the last step has reached, where steps say so."""
        return None

    @staticmethod
    def terminated(functions: Mapping[str, Any], address: int) -> tuple[bool, float | None]:
        """Whether a discarded step was a request to end, and up to when it went [s]."""
        if "fmi2GetBooleanStatus" not in functions:
            return False, None
        asked, last = ct.c_int(0), ct.c_double(0.0)
        status = functions["fmi2GetBooleanStatus"](address, _TERMINATED, ct.addressof(asked))
        if status not in (0, 1) or not asked.value:
            return False, None
        if "fmi2GetRealStatus" not in functions:
            return True, None
        status = functions["fmi2GetRealStatus"](address, _LAST_TIME, ct.addressof(last))
        return True, last.value if status in (0, 1) else None

    @staticmethod
    def directional_arguments(
        unknowns: Any, knowns: Any, seed: Any, sensitivity: Any
    ) -> tuple[Any, ...]:
        """Arguments of a directional derivative, after the instance."""
        return (
            unknowns.ctypes.data, unknowns.size, knowns.ctypes.data, knowns.size,
            seed.ctypes.data, sensitivity.ctypes.data,
        )  # fmt: skip

    DIRECTIONAL = "fmi2GetDirectionalDerivative"
