"""The command line: the catalogue of FMUs, and scenarios.

Results go to stdout (one JSON value with `--json`), messages and progress to stderr. Exit codes:
0 done, 1 the work failed, 2 wrong usage or input.

Modules of this folder import at their top what declares the commands; what does the work is
imported by the command, so that `--help` answers at once.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import signal
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CheckError, CosimError, FmuFileError, InputError, VariantError
from ..installation import places
from ..installation.builder import default_provider, naming_errors, sources
from ..master import algorithms
from ..system.provider import FolderProvider, Provider
from .calibrate import calibrate_command
from .diagnose import diagnose_command
from .export import draw_command, export_command
from .linearize import linearize_command
from .study import study_command

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from ..running.runner import Result

app = typer.Typer(
    help="Robot subsystems as FMUs, run together and compared with measurements.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
fmus_app = typer.Typer(
    help="The component catalogue: list, build and check FMUs.", no_args_is_help=True
)
app.add_typer(fmus_app, name="fmus")
app.command("calibrate")(calibrate_command)
app.command("diagnose")(diagnose_command)
app.command("linearize")(linearize_command)
app.command("export")(export_command)
app.command("draw")(draw_command)
app.command("study")(study_command)


class Kind(StrEnum):
    """Kinds of FMUs that can be built."""

    native = "native"
    python = "python"


class Platform(StrEnum):
    """Platforms that FMUs can be built for."""

    host = "host"
    all = "all"


SHOWN = 40
"""Comparisons and passed checks that are printed; more are in result.json only."""
SHOWN_FOLDERS = 8
"""Folders of results that are named one by one."""
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON value to stdout.")]


# -- fmus ------------------------------------------------------------------------------------------


def _describe_file(path: Path) -> dict[str, Any]:
    """What `fmus list` says, from an FMU instead of the sources."""
    from ..fmu.archive import open_fmu

    description = open_fmu(path).description

    def listed(causality: Any) -> list[dict[str, str]]:
        return [
            {"name": v.name, "unit": v.symbol, "description": v.text}
            for v in description.of(causality)
        ]

    return {
        "variant": description.extra.get("variant", description.name),
        "component": description.extra.get("component", ""),
        "fidelity": description.extra.get("fidelity", ""),
        "effects": description.extra.get("effects", []),
        "inputs": listed("input"),
        "outputs": listed("output"),
        "parameters": listed("parameter"),
        "states": [],
        "description": description.text,
    }


@fmus_app.command("list")
def fmus_list(
    component: Annotated[str, typer.Argument(help="Only variants of this component.")] = "",
    as_json: AsJson = False,
) -> None:
    """List the component catalogue.

    Example: `cosim fmus list gearbox`
    """
    try:
        catalog = sources("packaging.catalog")
        with naming_errors():
            names = [name for name in catalog.names() if _is_of(name, component)]
            entries = [catalog.describe(name) for name in names]
    except VariantError:
        if places.in_checkout():
            raise
        found = [_describe_file(path) for path in sorted(places.fmus().rglob("*.fmu"))]
        entries = [entry for entry in found if _is_of(entry["variant"], component)]
    if component and not entries:
        raise VariantError(f"no variant of a component {component!r}; see 'cosim fmus list'")
    if as_json:
        _print_json(entries)
        return
    table = _table("variant", "inputs", "outputs", "parameters", "description")
    for entry in entries:
        counts = [str(len(entry[key])) for key in ("inputs", "outputs", "parameters")]
        table.add_row(entry["variant"], *counts, entry["description"])
    _console().print(table)


def _is_of(variant: str, component: str) -> bool:
    from ..system import variants

    return not component or variants.component(variant) == component


@fmus_app.command("build")
def fmus_build(
    variants: Annotated[
        list[str] | None,
        typer.Argument(help="E.g. gearbox/elastic+backlash [all]."),
    ] = None,
    fmi: Annotated[int, typer.Option(help="FMI version.", min=2, max=3)] = 2,
    kind: Annotated[Kind, typer.Option(help="C code, or the Python twin.")] = Kind.native,
    platform: Annotated[
        Platform, typer.Option(help="This machine, or all five platforms.")
    ] = Platform.host,
    out: Annotated[Path | None, typer.Option(help="Folder; below it fmi2, fmi3, python.")] = None,
    as_json: AsJson = False,
) -> None:
    """Build FMUs of variants.

    Example: `cosim fmus build gearbox/elastic+backlash --fmi 3 --out fmus`
    """
    build_many = sources("packaging.build").build_many
    folder = out or (places.fmus() if places.in_checkout() else Path("fmus"))
    with naming_errors():
        names = list(variants or sources("packaging.catalog").names())
        for name in variants or ():  # bad names are found before anything is built
            sources("variant").build_model(name)
    if kind is Kind.python and fmi == 3:
        raise InputError("python FMUs are FMI 2.0 only; drop --fmi 3 or --kind python")
    done = itertools.count(1)
    with naming_errors():
        built = build_many(
            names,
            out=folder,
            fmi=fmi,
            kind=kind.value,
            platform=platform.value,
            progress=lambda name, path: _say(f"{next(done)}/{len(names)} {name}: {path}"),
        )
    paths = [{"variant": name, "file": str(path)} for name, path in zip(names, built, strict=True)]
    if as_json:
        _print_json({"fmi": fmi, "kind": kind.value, "platform": platform.value, "built": paths})
    else:
        for item in paths:
            typer.echo(item["file"])


@fmus_app.command("check")
def fmus_check(
    files: Annotated[
        list[Path] | None, typer.Argument(help=".fmu files; those of the library if none is given.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check FMUs, ours or anybody's, without running anything of them.

    Errors break the standard of FMI, or keep masters from running the FMU; warnings are allowed,
    but others may stumble over them.

    Example: `cosim fmus check gearbox.fmu`
    """
    from ..fmu.check import check

    paths = list(files or sorted(places.fmus().rglob("*.fmu")))
    for path in paths:
        if not path.is_file():
            raise FmuFileError(f"{path}: there is no such file")
    if not paths:
        raise InputError(f"{places.fmus()}: has no .fmu; build some with 'cosim fmus build'")
    results = {}
    bad = 0
    for path in paths:
        findings = check(path)
        results[str(path)] = [finding.to_dict() for finding in findings]
        bad += any(finding.severity == "error" for finding in findings)
        if not as_json:
            counts = Counter(finding.severity for finding in findings)
            shown = ", ".join(f"{number} {kind}(s)" for kind, number in counts.items())
            typer.echo(f"{path}: {shown or 'ok'}")
            for finding in findings:
                typer.echo(f"  {finding}")
    if as_json:
        _print_json({"checked": len(results), "with_problems": bad, "problems": results})
    if bad:
        raise CheckError(f"{bad} of {len(results)} FMUs have problems")


