"""Reads a data set and the mapping of its rig to a system: the parts of a calibration problem.

`dataset.toml` (docs/datasets.md has the schema) says which system describes the rig, which
variables the sheet's parameters set, which columns drive inputs, and what each measured column is
in the model. It is looked for in the data set's folder, above it, and among the scenarios by its
`rig`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ..data.logs import DataSet, read_data_set, runs_of
from ..errors import InputError, ScenarioError, UnknownNameError, listing
from ..files import exists, is_file, read_toml
from ..installation import builder, places
from ..installation.examples import example_sets, named_mappings, read_mapping
from ..system.provider import Provider
from ..system.toml import SystemFile, read_system
from ..system.variants import apply
from .joining import Joined
from .parts import Parameter
from .problem import Problem
from .schema import check_mapping


def _folder(given: Path) -> Path:
    """The folder of a data set, which may be named as one that comes with cosim."""
    if exists(given):
        return given
    known = example_sets()
    if str(given) in known:
        return known[str(given)]
    here = sorted(path.name for path in given.parent.glob("[!.]*") if path.is_dir())
    if len(given.parts) > 1:
        beside = f"; beside it {listing(here, given.name)}" if here else ""
        raise ScenarioError(f"{given}: there is no such folder{beside}")
    raise UnknownNameError(
        f"{given}: there is no such folder, and no data set of this name comes with cosim; "
        f"{listing([*known, *here], str(given))}"
    )


def _mapping(given: Path) -> Path:
    """A mapping file, which may be named as one that comes with cosim."""
    if exists(given) or given.suffix == ".toml":
        return given
    known = named_mappings()
    if given.as_posix() not in known:
        raise UnknownNameError(
            f"there is no mapping {given.as_posix()!r}; {listing(known, given.as_posix())}, or "
            "give the path of a dataset.toml"
        )
    return known[given.as_posix()]


def find_mapping(folder: Path, rig: str) -> Path:
    """The `dataset.toml` for a data set.

    Raises:
        ScenarioError: there is none.
    """
    for place in (folder, folder.parent, folder.parent.parent):
        if (place / "dataset.toml").is_file():
            return place / "dataset.toml"
    known = []
    for path in sorted(places.scenarios().rglob("dataset.toml")) if rig else ():
        name = str(read_toml(path).get("rig", path.parent.name))
        if name == rig:
            return path
        known.append(name)
    if not rig:
        raise ScenarioError(
            f"{folder}: has no set.toml that names a rig, and there is no dataset.toml in it nor "
            "in the two folders above; make one of logs with `cosim data import LOGS --system "
            "SYSTEM` (docs/own_logs.md), write one (docs/datasets.md), or name one with --mapping"
        )
    raise ScenarioError(
        f"{folder}: no dataset.toml says how rig {rig!r} maps to a system; {listing(known, rig)}; "
        "write one beside the data"
    )


def find_system(path: Path, name: str) -> SystemFile:
    """The system that a mapping names.

    Raises:
        UnknownNameError: there is none.
    """
    files = [path.parent / name] if name.endswith(".toml") else []
    for folder in (path.parent, *path.parents, places.scenarios()):
        files.append(folder / "systems" / f"{name}.toml")
    for file in files:
        if is_file(file):
            return read_system(file)
    known = [item.stem for item in sorted((places.scenarios() / "systems").glob("*.toml"))]
    beside = [item.name for item in sorted(path.parent.glob("*.toml")) if item != path]
    # a path means a file: what comes with cosim is no help where there are files
    known = beside if beside and name.endswith(".toml") else [*beside, *known]
    raise UnknownNameError(f"{path}: there is no system {name!r}; {listing(known, name)}")


def read_problem(
    folder: Path | str,
    provider: Provider | None = None,
    *,
    mapping: Path | str | None = None,
    system: str | None = None,
    only: Mapping[str, Any] | None = None,
) -> Problem:
    """Read a data set as a calibration problem.

    Args:
        folder: with `set.toml`, or the name of a set that comes with cosim.
        provider: where variants come from; builds them if not given.
        mapping: a `dataset.toml`, or the name of one that comes with cosim; looked for if not
            given.
        system: another system than the mapping's, with the same instances.
        only: entries that the runs must have, besides those of the mapping's `only`.

    Raises:
        ScenarioError, UnknownNameError: a file or a name in it is wrong.
    """
    return read_joined(folder, provider, mapping=mapping, system=system, only=only)[1]


def read_joined(
    folder: Path | str,
    provider: Provider | None = None,
    *,
    mapping: Path | str | None = None,
    system: str | None = None,
    only: Mapping[str, Any] | None = None,
) -> tuple[Joined, Problem]:
    """A problem as of `read_problem`, and what made it of mapping and data.

    Raises:
        ScenarioError, UnknownNameError: as of `read_problem`.
    """
    if provider is None:
        provider = builder.default_provider()
    folder = _folder(Path(folder))
    has_set = (folder / "set.toml").is_file()
    rig = str(read_toml(folder / "set.toml").get("rig", "")) if has_set else ""
    path = _mapping(Path(mapping)) if mapping is not None else find_mapping(folder, rig)
    table = read_mapping(path)
    check_mapping(table, path)
    used = _asked(table)
    data = read_data_set(folder, used) if has_set else _plain(folder, path, table, used)
    file = find_system(path, system or str(table.get("system", "")))
    further = [
        partial(read_problem, folder, provider, mapping=path.parent / name, only=only)
        for name in table.get("further", [])
    ]
    with _named(path, folder):
        file = _arranged(file, table, provider)
        joined = Joined(path, table, data, only or {})
        problem = joined.problem(file, provider).changed(further=further)
        _set_once(problem)
        _outputs(problem)
    return joined, problem


def _arranged(file: SystemFile, table: Mapping[str, Any], provider: Provider) -> SystemFile:
    """The system without what the logs stand for, in the variants that the mapping names."""
    file = file.without(table.get("without", ()))
    folder = file.path.parent
    return replace(
        file, instances=apply(file.instances, table.get("variants", {}), provider, folder)
    )


def _set_once(problem: Problem) -> None:
    """Refuse two parameters that set the same variable in the same run: the last one would win."""
    setting: dict[str, list[Parameter]] = {}
    for parameter in problem.parameters:
        for target, _ in parameter.targets:
            for other in setting.setdefault(target, []):
                if not (other.run and parameter.run and other.run != parameter.run):
                    raise ScenarioError(
                        f"parameters {other.name!r} and {parameter.name!r} both set {target}; "
                        "take it out of the targets of one"
                    )
            setting[target].append(parameter)


def _outputs(problem: Problem) -> None:
    """Refuse channels whose signal is an open input: the model would be compared with its cause."""
    system = problem.plain()
    inputs = set(system.open_inputs())
    for channel in problem.channels:
        if channel.signal in inputs:
            raise ScenarioError(
                f"channel {channel.name}: signal {channel.signal} is an input of the system, which "
                f"tells what drives it and nothing of the model; {listing(system.signals(), '')}"
            )


@contextmanager
def _named(path: Path, folder: Path) -> Iterator[None]:
    """Errors that name no file of the data set are about the mapping."""
    try:
        yield
    except InputError as error:
        if str(path) in str(error) or str(folder) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


def _asked(table: Mapping[str, Any]) -> set[str]:
    """Entries of runs that a mapping asks for."""
    wanted = [*table.get("starts", {}), *table.get("only", {})]
    for key in ("parameter", "nuisance"):
        wanted += [
            item["nominal"] for item in table.get(key, []) if isinstance(item["nominal"], str)
        ]
    return {name.removeprefix("begin:").partition("[")[0] for name in wanted}


def _plain(folder: Path, path: Path, table: Mapping[str, Any], used: set[str]) -> DataSet:
    """A data set of plain logs, whose runs the mapping lists."""
    runs = table.get("run", [])
    if not runs:
        raise ScenarioError(
            f"{folder}: has no set.toml, and {path} lists no runs "
            "([[run]] with name, file, purpose)"
        )
    found = runs_of(runs, folder, str(path), used)
    return DataSet(folder, folder.resolve().name, "", found, {}, {}, {}, file=path)
