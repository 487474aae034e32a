"""Runs scenarios: builds the system, runs it, compares, checks, writes files."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import need_function, need_number, need_table, need_text
from ..data.comparison import Comparison, compare, convert_reference
from ..data.recording import Recording
from ..errors import StepError, ValueRangeError
from ..files import claimed, json_text, write_text
from ..installation import builder
from ..master.algorithms import names
from ..master.master import Master
from ..master.outline import Outline
from ..master.session import Session
from ..master.twin import Twin
from ..scenario import scenario as scenarios
from ..scenario.checks import CheckResult, evaluate, met
from ..scenario.scenario import Scenario
from ..ssp import read_scenario
from ..system.provider import Provider
from ..system.variants import apply
from ..view.scene import Scenes, needs, scenes
from .checks_table import checks_html
from .comparison_table import ComparedQuantity, overview
from .measures import measurable
from .plots import plot_overview, plot_run
from .preparation import (
    adjusted,
    left_out,
    recorded_signals,
    recording_interval,
    swapped_system,
)

Vector = NDArray[np.float64]
WHOLE = ("result.json", "report.html", "overview.png")
"""Files that tell of all runs together; where one of them fails there are none."""
SHOWN_RUNS = 3
"""Recordings that a result of many runs shows in a notebook."""


@dataclass(frozen=True)
class RunResult:
    """One run of a scenario.

    Attributes:
        scenario: what was run.
        variants: instance -> variant that was used.
        recording: what was recorded.
        comparisons: by name.
        checks: outcomes.
        wall_s: time that it took, without building FMUs [s].
        fmu_steps: steps of all FMUs together.
        notes: what a changed variant made the run leave out.
    """

    scenario: Scenario
    variants: Mapping[str, str]
    recording: Recording
    comparisons: Mapping[str, Comparison]
    checks: tuple[CheckResult, ...]
    wall_s: float
    fmu_steps: int
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<RunResult of {self.scenario.name}: {met(self.checks)}, {self.recording!r}>"

    def _repr_html_(self) -> str:
        from ..display.html import Html, join

        checks = checks_html(self.scenario.name, self.checks)
        differences = (item._repr_html_() for item in self.comparisons.values())
        return join(*map(Html, (checks, self.recording._repr_html_(), *differences)))

    def plot(self, path: Path | str | None = None) -> Any:
        """Plot what the scenario describes or names, else what is compared, else everything."""
        if self.scenario.plots:
            whole = self.scenario
            return plot_run(
                self.recording, whole.plots, whole.references, self.comparisons, whole.name, path
            )
        references: dict[str, list[tuple[Vector, Vector, str]]] = {}
        for item in self.scenario.references.values():
            columns = convert_reference(self.recording, item).T
            for name, values in zip(item.signals, columns, strict=True):
                references.setdefault(name, []).append((item.times, values, item.text))
        signals = self.scenario.plot or tuple(references) or None
        return self.recording.plot(signals, path, references)


@dataclass(frozen=True)
class Result:
    """All runs of a scenario.

    Attributes:
        name: of the scenario.
        runs: by run name; one unnamed run ("") for most scenarios.
        files: what was written.
    """

    name: str
    runs: Mapping[str, RunResult]
    files: tuple[Path, ...] = field(default=())

    def __repr__(self) -> str:
        return f"<Result of {self.name}: runs {len(self.runs)}, {met(self.checks.values())}>"

    @property
    def recording(self) -> Recording:
        """The recording of a scenario with one run.

        Raises:
            ValueRangeError: there are several; take `runs[name].recording`.
        """
        if len(self.runs) != 1:
            of = f"{self.name} has {len(self.runs)} runs; take runs[name].recording, name one of "
            raise ValueRangeError(f"{of}{', '.join(self.runs)}")
        return next(iter(self.runs.values())).recording

    @property
    def checks(self) -> dict[str, CheckResult]:
        """Outcomes of all checks by name (`run: name` where there are several runs)."""
        return {
            _prefixed(run, check.name): check
            for run, result in self.runs.items()
            for check in result.checks
        }

    @property
    def overview(self) -> list[ComparedQuantity]:
        """What the runs say of the same quantities, side by side."""
        return overview(
            {
                run: tuple(zip(result.scenario.checks, result.checks, strict=True))
                for run, result in self.runs.items()
            }
        )

    def _repr_html_(self) -> str:
        from ..display.html import Html, join

        if len(self.runs) == 1:
            return next(iter(self.runs.values()))._repr_html_()
        checks = [replace(check, name=name) for name, check in self.checks.items()]
        shown = [run.recording._repr_html_() for run in list(self.runs.values())[:SHOWN_RUNS]]
        return join(*map(Html, (checks_html(self.name, checks), *shown)))

    def to_dict(self) -> dict[str, Any]:
        """As `cosim run --json` prints it."""
        first = next(iter(self.runs.values()))
        return {
            "scenario": self.name,
            "variants": dict(first.variants),
            "algorithm": first.scenario.algorithm,
            "step": first.scenario.step,
            "simulated_s": sum(run.scenario.duration for run in self.runs.values()),
            "wall_s": sum(run.wall_s for run in self.runs.values()),
            "fmu_steps": sum(run.fmu_steps for run in self.runs.values()),
            "energy_residual_J": sum(run.recording.energy_residual for run in self.runs.values()),
            "comparison": {
                _prefixed(name, key): {
                    "unit": item.unit,
                    "rms": item.rms,
                    "max": item.max,
                    "reference": item.reference,
                }
                for name, run in self.runs.items()
                for key, item in run.comparisons.items()
            },
            "checks": [{**check.to_dict(), "name": name} for name, check in self.checks.items()],
            "notes": list(dict.fromkeys(n for run in self.runs.values() for n in run.notes)),
            "files": [str(path) for path in self.files],
        }


def _prefixed(run: str, name: str) -> str:
    return f"{run}: {name}" if run else name


@dataclass(frozen=True)
class Prepared:
    """A scenario whose FMUs are chosen and whose values are set, ready to run.

    Attributes:
        scenario: what is run.
        declared: instance -> variant that the scenario declares.
        variants: instance -> variant that is used.
        master: system, algorithm and step.
        record: signals to record.
        every: record every n-th communication point.
        notes: what a changed variant made the run leave out.
        scenes: of the instances, which recordings keep; empty if they are not wanted.
    """

    scenario: Scenario
    declared: Mapping[str, str]
    variants: Mapping[str, str]
    master: Master
    record: tuple[str, ...]
    every: int
    notes: tuple[str, ...]
    scenes: Scenes = field(default_factory=dict)

    @property
    def _arguments(self) -> dict[str, Any]:
        return {
            "inputs": self.scenario.inputs,
            "record": self.record,
            "every": self.every,
            "start": self.scenario.start,
        }

    def run(self, progress: Callable[[float], None] | None = None) -> Recording:
        """Run it once."""
        found = self.master.run(self.scenario.duration, **self._arguments, progress=progress)
        if self.scenes:
            found = replace(found, provenance={**found.provenance, "scene": self.scenes})
        return found

    def session(self) -> Session:
        """Instances for many runs, one after the other."""
        return Session(self.master, self.scenario.duration, **self._arguments)

    def twin(self) -> Twin:
        """Instances that are stepped from outside."""
        about = {"scene": self.scenes} if self.scenes else {}
        return Twin(self.master, self.scenario.duration, **self._arguments, about=about)

    def outline(self) -> Outline:
        """Everything checked, inputs tabulated, no FMU created."""
        return self.master.outline(self.scenario.duration, **self._arguments)

    def conclude(self, recording: Recording, wall_s: float) -> RunResult:
        """Compare and check what was recorded in `wall_s`."""
        # of a whole run the last point that is recorded is less than a record period before its end
        begin, period = self.scenario.start, self.every * self.master.step
        end = begin + self.scenario.duration - period
        comparisons = {
            name: compare(recording, reference)
            for name, reference in self.scenario.references.items()
        }
        return RunResult(
            scenario=self.scenario,
            variants=self.variants,
            recording=recording,
            comparisons=comparisons,
            checks=tuple(
                evaluate(
                    check,
                    recording,
                    comparisons,
                    check.unfit(self.declared, self.variants) or check.unreached(recording, end),
                )
                for check in self.scenario.checks
            ),
            wall_s=wall_s,
            fmu_steps=int(recording.provenance["fmu_steps"]),
            notes=(*self.notes, *recording.notes),
        )


def prepare(
    scenario: Scenario,
    provider: Provider | None,
    *,
    variants: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    base: Path | None = None,
    isolate: float | None = None,
    guard: bool = False,
    scene: bool = False,
) -> Prepared:
    """Choose the FMUs of a scenario and set its values; arguments as of `run_scenario`.

    Raises:
        InputError: wrong names, variants or values (see the subclasses).
    """
    usual = apply(scenario.system.instances, scenario.variants, provider, scenario.folder)
    instances = apply(usual, variants or {}, provider, base)
    changed = {name for name in instances if instances[name] != usual[name]}
    system, notes = swapped_system(scenario, provider, instances, changed, parameters or {})
    notes += left_out(system, changed)
    record, others = recorded_signals(scenario, system, changed)
    looks = scenes(system) if scene else {}
    record = tuple(dict.fromkeys([*record, *needs(looks)]))
    master = Master(
        system, scenario.algorithm, scenario.step, scenario.tolerance, scenario.name,
        isolate=isolate, guard=guard, options=scenario.options,
    )  # fmt: skip
    every = recording_interval(scenario)
    coarse = measurable(scenario, system, every)
    return Prepared(
        scenario, usual, instances, master, record, every, (*notes, *others, *coarse), looks
    )


def run_scenario(
    scenario: Scenario,
    provider: Provider | None,
    *,
    variants: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    progress: Callable[[float], None] | None = None,
    base: Path | None = None,
    isolate: float | None = None,
    guard: bool = False,
    scene: bool = False,
) -> RunResult:
    """Run one scenario.

    Args:
        scenario: what to run.
        provider: where variants come from.
        variants: changes on top of the scenario's. Parameters and recorded signals of the scenario
            that a changed variant does not have are left out, with a note.
        parameters: values on top of the scenario's.
        progress: told now and then which fraction is done.
        base: folder against which .fmu paths among the variants are taken.
        isolate, guard: as of `Master`.
        scene: record what the scenes of the FMUs show, too, and keep the scenes.

    Raises:
        CosimError: see `errors`; a `StepError` carries the recording up to the failure.
    """
    prepared = prepare(
        scenario, provider, variants=variants, parameters=parameters, base=base, isolate=isolate,
        guard=guard, scene=scene,
    )  # fmt: skip
    started = time.perf_counter()
    recording = prepared.run(progress)
    return prepared.conclude(recording, time.perf_counter() - started)


def find_runs(
    name: str, folder: Path | None, duration: float | None, step: float | None
) -> tuple[str, str, str, dict[str, Scenario]]:
    """Name and description of the whole, the run that was asked for ("" for all), the runs."""
    if name.endswith((".ssp", ".ssd")):
        item = read_scenario(name, duration=duration, step=step)
        return Path(name).stem, "", "", {"": item}
    file, wanted = scenarios.find(name, folder)
    chosen = [wanted] if wanted else list(file.runs)
    return file.name, file.text, wanted, {run: file.scenario(run) for run in chosen}


def run(
    name: Path | str,
    *,
    variants: Mapping[str, str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    algorithm: str | None = None,
    options: Mapping[str, Any] | None = None,
    step: float | None = None,
    duration: float | None = None,
    record: Sequence[str] = (),
    record_period: float | None = None,
    provider: Provider | None = None,
    out: Path | str | None = None,
    folder: Path | None = None,
    progress: Callable[[str, float], None] | None = None,
    isolate: float | None = None,
    guard: bool = False,
) -> Result:
    """Run a scenario, all its runs or the one that the name ends with.

    Args:
        name: `motor_bench`, `crawler_paper/SET1_1`, a folder or a scenario.toml; an .ssp archive
            or .ssd file.
        variants: instance (or component, or slot) -> variant, fidelity, or `+effect`.
        parameters: `instance.name` -> value.
        options: of the algorithm; those of the scenario if that is its algorithm, too.
        algorithm, step, duration: replace the scenario's; a shorter run drops the checks that it
            does not reach.
        record: signals that are recorded besides those of the scenario, `motor.i` or a vector.
        record_period: replaces the scenario's [s]; a whole number of steps.
        provider: where variants come from; by default they are built from the sources, or taken
            from the installed FMUs where those are missing.
        out: folder for recording, plot and result; nothing is written without it.
        folder: where scenarios are looked for; the library's by default.
        progress: told run and fraction now and then.
        isolate, guard: as of `Master`.

    Raises:
        CosimError: see `errors`.
    """
    name = str(name) if isinstance(name, Path) else name
    need_text("the scenario to run", name, 'give its name or path, as in run("motor_bench")')
    for what, table, example in (
        ("variants", variants, 'variants={"gearbox": "lossy"}'),
        ("parameters", parameters, 'parameters={"load.J": 0.09}'),
        ("options", options, 'options={"extrapolation": 1}'),
    ):
        need_table(f"{what} of a run", table or {}, example)
    for key, wanted in (variants or {}).items():
        need_text(f"the variant of {key}", wanted, 'write variants={"gearbox": "lossy"}')
    for what, value in (
        ("step", step),
        ("duration", duration),
        ("record period", record_period),
        ("time limit isolate", isolate),
    ):
        if value is not None:
            need_number(f"{what} of a run", value, "give it in seconds")
    if algorithm is not None:
        need_text("the algorithm of a run", algorithm, f"take one of {', '.join(names())}")
    need_function("progress of a run", progress)
    if provider is None:
        provider = builder.default_provider()
    found = find_runs(name, folder, duration, step)
    with contextlib.nullcontext() if out is None else claimed(Path(out)):
        return _run(
            found, None if out is None else Path(out), provider, progress,
            {"algorithm": algorithm, "options": options, "step": step, "duration": duration,
             "record": record, "record_period": record_period},
            {"variants": variants, "parameters": parameters, "isolate": isolate, "guard": guard,
             "scene": True},
        )  # fmt: skip


def _run(
    found: tuple[str, str, str, dict[str, Scenario]],
    out: Path | None,
    provider: Provider,
    progress: Callable[[str, float], None] | None,
    adjustments: Mapping[str, Any],
    how: Mapping[str, Any],
) -> Result:
    """Make the runs that were found; arguments as of `run`."""
    whole, text, wanted, items = found
    chosen = list(items)
    results: dict[str, RunResult] = {}
    files: list[Path] = []
    for run_name, item in items.items():
        item = adjusted(item, **adjustments)
        place = None if out is None else out / run_name
        told = None if progress is None else partial(progress, item.name)
        try:
            result = run_scenario(item, provider, progress=told, base=Path.cwd(), **how)
        except StepError as error:
            if out is not None and place is not None and error.recording is not None:
                for stale in (
                    *(place / n for n in ("recording.csv", "plot.png")),
                    *(out / n for n in WHOLE),
                ):  # of a run before
                    stale.unlink(missing_ok=True)
                path = error.recording.keep(place / "recording")
                error.add_note(f"the recording up to then is in {path}")
            raise
        results[run_name] = result
        if place is not None:
            files += [
                result.recording.keep(place / "recording"),
                result.recording.write_csv(place / "recording.csv"),
            ]
            result.plot(place / "plot.png")
            files.append(place / "plot.png")
    single = wanted or (chosen[0] if len(chosen) == 1 else "")
    runs = {"": next(iter(results.values()))} if len(chosen) == 1 else results
    final = Result(whole + (f"/{single}" if single else ""), runs, tuple(files))
    if out is not None:
        quantities = final.overview
        if quantities and len(runs) > 1:
            path = out / "overview.png"
            plot_overview(quantities, text or whole, path)
            files.append(path)
        path = out / "result.json"
        final = replace(final, files=(*files, path))
        write_text(path, json_text(final.to_dict()))
    return final
