"""`cosim data`: what is in a log, and a mapping made from it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .output import AsJson, new_table, open_console, say
from .streams import print_json

if TYPE_CHECKING:
    from rich.console import Console

    from ..calibrate.checks.finding import Finding
    from ..intake.importing import Imported
    from ..intake.inspect import ColumnReport, FileReport, TopicReport
    from ..intake.matching import Column, Match, Place


class FilesAre(StrEnum):
    """What files are that no `--run` names."""

    RUNS = "runs"
    PARTS = "parts"


data_app = typer.Typer(help="Logs: what is in them, and how they map to a system.",
                       no_args_is_help=True)  # fmt: skip

Files = Annotated[
    list[Path], typer.Argument(metavar="FILE...", help="Logs: tables, bags, MCAP, MATLAB, ulog.")
]
Topics = Annotated[
    list[str] | None, typer.Option("--topic", help="Of a bag: only this topic (again for more).")
]
SMOOTH = 0.2
"""Steps of resolution below which noise is none: rounding alone makes 0.29 of one."""
Received = Annotated[
    bool,
    typer.Option("--received", help="Of a bag: times of recording instead of header stamps."),
]
Clock = Annotated[str, typer.Option(help="The column of times, if it is not found.")]
PICTURES = (".png", ".svg", ".pdf")


@data_app.command("inspect")
def inspect_command(
    files: Files,
    topics: Topics = None,
    received: Received = False,
    clock: Clock = "",
    plot: Annotated[Path | None, typer.Option(help="Draw it: a .png, .svg or .pdf file.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what is in logs: columns, units, clocks, gaps, and what is odd.

    Example: `cosim data inspect log.csv --plot log.png`
    """
    from ..intake.inspect import check_clock, inspect
    from ..intake.picture import draw

    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise InputError(f"--plot {plot}: pictures are {', '.join(PICTURES)} files")
    reports = []
    with working() as told:
        for path in files:
            told(f"reading {path}")
            reports.append(inspect(path, topics or (), clock, received))
    check_clock(reports, clock)
    made = []
    if plot is not None:
        path, left = draw(reports, plot)
        made.append(str(path))
        if left:
            say(f"note: no room in the picture for {', '.join(left)}")
    if as_json:
        print_json({"files": [report.to_dict() for report in reports], "pictures": made})
        return
    console = open_console()
    for report in reports:
        _print(console, report)
    for name in made:
        console.print(f"picture: {name}", soft_wrap=True, markup=False)


def _print(console: Console, report: FileReport) -> None:
    for topic in report.topics:
        name = report.source.path.name
        if not report.source.plain:
            name += f" {topic.topic.name}"
        console.print(f"{name} ({topic.topic.kind}): {clock_line(topic)}", soft_wrap=True,
                      markup=False, highlight=False)  # fmt: skip
        if topic.topic.frames:
            console.print(f"  frames: {topic.topic.frames}", markup=False, highlight=False)
        table = new_table("column", "unit", "why", "min", "max", "resolution", "noise", "missing")
        for column in topic.columns:
            table.add_row(*_row(column))
        console.print(table)
        for found in gathered(topic.findings):
            where = f"{found.column}: " if found.column else ""
            console.print(f"  {found.severity}: {where}{found.text}", soft_wrap=True,
                          markup=False, highlight=False)  # fmt: skip
    for name, why in report.source.left.items():
        console.print(f"  left out: {name}: {why}", soft_wrap=True, markup=False, highlight=False)


def gathered(findings: Sequence[Finding]) -> list[Finding]:
    """Findings that say the same of several columns as one."""
    alike: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        alike.setdefault((finding.severity, finding.kind, finding.text), []).append(finding)
    return [
        replace(group[0], column=", ".join(f.column for f in group)) for group in alike.values()
    ]  # fmt: skip


def _row(column: ColumnReport) -> list[str]:
    unit = column.unit.unit or "?"
    noise = f"{column.noise:.3g}" if column.noise > SMOOTH * column.resolution else "-"
    return [
        column.name, unit if column.unit.sure or unit == "?" else f"{unit} (guessed)",
        column.unit.reason, f"{column.low:.5g}", f"{column.high:.5g}",
        f"{column.resolution:.3g}", noise,
        str(column.missing) if column.missing else "-",
    ]  # fmt: skip


def clock_line(topic: TopicReport) -> str:
    """Rate, duration and clock of a topic in one line."""
    clock, log = topic.clock, topic.topic.log
    rows = next((len(values) for values in log.columns.values()), 0)
    if not clock.column:
        return f"{rows} rows, no clock"
    rate = f"{1.0 / clock.interval:.4g} Hz" if clock.interval > 0.0 else "one row"
    began = f", from {clock.began()}" if clock.began() else ""
    unit = clock.unit.unit or "unknown unit"
    return (
        f"{rows} rows, {rate} for {clock.duration:.4g} s (jitter {clock.jitter:.1%}), clock "
        f"{clock.column} in {unit}: {clock.unit.reason}{began}"
    )


