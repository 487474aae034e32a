"""Binaries of FMUs, loaded once per process."""

from __future__ import annotations

import atexit
import ctypes as ct
import os
import sys
from functools import cached_property
from typing import Any

from ..errors import FmuFileError
from .archive import Fmu
from .fmi2 import Fmi2
from .fmi3 import Fmi3

_libraries: dict[str, Any] = {}
WORK = "cosim_work"
"""Function that counts the steps that an instance's solver has made; FMI knows none, so only FMUs
that have it can be limited without looking at the clock. Our packager gives it to its FMUs, whose
C code changes nothing of the process; an FMU with it is not watched (`Instance.watched`)."""


class Functions(dict[str, Any]):
    """C functions of a library by name."""

    @cached_property
    def addresses(self) -> dict[str, int]:
        """Where they are."""
        return {name: ct.cast(item, ct.c_void_p).value or 0 for name, item in self.items()}


_functions: dict[tuple[str, int], Functions] = {}


def _library(fmu: Fmu) -> Any:
    path = str(fmu.binary)
    if path not in _libraries:
        try:
            if sys.platform == "win32":
                with os.add_dll_directory(str(fmu.binary.parent)):
                    _libraries[path] = ct.CDLL(path)
            else:
                _libraries[path] = ct.CDLL(path)
        except OSError as error:
            raise FmuFileError(
                f"{fmu.path}: its binary cannot be loaded ({error}); it may need a library that "
                "this machine lacks"
            ) from error
        # libraries of pythonfmu release their state twice when the process ends, unless told before
        finalize = getattr(_libraries[path], "finalizePythonInterpreter", None)
        if finalize is not None:
            atexit.register(finalize)
    return _libraries[path]


def bind(fmu: Fmu) -> tuple[Fmi2 | Fmi3, Functions]:
    """A binding to an FMU's library, and its functions, made once for all instances.

    Raises:
        FmuFileError: it cannot be loaded here, or lacks a function.
    """
    library = _library(fmu)
    key = str(fmu.binary), fmu.description.fmi
    try:
        binding = Fmi2(library) if fmu.description.fmi == 2 else Fmi3(library)
        if key not in _functions:
            functions = Functions(
                (name, _prototype(library, name, signature))
                for name, signature in binding.SIGNATURES.items()
            )
            for name, signature in binding.OPTIONAL.items():
                if hasattr(library, name):
                    functions[name] = _prototype(library, name, signature)
            if hasattr(library, WORK):
                functions[WORK] = _prototype(library, WORK, (ct.c_void_p,), ct.c_int64)
            _functions[key] = functions
    except AttributeError as error:
        raise FmuFileError(
            f"{fmu.path}: its binary lacks a function of FMI {fmu.description.fmi}.0 ({error})"
        ) from error
    return binding, _functions[key]


def _prototype(library: Any, name: str, signature: tuple[Any, ...], result: Any = ct.c_int) -> Any:
    function = library[name]  # a fresh object: prototypes are not shared between bindings
    function.argtypes, function.restype = list(signature), result
    return function
