"""`cosim calibrate`: estimate the declared parameters of a system from measured runs."""

from __future__ import annotations

import math
import time
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CosimError, InputError
from ..files import claimed, json_text, write_text
from ..installation.builder import default_provider
from .output import new_table, open_console
from .progress import Display
from .streams import print_json

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from ..calibrate.checks.finding import Finding
    from ..calibrate.estimate import Estimate
    from ..calibrate.problem import Problem
    from ..calibrate.sensitivity import Correlation

    Residuals = list[tuple[str, NDArray[np.float64]]]

FAR = 2.0
"""Residual over the noise from which a model evidently lacks something: good ones leave 1, and
logs whose noise is guessed up to half as much again."""
HOPELESS = 100.0
"""The same from which a fit may have ended in a minimum of its own: of what goes over the top, or
turns over, another one may be as deep for its surroundings."""
OTHER_END = (
    "; or the fit has ended far from the machine, as it may where motion is unstable or goes over "
    "the top: try nominal values that are nearer, or shorter pieces (`window`)"
)


def calibrate_command(
    dataset: Annotated[
        Path,
        typer.Argument(metavar="DATASET", help="Folder of logs, or a set of `cosim scenarios`."),
    ],
    system: Annotated[
        str | None, typer.Option(help="Another system than that of the mapping.")
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(help="A dataset.toml, or a name of `cosim scenarios` [by the rig]."),
    ] = None,
    samples: Annotated[
        int, typer.Option(help="Parameter sets for the correlation index, 0 for none.")
    ] = 40,
    out: Annotated[Path | None, typer.Option(help="Folder for results [out/DATASET].")] = None,
    workers: Annotated[int | None, typer.Option(help="Threads [all cores].")] = None,
    figures: Annotated[
        bool,
        typer.Option("--figures", help="Draw each run before and after, and its sensitivities."),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON value to stdout.")
    ] = False,
) -> None:
    """Estimate the declared parameters of a system from measured runs.

    Example: `cosim calibrate MB-12 --out out/MB-12`
    """
    from ..calibrate.calibration import calibrated
    from ..calibrate.checks.examine import check_fit, examine
    from ..calibrate.input_noise import propagated
    from ..calibrate.mapping import read_problem
    from ..calibrate.sensitivity import correlation_index, tornado
    from ..calibrate.simulator import Simulator
    from ..report.calibration import write_calibration_page
    from ..report.pictures import first_guess, run_pictures, tornado_by_run

    started = time.perf_counter()
    with ExitStack() as place:
        with Display() as display:
            provider = default_provider(display.building)
            problem = read_problem(dataset, provider, mapping=mapping, system=system)
            folder = out or Path("out") / problem.name
            place.enter_context(claimed(folder))
            simulator = Simulator(problem, workers=workers)
            stage = "checking the data"
            with display.watch(
                "calibrating", lambda: f"{stage}: {simulator.evaluations} simulations"
            ):
                findings = _usable(problem, examine(simulator))
                simulator, counted = propagated(simulator)
                findings += counted
                stage = "fitting"
                estimate, exchange = calibrated(simulator)
                findings += _usable(problem, check_fit(estimate))
                stage = "what the runs tell of each parameter"
                correlation = (
                    correlation_index(simulator, estimate.theta, samples, everywhere=figures)
                    if samples
                    else None
                )
                guess = first_guess(estimate) if figures else {}
        if not exchange.small:
            typer.echo(f"warning: {exchange}", err=True)
        settled, unused = validation_residuals(estimate)
        content = calibration_table(estimate, unused, correlation, findings)
        beside = None if problem.unstable else partial(_beside_intervals, settled, unused)
        for line in _far(content["channels"], beside):
            typer.echo(f"warning: {line}", err=True)
        if estimate.refused:
            typer.echo(f"warning: {_refused(estimate)}", err=True)
        content["exchange"] = exchange.to_dict()
        content["evaluations"] = simulator.evaluations + exchange.evaluations
        content["wall_s"] = time.perf_counter() - started
        # the page of a diagnosis took minutes
        name = "calibration.html" if (folder / "diagnosis.json").exists() else "report.html"
        page, table = folder / name, folder / "calibration.json"
        content["files"] = [str(table), str(page)]
        try:
            if correlation is not None:
                content["files"].append(str(tornado(correlation, folder / "tornado.png")))
            if figures:
                pictures = folder / "figures"
                residuals = dict(estimate.residuals) | dict(unused)
                drawn = run_pictures(estimate, guess, residuals, pictures)
                if correlation is not None:
                    drawn.append(tornado_by_run(correlation, pictures / "sensitivity.png"))
                content["files"] += map(str, drawn)
                _add_first_guess(content, problem, guess)
            write_text(table, json_text(content))
            write_calibration_page(content, estimate, unused, page)
        finally:  # what was found is said, whatever becomes of the files
            if as_json:
                print_json(content)
            else:
                _print(content)


