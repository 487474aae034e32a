"""Runs a study: computes what is missing, tabulates everything."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..data.recording import Recording
from ..errors import UnknownNameError, ValueRangeError
from ..files import json_text, write_text
from ..installation import builder
from ..master.cores import cores
from ..spec.distribution import has
from ..system.provider import Provider
from .compute import RunnerPool, TaskResult
from .definition import Study, read_study
from .parallel import in_threads, on_scheduler
from .picture import plot
from .planning import StudyPlan, Task, plan_study
from .sensitivity import Sensitivity, sensitivities, write_csv
from .sensitivity_picture import parallel, tornado
from .store import Store
from .table import StudyTable, tabulate

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Progress:
    """How far a study is.

    Attributes:
        total, done: runs; those of an earlier start count as done.
        failed: of those done.
        label: what the last run was made with, "" at the start.
    """

    total: int
    done: int
    failed: int
    label: str = ""


@dataclass(frozen=True)
class StudyResult:
    """What a study gave.

    Attributes:
        study: what was run.
        folder: where it is.
        table: one row per run.
        computed, reused: runs that were made now, and at an earlier start.
        corrupt: result files that could not be used and were made again.
        notes: what was left out, and why.
        sensitivities: what the spread of each sampled parameter does to the results.
        files: tables and plots.
        wall_s: time that this start took [s].
    """

    study: Study
    folder: Path
    table: StudyTable
    computed: int
    reused: int
    corrupt: tuple[Path, ...]
    notes: tuple[str, ...]
    sensitivities: tuple[Sensitivity, ...]
    files: tuple[Path, ...]
    wall_s: float

    @property
    def failures(self) -> list[dict[str, Any]]:
        """Rows of the runs that failed."""
        return [row for row in self.table.rows if row["status"] != "ok"]

    def to_pandas(self) -> pd.DataFrame:
        """The table as a data frame; units are in its `attrs`."""
        return self.table.to_pandas()

    def recording(self, key: str) -> Recording:
        """The kept signals of a run, by its row's `key`.

        Raises:
            UnknownNameError: no such run, or it keeps none.
        """
        store = Store(self.folder / "runs", _warn)
        if not store.channels(key).is_file():
            raise UnknownNameError(
                f"{self.study.name}: run {key!r} has no recording; name signals in keep"
            )
        return store.recording(key)

    def to_dict(self) -> dict[str, Any]:
        """As `cosim study --json` prints it."""
        return {
            "study": self.study.name,
            "runs": len(self.table.rows),
            "computed": self.computed,
            "reused": self.reused,
            "failed": len(self.failures),
            "corrupt": [str(path) for path in self.corrupt],
            "notes": list(self.notes),
            "units": {name: unit for name, unit in self.table.units.items() if unit},
            "variants": self.table.variants(),
            "sensitivity": [row for item in self.sensitivities for row in item.rows()],
            "rows": self.table.rows,
            "files": [str(path) for path in self.files],
            "wall_s": self.wall_s,
        }


def _warn(text: str) -> None:
    warnings.warn(text, stacklevel=2)


def run_study(
    study: Study | Path | str,
    *,
    out: Path | str | None = None,
    workers: int | None = None,
    scheduler: str = "",
    isolate: float | None = None,
    retry: bool = False,
    provider: Provider | None = None,
    progress: Callable[[Progress], None] | None = None,
    warn: Callable[[str], None] = _warn,
    picture: bool = True,
) -> StudyResult:
    """Run a study, or what is missing of it.

    Args:
        study: or the path of a study file.
        out: folder for the results, `out/STUDY` by default. Runs whose results are there are not
            made again.
        workers: threads, one per core by default.
        scheduler: address of a dask scheduler, whose workers make the runs then.
        isolate: as of `Master`: each run in a process of its own, much slower.
        retry: make runs again that failed at an earlier start.
        provider: where variants come from; as of `cosim.run`.
        progress: told after each run.
        warn: told about result files that cannot be used.
        picture: plot error against cost, and what sampled parameters do.

    Raises:
        InputError: the study is wrong; nothing was run.
        KeyboardInterrupt: what is finished is kept.
    """
    started = time.perf_counter()
    if not isinstance(study, Study):
        study = read_study(study)
    if provider is None:
        provider = builder.default_provider()
    if workers is not None and workers < 1:
        raise ValueRangeError(f"{workers} workers: at least 1 is needed")
    plan = plan_study(study, provider)
    folder = Path(out) if out is not None else Path("out") / study.name
    store = Store(folder / "runs", warn)
    store.tidy()
    missing, failed = _missing(plan, store, retry)
    if missing:
        plan.provider.pin(folder / "fmus")
    done, kept = len(plan.tasks) - len(missing), list[bool]()

    def keep(_: Task, outcome: TaskResult) -> None:
        store.write(outcome.result, outcome.recording)
        kept.append(outcome.result["status"] != "ok")

    def report(label: str = "") -> None:
        if progress is not None:
            state = Progress(len(plan.tasks), done + len(kept), failed + sum(kept), label)
            progress(state)

    report()
    notes = _notes(plan)
    try:
        if missing and scheduler:
            name = f"{study.name} {time.time_ns()}"
            on_scheduler(missing, scheduler, plan.provider, isolate, name, keep, report)
        elif missing:
            count = min(workers or cores(), len(missing))
            if plan.single and isolate is None and count > 1:
                notes.append(
                    f"one thread only: the FMU of {plan.single[0]} allows one instance per "
                    "process; --isolate gives each run a process of its own"
                )
                count = 1
            in_threads(missing, RunnerPool(plan.provider, count, isolate), count, keep, report)
    except KeyboardInterrupt:
        report()  # runs may have been kept since the last report
        raise
    table = tabulate(plan, store)
    found = sensitivities(study, table, plan.points) if study.sample else []
    files = _write(study, folder, table, picture)
    if study.sample:
        files += _write_sensitivity(plan, folder, table, found, picture)
    return StudyResult(
        study=study,
        folder=folder,
        table=table,
        computed=len(missing),
        reused=len(plan.tasks) - len(missing),
        corrupt=tuple(store.corrupt),
        notes=tuple(notes),
        sensitivities=tuple(found),
        files=tuple(files),
        wall_s=time.perf_counter() - started,
    )


def _missing(plan: StudyPlan, store: Store, retry: bool) -> tuple[list[Task], int]:
    """Runs to be made, those that share instances one after the other, and failures kept."""
    groups: dict[str, list[Task]] = {}
    failed = 0
    for task in plan.tasks.values():
        result = store.read(task.key)
        if result is None or (retry and result["status"] != "ok"):
            groups.setdefault(task.group.digest, []).append(task)
        else:
            failed += result["status"] != "ok"
    return [task for tasks in groups.values() for task in tasks], failed


def _notes(plan: StudyPlan) -> list[str]:
    notes = list(dict.fromkeys(note for task in plan.tasks.values() for note in task.notes))
    same = len(plan.points) - sum(task.designed for task in plan.tasks.values())
    if same:
        notes.append(f"{same} of {len(plan.points)} points are the same run as another one")
    return notes


def _write(study: Study, folder: Path, table: StudyTable, picture: bool) -> list[Path]:
    files = [
        table.write_csv(folder / "study.csv"),
        folder / "study.json",
    ]
    if has("pyarrow"):
        files.append(table.write_parquet(folder / "study.parquet"))
    write_text(files[1], json_text(_rows(study, table), 1))
    if picture:
        files.append(folder / "study.png")
        plot(table, study.text or study.name, files[-1])
    return files


def _write_sensitivity(
    plan: StudyPlan, folder: Path, table: StudyTable, found: list[Sensitivity], picture: bool
) -> list[Path]:
    files = []
    title = plan.study.text or plan.study.name
    if found:
        files.append(write_csv(found, folder / "sensitivity.csv"))
        if picture:
            files.append(folder / "sensitivity.png")
            tornado(found, title, files[-1])
    lines = folder / "parallel.png"
    if picture and parallel(plan.study, table, plan.points, title, lines):
        files.append(lines)
    return files


def _rows(study: Study, table: StudyTable) -> Mapping[str, Any]:
    return {
        "study": study.name,
        "description": study.text,
        "units": {name: unit for name, unit in table.units.items() if unit},
        "rows": table.rows,
    }
