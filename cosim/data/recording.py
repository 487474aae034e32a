"""What a run recorded: columns over time, with units and where they come from."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import need_text
from ..display.literal import literal
from ..errors import ScenarioError, UnitError, UnknownNameError, listing
from ..files import atomic
from ..spec.distribution import has, needed
from ..spec.units import Unit, conversion, parse
from .npz import read_npz
from .parquet import read_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Vector = NDArray[np.float64]
_META = b"cosim"
_NPZ_META = "cosim"
_TYPES = ("double", "int64", "uint64", "string", "binary")
"""Of columns in Parquet; one of objects without rows has none."""

MOST_AXES = 8
"""Axes of a plot for which nobody has chosen signals."""
_QUANTITIES = {
    "rad": "angle", "deg": "angle", "rad/s": "angular speed", "rad/s2": "angular acceleration",
    "m": "length", "m/s": "speed", "m/s2": "acceleration", "N": "force", "N.m": "torque",
    "A": "current", "V": "voltage", "W": "power", "J": "energy", "kg": "mass", "s": "time",
    "kg.m2": "inertia", "K": "temperature", "degC": "temperature", "1": "ratio",
}  # fmt: skip
"""Unit -> what it measures, as axes are named."""


@dataclass(frozen=True)
class Recording:
    """Signals over time.

    Attributes:
        time: communication points [s].
        values: one row per time, one column per signal.
        names: full scalar names, `instance.variable`.
        units: unit by name, "" where the FMU declares none.
        provenance: FMU files and hashes, parameters, algorithm, step, versions.
        bond_energy: energy that the coupling invented at each power bond [J], positive if the two
            ends together received more than was sent.
        bond_turnover: energy that went over each of them, either way [J].
        error: why the run stopped before its end by a fault, "" if it did not.
        objects: columns that doubles do not carry: integers of 64 bits, strings, binaries. The
            first are in `values`, too, as the nearest double; the others are nan there.
        notes: what else is to be known: an end that an FMU asked for, warnings.
        definitions: by name, what a unit is where the FMU means another one by it than we.
        relative: signals that are differences, so that the offset of their unit does not count.
    """

    time: Vector
    values: Vector
    names: tuple[str, ...]
    units: Mapping[str, str]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    bond_energy: Mapping[str, float] = field(default_factory=dict)
    bond_turnover: Mapping[str, float] = field(default_factory=dict)
    error: str = ""
    objects: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    definitions: Mapping[str, Unit] = field(default_factory=dict)
    relative: frozenset[str] = frozenset()

    @property
    def energy_residual(self) -> float:
        """Energy that the coupling invented at all power bonds together [J]."""
        return float(sum(self.bond_energy.values()))

    def find(self, name: str) -> list[int]:
        """Columns of a signal, or of all elements of a vector.

        Raises:
            UnknownNameError: it was not recorded.
            InputError: it is no text.
        """
        need_text("a signal of a recording", name, 'take one by name, as in recording["load.w"]')
        if name in self.names:
            return [self.names.index(name)]
        element = re.compile(re.escape(name) + r"\[\d+(,\d+)*\]")
        found = [column for column, item in enumerate(self.names) if element.fullmatch(item)]
        if not found:
            raise UnknownNameError(
                f"no signal {name!r} was recorded; {listing(self.names, name)}; a run records more "
                f'with record=["{name}"] (--record {name})'
            )
        return found

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A signal over time; a vector or matrix has one column per element."""
        columns = self.find(name)
        if any(self.names[column] in self.objects for column in columns):
            objects = np.column_stack([self.objects[self.names[column]] for column in columns])
            return objects[:, 0] if name in self.names else objects
        whole = self.values[:, columns]
        return whole[:, 0] if name in self.names else whole

    def __contains__(self, name: object) -> bool:
        """Whether a signal, or a vector, was recorded."""
        if not isinstance(name, str):
            return False
        return name in self.names or any(item.startswith(f"{name}[") for item in self.names)

    def __iter__(self) -> Iterator[str]:
        """Names of the signals, as of a data frame; `len` counts times."""
        return iter(self.names)

    def unit(self, name: str) -> Unit | None:
        """The unit of a signal as its FMU defines it; None where it declares none.

        Raises:
            UnitError: the recording does not say what is meant by its name.
        """
        symbol = self.units.get(name, "")
        return self.definitions.get(name) or (parse(symbol) if symbol else None)

    def like(self, name: str, other: str) -> NDArray[np.float64]:
        """A signal in the unit of another one, as far as both have one.

        Raises:
            UnitError: they measure different things.
        """
        own, wanted = self.unit(name), self.unit(other)
        if own is None or wanted is None:
            return self[name]
        try:
            gain, offset = conversion(own, wanted)
        except UnitError as error:
            raise UnitError(f"{name} cannot be set against {other}: unit {error}") from None
        difference = not self.relative.isdisjoint((name, other))
        return self[name] * gain + (0.0 if difference else offset)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        end = f"{self.time[-1]:g} s" if len(self.time) else "empty"
        failed = f", stopped: {self.error}" if self.error else ""
        return f"<Recording of {len(self.names)} signals, {len(self)} times to {end}{failed}>"

    def _repr_html_(self) -> str:
        from ..display.notebook import key_values, more, signal_charts, view

        columns = {
            name: self.values[:, column]
            for column, name in enumerate(self.names)
            if self.objects.get(name, self.time).dtype != object
        }
        charts, left = signal_charts(self.time, columns, self.units)
        title = self.provenance.get("scenario") or self.provenance.get("system") or "Recording"
        end = f"{self.time[-1]:g} s" if len(self) else "empty"
        facts: list[tuple[str, object]] = [("stopped", self.error)] if self.error else []
        if self.bond_energy:
            facts.append(("energy that the coupling invented", f"{self.energy_residual:.3g} J"))
        return view(
            title, f"{len(self.names)} signals, {len(self)} times to {end}",
            key_values(facts) if facts else "", charts, more(left),
        )  # fmt: skip

    # -- other forms -----------------------------------------------------------------------------

    def to_pandas(self) -> pd.DataFrame:
        """A data frame over time [s]; units and provenance are in its `attrs`.

        Raises:
            InputError: pandas is not installed.
        """
        pd = needed("pandas", "a recording as data frame", "tables")
        frame = pd.DataFrame(
            self.values, index=pd.Index(self.time, name="time"), columns=list(self.names)
        )
        for name, column in self.objects.items():
            frame[name] = column
        frame.attrs.update(
            units=dict(self.units), provenance=dict(self.provenance), error=self.error,
            notes=self.notes,
        )  # fmt: skip
        return frame

    def _meta(self) -> dict[str, Any]:
        return {
            "units": {"time": "s", **self.units},
            "provenance": dict(self.provenance),
            "bond_energy_J": dict(self.bond_energy),
            "bond_turnover_J": dict(self.bond_turnover),
            "error": self.error,
            "notes": list(self.notes),
            "definitions": {
                name: [list(unit.exponents), unit.factor, unit.offset]
                for name, unit in self.definitions.items()
            },
            "relative": sorted(self.relative),
        }

    def _columns(self) -> list[NDArray[Any]]:
        """The signals as they are: objects where there are such."""
        return [
            self.objects.get(name, self.values[:, column]) for column, name in enumerate(self.names)
        ]

    def write_csv(self, path: Path | str) -> Path:
        """Write a CSV file whose head names each column with its unit, `motor.w [rad/s]`."""
        path = Path(path)
        heads = ["time [s]"] + [
            f"{name} [{self.units[name]}]" if self.units.get(name) else name for name in self.names
        ]
        with (
            atomic(path) as temporary,
            temporary.open("w", encoding="utf-8", newline="") as handle,
        ):
            writer = csv.writer(handle)
            writer.writerow(heads)
            columns = [map(_cell, column.tolist()) for column in self._columns()]
            writer.writerows(zip(map(repr, self.time.tolist()), *columns, strict=True))
        return path

    def write_parquet(self, path: Path | str) -> Path:
        """Write a Parquet file; unit in each column's metadata, the rest in the schema's.

        Raises:
            InputError: pyarrow is not installed.
        """
        path = Path(path)
        pq = needed("pyarrow.parquet", f"{path}: writing Parquet", "tables")
        import pyarrow as pa

        columns = [_arrow(column) for column in (self.time, *self._columns())]
        fields = [
            pa.field(name, column.type, metadata={"unit": unit})
            for name, unit, column in zip(
                ("time", *self.names),
                ("s", *(self.units.get(name, "") for name in self.names)),
                columns,
                strict=True,
            )
        ]
        schema = pa.schema(fields, metadata={_META: json.dumps(self._meta()).encode()})
        with atomic(path) as temporary:
            pq.write_table(pa.table(columns, schema=schema), temporary)
        return path

    def write_npz(self, path: Path | str) -> Path:
        """Write an npz archive of numpy with one array per signal; the rest in the array `cosim`.

        Raises:
            ScenarioError: a signal is binary.
        """
        path = Path(path)
        arrays = {"time": self.time}
        for name, column in zip(self.names, self._columns(), strict=True):
            if any(isinstance(item, bytes) for item in column.tolist()):
                raise ScenarioError(
                    f"{path}: npz archives hold no binaries such as {name}; write Parquet"
                )
            arrays[name] = column.astype(str) if column.dtype == object else column
        arrays[_NPZ_META] = np.array(json.dumps(self._meta()))
        with atomic(path) as temporary, temporary.open("wb") as handle:
            np.savez_compressed(handle, **arrays)  # type: ignore[arg-type]
        return path

    def keep(self, stem: Path) -> Path:
        """Write `stem`.parquet, or `stem`.npz where pyarrow is not installed; returns the path."""
        if has("pyarrow"):
            return self.write_parquet(stem.with_name(f"{stem.name}.parquet"))
        return self.write_npz(stem.with_name(f"{stem.name}.npz"))

    def plot(
        self,
        signals: Sequence[str] | str | None = None,
        path: Path | str | None = None,
        references: Mapping[str, Sequence[tuple[Vector, Vector, str]]] | None = None,
    ) -> Figure:
        """Plot signals over time, those with the same unit in one axes, named by what it measures.

        Args:
            signals: names, or one (vectors too); all if not given, of the units with most signals.
            path: where to write the figure; the suffix says how.
            references: signal -> some (times, values, label) that are drawn with it.
        """
        from matplotlib.figure import Figure

        wanted = [signals] if isinstance(signals, str) else list(signals or ())
        wanted = list(self.names) if signals is None else wanted
        names = [self.names[column] for name in wanted for column in self.find(name)]
        names = [name for name in names if self.objects.get(name, self.time).dtype != object]
        groups: dict[str, list[str]] = {}
        for name in names:
            groups.setdefault(self.units.get(name, ""), []).append(name)
        if signals is None and len(groups) > MOST_AXES:
            most = sorted(groups, key=lambda unit: -len(groups[unit]))[:MOST_AXES]
            groups = {unit: members for unit, members in groups.items() if unit in most}
        figure = Figure(figsize=(9.0, 1.0 + 2.2 * max(len(groups), 1)), layout="constrained")
        axes = figure.subplots(max(len(groups), 1), 1, sharex=True, squeeze=False)[:, 0]
        for axis, (unit, members) in zip(axes, groups.items(), strict=False):
            for name in members:
                for times, values, label in (references or {}).get(name, ()):
                    axis.plot(times, values, color="0.6", linewidth=2.0, label=label)
                axis.plot(self.time, self[name], linewidth=1.0, label=name)
            axis.set_ylabel(f"{_QUANTITIES.get(unit, '')} [{unit}]".strip() if unit else "")
            axis.grid(True, alpha=0.3)
            if len(members) <= 12:
                axis.legend(loc="upper right", fontsize="small")
        axes[-1].set_xlabel("time [s]")
        title = str(self.provenance.get("scenario") or self.provenance.get("system") or "")
        figure.suptitle(title + (f" (stopped: {self.error[:80]})" if self.error else ""))
        literal(figure)
        if path is not None:
            with atomic(Path(path)) as temporary:
                figure.savefig(temporary, dpi=120)
        return figure