def _beside_intervals(unused: Estimate, residuals: Residuals) -> dict[str, float]:
    """Residuals of unused runs over the noise, by channel, beside what intervals make of them."""
    from ..calibrate.estimate import channel_rms
    from ..calibrate.foretelling import foretold

    try:
        beside = foretold(unused, residuals)
    except CosimError:  # it cannot be simulated beside its parameters: as they are, then
        beside = residuals
    return channel_rms(unused.problem, beside)


def _refused(estimate: Estimate) -> str:
    """What the fit wanted and could not have."""
    problem, (theta, why) = estimate.problem, estimate.refused or (estimate.theta, "")
    moved = {
        p.name: f"{p.name} = {there:.4g}"
        for p, here, there in zip(
            problem.parameters, estimate.theta.tolist(), theta.tolist(), strict=True
        )
        if abs(there - here) > 1e-9 * p.scale
    }
    return (
        f"the fit ended beside values that cannot be simulated ({', '.join(moved.values())}): "
        f"{why}; if the machine may be there, values and intervals are wrong"
    )


def _far(channels: dict[str, Any], beside: Callable[[], dict[str, float]] | None) -> list[str]:
    """What the model leaves far beyond the noise, in the runs that were fitted and in others.

    Args:
        channels: of the table.
        beside: gives what the others leave beside what the parameters' intervals make of them; not
            asked where fitted runs hold more than noise, for intervals then make up for that. None
            where a deviation is no small change (`Problem.unstable`).
    """
    from ..calibrate.foretelling import within_intervals

    fitted, others = (
        {n: (v[purpose] or 0.0) / v["noise_rms"] for n, v in channels.items()}
        for purpose in ("identification", "validation")
    )
    said = []
    name = max(fitted, key=lambda n: fitted[n])
    calm = fitted[name] <= FAR
    if not calm:
        said.append(
            f"the model leaves {fitted[name]:.3g} times the noise in {name}: it lacks something "
            "that values and intervals make up for; `cosim diagnose` looks for it"
            + OTHER_END
            * (fitted[name] > HOPELESS)
        )
    over = {n: size / max(fitted[n], 1.0) for n, size in others.items()}
    far = [n for n in sorted(over, key=lambda n: -over[n]) if over[n] > FAR]
    if not far:
        return said
    rest = beside() if calm and beside is not None else others
    lasting = [n for n in far if rest[n] > FAR * max(fitted[n], 1.0)]
    if not lasting:
        return [*said, within_intervals(far[0], others[far[0]])]
    name = lasting[0]
    return [
        *said,
        f"in runs that were not fitted it leaves {others[name]:.3g} times the noise in {name}, "
        f"in those that were {fitted[name]:.3g}: what was found does not hold there, or these "
        "logs are of another kind",
    ]


def _usable(problem: Problem, findings: list[Finding]) -> list[Finding]:
    """Say what was found.

    Raises:
        InputError: it stops the work.
    """
    from ..calibrate.checks.finding import lines

    for line in lines(findings):
        typer.echo(line, err=True)
    if any(f.severity == "error" for f in findings):
        raise InputError(f"{problem.name}: the data cannot be used; see the findings above")
    return findings