@data_app.command("example")
def example_command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="To write.")],
    machine: Annotated[
        str | None,
        typer.Option(help="A machine of the papers: mir250, mobile_manipulator or omni_base."),
    ] = None,
    fan: Annotated[
        bool,
        typer.Option("--fan", help="A motor with a fan, whose FMU is made of fan.py by pythonfmu."),
    ] = False,
    seed: Annotated[int, typer.Option(help="Of the noise, with --machine.")] = 0,
) -> None:
    """Write the logs of an example robot, and a system for it: CSV files, and ROS 2 bags.

    Example: `cosim data example robot`
    """
    from ..intake import fan_example
    from ..intake.example import write
    from ..intake.plants import writing

    if machine is not None and fan:
        raise InputError("--machine and --fan are two examples; give one of them")
    if machine is not None:
        writing.write(machine, folder, seed=seed)
    elif fan:
        fan_example.write(folder)
    elif not write(folder):
        say("note: without bags, which need the library rosbags: pip install rosbags")
    print(folder)


@data_app.command("import")
def import_command(
    files: Annotated[
        list[Path] | None,
        typer.Argument(metavar="FILE...", help="Logs; each is a run, or grouped by their names."),
    ] = None,
    system: Annotated[
        str, typer.Option(help="A system's name, or the path of its .toml file.")
    ] = "",
    runs: Annotated[
        list[str] | None,
        typer.Option("--run", metavar="NAME=FILE,FILE", help="A run of these files."),
    ] = None,
    files_are: Annotated[
        FilesAre | None,
        typer.Option(help="Each file is a run, or all are parts of one [by columns and names]."),
    ] = None,
    validation: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A run that is not fitted [the last of several]."),
    ] = None,
    maps: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="COLUMN=VARIABLE[:UNIT]", help="What a column is."),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option(
            "--parameter",
            metavar="NAME[=NOMINAL[:MIN:MAX]]",
            help="What is estimated [what the logs tell].",
        ),
    ] = None,
    window: Annotated[
        float, typer.Option(help="Cut runs into pieces of this length [s], each with its start.")
    ] = 0.0,
    late: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PART=SECONDS", help="How late the clock of a part is known to be [estimated]."
        ),
    ] = None,
    topics: Topics = None,
    received: Received = False,
    clock: Clock = "",
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("dataset"),
    as_json: AsJson = False,
) -> None:
    """Make a data set of logs: a folder with the logs and a mapping with comments to a system.

    Example: `cosim data import a.csv b.csv --system motor_bench --out my_motor`
    """
    from ..installation.builder import default_provider
    from ..intake.given import late_of, parameters_of, runs_of
    from ..intake.grouping import grouped
    from ..intake.importing import Inspected, Wishes, import_logs
    from ..intake.runs import purposes

    if not system:
        raise InputError(f"--system is missing; {_systems()}")
    wishes = Wishes(
        system,
        maps or (),
        parameters_of(parameters or []),
        tuple(topics or ()),
        clock,
        window,
        received,
        late_of(late or []),
    )
    ask = _Terminal() if _somebody() else None
    with working(quiet=ask is not None) as told:
        inspected = Inspected(wishes, told)
        group = grouped(
            files or [],
            runs_of(runs or []),
            inspected.columns,
            files_are.value if files_are else "",
        )
        named = group.runs
        chosen = purposes(list(named), validation or [])
        for note in _of_runs(list(named), group.said, not validation):
            say(f"note: {note}")
        done = import_logs(named, chosen, wishes, out, default_provider(), ask, told, inspected)
    for note in done.notes:
        say(f"note: {note}")
    if as_json:
        print_json(_imported(done))
    else:
        _print_imported(open_console(), done)
    bad = [f for f in done.findings if f.severity == "error"]
    if bad:
        raise InputError(
            f"{done.folder}: is written, but `cosim calibrate` will refuse it as it is; mend "
            f"{done.folder / 'dataset.toml'} as said above, or import again with --map, and with "
            "--parameter NAME=VALUE where the system's values are those of another machine"
        )


def _of_runs(names: Sequence[str], said: str, last: bool) -> list[str]:
    """What was assumed of the runs."""
    found = [said] if said else []
    if len(names) == 1:
        found.append("there is one run only, so nothing is left to judge what is fitted")
    elif last:
        found.append(f"run {names[-1]} is not fitted but judged (another with --validation)")
    return found


