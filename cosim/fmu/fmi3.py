"""The C interface of FMI 3.0 for co-simulation, with the same Python face as `fmi2`."""

from __future__ import annotations

import ctypes as ct
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from .archive import Fmu
from .intermediate import Moved
from .messages import LOGGER3, environment

_P, _D, _S, _B, _Z = ct.c_void_p, ct.c_double, ct.c_char_p, ct.c_bool, ct.c_size_t

NUMERIC = (
    "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Boolean",
)  # fmt: skip
SAME = 1e-9
"""Part of a step by which the time that an FMU has reached may differ from the end of the step."""
ENDED, EARLY = 1000, 1007
"""Far from FMI's statuses: a step that asked to end the simulation; one that ended before its end
although early returns are not allowed."""


class Fmi3:
    """FMI 3.0 functions of one shared library."""

    version = 3
    SIGNATURES: ClassVar[dict[str, tuple[Any, ...]]] = {
        "fmi3EnterInitializationMode": (_P, _B, _D, _D, _B, _D),
        "fmi3ExitInitializationMode": (_P,),
        "fmi3Terminate": (_P,),
        "fmi3Reset": (_P,),
        "fmi3DoStep": (_P, _D, _D, _B, _P, _P, _P, _P),
        "fmi3GetString": (_P, _P, _Z, _P, _Z),
        "fmi3SetString": (_P, _P, _Z, _P, _Z),
        "fmi3GetBinary": (_P, _P, _Z, _P, _P, _Z),
        "fmi3SetBinary": (_P, _P, _Z, _P, _P, _Z),
        **{f"fmi3Get{name}": (_P, _P, _Z, _P, _Z) for name in NUMERIC},
        **{f"fmi3Set{name}": (_P, _P, _Z, _P, _Z) for name in NUMERIC},
    }
    OPTIONAL: ClassVar[dict[str, tuple[Any, ...]]] = {
        "fmi3GetFMUState": (_P, _P),
        "fmi3SetFMUState": (_P, _P),
        "fmi3FreeFMUState": (_P, _P),
        "fmi3SerializedFMUStateSize": (_P, _P, _P),
        "fmi3SerializeFMUState": (_P, _P, _P, _Z),
        "fmi3DeserializeFMUState": (_P, _P, _Z, _P),
        "fmi3GetDirectionalDerivative": (_P, _P, _Z, _P, _Z, _P, _Z, _P, _Z),
    }
    STATE = "FMUState"
    GET: ClassVar[dict[str, str]] = {
        **{name: f"fmi3Get{name}" for name in (*NUMERIC, "String", "Binary")},
        "Enumeration": "fmi3GetInt64",
        "Float32Whole": "fmi3GetFloat32",
    }
    SET: ClassVar[dict[str, str]] = {key: name.replace("Get", "Set") for key, name in GET.items()}

    def __init__(self, library: Any) -> None:
        self.instantiate_ = library.fmi3InstantiateCoSimulation
        self.instantiate_.argtypes = [_S, _S, _S, _B, _B, _B, _B, _P, _Z, _P, _P, _P]
        self.instantiate_.restype = _P
        self.free_ = library.fmi3FreeInstance
        self.free_.argtypes, self.free_.restype = [_P], None
        self._event, self._stop, self._early = ct.c_bool(), ct.c_bool(), ct.c_bool()
        self._last = ct.c_double()

    def instantiate(
        self, fmu: Fmu, name: str, key: int, logging: bool, moved: Moved | None
    ) -> tuple[int | None, Any]:
        """Create an instance; returns its address and what must be kept alive.

        Args:
            fmu, name: whose, and its name.
            key: of its messages; the address of `moved` if there is one.
            logging: see `Instance`.
            moved: inputs for which it may ask within steps.
        """
        # The resource path ends with a separator, as the standard asks for.
        resources = str((fmu.folder / "resources").resolve() / "x")[:-1]
        required = moved.references if moved is not None else np.zeros(0, dtype=np.uint32)
        update = moved.callback if moved is not None else None
        address = self.instantiate_(
            name.encode(), fmu.description.token.encode(), resources.encode(), False, logging,
            False, False, required.ctypes.data if required.size else None, required.size,
            environment(key), ct.cast(LOGGER3, _P), update,
        )  # fmt: skip
        return address, moved

    @staticmethod
    def enter_calls(
        start: float, stop: float | None, tolerance: float | None
    ) -> list[tuple[str, tuple[Any, ...]]]:
        """Calls (after the instance argument) that begin initialization."""
        return [
            (
                "fmi3EnterInitializationMode",
                (tolerance is not None, tolerance or 0.0, start, stop is not None, stop or 0.0),
            )
        ]

    @staticmethod
    def values_arguments(references: Any, values: Any) -> tuple[Any, ...]:
        """Arguments of a get or set call, after the instance."""
        return (references.ctypes.data, references.size, values.ctypes.data, values.size)

    def step_arguments(self, final: bool) -> tuple[Any, ...]:
        """Arguments of a step after the instance, time and step size; `final`: none goes back."""
        return (
            final,
            ct.addressof(self._event),
            ct.addressof(self._stop),
            ct.addressof(self._early),
            ct.addressof(self._last),
        )

    def ending(self, end: float, size: float) -> int:
        """How the last step ended other than by its status: 0, ENDED or EARLY.

        Args:
            end: time at which it should have ended [s].
            size: how long it was [s].
        """
        if self._stop.value:
            return ENDED
        return EARLY if self._early.value and self._last.value < end - SAME * size else 0

    def reached(self) -> float | None:
        """The time that the last step has reached, where steps say so."""
        return self._last.value

    @staticmethod
    def terminated(functions: Mapping[str, Any], address: int) -> tuple[bool, float | None]:
        """Whether a discarded step was a request to end (FMI 3 says so by a flag)."""
        return False, None

    @staticmethod
    def directional_arguments(
        unknowns: Any, knowns: Any, seed: Any, sensitivity: Any
    ) -> tuple[Any, ...]:
        """Arguments of a directional derivative, after the instance."""
        return (
            unknowns.ctypes.data, unknowns.size, knowns.ctypes.data, knowns.size,
            seed.ctypes.data, seed.size, sensitivity.ctypes.data, sensitivity.size,
        )  # fmt: skip

    DIRECTIONAL = "fmi3GetDirectionalDerivative"