def calibration_table(
    estimate: Estimate,
    unused: Residuals,
    correlation: Correlation | None,
    findings: list[Finding],
) -> dict[str, Any]:
    """What `--json` prints."""
    from ..calibrate.clocks import offsets
    from ..calibrate.estimate import channel_rms
    from ..calibrate.sensitivity import local

    problem = estimate.problem
    fitted = channel_rms(problem, estimate.residuals)
    checked = channel_rms(problem, unused) if unused else {}
    return {
        "dataset": problem.name,
        "system": problem.file.name,
        "parameters": {
            p.name: {
                "value": value,
                "ci95": [low, high],
                "unit": p.unit,
                "identifiable": bool(known),
                "nominal": p.nominal,
                "at_bound": p.name in estimate.at_bound,
            }
            for p, value, low, high, known in zip(
                problem.parameters, estimate.theta.tolist(), estimate.low.tolist(),
                estimate.high.tolist(), estimate.identifiable, strict=True,
            )
            if p.role != "nuisance"
        },
        "clocks": offsets(estimate),
        "not_separable": [str(item) for item in estimate.combinations if str(item)],
        "channels": {
            c.name: {
                "unit": c.unit,
                "noise_rms": c.sigma,
                "identification": _scaled(fitted.get(c.name), c.sigma),
                "validation": _scaled(checked.get(c.name), c.sigma),
            }
            for c in problem.channels
        },
        "sensitivity": {
            "local": local(estimate),
            "correlation": dict(correlation.index) if correlation else {},
            "correlation_limit": correlation.limit if correlation else None,
            "correlation_by_run": dict(correlation.by_run) if correlation else {},
        },
        "findings": [finding.to_dict() for finding in findings],
    }  # fmt: skip


def _add_first_guess(
    content: dict[str, Any], problem: Problem, guess: dict[str, NDArray[np.float64]]
) -> None:
    """Errors at the nominal values, by channel and purpose."""
    from ..calibrate.estimate import channel_rms

    for purpose in ("identification", "validation"):
        chosen = [(run.name, guess[run.name]) for run in problem.chosen(purpose)]
        found = channel_rms(problem, chosen) if chosen else {}
        for c in problem.channels:
            row = content["channels"][c.name].setdefault("first_guess", {})
            row[purpose] = _scaled(found.get(c.name), c.sigma)


def validation_residuals(estimate: Estimate) -> tuple[Estimate, Residuals]:
    """Residuals over sigma on the runs that were not fitted, and the estimate with their values."""
    from ..calibrate.nuisance import settled

    problem = estimate.problem
    names = [run.name for run in problem.runs if run.purpose == "validation"]
    if not names:
        return estimate, []
    theta = settled(estimate.simulator, estimate.theta, names)
    return replace(estimate, theta=theta), list(estimate.simulator.residuals(theta, names))


def _scaled(value: float | None, sigma: float) -> float | None:
    return None if value is None or math.isnan(value) else value * sigma


def clock_lines(clocks: dict[str, dict[str, Any]]) -> list[str]:
    """What is said of clocks that were estimated."""
    found = []
    for name, item in clocks.items():
        low, high = item["ci95"]
        note = "" if item["identifiable"] else ", not identifiable"
        note += ", at its bound" if item["at_bound"] else ""
        side = "late" if item["value"] >= 0.0 else "early"
        size = f"{abs(item['value']):.4g} {item['unit']}"
        same = "; a delay of all commands looks the same" if item["value"] > 0.0 else ""
        found.append(f"{name}: {size} {side} ({low:.4g} to {high:.4g}{note}){same}")
    return found


def _print(content: dict[str, Any]) -> None:
    console = open_console()
    console.print(f"{content['dataset']} with {content['system']}, {content['wall_s']:.1f} s")
    table = new_table("parameter", "value", "95 %", "unit", "nominal", "")
    for name, item in content["parameters"].items():
        low, high = item["ci95"]
        note = "" if item["identifiable"] else "not identifiable"
        table.add_row(
            name, f"{item['value']:.5g}", f"{low:.5g} to {high:.5g}", item["unit"],
            f"{item['nominal']:.5g}", note + (" at bound" if item["at_bound"] else ""),
        )  # fmt: skip
    console.print(table)
    for text in clock_lines(content["clocks"]):
        console.print(text, soft_wrap=True)
    for text in content["not_separable"]:
        console.print(f"the runs do not tell apart: {text} (in spans)")
    purposes = ("identification", "validation")
    guessed = any("first_guess" in item for item in content["channels"].values())
    heads = [f"first guess, {purpose}" for purpose in purposes] if guessed else []
    table = new_table("channel", "unit", "noise", *heads, *purposes)
    for name, item in content["channels"].items():
        cells = [item[key] for key in purposes]
        cells = [item["first_guess"][key] for key in purposes] + cells if guessed else cells
        table.add_row(
            name, item["unit"], f"{item['noise_rms']:.4g}",
            *("-" if value is None else f"{value:.4g}" for value in cells),
        )  # fmt: skip
    console.print(table)
    console.print(content["exchange"]["text"], soft_wrap=True)
    for path in content["files"]:
        console.print(path, soft_wrap=True)