@contextmanager
def working(quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Shows at a terminal what is being done, until it is; or, quiet, leaves it to questions."""
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True)
    if quiet or not console.is_terminal:
        yield lambda text: None
        return
    with console.status("") as status:
        yield lambda text: status.update(Text(text))


def _systems() -> str:
    from ..errors import listing
    from ..installation import places

    folder = places.scenarios()
    known = [p.stem for p in sorted((folder / "systems").glob("*.toml"))]
    known += [p.parent.name for p in sorted(folder.glob("*/system.toml"))]
    return f"name one, or give the path of a .toml file; {listing(known, limit=40)}"


def _somebody() -> bool:
    """Whether somebody can answer."""
    return sys.stdin is not None and sys.stdin.isatty()


class _Terminal:
    """Asks at the terminal."""

    def column(self, place: Place, columns: Sequence[Column]) -> str:
        """A column by its number or name, or a constant."""
        say(
            f"\n{place.name} ({place.text or 'input'}, in {place.unit or '?'}): which column is it?"
        )
        for number, column in enumerate(columns, 1):
            say(f"  {number}) {column.source} [{column.unit.unit or '?'}: {column.unit.reason}]")
        say("  or c=VALUE for a constant")
        while True:
            answer = str(typer.prompt("number", err=True)).strip()
            if answer.startswith("c=") and _is_number(answer[2:]):
                return answer[2:]
            if answer.isdigit() and 1 <= int(answer) <= len(columns):
                return columns[int(answer) - 1].source
            if answer in [column.source for column in columns]:
                return answer
            say(f"{answer!r} is none of them; write a number from 1 to {len(columns)}, or c=0")

    def variable(self, source: str, names: Sequence[str]) -> str:
        """A variable by its number, or none."""
        say(f"\n{source}: which of these was measured?")
        for number, name in enumerate(names, 1):
            say(f"  {number}) {name}")
        say("  or 0 for none of them")
        while True:
            answer = str(typer.prompt("number", err=True)).strip()
            if answer.isdigit() and int(answer) <= len(names):
                return names[int(answer) - 1] if int(answer) else ""
            say(f"{answer!r} is none of them; write a number from 0 to {len(names)}")

    def unit(self, match: Match) -> str:
        """A unit that fits the variable."""
        from ..intake.guess import known_unit
        from ..intake.matching import fits

        column, place = match.column, match.place
        say(f"\n{column.source} is {place.name}, in {place.unit}: what is its unit? "
            f"({column.unit.reason})")  # fmt: skip
        while True:
            answer = str(typer.prompt("unit", err=True)).strip()
            if known_unit(answer) and fits(answer, place):
                return answer
            say(f"{answer!r} is no unit of what is in {place.unit}; write e.g. {place.unit}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _imported(done: Imported) -> dict[str, Any]:
    """For JSON."""
    matches = done.matches
    return {
        "folder": str(done.folder), "mapping": str(done.folder / "dataset.toml"),
        "inputs": {n: _match(m) for n, m in matches.inputs.items()},
        "channels": {n: _match(m) for n, m in matches.channels.items()},
        "constants": matches.constants, "left_at_start": matches.left,
        "unused": [c.source for c in done.columns if c.source not in matches.used()],
        "parameters": list(done.parameters),
        "runs": {run.name: run.purpose for run in done.runs},
        "findings": [f.to_dict() for f in done.findings], "notes": list(done.notes),
    }  # fmt: skip


def _match(match: Match) -> dict[str, str]:
    return {"column": match.column.source, "unit": match.column.unit.unit,
            "unit_reason": match.column.unit.reason, "reason": match.reason}  # fmt: skip


def _print_imported(console: Console, done: Imported) -> None:
    from ..calibrate.checks.finding import lines

    matches = done.matches
    table = new_table("column", "unit", "is", "variable", "in", "because")
    for what, found in (("drives", matches.inputs), ("measures", matches.channels)):
        for name, match in found.items():
            unit = match.column.unit
            table.add_row(
                match.column.source, unit.unit + ("" if unit.sure else " (guessed)"), what, name,
                match.place.unit, match.reason,
            )  # fmt: skip
    console.print(table)
    for name, value in matches.constants.items():
        console.print(f"{name} is held at {value:g}", markup=False)
    for name, value in matches.left.items():
        console.print(
            f"{name} stays at {value:g}: no column can be it (--map 'VALUE={name}' for another)",
            soft_wrap=True, markup=False, highlight=False,
        )  # fmt: skip
    unused = [c.source for c in done.columns if c.source not in matches.used()]
    for source in unused:
        rivals = matches.unsure.get(source)
        more = f"; may be {' or '.join(rivals)}: --map '{source}={rivals[0]}'" if rivals else ""
        console.print(f"not used: {source}{more}", soft_wrap=True, markup=False, highlight=False)
    console.print(f"estimated: {', '.join(done.parameters) or 'nothing'}", soft_wrap=True)
    for run in done.runs:
        console.print(f"run {run.name}: {run.purpose}", markup=False, highlight=False)
    for line in lines(done.findings):
        console.print(line, soft_wrap=True, markup=False, highlight=False)
    console.print(f"written: {done.folder / 'dataset.toml'}", soft_wrap=True, markup=False)
    if not any(f.severity == "error" for f in done.findings):
        console.print(f"next: read it, then  cosim calibrate {done.folder}", soft_wrap=True,
                      markup=False)  # fmt: skip
