"""Runs of a data set to be: their purposes, and what their parts are called."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError, listing
from .grouping import plain, without
from .inspect import FileReport, TopicReport


@dataclass(frozen=True)
class Part:
    """A topic of a run.

    Attributes:
        path: of its file.
        plain: whether a mapping can read the file as it is.
        report: what is in it.
    """

    path: Path
    plain: bool
    report: TopicReport


@dataclass(frozen=True)
class Run:
    """A run of a data set to be.

    Attributes:
        name: of the run.
        purpose: identification or validation.
        parts: by key; a single one is called "".
    """

    name: str
    purpose: str
    parts: Mapping[str, Part]


def purposes(names: Sequence[str], validation: Sequence[str]) -> dict[str, str]:
    """Purpose of each run: the last of several validates, if none is named.

    Raises:
        InputError: a run that there is not, or none is left to be fitted.
    """
    chosen = list(validation) or ([names[-1]] if len(names) > 1 else [])
    for name in chosen:
        if name not in names:
            raise InputError(f"--validation {name}: there is no such run; {listing(names, name)}")
    if set(chosen) == set(names):
        raise InputError("--validation names all runs; leave one that is fitted")
    return {name: "validation" if name in chosen else "identification" for name in names}


def parts_of(run: str, files: Sequence[FileReport]) -> dict[str, Part]:
    """The parts of a run by key: what is left of the files' or topics' names."""
    items = [
        (file, topic, topic.topic.name) for file in files for topic in file.topics
    ]  # fmt: skip
    if len(items) == 1:
        file, topic, _ = items[0]
        return {"": Part(file.source.path, file.source.plain, topic)}
    found: dict[str, Part] = {}
    for file, topic, name in items:
        short = without(name, run) if file.source.plain else plain(name)
        key = next(k for k in (short, *(f"{short}_{i}" for i in range(2, 999))) if k not in found)
        found[key] = Part(file.source.path, file.source.plain, topic)
    return found


def check_alike(runs: Sequence[Run]) -> None:
    """Refuse runs whose parts have other names.

    Raises:
        InputError: with both.
    """
    first = runs[0]
    for run in runs[1:]:
        if set(run.parts) != set(first.parts):
            here, there = (", ".join(sorted(r.parts)) or "one table" for r in (run, first))
            raise InputError(
                f"run {run.name} has the parts {here}, but run {first.name} has {there}; name "
                "files alike in all runs (RUN_cmd.csv, RUN_pose.csv), or choose topics with --topic"
            )
