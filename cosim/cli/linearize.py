"""`cosim linearize`: poles and open loops of a system, or of one FMU, at an operating point."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..files import json_text, write_text
from ..installation.builder import default_provider
from .output import open_console
from .pairs import pairs, values
from .progress import Display
from .streams import print_json

if TYPE_CHECKING:
    from ..control.linearize import Linear, Margins
    from ..master.master import Master
    from ..system.inputs import Driver

MOST = 24
"""Loops that are looked at if none are named."""


def linearize_command(
    name: Annotated[str, typer.Argument(metavar="SCENARIO", help="Scenario, run, or an .fmu.")],
    at: Annotated[
        float | None,
        typer.Option(help="Time of the operating point on the scenario's clock [s; its begin]."),
    ] = None,
    cut: Annotated[
        list[str] | None,
        typer.Option(help="Connected input at which a loop is cut [all that feed back]."),
    ] = None,
    variants: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="INSTANCE=VARIANT", help="E.g. gearbox=elastic."),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--param", metavar="INSTANCE.NAME=VALUE", help="E.g. motor.Kp_v=0.8."),
    ] = None,
    algorithm: Annotated[
        str | None, typer.Option(help="With which it runs up to the operating point.")
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Option("--option", metavar="NAME=VALUE", help="E.g. extrapolation=1."),
    ] = None,
    delay: Annotated[float, typer.Option(help="Dead time added to each loop [s].")] = 0.0,
    out: Annotated[Path | None, typer.Option(help="Folder for bode.png and linear.json.")] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON value to stdout.")
    ] = False,
) -> None:
    """Linearize a system: poles, margins of its loops, Bode plot.

    Example: `cosim linearize motor_bench --at 1 --cut motor.w --out out/linear`
    """
    from ..control.linearize import connect, loop_margins, operating_point, plot_bode

    master, inputs, start, changed = _master(
        name,
        pairs(variants, "--set", "INSTANCE=VARIANT"),
        values(parameters, "--param", "INSTANCE.NAME=VALUE"),
        algorithm,
        values(options, "--option", "NAME=VALUE"),
    )
    parts, notes = operating_point(master, at, inputs, start)
    notes = [*changed, *notes]
    system = connect(master, parts, notes)
    names = cut or [wire.target for wire in master.system.connections]
    loops = loop_margins(master, parts, names[:MOST] if not cut else names, delay)
    content = _content(name, system, loops)
    if out is not None:
        if loops:
            plot_bode(loops, out / "bode.png")
        matrices = {key: getattr(system, key).tolist() for key in "abcd"}
        text = json_text({**content, **matrices}, 1)
        write_text(out / "linear.json", text)
    if as_json:
        print_json(content)
    else:
        _print(content, out)


def _master(
    name: str,
    variants: Mapping[str, str],
    parameters: Mapping[str, Any],
    algorithm: str | None,
    options: Mapping[str, Any],
) -> tuple[Master, dict[str, Driver], float, tuple[str, ...]]:
    """What is linearized, what drives it, its start [s], notes; changes as in `cosim run`."""
    from ..errors import InputError
    from ..master.master import Master
    from ..running.preparation import adjusted
    from ..running.runner import prepare
    from ..scenario import scenario as scenarios
    from ..system.system import System

    if name.endswith(".fmu"):
        if variants:
            raise InputError(f"--set {next(iter(variants))}: {name} is one FMU; give another one")
        system = System(Path(name).stem)
        system.add("fmu", name)
        for key, value in parameters.items():
            system.set(key if key.startswith("fmu.") else f"fmu.{key}", value)
        return Master(system, algorithm or "jacobi", options=options), {}, 0.0, ()
    file, run = scenarios.find(name)
    item = adjusted(file.scenario(run or next(iter(file.runs))), algorithm, options)
    with Display() as display:
        provider = default_provider(display.building)
        prepared = prepare(
            item, provider, variants=variants, parameters=parameters, base=Path.cwd()
        )
    return prepared.master, dict(item.inputs), item.start, prepared.notes


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _content(name: str, system: Linear, loops: list[Margins]) -> dict[str, Any]:
    return {
        "of": name,
        "time_s": _finite(system.time),
        "states": list(system.states),
        "inputs": list(system.inputs),
        "outputs": list(system.outputs),
        "poles": [
            {
                "real_1_per_s": float(pole.real),
                "imag_rad_per_s": float(pole.imag),
                "frequency_Hz": abs(pole) / (2.0 * math.pi),
                "damping": float(-pole.real / abs(pole)) if abs(pole) > 0.0 else None,
            }
            for pole in system.poles
        ],
        "loops": [
            {
                "cut": loop.name,
                "crossover_Hz": _finite(loop.crossover),
                "phase_margin_deg": _finite(loop.phase),
                "gain_margin": _finite(loop.gain),
            }
            for loop in loops
        ],
        "notes": list(system.notes),
    }


def _print(content: dict[str, Any], out: Path | None) -> None:
    from rich.table import Table

    console = open_console(None)
    console.print(
        f"{content['of']} at t = {content['time_s'] or 0.0:g} s: {len(content['states'])} states",
        soft_wrap=True,
    )
    table = Table("pole [1/s]", "frequency [Hz]", "damping")
    for pole in content["poles"]:
        if pole["imag_rad_per_s"] >= 0.0:
            imag = pole["imag_rad_per_s"]
            text = f"{pole['real_1_per_s']:.4g}" + (f" ± {imag:.4g}j" if imag else "")
            damping = "-" if pole["damping"] is None else f"{pole['damping']:.3f}"
            table.add_row(text, f"{pole['frequency_Hz']:.4g}", damping)
    console.print(table)
    if content["loops"]:
        table = Table("loop cut at", "crossover [Hz]", "phase margin [deg]", "gain margin")
        for loop in content["loops"]:
            cells = [loop[key] for key in ("crossover_Hz", "phase_margin_deg", "gain_margin")]
            table.add_row(loop["cut"], *("-" if x is None else f"{x:.4g}" for x in cells))
        console.print(table)
    for note in content["notes"]:
        console.print(f"note: {note}", soft_wrap=True)
    if out is not None:
        console.print(f"in {out}", soft_wrap=True)
