"""From a study to its runs: FMUs found, every name and value checked, each run with a key.

Nothing is run here, and no FMU is created.
"""

from __future__ import annotations

import hashlib
import json
import platform
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..data.comparison import common_unit
from ..errors import ScenarioError, UnknownNameError, VariantError, listing
from ..files import atomic
from ..running.preparation import adjusted
from ..running.runner import Prepared, find_runs, prepare
from ..scenario.scenario import Scenario
from ..spec import distribution
from ..system.inputs import overruled
from ..system.provider import Provider
from ..system.system import System
from .definition import Study
from .design import Point, points, reference_of

FORMAT = 1
"""Of the result files; another one makes all results anew."""


class Found:
    """A provider that remembers what it found, and can be sent to another process.

    Args:
        inner: asked for what is not known yet; stays behind when this is sent.
    """

    def __init__(self, inner: Provider | None) -> None:
        self.inner = inner
        self.paths: dict[str, Path] = {}

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU."""
        if variant not in self.paths:
            if self.inner is None:
                raise VariantError(f"{variant!r} was not needed when the study was planned")
            self.paths[variant] = Path(self.inner.path(variant)).resolve()
        return self.paths[variant]

    def pin(self, folder: Path) -> None:
        """Copy what was found, so that a build meanwhile does not change the study's FMUs."""
        for variant, path in self.paths.items():
            content = path.read_bytes()
            digest = hashlib.sha256(content).hexdigest()
            target = folder.resolve() / digest[:16] / path.name
            if not target.exists():
                with atomic(target) as temporary:
                    temporary.write_bytes(content)
            self.paths[variant] = target

    def __getstate__(self) -> dict[str, Any]:
        return {"inner": None, "paths": dict(self.paths)}


@dataclass(frozen=True, eq=False)
class Group:
    """Runs that differ in parameters only: the same instances can make them all.

    Attributes:
        scenario: with the study's algorithm, step and signals.
        variants: short forms.
        base: folder against which .fmu paths among them are taken.
        wanted: signals whose recordings are kept.
        repeats, reuse: as of `Study`.
        parts: hashes of all that determines its results besides the runs' parameters, by name.
    """

    scenario: Scenario
    variants: Mapping[str, str]
    base: Path
    wanted: tuple[str, ...]
    repeats: int
    reuse: bool
    parts: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def digest(self) -> str:
        """Hash of the parts."""
        return _hash(dict(self.parts))

    def prepare(self, provider: Provider | None, isolate: float | None = None) -> Prepared:
        """Open its FMUs and connect them."""
        return prepare(
            self.scenario, provider, variants=self.variants, base=self.base, isolate=isolate
        )

    def channels(self, prepared: Prepared) -> tuple[str, ...]:
        """Full scalar names of the kept signals that its variants have."""
        system = prepared.master.system
        names = [name for name in prepared.record if name in self.wanted]
        return tuple(dict.fromkeys(item for name in names for item in system.elements(name)))

    def fingerprint(self, prepared: Prepared) -> dict[str, str]:
        """Hashes of all that determines its results besides the runs' parameters, by name."""
        scenario, master, outline = prepared.scenario, prepared.master, prepared.outline()
        members = master.system.members.values()
        columns = np.ascontiguousarray(outline.external.T)
        parts: dict[str, Any] = {
            "format": FORMAT,
            **{f"version of {name}": value for name, value in versions().items()},
            **{f"FMU of {member.name}": member.fmu.digest for member in members},
            "parameters": {member.name: member.parameters for member in members},
            "connections": [
                [member.name for member in members],
                [list(asdict(c).values()) for c in master.system.connections],
            ],
            "algorithm": [master.algorithm, master.options, master.tolerance],
            "times": [scenario.start, scenario.duration, master.step, prepared.every],
            "signals": [outline.observed, self.channels(prepared)],
            **{
                f"input {name}": _bytes(column)
                for name, column in zip(outline.signals, columns, strict=True)
            },
            **{
                f"reference {name}": [r.signals, r.unit, _bytes(r.times), _bytes(r.values)]
                for name, r in scenario.references.items()
            },
            "checks": [asdict(check) for check in scenario.checks],
            "making": [self.repeats, self.reuse],
        }
        return {name: _hash(_plain(part)) for name, part in parts.items()}