# -- scenarios -------------------------------------------------------------------------------------


@app.command("scenarios")
def list_scenarios(as_json: AsJson = False) -> None:
    """List what can be run.

    Example: `cosim scenarios`
    """
    from ..scenario import scenario

    files = scenario.scenario_files()
    if as_json:
        _print_json(
            [
                {
                    "scenario": file.name,
                    "system": file.table.get("system", ""),
                    "runs": [name for name in file.runs if name],
                    "description": file.text,
                }
                for file in files
            ]
        )
        return
    table = _table("scenario", "system", "runs", "description")
    for file in files:
        runs = [name for name in file.runs if name]
        shown = ", ".join(runs[:4]) + (f" … ({len(runs)})" if len(runs) > 4 else "")
        table.add_row(file.name, str(file.table.get("system", "")), shown, file.text)
    _console().print(table)


@app.command("run")
def run_command(
    name: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="Name, folder, .toml or .ssp file.")
    ],
    variants: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="INSTANCE=VARIANT", help="E.g. gearbox=elastic+backlash."),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="INSTANCE.NAME=VALUE", help="E.g. gearbox.eta=0.8."),
    ] = None,
    algorithm: Annotated[
        str | None, typer.Option(help=f"One of {', '.join(algorithms.names())}.")
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option("--option", metavar="NAME=VALUE", help="E.g. extrapolation=1."),
    ] = None,
    step: Annotated[float | None, typer.Option(help="Communication step [s].")] = None,
    duration: Annotated[float | None, typer.Option(help="Duration [s].")] = None,
    fmus: Annotated[
        Path | None, typer.Option(help="Take variants from this folder instead of building.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for results [out/SCENARIO].")] = None,
    isolate: Annotated[
        bool, typer.Option("--isolate", help="Run in a process of its own: FMUs may crash or hang.")
    ] = False,
    time_limit: Annotated[
        float, typer.Option(help="With --isolate: longest time of one call to an FMU [s].")
    ] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Run a scenario, compare it with its reference, plot it.

    Example: `cosim run motor_bench --set gearbox=elastic+backlash --param gearbox.eta=0.8`
    """
    from rich.console import Console
    from rich.progress import Progress

    from ..running.runner import run

    changes = dict(_pair(item, "--set", "INSTANCE=VARIANT") for item in variants or [])
    values = dict(_pair(item, "--param", "INSTANCE.NAME=VALUE") for item in parameters or [])
    chosen = dict(_pair(item, "--option", "NAME=VALUE") for item in options or [])
    if fmus is not None and not fmus.is_dir():
        raise InputError(f"--fmus {fmus}: there is no such folder")
    provider: Provider = FolderProvider(fmus) if fmus is not None else default_provider()
    with Progress(console=Console(stderr=True), transient=True) as progress:
        tasks: dict[str, Any] = {}

        def told(item: str, fraction: float) -> None:
            if item not in tasks:
                tasks[item] = progress.add_task(item, total=1.0)
            progress.update(tasks[item], completed=fraction)

        result = run(
            name,
            variants=changes,
            parameters={key: _number(text) for key, text in values.items()},
            algorithm=algorithm,
            options={key: _number(text) for key, text in chosen.items()},
            step=step,
            duration=duration,
            provider=provider,
            out=out or Path("out") / _folder_name(name),
            progress=told,
            isolate=time_limit if isolate else None,
            guard=True,
        )
    for note in dict.fromkeys(note for item in result.runs.values() for note in item.notes):
        _say(f"note: {note}")
    if as_json:
        _print_json(result.to_dict())
    else:
        _print_result(result)
    failed = [label for label, check in result.checks.items() if not check.ok]
    if failed:
        shown = "; ".join(failed[:5]) + ("; ..." if len(failed) > 5 else "")
        raise CheckError(f"{len(failed)} of {len(result.checks)} checks failed: {shown}")


def _folder_name(name: str) -> str:
    for suffix in (".toml", ".ssp", ".ssd"):
        name = name.removesuffix(suffix)
    return name.strip("./")


def _pair(text: str, option: str, form: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or not key or not value:
        raise InputError(f"{option} {text}: write {option} {form}")
    return key.strip(), value.strip()


def _number(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return text


def _print_result(result: Result) -> None:
    from rich.markup import escape

    content, console = result.to_dict(), _console()
    console.print(
        f"{content['scenario']}: {content['simulated_s']:g} s simulated in "
        f"{content['wall_s']:.2f} s, {content['fmu_steps']} FMU-steps, {content['algorithm']} with "
        f"{content['step']:g} s; the coupling invented {content['energy_residual_J']:.3g} J",
        soft_wrap=True,
    )
    for quantity in result.overview if len(result.runs) > 1 else ():
        head, rows = quantity.rows()
        table = _table(*map(escape, head))
        for row in rows:
            table.add_row(*map(escape, row))
        console.print(table)
    if 0 < len(content["comparison"]) <= SHOWN:
        table = _table("compared", "rms", "max", "unit", "with")
        for key, item in content["comparison"].items():
            table.add_row(
                key, f"{item['rms']:.4g}", f"{item['max']:.4g}", item["unit"], item["reference"]
            )
        console.print(table)
    shown = content["checks"]
    if len(shown) > SHOWN:
        shown = [item for item in shown if not item["ok"]]
        console.print(
            f"{len(content['checks']) - len(shown)} of {len(content['checks'])} checks ok"
        )
    if shown:
        table = _table("check", "value", "limit", "", "source")
        for item in shown:
            outcome = "ok" if item["ok"] else "FAILED"
            limit = item["limit"]
            bound = f"{limit:.4g}" if isinstance(limit, float) else str(limit)
            table.add_row(item["name"], f"{item['value']:.4g}", bound, outcome, item["source"])
        console.print(table)
    folders = list(dict.fromkeys(str(path.parent) for path in result.files))
    if len(folders) > SHOWN_FOLDERS:
        console.print(f"in {len(folders) - 1} folders below {folders[-1]}", soft_wrap=True)
    for folder in folders if len(folders) <= SHOWN_FOLDERS else ():
        console.print(f"in {folder}", soft_wrap=True)
    pictures = [path for path in result.files if path.suffix == ".png"]
    for path in pictures[-1:] if pictures and pictures[-1].name == "overview.png" else pictures:
        console.print(f"picture: {path}", soft_wrap=True)


# -- frame -----------------------------------------------------------------------------------------


def _console() -> Console:
    """Standard output; wide if nobody looks at it, so that names stay whole for other programs."""
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=160)


def _table(first: str, *others: str) -> Table:
    from rich.table import Table

    table = Table()
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name)
    return table


def _say(text: str) -> None:
    typer.echo(text, err=True)


def _print_json(content: Any) -> None:
    typer.echo(json.dumps(content, indent=2))


@contextlib.contextmanager
def leaving_nothing() -> Iterator[None]:
    """Let SIGTERM end the block like an error: what it has started and made is put away."""

    def terminate(*_: Any) -> None:
        _say("terminated")
        raise SystemExit(128 + signal.SIGTERM)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def main() -> None:
    """Run the command line; one line on stderr per error, no traceback."""
    try:
        with leaving_nothing():
            app()
    except CosimError as error:
        _say(f"error: {error}")
        for note in getattr(error, "__notes__", ()):
            _say(note)
        raise SystemExit(error.exit_code) from None
    except KeyboardInterrupt:
        _say("interrupted")
        raise SystemExit(130) from None
