"""A run before any FMU exists: everything checked, the inputs tabulated, the plan compiled."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.recording import Recording
from ..data.signals import Signal
from ..spec import distribution
from ..spec.units import usual
from ..system.inputs import overruled
from ..system.system import System
from .invented import invented
from .plan import Plan

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Outline:
    """All that an execution needs to know.

    Attributes:
        system: the graph.
        scenario: name that recordings carry.
        options: of the algorithm.
        step: communication step [s].
        tolerance: relative tolerance handed to the FMUs, None for their own.
        executor: `c`, `python` or `auto`.
        plan: of the algorithm.
        times: communication points [s].
        observed: full scalar names of what is recorded.
        every: every n-th communication point is recorded.
        signals: scalar input -> what drives it.
        external: values of the driven inputs, one row per communication point.
        objects: per column of `external` whose values travel as objects, one per communication
            point.
        endless: the run goes on beyond `times`, which are a window of it.
        driven: inputs whose values in `external` are no longer those of `signals`.
    """

    system: System
    scenario: str
    options: Mapping[str, Any]
    step: float
    tolerance: float | None
    executor: str
    plan: Plan
    times: Vector
    observed: tuple[str, ...]
    every: int
    signals: Mapping[str, Signal]
    external: Vector
    objects: Mapping[int, list[Any]]
    endless: bool = False
    driven: set[str] = field(default_factory=set)

    def tables_for(
        self, system: System, signals: Mapping[str, Signal], times: Vector
    ) -> tuple[Vector, Vector] | None:
        """The same points and values of inputs, if a run of another system has them, too.

        Nobody may write to them from then on: a minute in steps of 0.1 ms takes ten megabytes.

        Args:
            system: of the other run.
            signals: that drive its inputs.
            times: its communication points [s].
        """
        known = self.signals
        if (
            self.objects
            or self.driven
            or not np.array_equal(times, self.times)
            or list(known) != list(signals)
        ):
            return None
        for name, signal in signals.items():
            one, other = self.system.declaration(name), system.declaration(name)
            units = self.system.unit(name) == system.unit(name) and one.unit == other.unit
            alike = units and one.relative == other.relative and one.type == other.type
            if known[name] is not signal or not alike or one.items or other.items:
                return None
        for table in (self.times, self.external):
            table.setflags(write=False)
        return self.times, self.external

    @property
    def count(self) -> int:
        """Communication steps."""
        return self.times.size - 1

    @property
    def end(self) -> float:
        """Where the run ends [s]; infinite if nobody knows."""
        return math.inf if self.endless else float(self.times[-1])

    @property
    def capacity(self) -> int:
        """Rows of a recording: every n-th communication point, and an end between them."""
        return self.count // self.every + 2

    def recorded_times(self, rows: int, beside: int | None = None) -> Vector:
        """Times of the rows of a recording [s].

        Args:
            rows: how many there are.
            beside: communication point of the last one, if it is none of every n-th.
        """
        if beside is None:
            return self.times[:: self.every][:rows].copy()
        return np.append(self.times[:: self.every][: rows - 1], self.times[beside])

    def recording(
        self,
        rows: Vector,
        bond_energy: Mapping[str, float],
        how: Mapping[str, Any],
        error: str = "",
        *,
        turnover: Mapping[str, float],
        objects: Mapping[str, Sequence[Any]] | None = None,
        notes: Sequence[str] = (),
        beside: int | None = None,
    ) -> Recording:
        """A recording of this run.

        Args:
            rows: recorded values, one row per recorded communication point that was reached.
            bond_energy: invented, per power bond [J].
            turnover: went over it [J].
            how: what else its provenance says of how it was run.
            error: what ended it early.
            objects: recorded values that travel as objects.
            notes: what else is to be known.
            beside: as of `recorded_times`.
        """
        carried = {
            name: _column(self.system.declaration(name).type, items[: len(rows)])
            for name, items in (objects or {}).items()
        }
        declared = {name: self.system.declaration(name) for name in self.observed}
        values = rows.copy()
        for name, column in carried.items():
            text = column.dtype == object
            values[:, self.observed.index(name)] = np.nan if text else column.astype(np.float64)
        return Recording(
            time=self.recorded_times(len(rows), beside),
            values=values,
            names=self.observed,
            units={name: variable.symbol for name, variable in declared.items()},
            definitions={
                name: variable.unit
                for name, variable in declared.items()
                if variable.unit is not None and not usual(variable.unit)
            },
            relative=frozenset(name for name, variable in declared.items() if variable.relative),
            provenance={
                **self._provenance(),
                "inputs": {name: signal.text for name, signal in self.signals.items()},
                **how,
            },
            bond_energy=dict(bond_energy),
            bond_turnover=dict(turnover),
            error=error,
            objects=carried,
            notes=tuple(dict.fromkeys([*notes, *self._notes(), *invented(bond_energy, turnover)])),
        )

    def _notes(self) -> list[str]:
        """On values that nothing asks for, and units that nothing checks."""
        given = (f"{m.name}.{key}" for m in self.system.members.values() for key in m.parameters)
        idle = [overruled(self.system, name, self.signals) for name in given]
        return [note for note in idle if note] + [
            f"input {name} takes {signal.text} as it is: it is in {signal.unit!r}, and the FMU "
            "declares no unit that could be converted into"
            for name, signal in self.signals.items()
            if signal.unit not in ("", "1", "-", "any") and not self.system.unit(name)
        ]

    def _provenance(self) -> dict[str, Any]:
        return {
            "system": self.system.name,
            "scenario": self.scenario,
            "algorithm": self.plan.algorithm,
            "options": {key: _plain(value) for key, value in self.options.items()},
            "step_s": self.step,
            "instances": {
                member.name: {
                    "reference": member.reference,
                    "model": member.description.name,
                    "fmi": member.description.fmi,
                    "file": member.fmu.path.name,
                    "sha256": member.fmu.digest,
                    "tool": member.description.tool,
                    "parameters": {k: _plain(v) for k, v in member.parameters.items()},
                }
                for member in self.system.members.values()
            },
            "connections": [f"{c.source} -> {c.target}" for c in self.system.connections],
            "versions": {"cosim": distribution.version(), "numpy": np.__version__},
        }


def _column(type_: str, items: Sequence[Any]) -> NDArray[Any]:
    """Recorded objects as an array of their type."""
    kinds = {"Int64": np.int64, "UInt64": np.uint64}
    return np.array(items, dtype=kinds.get(type_, object))


def _plain(value: Any) -> Any:
    """A value as files of recordings take it: bytes as hexadecimal digits."""
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return dict(value) if isinstance(value, Mapping) else value
