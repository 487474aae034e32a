"""A disk that is full in the middle of a file leaves the old file as it was."""

from __future__ import annotations

import contextlib
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from cosim import Recording
from cosim.calibrate.sensitivity import Correlation, tornado
from cosim.cli import app as cli
from cosim.control.linearize import margins, plot_bode
from cosim.errors import InputError
from cosim.files import make_folder

resource = pytest.importorskip("resource", reason="limits of a process are not known here")
ROOM = 64
"""Bytes that a file can take on the full disk: less than any result has."""
DATA = Path(__file__).parents[2] / "scenarios" / "motor_bench" / "data" / "MB-12"


@contextlib.contextmanager
def full_disk() -> Iterator[None]:
    """No file may grow beyond ROOM, as if the disk were full then."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def recorded() -> Recording:
    return Recording(np.arange(50.0), np.arange(100.0).reshape(50, 2), ("a.x", "a.y"), {})


def bode(path: Path) -> Path:
    frequencies = np.geomspace(0.1, 10.0, 200)
    return plot_bode([margins("a.u", frequencies, 1.0 / (1j * frequencies))], path)


WRITERS: dict[str, Callable[[Path], object]] = {
    "run.csv": lambda path: recorded().write_csv(path),
    "run.parquet": lambda path: recorded().write_parquet(path),
    "run.png": lambda path: recorded().plot(path=path),
    "tornado.png": lambda path: tornado(Correlation({"a.b": 0.5, "a.c": -0.9}, 0.3, 40), path),
    "bode.png": bode,
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_is_drawn_and_recorded(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    WRITERS[name](path)
    old = path.read_bytes()
    with full_disk(), pytest.raises(InputError, match=rf"{name}: cannot be written .*--out"):
        WRITERS[name](path)
    assert len(old) > ROOM
    assert path.read_bytes() == old and list(tmp_path.iterdir()) == [path]


def dataset(folder: Path, duration: float, current: float | None = None) -> Path:
    """The motor bench's data, cut short; the current a constant if one is given."""
    copy = folder / "MB-12"
    shutil.copytree(DATA, copy)
    shutil.copy(DATA.parent / "motor_bench.toml", folder)
    for file in (copy / "runs").iterdir():
        with np.load(file) as archive:
            table = {name: archive[name] for name in archive.files}
        kept = table["time"] <= table["time"][0] + duration
        table = {name: values[kept] for name, values in table.items()}
        if current is not None:
            table["current"] = np.full(int(kept.sum()), current)
        np.savez(file, **table)
    return copy


def command(*words: object) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["cosim", *map(str, words)])
        try:
            cli.main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


@pytest.mark.parametrize(
    ("words", "current", "names"),
    [
        # a sensor that says nothing ends a diagnosis at once
        (["diagnose"], 0.0, ["diagnosis.json", "models.json", "report.html"]),
        (["calibrate", "--samples", 0], None, ["calibration.json", "report.html"]),
    ],
    ids=["diagnose", "calibrate"],
)
@pytest.mark.slow
def test_results_of_a_command(
    words: list[object],
    current: float | None,
    names: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    data, out = dataset(tmp_path, 1.0, current), tmp_path / "out"
    whole = [*words, data, "--mapping", DATA.parents[1] / "dataset.toml", "--out", out]
    assert command(*whole) == 0
    old = {path: path.read_bytes() for path in out.iterdir()}
    assert sorted(path.name for path in old) == names
    capsys.readouterr()
    with full_disk():
        code = command(*whole)
    assert code == 2 and "cannot be written (File too large)" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in out.iterdir()} == old


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"out: cannot be written \(Not a directory\)"):
        make_folder(tmp_path / "file" / "out")
