"""Packages as scenarios, and scenarios as packages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.signals import Signal, SignalVector, as_signal, objects
from ..errors import ScenarioError, UnitError, UnknownNameError, listing
from ..scenario.scenario import Scenario
from ..spec.units import change
from ..system.provider import Provider
from ..system.variants import apply
from .read import Experiment, Package, Terminal, read_package
from .write import write

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class _Scaled:
    """A signal on its way to a variable inside: factor * signal + offset."""

    signal: Signal
    factor: float
    offset: float
    unit: str = ""

    @property
    def text(self) -> str:
        """Where it comes from."""
        return self.signal.text

    def at(self, times: Vector) -> Vector:
        """Values at these times."""
        values = np.asarray(self.signal.at(times), dtype=np.float64)
        return self.factor * values + self.offset

    def objects(self, times: Vector) -> list[Any]:
        """What doubles do not carry, where nothing is to be calculated with it."""
        return objects(self.signal, times) if (self.factor, self.offset) == (1.0, 0.0) else []


def read_scenario(
    path: Path | str,
    *,
    ssd: str = "SystemStructure.ssd",
    duration: float | None = None,
    step: float | None = None,
    inputs: Mapping[str, Signal | SignalVector | float] | None = None,
) -> Scenario:
    """A scenario from an SSP package, as `cosim run` takes it.

    Args:
        path: an .ssp archive, a folder with its content, or an .ssd file.
        ssd: which structure, where a package holds several.
        duration: replaces what the default experiment says [s].
        step: the same; standard SSP has no step, so packages of most tools need one [s].
        inputs: connector of the root system, or full name of an open input -> signal or number.

    Raises:
        ScenarioError: it cannot be read, or neither it nor the arguments give duration and step.
        UnknownNameError: no such input.
        UnitError: the unit of an input does not convert.
    """
    path = Path(path)
    package = read_package(path, ssd=ssd)
    experiment = package.experiment
    start = experiment.start or 0.0
    if duration is None and experiment.stop is not None:
        duration = experiment.stop - start
    step = step if step is not None else experiment.step
    for name, value in (("duration", duration), ("step", step)):
        if value is None:
            raise ScenarioError(f"{path}: says nothing about the {name}; give one (--{name})")
    assert duration is not None and step is not None
    return Scenario(
        name=package.system.name,
        folder=package.system.path.parent,
        text=package.system.text,
        question="",
        expected="",
        source=path.name,
        system=package.system,
        duration=duration,
        start=start,
        step=step,
        algorithm=experiment.algorithm or "jacobi",
        options=dict(experiment.options),
        tolerance=experiment.tolerance,
        variants={},
        parameters={},
        inputs={**package.signals, **drive(package, inputs or {})},
        record=None,
        period=None,
        references={},
        checks=(),
        plot=None,
    )


def drive(
    package: Package, inputs: Mapping[str, Signal | SignalVector | float]
) -> dict[str, Signal | SignalVector]:
    """Signals of open inputs, from signals of connectors of the root system (or of inputs)."""
    found: dict[str, Signal | SignalVector] = {}
    for name, driver in inputs.items():
        if isinstance(driver, SignalVector):
            found[name] = driver
            continue
        signal = as_signal(driver)
        if name in package.inputs:
            for terminal in package.inputs[name]:
                found[terminal.name] = _inside(name, signal, terminal)
        elif "." in name:
            found[name] = signal
        else:
            raise UnknownNameError(
                f"{package.system.name}: the root system has no input {name!r}; "
                f"{listing(package.inputs, name)}"
            )
    return found


def _inside(name: str, signal: Signal, terminal: Terminal) -> Signal:
    """What a variable behind a connector is given: the connector's unit counts on the way."""
    factor, offset = terminal.factor, terminal.offset
    if (factor, offset) == (1.0, 0.0):
        return signal
    if signal.unit and terminal.unit is not None:
        try:
            gain, shift = change(signal.unit, terminal.unit, difference=terminal.relative)
        except UnitError as error:
            raise UnitError(f"input {name} from {signal.text}: {error}") from error
        offset += factor * shift
        factor *= gain
    return _Scaled(signal, factor, offset)


def export(
    scenario: Scenario,
    path: Path | str,
    provider: Provider | None,
    *,
    version: str = "1.0",
    base: Path | None = None,
) -> Path:
    """Write the system of a scenario as an SSP archive, with its inputs, duration and step.

    Args:
        scenario: what to write.
        path: the .ssp file.
        provider: where variants come from.
        version: of SSP.
        base: folder against which .fmu paths among the variants are taken.

    Raises:
        GraphError: something that this version of SSP cannot express.
    """
    instances = apply(scenario.system.instances, scenario.variants, provider, base)
    file = replace(scenario.system, instances=instances)
    system = file.build(provider, scenario.parameters)
    experiment = Experiment(
        scenario.start, scenario.start + scenario.duration, scenario.step, scenario.algorithm,
        scenario.options, scenario.tolerance,
    )  # fmt: skip
    return write(system, path, version=version, experiment=experiment, inputs=scenario.inputs)
