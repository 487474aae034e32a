"""The page of a calibration: how well the model fits, its parameters, and what they rest on."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..diagnose.adding import scenario_of
from ..diagnose.story.facts import Facts, named_unit
from ..diagnose.whiteness import CALIBRATED
from ..display.bars import signed, within
from ..display.document import document, links, section
from ..display.html import Cell, Html, command, explained, join, number, table, tag, words
from ..files import write_text
from . import sections
from .figures import HEIGHT, Signals, all_signals, ordered, telling
from .material import Material, ShownRun, shown_channels, symbols

if TYPE_CHECKING:
    from ..calibrate.estimate import Estimate

Vector = NDArray[np.float64]
Residuals = Iterable[tuple[str, Vector]]


def write_calibration_page(
    content: Mapping[str, Any], estimate: Estimate, unused: Residuals, path: Path
) -> None:
    """Write the page.

    Args:
        content: as of `cosim calibrate --json`.
        estimate: what was fitted.
        unused: residuals over sigma in the runs that were not fitted.
        path: of the page.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(path, calibration_page(content, estimate, unused))


def calibration_page(content: Mapping[str, Any], estimate: Estimate, unused: Residuals) -> str:
    """The page as HTML; arguments as of `write_calibration_page`."""
    problem = estimate.problem
    residuals = dict(estimate.residuals) | dict(unused)
    runs = tuple(
        ShownRun(run.name, run.purpose, run.logged, run.data,
                 {"before": residuals[run.name]} if run.name in residuals else {})
        for run in problem.runs
    )  # fmt: skip
    bounds = {p.name: (p.minimum, p.maximum) for p in problem.parameters}
    values: dict[str, float] = {}
    for p, value in zip(problem.parameters, estimate.theta.tolist(), strict=True):
        if p.role != "nuisance" and not p.run:
            values.update(p.set(value))
    material = Material(content, shown_channels(problem), runs, None, symbols(problem))
    return rendered(material, bounds, values, scenario_of(problem))


def rendered(
    material: Material,
    bounds: Mapping[str, tuple[float, float]],
    values: Mapping[str, float],
    scenario: str,
) -> str:
    """The page of what was collected.

    Args:
        material: table as of `cosim calibrate --json`, signals.
        bounds: of the parameters.
        values: full variable name -> calibrated value.
        scenario: that the values can be tried in, "" without one.
    """
    content = material.table
    facts = Facts(content)
    purpose = (
        "validation" if any(run.purpose == "validation" for run in material.runs)
        else "identification"
    )  # fmt: skip
    sizes = {
        name: facts.over_noise("channels", name, purpose)
        for name, row in content["channels"].items()
        if row[purpose] is not None
    }
    worst = max(sizes, key=lambda name: sizes[name], default="")
    good = bool(sizes) and sizes[worst] <= CALIBRATED
    chosen = telling(material, worst, purpose)
    signals = Signals(material, chosen.name if chosen is not None else "")
    runs = ordered(material.runs, chosen)
    where = "runs that were not used for fitting" if purpose == "validation" else "the fitted runs"
    count = len(content["parameters"])
    headline = join(
        f"{count} parameters were fitted; on {where} the model misses its worst channel, ",
        tag("b", worst), ", by ", facts.ratio("channels", worst, purpose), " its sensor's noise: ",
        "that is as good as a model can be." if good else "calibration alone does not explain the "
        "machine.",
    ) if worst else Html(f"{count} parameters were fitted.")  # fmt: skip
    details = [
        _parameters(facts, material, bounds),
        _errors(facts, material),
        all_signals(material, signals, runs),
        _tornado(content["sensitivity"], material),
        sections.findings(facts),
        sections.glossary(material),
    ]
    names = [channel.name for channel in material.channels]
    plot = signals.shown(names.index(worst), runs, "first", HEIGHT) if worst in names else ""
    first = tag(
        "div",
        tag("div", _meaning(facts), _next(facts, values, scenario, good), class_="cards"),
        tag("section", tag("h2", f"Measured and modelled: {worst}"), tag("p", "Drag to zoom, "
            "double-click to see all, hover or tap to read values.", class_="note hint"), plot),
        class_="first",
    )  # fmt: skip
    kind = "nothing_missing" if good else "unexplained"
    about = (
        f"system {content['system']}, {len(runs)} runs, {content['evaluations']} simulated runs, "
        f"{content['wall_s']:.0f} s"
    )
    return document(
        f"Calibration of {content['dataset']}",
        tag("header", tag("h1", f"Calibration of {content['dataset']}"), tag("small", about),
            class_="top"),
        tag("div", tag("div", "Calibrated" if good else "Calibrated, but more is missing",
                       class_="label"),
            tag("p", headline, class_="sentence"), class_=f"verdict {kind}"),
        first, links(details), *details, signals=signals.store,
    )  # fmt: skip


def _open(facts: Facts) -> list[str]:
    return [name for name, p in facts.at("parameters").items() if not p["identifiable"]]


def _codes(names: Iterable[str]) -> Html:
    return words([tag("code", name) for name in names])