@dataclass(frozen=True, eq=False)
class Task:
    """One run of a study.

    Attributes:
        key: hash of all that determines it; the name of its result file.
        group: what it shares with others.
        point: what it is made with; parameters that its variants lack are left out.
        reference: key of the run that it is compared with, "" for none.
        designed: whether the study asks for it; else it is a reference run only.
        notes: what was left out.
    """

    key: str
    group: Group
    point: Point
    reference: str
    designed: bool
    notes: tuple[str, ...]

    @property
    def label(self) -> str:
        """What it is made with, in one line."""
        point = self.point
        parts = [f"{name}={value}" for name, value in point.variants.items()]
        parts += [str(point.algorithm)] if point.algorithm else []
        parts += [f"{point.step:g} s"] if point.step else []
        parts += [f"{name}={_short(value)}" for name, value in point.parameters.items()]
        return ", ".join([point.scenario, *parts])


@dataclass(frozen=True)
class StudyPlan:
    """What a study runs.

    Attributes:
        study: what was planned.
        tasks: by key, in the order of the study, reference runs that nobody asked for last.
        signals: what is compared with the reference runs.
        provider: where the FMUs are.
        points: key of the run of each point of the study; some may be the same run.
        single: instances whose FMU allows one instance per process only.
    """

    study: Study
    tasks: Mapping[str, Task]
    signals: tuple[str, ...]
    provider: Found
    points: tuple[str, ...]
    single: tuple[str, ...] = ()


def plan_study(study: Study, provider: Provider | None) -> StudyPlan:
    """Find the FMUs of a study (building those that are missing), check it, list its runs.

    Raises:
        InputError: wrong names, variants or values (see the subclasses).
    """
    found = Found(provider)
    runs = _scenarios(study)
    signals = _signals(study, runs)
    asked = points(study, list(runs))
    compared = [reference_of(point, study) for point in asked] if study.reference else []
    everything = [*asked, *compared]
    single: dict[str, None] = {}
    keys, details = _keys(study, runs, everything, signals, found, single)
    tasks: dict[str, Task] = {}
    for index, key in enumerate(keys):
        if key in tasks:
            continue
        group, parameters, notes = details[index]
        designed = index < len(asked)
        reference = keys[len(asked) + index] if designed and compared else ""
        point = replace(everything[index], parameters=parameters)
        tasks[key] = Task(key, group, point, reference, designed, notes)
    return StudyPlan(study, tasks, signals, found, tuple(keys[: len(asked)]), tuple(single))


def _scenarios(study: Study) -> dict[str, Scenario]:
    """All runs of the study's scenarios, by full name."""
    found: dict[str, Scenario] = {}
    known: list[str] = []
    for name in study.scenarios:
        is_file = name.endswith((".toml", ".ssp", ".ssd"))
        place = str(study.folder / name) if is_file else name
        step = study.steps[0] if study.steps else None
        items = find_runs(place, None, study.duration, step)[3]
        known += [run for run in items if run]
        for run, item in items.items():
            if study.runs and run not in study.runs:
                continue
            if item.name in found:
                raise ScenarioError(
                    f"{study.name}: scenario {name!r} brings a second run {item.name!r}; "
                    "name it once"
                )
            found[item.name] = item
    for run in study.runs:
        if run not in known:
            raise UnknownNameError(
                f"{study.name}: no scenario has a run {run!r}; {listing(known, run)}"
            )
    return found


def _signals(study: Study, runs: Mapping[str, Scenario]) -> tuple[str, ...]:
    if study.reference is None:
        return ()
    compared = dict.fromkeys(
        name
        for item in runs.values()
        for reference in item.references.values()
        for name in reference.signals
    )
    signals = study.signals or tuple(compared) or study.keep
    if not signals:
        raise ScenarioError(
            f"{study.name}: a reference run is given, but no signal to compare with it; give "
            'signals = ["instance.variable"]'
        )
    return signals


