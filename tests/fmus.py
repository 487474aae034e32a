"""FMUs for tests: built once per variant, driven through fmpy alone."""

from __future__ import annotations

import atexit
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import lru_cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave

from cosim.spec.cache import cache_folder
from sources.packaging import catalog
from sources.packaging.build import build

_CHECKOUT = hashlib.sha256(str(Path(__file__).resolve().parents[1]).encode()).hexdigest()[:12]
OUT = cache_folder() / "tests" / _CHECKOUT
"""Each checkout has its own: the same name may stand for other equations in another one."""
_HOLDERS: list[tempfile.TemporaryDirectory[str]] = []


@lru_cache(maxsize=None)
def fmu(name: str, kind: str = "native", fmi: int = 2) -> Path:
    return build(name, out=OUT, kind=kind, fmi=fmi)  # type: ignore[arg-type]


@lru_cache(maxsize=None)
def _unpacked(path: Path) -> tuple[Any, Path]:
    holder = tempfile.TemporaryDirectory(prefix="cosim-test-", ignore_cleanup_errors=True)
    _HOLDERS.append(holder)  # removed when the interpreter ends
    folder = Path(holder.name)
    fmpy.extract(str(path), str(folder))
    return fmpy.read_model_description(str(path), validate=False), folder


@lru_cache(maxsize=1)
def catalogue() -> tuple[str, ...]:
    """The variants under test: all fidelities, and every effect once, on each component in turn.

    With `COSIM_TESTS=all` every catalogued variant, which compiles for half an hour on two cores.
    """
    if os.environ.get("COSIM_TESTS") == "all":
        return catalog.names()
    chosen = [name for name in catalog.names() if "+" not in name]
    hosts: dict[str, list[str]] = {}
    for name in catalog.names():
        if "+" in name:
            hosts.setdefault(name.partition("+")[2], []).append(name)
    for turn, (_, names) in enumerate(sorted(hosts.items())):
        chosen.append(names[turn % len(names)])
    return tuple(chosen)


@lru_cache(maxsize=None)
def _loaded(path: Path) -> FMU2Slave | FMU3Slave:
    """FMPy's access to the library of an FMU, whose functions it binds for 4 ms each time."""
    description, folder = _unpacked(path)
    kind = FMU3Slave if description.fmiVersion.startswith("3") else FMU2Slave
    return kind(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="x",
    )


@lru_cache(maxsize=None)
def _ended_at_exit(path: Path) -> None:
    atexit.register(_loaded(path).dll.finalizePythonInterpreter)


class Slave:
    """A co-simulation instance with values by name; `messages` holds what it logged."""

    def __init__(
        self,
        path: Path,
        values: Mapping[str, float] | None = None,
        *,
        start: float = 0.0,
        initialize: bool = True,
        token: str | None = None,
        event_mode: bool = False,
        update: Callable[..., None] | None = None,
        required: Iterable[str] = (),
    ) -> None:
        self.description, _ = _unpacked(path)
        self.version = 3 if self.description.fmiVersion.startswith("3") else 2
        self.messages: list[str] = []
        self.alive = True  # after fmi2Fatal, pythonfmu's answer to all errors, no call may follow
        # an instance of its own, of a library that stays loaded: FMPy unloads it with an instance
        self.fmu = copy(_loaded(path))
        self.fmu.freeLibrary = lambda: None
        self.fmu.guid = token or self.description.guid
        self.inputs = [v for v in self.description.modelVariables if v.causality == "input"]
        self.vr = {v.name: v.valueReference for v in self.description.modelVariables}
        self.start = start
        if self.version == 2:

            def log(
                _environment: Any, _name: Any, status: int, _category: Any, text: bytes
            ) -> None:
                self.messages.append(text.decode())
                self.alive = self.alive and status != 4

            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = fmi2CallbackLoggerTYPE(log)
            # libraries of pythonfmu release their state twice when the process ends, unless told
            if hasattr(self.fmu.dll, "finalizePythonInterpreter"):
                _ended_at_exit(path)
            # an interpreted FMU reports its exceptions only when it may log
            chatty = bool(self.description.coSimulation.needsExecutionTool)
            self.fmu.instantiate(callbacks=self._callbacks, loggingOn=chatty)
        else:
            self.fmu.instantiate(
                eventModeUsed=event_mode,
                intermediateUpdate=update,
                requiredIntermediateVariables=[self.vr[name] for name in required],
                logMessage=lambda _env, _status, _category, text: self.messages.append(
                    text.decode()
                ),
            )
        if initialize:
            self.initialize(values)

    def initialize(self, values: Mapping[str, float] | None = None) -> None:
        if self.version == 2:
            self.fmu.setupExperiment(startTime=self.start)
            self.set(values or {})
            self.fmu.enterInitializationMode()
        else:
            self.set(values or {})
            self.fmu.enterInitializationMode(startTime=self.start)
        self.fmu.exitInitializationMode()

    def set(self, values: Mapping[str, float]) -> None:
        real = {k: v for k, v in values.items() if k != "solver.method"}
        references, numbers = [self.vr[k] for k in real], [float(v) for v in real.values()]
        if self.version == 2:
            if real:
                self.fmu.setReal(references, numbers)
            if "solver.method" in values:
                self.fmu.setInteger([self.vr["solver.method"]], [int(values["solver.method"])])
        else:
            if real:
                self.fmu.setFloat64(references, numbers)
            if "solver.method" in values:
                self.fmu.setInt64([self.vr["solver.method"]], [int(values["solver.method"])])

    def get(self, names: Iterable[str]) -> np.ndarray:
        references = [self.vr[name] for name in names]
        if not references:
            return np.zeros(0)
        read: Callable[[list[int]], list[float]] = (
            self.fmu.getReal if self.version == 2 else self.fmu.getFloat64
        )
        return np.array(read(references))

    def step(self, t: float, h: float) -> None:
        self.fmu.doStep(t, h)

    def names(self, causality: str) -> list[str]:
        return [
            v.name
            for v in self.description.modelVariables
            if v.causality == causality and v.type in ("Real", "Float64")
        ]

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()

    def __enter__(self) -> Slave:
        return self

    def __exit__(self, *_: object) -> None:
        if self.alive:
            self.fmu.freeInstance()
