"""What a base installation does without the packages of the extras."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from cosim.data.logs import read_log
from cosim.data.recording import Recording, read_recording
from cosim.errors import InputError, ScenarioError
from cosim.spec import distribution


def recorded(**columns: list[object]) -> Recording:
    """Two numbers, and columns of objects."""
    time = np.array([0.0, 0.1, 0.3])
    values = np.array([[1.0, np.nan], [2.5e-300, -0.0], [np.inf, 7.0]])
    objects = {name: np.array(items, dtype=object) for name, items in columns.items()}
    values = np.column_stack([values, *(np.full(3, np.nan) for _ in columns)])
    return Recording(
        time, values, ("a.x", "b.y[1]", *columns), {"a.x": "rad/s"}, {"step": 0.1},
        {"a.p-b.q": 1.5}, error="stopped", objects=objects, notes=("one",),
    )  # fmt: skip


@pytest.fixture()
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("pyarrow", "pyarrow.parquet", "pandas"):
        monkeypatch.setitem(sys.modules, name, None)


def test_a_recording_comes_back_from_npz_as_it_was(tmp_path: Path) -> None:
    before = recorded(said=["yes", "nò", ""])
    after = read_recording(before.write_npz(tmp_path / "deep" / "r.npz"))
    assert np.array_equal(after.time, before.time)
    assert np.array_equal(after.values, before.values, equal_nan=True)
    assert np.signbit(after["b.y[1]"][1])
    assert (after.names, after.error, after.notes) == (before.names, before.error, before.notes)
    assert dict(after.units) == {"a.x": "rad/s"} and dict(after.provenance) == {"step": 0.1}
    assert dict(after.bond_energy) == {"a.p-b.q": 1.5}
    assert after["said"].tolist() == ["yes", "nò", ""]


def test_npz_is_refused_for_binaries_and_for_what_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no binaries such as raw; write Parquet"):
        recorded(raw=[b"a\0", b"", b"b"]).write_npz(tmp_path / "r.npz")
    assert not list(tmp_path.iterdir())
    np.savez(tmp_path / "log.npz", time=np.arange(3.0))
    with pytest.raises(ScenarioError, match="is not a recording of cosim"):
        read_recording(tmp_path / "log.npz")


def test_recordings_are_kept_as_parquet_and_without_pyarrow_as_npz(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    assert recorded().keep(tmp_path / "r").name == "r.parquet"
    request.getfixturevalue("bare")
    kept = recorded().keep(tmp_path / "r")
    assert kept.name == "r.npz"
    assert read_recording(kept).names == ("a.x", "b.y[1]")
    way = r"pip install 'cosim-robotics\[tables\]'"
    with pytest.raises(InputError, match=f"r.parquet: reading Parquet needs pyarrow, .*{way}"):
        read_log(tmp_path / "r.parquet")
    with pytest.raises(InputError, match=f"a recording as data frame needs pandas, .*{way}"):
        recorded().to_pandas()


def test_the_distribution_is_the_one_of_pyproject() -> None:
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    assert f'name = "{distribution.NAME}"' in text
    assert f'version = "{distribution.version()}"' in text
    assert distribution.has("numpy") and not distribution.has("no_such_package")


def test_the_other_package_of_this_name_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert distribution.shadowed() == ""
    monkeypatch.setitem(sys.modules, "cosim", ModuleType("cosim"))  # as its __init__ leaves it
    assert "pip uninstall cosim, then pip install --force-reinstall" in distribution.shadowed()