def _group(study: Study, item: Scenario, point: Point, signals: tuple[str, ...]) -> Group:
    algorithm = point.algorithm
    item = adjusted(
        item,
        algorithm.name if algorithm else None,
        algorithm.options if algorithm else None,
        point.step,
        study.duration,
    )
    period = study.period or item.period
    if period is None and study.reference and len(study.steps) > 1:
        period = max(study.steps)  # the same instants for all, so that nothing is interpolated
    wanted = tuple(dict.fromkeys([*study.keep, *signals]))
    item = replace(item, period=period, record=wanted, plot=None, plots=())
    return Group(item, point.variants, study.folder, wanted, study.repeats, study.reuse)


Detail = tuple[Group, dict[str, Any], tuple[str, ...]]


def _keys(
    study: Study,
    runs: Mapping[str, Scenario],
    everything: list[Point],
    signals: tuple[str, ...],
    provider: Found,
    single: dict[str, None],
) -> tuple[list[str], list[Detail]]:
    """Key of each point, and its group, parameters that it has, and notes on those it lacks."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    for index, point in enumerate(everything):
        groups.setdefault(point.group, []).append(index)
    keys = [""] * len(everything)
    details: dict[int, Detail] = {}
    missing: dict[str, UnknownNameError] = {}
    present: set[str] = set()
    for members in groups.values():
        first = everything[members[0]]
        group = _group(study, runs[first.scenario], first, signals)
        prepared = group.prepare(provider)
        group = replace(group, parts=group.fingerprint(prepared))
        system = prepared.master.system
        driven = _driven(system, prepared.scenario.inputs)
        for name in (name for name in prepared.record if name in signals):
            elements = system.elements(name)  # a vector's distance is taken
            common_unit({item: system.unit(item) for item in elements}, elements)
        for member in system.members.values():
            if member.description.can("canBeInstantiatedOnlyOncePerProcess"):
                single[member.name] = None
        for index in members:
            kept, notes = {}, list(prepared.notes)
            for name, value in everything[index].parameters.items():
                try:
                    system.variables(name)
                except UnknownNameError as error:
                    missing.setdefault(name, error)
                    reference = prepared.variants.get(name.partition(".")[0], "this system")
                    notes.append(f"{name} is left out: {reference} has none")
                    continue
                system.set(name, value)
                if note := overruled(system, name, driven):
                    notes.append(note)
                present.add(name)
                kept[name] = value
            keys[index] = _hash({"group": group.digest, "parameters": _plain(kept)})
            details[index] = (group, kept, tuple(notes))
    for name, unknown in missing.items():
        if name not in present:
            raise unknown
    return keys, [details[index] for index in range(len(everything))]


def _driven(system: System, inputs: Iterable[str]) -> set[str]:
    """Full scalar names that inputs of a scenario drive; a run says which are wrong."""
    found: set[str] = set()
    for name in inputs:
        with suppress(UnknownNameError):
            found.update(system.first_name(element) for element in system.elements(name))
    return found


# -- hashes ----------------------------------------------------------------------------------------


@lru_cache
def versions() -> dict[str, str]:
    """Versions that determine results; `code` changes with every file of this package."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*")):
        if path.suffix in (".py", ".c", ".h"):
            digest.update(path.relative_to(root).as_posix().encode() + b"\0")
            digest.update(path.read_bytes())
    return {
        "cosim": distribution.version(),
        "code": digest.hexdigest(),
        "numpy": np.__version__,
        "machine": f"{sys.platform} {platform.machine()}",
    }


def _plain(value: Any) -> Any:
    """Numbers as floats, so that 1 and 1.0 are the same value."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value


def _bytes(values: Any) -> str:
    return hashlib.sha256(np.ascontiguousarray(values, dtype=np.float64).tobytes()).hexdigest()


def _hash(content: Any) -> str:
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:40]


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
