"""Study files: which scenario is run over which variants, parameters, algorithms and steps.

docs/study.md has the schema.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import ScenarioError, UnknownNameError, listing
from ..files import flatten, is_file, read_toml
from ..installation import places
from ..reading.schema import is_finite, shown

KEYS = {
    "description", "scenario", "runs", "duration", "period", "algorithm", "step", "repeats",
    "reuse", "combine", "set", "param", "sample", "keep", "signals", "reference",
}  # fmt: skip
REFERENCE_KEYS = {"set", "param", "algorithm", "step"}
DISTRIBUTIONS = ("uniform", "log_uniform", "normal")
METHODS = ("latin_hypercube", "random", "sobol", "morris")
FINEST = "finest"
MOST = 1_000_000
"""Values, repeats and samples of a study: at a millisecond each, a quarter of an hour."""


@dataclass(frozen=True)
class Algorithm:
    """A co-simulation algorithm with its options."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        inside = ", ".join(f"{key}={value}" for key, value in self.options.items())
        return f"{self.name}({inside})" if inside else self.name


@dataclass(frozen=True)
class Distribution:
    """How a parameter is sampled.

    Attributes:
        kind: `uniform`, `log_uniform` or `normal`.
        first, second: ends of the interval; mean and standard deviation of `normal`.
        minimum, maximum: where `normal` is cut off.
    """

    kind: str
    first: float
    second: float
    minimum: float = -math.inf
    maximum: float = math.inf


@dataclass(frozen=True)
class Sample:
    """How many values of each distribution are drawn, and how.

    Attributes:
        count: values; of `sobol` its base samples, of `morris` its trajectories.
        method: one of `METHODS`.
        seed: of the random numbers.
    """

    count: int
    method: str = "latin_hypercube"
    seed: int = 0


@dataclass(frozen=True)
class ReferenceRun:
    """What the run is made with that others are compared with; the rest is as in the other run.

    Attributes:
        finest: take the smallest of the study's steps.
        variants, parameters, algorithm, step: take these; None or empty for the other run's own.
    """

    finest: bool = False
    variants: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    algorithm: Algorithm | None = None
    step: float | None = None


@dataclass(frozen=True)
class Study:
    """A scenario over variants, parameters, algorithms and steps.

    Attributes:
        name: for the folder of results.
        scenarios: names, or paths of .toml and .ssp files; all their runs.
        folder: against which paths are taken.
        text: one line on what it is.
        runs: only these of the scenarios' runs; empty for all.
        variants: instance (or component, or slot) -> short forms, "" for the scenario's own.
        parameters: full name -> values, or a distribution.
        algorithms, steps: to be combined with the rest; empty for the scenario's own.
        duration, period: replace the scenario's [s].
        combine: `grid` (each with each) or `zip` (the first of all lists, the second, ...).
        sample: how distributions are sampled; each variant sees the same values.
        keep: signals whose recordings are kept.
        signals: signals that are compared with the reference run; by default those that the
            scenario compares, else those that are kept.
        reference: the run to compare with, None for none; what the scenario compares with (a
            measurement) is compared with anyway.
        repeats: runs of each point, of which the fastest gives the cost.
        reuse: reset instances and run again; False creates new ones for each run.
    """

    name: str
    scenarios: tuple[str, ...]
    folder: Path = Path()
    text: str = ""
    runs: tuple[str, ...] = ()
    variants: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    parameters: Mapping[str, tuple[Any, ...] | Distribution] = field(default_factory=dict)
    algorithms: tuple[Algorithm, ...] = ()
    steps: tuple[float, ...] = ()
    duration: float | None = None
    period: float | None = None
    combine: str = "grid"
    sample: Sample | None = None
    keep: tuple[str, ...] = ()
    signals: tuple[str, ...] = ()
    reference: ReferenceRun | None = None
    repeats: int = 1
    reuse: bool = True

    @property
    def sampled(self) -> dict[str, Distribution]:
        """The parameters that are sampled."""
        return {k: v for k, v in self.parameters.items() if isinstance(v, Distribution)}