def _meaning(facts: Facts) -> Html:
    """What the fit says of its parameters."""
    parameters = facts.at("parameters")
    unknown = _open(facts)
    edge = [name for name, p in parameters.items() if p["at_bound"]]
    known = len(parameters) - len(unknown)
    parts = [join(f"The runs determine {known} of {len(parameters)} parameters.")]  # fmt: skip
    if unknown:
        parts.append(
            join("They alone do not determine ", _codes(unknown), ": what is known of ",
                 "it" if len(unknown) == 1 else "them", " rests on the declared bounds.")
        )  # fmt: skip
    if edge:
        parts.append(
            join(_codes(edge), " ended at a bound: the bound is wrong, or the parameter makes up "
                 "for something that the model lacks.")
        )  # fmt: skip
    parts += [
        join("Not told apart, in spans of the parameters: ", tag("code", text), ".")
        for text in facts.at("not_separable")
    ]
    return tag("section", tag("h2", "What it means"), *(tag("p", p) for p in parts), class_="card")


def _next(facts: Facts, values: Mapping[str, float], scenario: str, good: bool) -> Html:
    """What to do with the result."""
    steps: list[Html] = []
    if not good:
        steps.append(
            join(tag("b", "Find what is missing"), ": run ", tag("code", "cosim diagnose"),
                 " on the same data set; it names the effect, if the catalogue has it.")
        )  # fmt: skip
    if scenario:
        pairs = " ".join(f"--param {name}={value:.6g}" for name, value in values.items())
        line = f"cosim run {shlex.quote(scenario)} {pairs}"
        steps.append(join(tag("b", "Use the values"), ", for instance:", command(line)))
    else:
        steps.append(
            join(tag("b", "Use the values"), ": write them under ", tag("code", "[parameters]"),
                 " of the system file.")
        )  # fmt: skip
    if _open(facts):
        steps.append(
            join(tag("b", "Measure"), " ", _codes(_open(facts)), " otherwise, or add runs that "
                 "move more, faster, slower or loaded.")
        )  # fmt: skip
    body = tag("ol", *(tag("li", step) for step in steps))
    return tag("section", tag("h2", "What to do next"), body, class_="card")


def _parameters(
    facts: Facts, material: Material, bounds: Mapping[str, tuple[float, float]]
) -> Html:
    """Values with their intervals."""
    local = facts.at("sensitivity", "local")
    rows = []
    for name, p in facts.at("parameters").items():
        (minimum, maximum), (low, high) = bounds[name], p["ci95"]
        rows.append(
            [explained(name, material.symbols.get(name, "")),
             Cell(number(p["value"]), p["value"], "over" if p["at_bound"] else ""),
             Cell(facts.interval("parameters", name), p["ci95"][0],
                  "" if p["identifiable"] else "over"),
             named_unit(p["unit"]), p["nominal"],
             Cell(within(p["value"], low, high, minimum, maximum, p["nominal"]),
                  (p["value"] - minimum) / (maximum - minimum) if maximum > minimum else None),
             Cell(number(local.get(name)), local.get(name))]
        )  # fmt: skip
    head = [
        "parameter", "value", ("95 % interval", sections.WORDS["95 % interval"]), "unit",
        ("nominal", "Value of the rig's sheet, from which the fit began."),
        ("within its bounds", "Dot: value, bar: 95 % interval, tick: nominal value, line: bounds."),
        ("weight", "RMS change of the channels, in their noise, for a change over all bounds."),
    ]  # fmt: skip
    return section(
        "parameters", "Parameters", table(head, rows, "calibrated parameters"),
        sections.clocks(facts),
    )  # fmt: skip


def _errors(facts: Facts, material: Material) -> Html:
    """Errors by channel and by run."""
    rows: list[list[object]] = [
        [name, named_unit(row["unit"]), row["noise_rms"],
         *(facts.error_cell("channels", name, p) for p in ("identification", "validation"))]
        for name, row in facts.at("channels").items()
    ]  # fmt: skip
    head = ["channel", "unit", ("noise", sections.WORDS["noise"]),
            ("fitted runs", sections.WORDS["fitted"]),
            ("unused runs", sections.WORDS["unused"])]  # fmt: skip
    return section(
        "errors", "Errors of the model",
        tag("p", "RMS difference between measurement and simulation; in brackets over the noise."),
        table(head, rows, "errors by channel"), sections.by_run(material),
    )  # fmt: skip


def _tornado(sensitivity: Mapping[str, Any], material: Material) -> Html:
    """Which parameters the fit hangs on."""
    index, limit = sensitivity["correlation"], sensitivity["correlation_limit"]
    rows = [
        [explained(name, material.symbols.get(name, "")), Cell(signed(value, limit), abs(value)),
         value]
        for name, value in sorted(index.items(), key=lambda item: -abs(item[1]))
    ]  # fmt: skip
    if not rows:
        return Html("")
    return section(
        "tornado", "What the fit hangs on",
        tag("p", "Correlation of each parameter with the error over random parameter sets around "
            f"the result. What stays within the dashed lines (± {limit:.2f}) may be chance."),
        table(["parameter", "correlation", ""], rows, "correlation index"),
    )  # fmt: skip
