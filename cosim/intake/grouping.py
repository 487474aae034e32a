"""Which files are a run of their own and which are parts of one, by their columns and names."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Literal

from ..errors import InputError

FilesAre = Literal["", "runs", "parts"]
Columns = frozenset[str]
ALIKE = 0.5
"""Share of the columns of the smaller of two files above which both hold the same."""
_PLAIN = re.compile(r"[^A-Za-z0-9_]+")
_TOKEN = re.compile(r"\d+|[^\W\d_]+")


@dataclass(frozen=True)
class Grouping:
    """Files by run.

    Attributes:
        runs: files by the name of their run.
        said: what the files were taken for and how to say otherwise, "" where nothing was guessed.
    """

    runs: dict[str, list[Path]]
    said: str = ""


def plain(name: str) -> str:
    """A name that can be a key: letters, digits and underscores."""
    return _PLAIN.sub("_", name).strip("_") or "log"


def tokens(name: str) -> list[str]:
    """Words and numbers of a name, one by one."""
    return _TOKEN.findall(name)


def without(name: str, run: str) -> str:
    """The name of a file without that of its run, wherever that stands in it."""
    spans, sought = list(_TOKEN.finditer(name)), tokens(run)
    for first in range(len(spans) - len(sought) + 1):
        found = spans[first : first + len(sought)]
        if sought and [match.group() for match in found] == sought:
            return plain(name[: found[0].start()].rstrip("_-. ") + name[found[-1].end() :])
    return plain(name)


def grouped(
    files: Sequence[Path],
    runs: Mapping[str, Sequence[Path]],
    columns: Callable[[Path], Columns],
    files_are: FilesAre = "",
) -> Grouping:
    """Files by run.

    Files that no run names and that have the same columns are different runs. Those with different
    columns are parts of a run where the rest of their names is the same: `a_cmd.csv a_pose.csv
    b_cmd.csv b_pose.csv` are the runs a and b.

    Args:
        files: without a run.
        runs: files by the name of their run, as given.
        columns: what is in a file, without its clock; asked for where there are several files.
        files_are: each file is a run, or all are parts of one; what seems right if not given.

    Raises:
        InputError: two runs of one name, a run without one of the parts, or nothing at all.
    """
    given = {name: list(paths) for name, paths in runs.items()}
    if not files and not given:
        raise InputError("no files to import; name some, or give --run NAME=FILE,FILE")
    if len(files) < 2 or files_are == "runs":
        return Grouping(given | _alone(files, given))
    if files_are == "parts":
        return Grouping(given | {_shared(files, given): list(files)})
    kinds = _kinds(files, columns)
    if len(kinds) == 1:
        found = _alone(files, given)
        said = f"{len(files)} runs of one file each, since all have the same columns"
        return Grouping(given | found, _said(found, said, "--files-are parts if they are one run"))
    if all(len(kind) == 1 for kind in kinds):
        name = _shared(files, given)
        said = f"the {len(files)} parts of one run, since they have different columns"
        return Grouping(
            given | {name: list(files)},
            _said([name], said, "--files-are runs if each is a run of its own"),
        )
    found = _matched(kinds, given)
    said = f"{len(found)} runs of {len(kinds)} files each, by their columns and names"
    return Grouping(given | found, _said(found, said, "--run NAME=FILE,FILE says it yourself"))


def _said(names: Sequence[str] | Mapping[str, object], what: str, otherwise: str) -> str:
    return f"the files are taken for {what} ({', '.join(names)}); {otherwise}"


def _alone(files: Sequence[Path], given: Mapping[str, object]) -> dict[str, list[Path]]:
    """Each file as a run.

    Raises:
        InputError: two have one name.
    """
    found: dict[str, list[Path]] = {}
    for path in files:
        name = plain(path.stem)
        if name in found or name in given:
            raise InputError(
                f"{path}: there is a run {name!r} already; name it with --run NAME=FILE"
            )
        found[name] = [path]
    return found


def _shared(files: Sequence[Path], given: Mapping[str, object]) -> str:
    """What the names of all files begin with, as a name of a run."""
    name = plain("_".join(_common([tokens(path.stem) for path in files])) or "run")
    if name in given:
        raise InputError(f"there is a run {name!r} already; name these files with --run NAME=FILE")
    return name


def _kinds(files: Sequence[Path], columns: Callable[[Path], Columns]) -> list[list[Path]]:
    """Files that hold the same, together."""
    kinds: list[tuple[Columns, list[Path]]] = []
    for path in files:
        has = columns(path)
        for others, paths in kinds:
            if has == others or len(has & others) > ALIKE * min(len(has), len(others)):
                paths.append(path)
                break
        else:
            kinds.append((has, [path]))
    return [paths for _, paths in kinds]


def _matched(kinds: Sequence[Sequence[Path]], given: Mapping[str, object]) -> dict[str, list[Path]]:
    """Runs with a file of each kind: those whose names differ alike.

    Raises:
        InputError: a file has no partner, or two have one name.
    """
    shared = _common([tokens(path.stem) for paths in kinds for path in paths])
    several = [_keys(paths, shared) for paths in kinds if len(paths) > 1]
    known = list(dict.fromkeys(name for of_kind in several for name in of_kind))
    lone = [_lone(paths[0], known) for paths in kinds if len(paths) == 1]
    named = several + lone
    found: dict[str, list[Path]] = {}
    for name in dict.fromkeys(name for of_kind in named for name in of_kind):
        paths = [path for of_kind in named for path in of_kind.get(name, ())]
        if len(paths) != len(kinds) or any(len(of_kind.get(name, ())) != 1 for of_kind in named):
            what = " | ".join(
                ", ".join(path.name for path in paths) for paths in kinds
            )  # fmt: skip
            raise InputError(
                f"by their columns the files are of {len(kinds)} kinds: {what}; run {name!r} would "
                f"be {', '.join(path.name for path in paths)}. Name files alike in all runs "
                "(RUN_cmd.csv, RUN_pose.csv), leave out those without a partner, or say which "
                "belong together with --run NAME=FILE,FILE, or that each is a run with "
                "--files-are runs"
            )
        if name in given:
            raise InputError(
                f"{paths[0]}: there is a run {name!r} already; name it with --run NAME=FILE,FILE"
            )
        found[name] = paths
    return found


def _keys(paths: Sequence[Path], shared: Sequence[str]) -> dict[str, list[Path]]:
    """Files of one kind by what only their own names have, after what all files' names have."""
    split = [tokens(path.stem) for path in paths]
    begin = _common(split)
    end = _common([part[len(begin) :][::-1] for part in split])
    found: dict[str, list[Path]] = {}
    for path, part in zip(paths, split, strict=True):
        own = part[len(begin) : len(part) - len(end)]
        at_begin = [*shared, *own] if len(begin) == len(shared) else own
        found.setdefault(plain("_".join(at_begin)), []).append(path)
    return found


def _lone(path: Path, known: Sequence[str]) -> dict[str, list[Path]]:
    """The only file of its kind, by the run of the other kinds that its name has in it."""
    name = next((run for run in known if without(path.stem, run) != plain(path.stem)), "")
    return {name or plain(path.stem): [path]}


def _common(lists: Sequence[Sequence[str]]) -> list[str]:
    """What all lists begin with."""
    alike = takewhile(lambda items: len(set(items)) == 1, zip(*lists, strict=False))
    return [items[0] for items in alike]
