"""Every log of an import keeps a file of its own, whatever files and runs are called."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.data.logs import read_log
from cosim.intake.files import place
from cosim.intake.inspect import inspect
from cosim.intake.runs import Run, parts_of


def log(path: Path, size: float) -> Path:
    """A log that is told from others by its values."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [f"{0.1 * i:.1f},{size + i:g}" for i in range(20)]
    path.write_text("\n".join([f"time [s],{path.parent.name}", *rows]))
    return path


def run(name: str, *paths: Path) -> Run:
    return Run(name, "identification", parts_of(name, [inspect(path) for path in paths]))


def first(path: Path) -> float:
    """The value by which a log is told from others."""
    columns = read_log(path).columns
    return float(next(v[0] for name, v in columns.items() if "time" not in name))


def test_files_of_one_name_from_three_folders_stay_three(tmp_path: Path) -> None:
    paths = [log(tmp_path / sensor / "a.csv", k) for k, sensor in enumerate(("imu", "enc", "cam"))]
    stored = place([run("a", *paths)], tmp_path / "set", whole=True)["a"]
    assert [first(tmp_path / "set" / file) for file in stored.values()] == [0.0, 1.0, 2.0]
    # once more: what is there already is not there again
    assert place([run("a", *paths)], tmp_path / "set", whole=True)["a"] == stored
    assert len(list((tmp_path / "set" / "logs").iterdir())) == 3


@pytest.mark.parametrize("whole", [True, False], ids=["as they are", "written anew"])
@pytest.mark.parametrize("pyarrow", [True, False])
def test_runs_whose_names_are_alike_stay_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: bool, pyarrow: bool
) -> None:
    monkeypatch.setattr("cosim.intake.files.has", lambda module: pyarrow)
    names = ("still", "v +5", "v -5", "V 5")
    runs = [run(name, log(tmp_path / f"day{k}" / "x.csv", k)) for k, name in enumerate(names)]
    stored = place(runs, tmp_path / "set", whole)
    assert [first(tmp_path / "set" / stored[name][""]) for name in names] == [0.0, 1.0, 2.0, 3.0]


def test_a_log_in_the_folder_of_the_data_set_is_not_written_over(tmp_path: Path) -> None:
    path = log(tmp_path / "set" / "logs" / "a.csv", 3.0)
    before = path.read_bytes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cosim.intake.files.has", lambda module: False)
        stored = place([run("a", path)], tmp_path / "set", whole=False)["a"]
    assert path.read_bytes() == before and stored[""] != "logs/a.csv"