def read_study(path: Path | str) -> Study:
    """Read a study file: its path, or the name of one that comes with cosim.

    Raises:
        ScenarioError: not TOML, or a wrong key or value.
        UnknownNameError: there is none of this name.
    """
    path = Path(path)
    if path.suffix != ".toml" and not is_file(path):
        known = {item.stem: item for item in (places.scenarios() / "studies").glob("*.toml")}
        if str(path) not in known:
            raise UnknownNameError(
                f"there is no study {str(path)!r}; {listing(sorted(known), str(path))}; or give "
                "the path of a .toml file"
            )
        path = known[str(path)]
    return study_from(read_toml(path), path.stem, path.parent, str(path))


def study_from(
    table: Mapping[str, Any], name: str = "study", folder: Path | None = None, where: str = ""
) -> Study:
    """A study from the content of a study file.

    Args:
        table: as read from TOML.
        name: for the folder of results.
        folder: against which paths are taken.
        where: what error texts begin with; the name by default.

    Raises:
        ScenarioError: a wrong key or value.
    """
    return _Reader(table, where or name).read(name, folder or Path())


class _Reader:
    def __init__(self, table: Mapping[str, Any], where: str) -> None:
        self.table, self.where = table, where

    def fail(self, text: str) -> ScenarioError:
        return ScenarioError(f"{self.where}: {text}")

    def only(self, table: Any, known: set[str], what: str) -> None:
        if not isinstance(table, Mapping):
            raise self.fail(f"{what} must be a table, not {table!r}")
        unknown = sorted(set(table) - known)
        if unknown:
            raise self.fail(
                f"{what} has no key {unknown[0]!r}; {listing(sorted(known), unknown[0])}"
            )

    def number(self, what: str, value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.fail(f"{what} must be a number, not {value!r}")
        if not is_finite(value):
            raise self.fail(f"{what} = {shown(value)} must be finite")
        return float(value)

    def positive(self, what: str, value: Any) -> float:
        number = self.number(what, value)
        if not number > 0.0:
            raise self.fail(f"{what} = {number:g} must be positive")
        return number

    def count(self, what: str, value: Any, least: int, most: int = MOST) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise self.fail(f"{what} must be a whole number from {least} on, not {value!r}")
        if value > most:
            raise self.fail(f"{what} = {shown(value)} is more than the most, {most}")
        return value

    def texts(self, what: str, value: Any) -> tuple[str, ...]:
        found = [value] if isinstance(value, str) else value
        if not isinstance(found, list) or not all(isinstance(item, str) for item in found):
            raise self.fail(f"{what} must be a text or a list of texts, not {value!r}")
        if not found:
            raise self.fail(f"{what} is an empty list; leave the key out instead")
        return tuple(found)

    def read(self, name: str, folder: Path) -> Study:
        table = self.table
        self.only(table, KEYS, "a study")
        if "scenario" not in table:
            raise self.fail('scenario = "name" is missing; see cosim scenarios')
        combine = table.get("combine", "grid")
        if combine not in ("grid", "zip"):
            raise self.fail(f"combine = {combine!r} is not grid or zip")
        reuse = table.get("reuse", True)
        if not isinstance(reuse, bool):
            raise self.fail(f"reuse must be true or false, not {reuse!r}")
        for key in ("set", "param"):
            if not isinstance(table.get(key, {}), Mapping):
                raise self.fail(f"[{key}] must be a table, not {table[key]!r}")
        parameters = {
            key: self.values(f"[param] {key}", value)
            for key, value in self.flat(table.get("param", {})).items()
        }
        sampled = [key for key, item in parameters.items() if isinstance(item, Distribution)]
        sample = self.sample(table["sample"]) if "sample" in table else None
        if sampled and sample is None:
            raise self.fail(
                f"[param] {sampled[0]} is a distribution; say how often it is sampled: "
                "[sample] count = 100"
            )
        if sample is not None and not sampled:
            raise self.fail("[sample] without a distribution in [param]; give one or drop [sample]")
        reference = self.reference(table["reference"]) if "reference" in table else None
        if "signals" in table and reference is None:
            raise self.fail(
                "signals are compared with a reference run, and there is none; give reference = "
                '"finest" or [reference], or name signals whose recording you want in keep'
            )
        return Study(
            name=name,
            scenarios=self.texts("scenario", table["scenario"]),
            folder=folder,
            text=str(table.get("description", "")),
            runs=self.texts("runs", table["runs"]) if "runs" in table else (),
            variants={
                key: self.texts(f"[set] {key}", value)
                for key, value in table.get("set", {}).items()
            },
            parameters=parameters,
            algorithms=self.algorithms(table["algorithm"]) if "algorithm" in table else (),
            steps=self.steps(table["step"]) if "step" in table else (),
            duration=self.positive("duration", table["duration"]) if "duration" in table else None,
            period=self.positive("period", table["period"]) if "period" in table else None,
            combine=combine,
            sample=sample,
            keep=self.texts("keep", table["keep"]) if "keep" in table else (),
            signals=self.texts("signals", table["signals"]) if "signals" in table else (),
            reference=reference,
            repeats=self.count("repeats", table.get("repeats", 1), 1),
            reuse=reuse,
        )  # fmt: skip

    def flat(self, table: Mapping[str, Any]) -> dict[str, Any]:
        """`[param.gearbox] eta = ...` and `"gearbox.eta" = ...` alike; axes stay tables."""
        found: dict[str, Any] = {}
        for key, value in table.items():
            if isinstance(value, Mapping) and not set(value) & {"from", *DISTRIBUTIONS}:
                if not value:
                    raise self.fail(f"[param] {key} is an empty table; {_AXES}")
                found.update({f"{key}.{name}": item for name, item in self.flat(value).items()})
            else:
                found[key] = value
        return found

    # -- axes --------------------------------------------------------------------------------------

    def values(self, what: str, value: Any) -> tuple[Any, ...] | Distribution:
        if isinstance(value, list):
            if not value:
                raise self.fail(f"{what} is an empty list; leave the key out instead")
            return tuple(value)
        if not isinstance(value, Mapping):
            return (value,)
        kinds = [kind for kind in DISTRIBUTIONS if kind in value]
        if not kinds:
            return self.range(what, value)
        kind = kinds[0]
        self.only(value, {kind, *({"minimum", "maximum"} if kind == "normal" else ())}, what)
        pair = value[kind]
        if not isinstance(pair, list) or len(pair) != 2:
            form = "[mean, standard deviation]" if kind == "normal" else "[from, to]"
            raise self.fail(f"{what}: {kind} = {pair!r}; give {form}")
        first, second = (self.number(f"{what}: {kind}", item) for item in pair)
        if kind == "normal":
            self.positive(f"{what}: the standard deviation", second)
        elif not first < second:
            raise self.fail(
                f"{what}: {kind} goes from {first:g} to {second:g}; write them in order"
            )
        if kind == "log_uniform":
            self.positive(f"{what}: the lower end of log_uniform", first)
        low, high = (
            self.number(f"{what}: {key}", value[key]) if key in value else default
            for key, default in (("minimum", -math.inf), ("maximum", math.inf))
        )
        if not low < high:
            raise self.fail(f"{what}: minimum {low:g} is not below maximum {high:g}")
        return Distribution(kind, first, second, low, high)

    def range(self, what: str, value: Mapping[str, Any]) -> tuple[Any, ...]:
        self.only(value, {"from", "to", "count", "scale"}, what)
        missing = [key for key in ("from", "to", "count") if key not in value]
        if missing:
            raise self.fail(f"{what}: {missing[0]} is missing; {_AXES}")
        first, last = self.number(f"{what}: from", value["from"]), self.number(what, value["to"])
        count = self.count(f"{what}: count", value["count"], 2)
        scale = value.get("scale", "linear")
        if scale == "log":
            first = self.positive(f"{what}: from", first)
            last = self.positive(f"{what}: to", last)
            if not 0.0 < last / first < math.inf:
                raise self.fail(f"{what} goes from {first:g} to {last:g}, too far for one range")
            inner = [first * (last / first) ** (i / (count - 1)) for i in range(1, count - 1)]
        elif scale == "linear":
            inner = [first + (last - first) * i / (count - 1) for i in range(1, count - 1)]
        else:
            raise self.fail(f"{what}: scale = {scale!r} is not linear or log")
        return (first, *inner, last)

    def sample(self, table: Any) -> Sample:
        self.only(table, {"count", "method", "seed"}, "[sample]")
        method = table.get("method", METHODS[0])
        if method not in METHODS:
            raise self.fail(f"[sample] method = {method!r} is not one of {', '.join(METHODS)}")
        if "count" not in table:
            raise self.fail("[sample] count is missing")
        count = self.count("[sample] count", table["count"], 1)
        if method == "sobol" and count & (count - 1):
            below = 1 << (count.bit_length() - 1)
            raise self.fail(
                f"[sample] count = {count} is no power of 2, which a Sobol sequence needs to fill "
                f"its space evenly; give {below} or {2 * below}"
            )
        return Sample(
            count,
            method,
            self.count("[sample] seed", table.get("seed", 0), 0, 2**63 - 1),
        )

    def algorithms(self, value: Any) -> tuple[Algorithm, ...]:
        entries: Sequence[Any] = value if isinstance(value, list) else [value]
        return tuple(self.algorithm(entry) for entry in entries)

    def algorithm(self, entry: Any) -> Algorithm:
        if isinstance(entry, str):
            return Algorithm(entry)
        if not isinstance(entry, Mapping) or not isinstance(entry.get("name"), str):
            raise self.fail(
                f'algorithm {entry!r}: write "jacobi", or {{ name = "jacobi", extrapolation = 1 }}'
            )
        return Algorithm(entry["name"], {key: item for key, item in entry.items() if key != "name"})

    def steps(self, value: Any) -> tuple[float, ...]:
        return tuple(
            self.positive("step", item) for item in (value if isinstance(value, list) else [value])
        )

    def several_steps(self) -> None:
        steps = self.table.get("step")
        if not isinstance(steps, list) or len(set(map(repr, steps))) < 2:
            raise self.fail('reference "finest" needs a list of at least two steps in step')

    def reference(self, value: Any) -> ReferenceRun:
        if value == FINEST:
            self.several_steps()
            return ReferenceRun(finest=True)
        if not isinstance(value, Mapping):
            raise self.fail(
                f'reference = {value!r}: write "finest", or a table [reference] with '
                f"{', '.join(sorted(REFERENCE_KEYS))}"
            )
        self.only(value, REFERENCE_KEYS, "[reference]")
        if not value:
            raise self.fail("[reference] is empty; say in what the reference run differs")
        step = value.get("step")
        if step == FINEST:
            self.several_steps()
        return ReferenceRun(
            finest=step == FINEST,
            variants={
                key: self.texts(f"[reference] set {key}", item)[0]
                for key, item in value.get("set", {}).items()
            },
            parameters=flatten(value.get("param", {})),
            algorithm=self.algorithm(value["algorithm"]) if "algorithm" in value else None,
            step=None if step in (None, FINEST) else self.positive("[reference] step", step),
        )


_AXES = (
    "write a number, a list, { from = 0.1, to = 1.0, count = 5 }, { uniform = [0.1, 1.0] }, "
    "{ log_uniform = [0.1, 1.0] } or { normal = [1.0, 0.1] }"
)
