"""Logs become a data set: a folder with the logs and a mapping with comments to a system."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from ..calibrate.checks.examine import examine
from ..calibrate.checks.finding import Finding
from ..calibrate.mapping import find_system, read_problem
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import InputError, UnknownNameError
from ..files import make_folder, write_text
from ..installation import places
from ..system.provider import Provider
from ..system.toml import SystemFile, read_system
from .draft import Draft
from .drafting import columns_of, draft_of, layout
from .files import place
from .given import take
from .guess import Guess
from .inspect import FileReport, check_clock, inspect
from .matching import Column, Match, Matches, Place, candidates, guess, places_of
from .refine import add_parameters, add_starts, choose_steps, short
from .runs import Run, check_alike, parts_of

NAME = "dataset.toml"


class Asker(Protocol):
    """Somebody who answers."""

    def column(self, place: Place, columns: Sequence[Column]) -> str:
        """The column that drives an input, as `--map` names it, or a number."""
        ...

    def variable(self, source: str, names: Sequence[str]) -> str:
        """The variable that a column is, "" for none of them."""
        ...

    def unit(self, match: Match) -> str:
        """The unit of a column."""
        ...


def _silent(text: str) -> None:
    """Nobody looks."""


@dataclass(frozen=True)
class Wishes:
    """What the user says.

    Attributes:
        system: name or path of the system.
        maps: as of `--map`.
        parameters: as of `--parameter`.
        topics: only these.
        clock: column of times, where it is not found.
        received: of bags, take the times of recording instead of the stamps in headers.
        window: [s] of the pieces that runs are cut into, 0 for whole runs.
        late: [s] by which the clocks of parts are late, where that is known.
    """

    system: str
    maps: Sequence[str] = ()
    parameters: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    topics: Sequence[str] = ()
    clock: str = ""
    window: float = 0.0
    received: bool = False
    late: Mapping[str, float] = field(default_factory=dict)


class Inspected:
    """What is in files, each read once.

    Args:
        wishes: topics and clock.
        told: is told which file is being read.
    """

    def __init__(self, wishes: Wishes, told: Callable[[str], None] = _silent) -> None:
        self._wishes, self._told = wishes, told
        self._found: dict[Path, FileReport] = {}

    def __call__(self, path: Path) -> FileReport:
        """What is in a file.

        Raises:
            ScenarioError: it cannot be read.
        """
        if path not in self._found:
            self._told(f"reading {path}")
            wishes = self._wishes
            self._found[path] = inspect(path, wishes.topics, wishes.clock, wishes.received)
        return self._found[path]

    def columns(self, path: Path) -> frozenset[str]:
        """Columns of a file without clocks."""
        return self(path).column_names()


@dataclass(frozen=True)
class Imported:
    """What was written.

    Attributes:
        folder: of the data set.
        matches: which column is which variable.
        columns: all that there are.
        findings: of the checks before a fit.
        notes: what was assumed.
        runs: with their purposes.
        parameters: that are estimated.
    """

    folder: Path
    matches: Matches
    columns: Sequence[Column]
    findings: Sequence[Finding]
    notes: Sequence[str]
    runs: Sequence[Run]
    parameters: Sequence[str]


def import_logs(
    files: Mapping[str, Sequence[Path]],
    purposes: Mapping[str, str],
    wishes: Wishes,
    folder: Path,
    provider: Provider,
    ask: Asker | None = None,
    told: Callable[[str], None] = _silent,
    inspected: Inspected | None = None,
) -> Imported:
    """Write a data set.

    Args:
        files: by run.
        purposes: by run.
        wishes: what the user says.
        folder: to write.
        provider: where variants come from.
        ask: is asked for what is missing; an error lists it if not given.
        told: is told what is being done.
        inspected: files that are read already.

    Raises:
        InputError: what is missing or does not fit, with the flag to give.
        UnknownNameError: no file has the clock that is wished.
    """
    if (folder / NAME).exists():
        raise InputError(
            f"{folder / NAME}: is there already; choose another folder with --out, or delete it"
        )
    file = _system(wishes.system)
    system = file.build(provider)
    inspected = inspected or Inspected(wishes, told)
    runs = [
        Run(name, purposes[name], parts_of(name, [inspected(path) for path in paths]))
        for name, paths in files.items()
    ]
    check_clock([inspected(path) for paths in files.values() for path in paths], wishes.clock)
    check_alike(runs)
    variables = places_of(system)
    columns = columns_of(runs)
    matches = _matched(columns, variables, wishes, ask)
    runs = _used(runs, matches)
    plan = layout(runs, matches, wishes.window, wishes.late)
    make_folder(folder)
    stored = place(runs, folder, plan.whole)
    said = _system_entry(file, folder, wishes.system)
    # templates call every system file `system.toml`
    known = file.path.resolve().parent.name if file.name == "system" else file.name
    head = (
        f"Made by `cosim data import` from {sum(len(paths) for paths in files.values())} files for "
        f"the system {known}. It is yours: correct what you know better. docs/datasets.md says "
        "what each key means."
    )
    draft = draft_of(runs, matches, stored, plan, said, head)
    unfinished = folder / f"unfinished_{NAME}"
    try:
        notes = _refined(draft, unfinished, provider, plan.late, wishes, told)
    finally:
        unfinished.unlink(missing_ok=True)
    write_text(folder / NAME, draft.text())
    if lost := [column.name for column in draft.columns if "missing" in column.keys]:
        notes.append(
            f"{', '.join(lost)}: rows that are exactly 0 together count as no value (missing = 0): "
            "what a sensor writes that has lost its object"
        )
    told("checking the data set")
    problem = read_problem(folder, provider)
    findings = examine(Simulator(problem))
    estimated = [str(entry.keys["name"]) for entry in draft.parameters]
    return Imported(
        folder,
        matches,
        columns,
        findings,
        notes,
        runs,
        estimated,
    )


def _system(name: str) -> SystemFile:
    """A system by its path, its name among the systems, or that of the scenario that has it.

    Raises:
        UnknownNameError: there is none.
    """
    path = Path(name)
    if path.suffix == ".toml":
        return read_system(path)
    own = places.scenarios() / name / "system.toml"
    if own.is_file():
        return read_system(own)
    try:
        return find_system(Path("--system").resolve(), name)
    except UnknownNameError as error:
        text = str(error).partition(": ")[2]
        raise UnknownNameError(
            f"--system {name}: {text}; or give the path of a .toml file"
        ) from None


def _system_entry(file: SystemFile, folder: Path, name: str) -> str:
    """What the mapping says as its system: a copy beside it, or where it is."""
    shared = places.scenarios() / "systems"
    if file.path.resolve().parent == shared.resolve():
        return file.path.stem
    if any(reference.endswith(".fmu") for reference in file.instances.values()):
        return Path(os.path.relpath(file.path.resolve(), folder.resolve())).as_posix()
    target = folder / "system.toml"
    if file.path.resolve() != target.resolve():
        shutil.copyfile(file.path, target)
    return target.name


def _matched(
    columns: Sequence[Column], variables: Sequence[Place], wishes: Wishes, ask: Asker | None
) -> Matches:
    """Columns as variables: as given, by guess, and as answered."""
    matches = take(wishes.maps, columns, variables)
    guess(columns, variables, matches)
    if ask is not None:
        matches = _asked(matches, columns, variables, wishes, ask)
    if matches.open:
        raise InputError(_lacking(matches, columns))
    if not matches.channels:
        raise InputError(_nothing_measured(matches))
    if without := _without_unit(matches):
        lines = [
            f"  --map '{m.column.source}={m.place.name}:UNIT'  ({m.column.unit.reason}; "
            f"{m.place.name} is in {m.place.unit})"
            for m in without
        ]
        raise InputError("units that nothing tells; give them:\n" + "\n".join(lines))
    return matches


def _asked(
    matches: Matches, columns: Sequence[Column], variables: Sequence[Place], wishes: Wishes,
    ask: Asker,
) -> Matches:  # fmt: skip
    """What was guessed, with what somebody answers about the rest."""
    answers = []
    for place_ in matches.open:
        left = [c for c in candidates(place_, columns) if c.source not in matches.used()]
        if answer := ask.column(place_, left):
            answers.append(f"{answer}={place_.name}")
    for source, names in matches.unsure.items():
        free = [n for n in names if not any(a.endswith(f"={n}") for a in answers)]
        if free and (answer := ask.variable(source, free)):
            answers.append(f"{source}={answer}")
    if answers:
        matches = take([*wishes.maps, *answers], columns, variables)
        guess(columns, variables, matches)
    for match in _without_unit(matches):
        unit = Guess(ask.unit(match), "answered", sure=True)
        into = matches.inputs if match.place.role == "input" else matches.channels
        into[match.place.name] = replace(match, column=replace(match.column, unit=unit))
    return matches


def _without_unit(matches: Matches) -> list[Match]:
    """Matches of columns whose unit is unknown, to variables that have one."""
    return [m for m in (*matches.inputs.values(), *matches.channels.values())
            if not m.column.unit.unit and m.place.unit not in ("", "1")]  # fmt: skip


def _nothing_measured(matches: Matches) -> str:
    lines = [
        "no column is matched to an output of the system, so nothing would be compared; give "
        "--map 'COLUMN=instance.output'"
    ]
    for source, names in matches.unsure.items():
        lines.append(f"  --map '{source}={names[0]}'  (or {', '.join(names[1:])})"
                     if names[1:] else f"  --map '{source}={names[0]}'")  # fmt: skip
    return "\n".join(lines)


def _lacking(matches: Matches, columns: Sequence[Column]) -> str:
    lines = ["inputs of the system that no column drives; give for each a column, or a number:"]
    taken = {m.column.source: f" (taken for {m.place.name})"
             for m in (*matches.inputs.values(), *matches.channels.values())}  # fmt: skip
    for place_ in matches.open:
        fit = ", ".join(c.source + taken.get(c.source, "") for c in candidates(place_, columns)[:6])
        fit = fit or "none"
        lines.append(
            f"  --map 'COLUMN={place_.name}'  ({place_.text or 'input'}, in "
            f"{place_.unit or '?'}; columns that fit by their unit: {fit}), or "
            f"--map '0={place_.name}' if it is constant"
        )
    return "\n".join(lines)


def _used(runs: Sequence[Run], matches: Matches) -> list[Run]:
    """The runs with the parts that hold a matched column."""
    used = {m.column.part for m in (*matches.inputs.values(), *matches.channels.values())}
    runs = [replace(run, parts={k: p for k, p in run.parts.items() if k in used}) for run in runs]
    for run in runs:
        for key, part in run.parts.items():
            if not part.report.clock.column:
                raise InputError(
                    f"{part.path}: {key or 'it'} has no clock: no column rises evenly; name one "
                    "with --clock COLUMN"
                )
            clock = part.report.clock
            if part.report.topic.log.units.get(clock.column) and not clock.unit.unit:
                raise InputError(
                    f"{part.path}: the unit of its clock {clock.column!r} is not known: "
                    f"{clock.unit.reason}; correct it in the log, or name another with --clock"
                )
        clocks = {key: part.report.clock for key, part in run.parts.items()}
        if len({clock.epoch for clock in clocks.values()}) > 1:
            since = [key for key, clock in clocks.items() if clock.epoch]
            other = [key for key, clock in clocks.items() if not clock.epoch]
            raise InputError(
                f"run {run.name}: the clock of {', '.join(since)} counts from 1970 and that of "
                f"{', '.join(other)} does not, so they cannot be compared; for bags take the times "
                "of recording with --received, else mend the logs"
            )
    return runs


def _refined(
    draft: Draft, path: Path, provider: Provider, late: float, wishes: Wishes,
    told: Callable[[str], None],
) -> list[str]:  # fmt: skip
    """Put into a draft what simulating tells; what is worth a word."""
    notes = []

    def problem() -> Problem:
        write_text(path, draft.text())
        return short(read_problem(path.parent, provider, mapping=path))

    first = problem()
    inputs = [signal for run in first.runs for signal in run.inputs.values()]
    shortest = min((_interval(signal) for signal in inputs), default=draft.period)
    told("trying communication steps")
    draft.step, change, search = choose_steps(first, max(shortest, draft.period * 0.02))
    draft.search_step = search if search > draft.step else 0.0
    if draft.nuisances:  # late clocks ask for what is between the samples
        draft.period = draft.step
    if change is None:
        draft.step_comment = "Finer steps still change something: try a smaller one."
        notes.append(
            f"step {draft.step:g} s: finer steps still change something; try a smaller one"
        )
    else:
        draft.step_comment = (
            f"[s] A finer step changes {change:.2g} of the noise. Recorded is every `period`."
        )
    told("trying start values")
    add_starts(draft, problem(), late)
    told("trying which parameters the logs tell")
    if kept := add_parameters(draft, problem(), wishes.parameters):
        notes.append(
            f"the logs do not tell {', '.join(kept)} apart from the rest: the system's values are "
            "taken as right to the `prior` in the mapping, else as exact; correct what you know"
        )
    return notes


def _interval(signal: object) -> float:
    import numpy as np

    times = getattr(signal, "times", np.zeros(0))
    return float(np.median(np.diff(times))) if times.size > 2 else np.inf
