"""What `cosim calibrate` found is said, letter by letter, and is not lost where it is written."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from cosim.cli import calibrate, diagnose
from cosim.cli.app import app
from cosim.diagnose import Diagnosis
from cosim.diagnose.answer import Verdict
from cosim.errors import InputError
from tests.calibrate.test_log_habits import read, written


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data set whose only channel has a name that looks like markup."""
    folder = tmp_path / "shaft [bold]x"
    folder.mkdir()
    read(folder, written())
    mapping = folder / "dataset.toml"
    text = mapping.read_text().replace("w = {", '"w[/x] [rad] :on:" = { column = "w",')
    mapping.write_text(text)
    return folder


def invoked(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def test_names_and_paths_are_no_markup(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out [red]"
    done = invoked("calibrate", data, "--samples", "0", "--out", out)
    assert done.exit_code == 0, done.exception
    for part in ("shaft [bold]x with", "w[/x] [rad] :on:", str(out / "calibration.json")):
        assert part in done.stdout
    assert sorted(path.name for path in out.iterdir()) == ["calibration.json", "report.html"]


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "monitor"])
def test_nothing_is_done_for_a_folder_that_cannot_be_written(
    command: str, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*args: object, **more: object) -> None:
        raise AssertionError

    monkeypatch.setattr("cosim.calibrate.calibration.calibrated", never)
    monkeypatch.setattr("cosim.diagnose.diagnose", never)
    monkeypatch.setattr("cosim.monitor.monitor", never)
    monkeypatch.setattr(
        "cosim.monitor.read_series", lambda folder, *_, **__: read(folder, written())
    )
    (tmp_path / "file").write_text("")
    done = invoked(command, data, "--out", tmp_path / "file" / "out")
    assert isinstance(done.exception, InputError)
    assert "out: cannot be written (Not a directory)" in str(done.exception)


def test_the_page_of_a_diagnosis_stays(data: Path, tmp_path: Path) -> None:
    """It took minutes."""
    for name in ("report.html", "diagnosis.json"):
        (tmp_path / name).write_text("{}")
    assert invoked("calibrate", data, "--out", tmp_path, "--samples", "0").exit_code == 0
    assert (tmp_path / "report.html").read_text() == "{}"
    assert "<html" in (tmp_path / "calibration.html").read_text()


@pytest.mark.parametrize("more", [(), ("--json",)], ids=["text", "json"])
@pytest.mark.parametrize("command", ["calibrate", "diagnose"])
def test_what_was_found_is_said_where_it_cannot_be_written(
    command: str, more: tuple[str, ...], data: Path, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    def full(path: Path, text: str) -> None:
        raise InputError(f"{path}: cannot be written (No space left on device)")

    for module in (calibrate, diagnose):
        monkeypatch.setattr(module, "write_text", full)
    monkeypatch.setattr(
        "cosim.diagnose.diagnose",
        lambda problem, *_, **__: Diagnosis(problem, Verdict("bad_data", errors=("It is odd.",))),
    )
    words = ("--samples", "0") if command == "calibrate" else ()
    done = invoked(command, data, "--out", tmp_path / "out", *words, *more)
    assert isinstance(done.exception, InputError) and "No space left" in str(done.exception)
    assert ("N.m.s/rad" if command == "calibrate" else "It is odd.") in done.stdout
