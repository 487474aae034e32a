"""`cosim twin`: a model runs beside its machine."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer

from ..files import claimed
from .output import say
from .pairs import pairs
from .streams import print_json, stdout_for_json


def twin_command(
    dataset: Annotated[
        str, typer.Argument(metavar="DATASET", help="Data set whose rig this is, or a scenario.")
    ],
    source: Annotated[
        str, typer.Option(help="tcp://HOST:PORT, udp://:PORT, mqtt://HOST/TOPIC, a file, or -.")
    ],
    pace: Annotated[
        float, typer.Option(help="Times real time for a recorded stream; 0: as fast as possible.")
    ] = 1.0,
    calibrated: Annotated[
        Path | None, typer.Option(help="calibration.json whose parameter values the model takes.")
    ] = None,
    variants: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="INSTANCE=VARIANT", help="E.g. load=+coulomb."),
    ] = None,
    mapping: Annotated[
        Path | None, typer.Option(help="A dataset.toml [found by the data set's rig].")
    ] = None,
    false_alarms: Annotated[float, typer.Option(help="Expected false alarms per hour.")] = 0.01,
    margin: Annotated[
        float, typer.Option(help="What the model may be off by without a fault [sigma].")
    ] = 0.0,
    wait: Annotated[
        float | None, typer.Option(help="How late samples may come [s; 0.1 for udp, else 0].")
    ] = None,
    settle: Annotated[float, typer.Option(help="No alarms so long after a run's begin [s].")] = 0.0,
    report: Annotated[float, typer.Option(help="Time between reports [s].")] = 1.0,
    idle: Annotated[
        float | None, typer.Option(help="End when nothing comes for so long [s; never].")
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="End after so much of the stream's time [s; never].")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="New folder, a data set of the samples.")] = None,
) -> None:
    """Run a model beside its machine: residuals, alarms and lateness as JSON lines.

    Example: `cosim twin motor_bench --source mqtt://localhost/bench --out out/live`
    """
    from ..live.folder import Folder
    from ..live.reading import read_reading
    from ..live.sources import Source
    from ..live.watch import Settings, Watch

    if wait is None:
        wait = 0.1 if source.startswith("udp://") else 0.0
    settings = Settings(pace, false_alarms, margin, wait, settle, report, idle, duration)
    reading = read_reading(
        dataset,
        mapping=mapping,
        calibrated=calibrated,
        variants=pairs(variants, "--set", "INSTANCE=VARIANT"),
    )
    with ExitStack() as place:
        folder = None
        if out is not None:
            place.enter_context(claimed(out))
            folder = Folder(out, reading)
        watch = Watch(reading, settings, _emit, folder)
        say(f"{reading.problem.name}: waiting for {source}")
        with stdout_for_json():
            try:
                watch.follow(Source(source))
            except KeyboardInterrupt:  # the way to end a stream that has no end
                watch.summary()


def _emit(event: dict[str, Any]) -> None:
    print_json(event, indent=None)