def _cell(value: Any) -> str:
    """A value in a CSV file; binaries as hexadecimal digits."""
    return (
        value
        if isinstance(value, str)
        else value.hex()
        if isinstance(value, bytes)
        else repr(value)
    )


def read_recording(path: Path | str) -> Recording:
    """Read a recording that `write_parquet` or `write_npz` wrote.

    Raises:
        ScenarioError: missing, or not such a file.
        InputError: it is Parquet, and pyarrow is not installed.
    """
    path = Path(path)
    if path.suffix.lower() == ".npz":
        found, content = _read_npz(path)
    else:
        table = read_table(path)
        content = (table.schema.metadata or {}).get(_META)
        found = {name: _column(path, name, table[name]) for name in table.column_names}
    if content is None or "time" not in found:
        raise ScenarioError(f"{path}: is not a recording of cosim; read it as measurement")
    meta = _read_meta(path, content)
    time = found.pop("time")
    names, columns = tuple(found), list(found.values())
    if time.dtype != np.float64:
        raise ScenarioError(f"{path}: its times are no floating-point numbers; record it again")
    objects = {
        name: column
        for name, column in zip(names, columns, strict=True)
        if column.dtype != np.float64
    }
    numbers = [
        np.full(len(column), np.nan) if column.dtype == object else column.astype(np.float64)
        for column in columns
    ]
    return Recording(
        time=time,
        values=np.column_stack(numbers) if numbers else np.zeros((len(time), 0)),
        names=names,
        units={name: unit for name, unit in meta["units"].items() if name != "time"},
        provenance=meta["provenance"],
        bond_energy=meta["bond_energy_J"],
        bond_turnover=meta.get("bond_turnover_J", {}),
        error=meta["error"],
        objects=objects,
        notes=tuple(meta.get("notes", ())),
        definitions=_definitions(path, meta),
        relative=frozenset(map(str, meta.get("relative", ()))),
    )


def _definitions(path: Path, meta: Mapping[str, Any]) -> dict[str, Unit]:
    """Units that are meant otherwise; older recordings tell of none."""
    try:
        return {
            name: Unit(meta["units"][name], tuple(map(int, powers)), float(factor), float(offset))
            for name, (powers, factor, offset) in dict(meta.get("definitions", {})).items()
        }
    except (KeyError, TypeError, ValueError) as error:
        raise ScenarioError(
            f"{path}: a unit that it defines cannot be read ({error!r}); record it again"
        ) from error


def _read_npz(path: Path) -> tuple[dict[str, NDArray[Any]], bytes | None]:
    """Columns of an npz archive, and what it says about itself.

    Raises:
        ScenarioError: it is none, or its columns have no rows of one length.
    """
    arrays = read_npz(path)
    meta = arrays.pop(_NPZ_META, None)
    if meta is None or meta.dtype.kind != "U" or meta.ndim:
        return {}, None
    rows = arrays["time"].shape if "time" in arrays else ()
    for name, column in arrays.items():
        if column.shape != rows or column.ndim != 1 or column.dtype.kind not in "fiuU":
            raise ScenarioError(
                f"{path}: column {name!r} has the shape {column.shape} and type {column.dtype}; "
                "record it again"
            )
    plain = {n: c.astype(object) if c.dtype.kind == "U" else c for n, c in arrays.items()}
    return plain, str(meta).encode()


def _arrow(column: NDArray[Any]) -> Any:
    """A column for Arrow, which loads pandas to look at an array, but not for its memory."""
    import pyarrow as pa

    if column.dtype != np.float64:
        return pa.array(column)
    memory = pa.py_buffer(np.ascontiguousarray(column))
    return pa.Array.from_buffers(pa.float64(), column.size, [None, memory])


def _column(path: Path, name: str, column: Any) -> NDArray[Any]:
    """A column of the types that `write_parquet` writes.

    Raises:
        ScenarioError: another type, or gaps.
    """
    if str(column.type) not in (*_TYPES, *([] if len(column) else ["null"])) or column.null_count:
        raise ScenarioError(
            f"{path}: column {name!r} is of type {column.type} with {column.null_count} gaps; a "
            f"recording has {', '.join(_TYPES)} without gaps: record it again"
        )
    return np.asarray(column.to_numpy())


def _read_meta(path: Path, content: bytes) -> dict[str, Any]:
    """What `Recording._meta` wrote.

    Raises:
        ScenarioError: something else.
    """
    meta: dict[str, Any]
    try:
        meta = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ScenarioError(
            f"{path}: what it says about itself is not JSON ({error}); record it again"
        ) from error
    kinds = {"units": dict, "provenance": dict, "bond_energy_J": dict, "error": str, "notes": list,
             "relative": list}  # fmt: skip
    for key, kind in kinds.items():
        missing: Any = [] if kind is list else None  # older recordings have none
        if not isinstance(meta, dict) or not isinstance(meta.get(key, missing), kind):
            raise ScenarioError(f"{path}: what it says about itself lacks {key}; record it again")
    energies = [meta["bond_energy_J"], meta.get("bond_turnover_J", {})]
    if not all(isinstance(unit, str) for unit in meta["units"].values()) or not all(
        isinstance(item, dict) and all(isinstance(energy, (int, float)) for energy in item.values())
        for item in energies
    ):
        raise ScenarioError(
            f"{path}: its units are no texts, or its energies no numbers; record it again"
        )
    return meta
