"""The table's figures are right, threads do not matter, failures are results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import cosim
from cosim.errors import UnitError, UnknownNameError, ValueRangeError
from cosim.study import run_study, study_from
from cosim.study.compute import GroupRunner, StudyChangedError
from cosim.study.picture import _points
from cosim.study.planning import plan_study
from cosim.study.table import StudyTable
from tests.cosim_fmus import rewrite
from tests.coupling.faulty import MODES
from tests.study.conftest import BASE
from tests.study.test_resume import figures
from tests.tiny_fmus import V, tiny

SWAP = {
    "set": {"gearbox": ["ratio", "elastic"]},
    "param": {"load.J": [0.07, 0.09]},
    "keep": ["load.w", "motor.tau"],
}


def test_a_table_is_written_without_looking_at_all_rows_for_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[int] = []
    columns = StudyTable.columns.fget
    assert columns is not None

    def counted(table: StudyTable) -> list[str]:
        looks.append(len(table.rows))
        return columns(table)

    monkeypatch.setattr(StudyTable, "columns", property(counted))
    rows = [{"key": str(k), "status": "ok", "step": 1e-3, "rms.w": 0.5 * k} for k in range(50)]
    text = StudyTable(rows).write_csv(tmp_path / "table.csv").read_text(encoding="utf-8")
    assert len(looks) == 1
    assert text.splitlines()[0] == "key,status,step,rms.w" and text.count("\n") == 51


def test_rows_are_what_cosim_run_gives_bit_for_bit(run: Any, provider: Any) -> None:
    result = run(SWAP)
    assert len(result.table.rows) == 4 and not result.failures
    for row in result.table.rows:
        alone = cosim.run(
            "motor_bench/ST1",
            variants={"gearbox": row["set.gearbox"]},
            parameters={"load.J": row["param.load.J"]},
            duration=0.7,
            step=1e-3,
            provider=provider,
        ).runs[""]
        for name, item in alone.comparisons.items():
            assert row[f"rms.{name}"] == item.rms and row[f"max.{name}"] == item.max
            assert result.table.units[f"rms.{name}"] == item.unit
        assert row["fmu_steps"] == alone.fmu_steps == 2800
        assert row["energy_residual"] == alone.recording.energy_residual
        kept = result.recording(row["key"])
        assert kept.names == ("load.w", "motor.tau")
        for name in kept.names:
            assert np.array_equal(kept[name], alone.recording[name])
        assert kept.provenance["instances"]["load"]["parameters"]["J"] == row["param.load.J"]
        assert row["x_real_time"] == pytest.approx(0.7 / row["wall"], rel=1e-12)  # rounding


@pytest.mark.parametrize("reuse", [True, False])
def test_threads_and_reuse_change_nothing(run: Any, tmp_path: Path, reuse: bool) -> None:
    table = {
        "set": {"gearbox": ["ratio", "elastic+backlash"], "motor": ["electrical", "sampled"]},
        "param": {"load.J": {"uniform": [0.07, 0.09]}},
        "sample": {"count": 4},
        "keep": ["load.w"],
    }
    one = run(table, workers=1, out=tmp_path / "one")
    two = run({**table, "reuse": reuse}, workers=2, out=tmp_path / "two")
    assert len(one.table.rows) == 16
    assert [{**row, "key": ""} for row in figures(one.table.rows)] == [
        {**row, "key": ""} for row in figures(two.table.rows)
    ]
    for first, second in zip(one.table.rows, two.table.rows, strict=True):
        a, b = one.recording(first["key"]), two.recording(second["key"])
        assert np.array_equal(a.values, b.values)


def test_errors_are_differences_from_the_reference_run(run: Any) -> None:
    table = {
        "step": [1e-3, 1e-4],
        "param": {"load.J": [0.07, 0.09]},
        "algorithm": ["jacobi", "gauss_seidel"],
        "signals": ["load.w"],
        "period": 1e-2,
    }
    result = run({**table, "reference": "finest"})
    assert len(result.table.rows) == 8
    frame = result.to_pandas().set_index(["algorithm", "param.load.J", "step"])
    assert (frame["role"] == "").all()
    for (algorithm, load, step), row in frame.iterrows():
        reference = result.recording(frame.loc[(algorithm, load, 1e-4), "key"])
        mine = result.recording(row["key"])
        apart = mine["load.w"] - reference["load.w"]
        assert len(apart) == 71
        # sums in another order
        assert row["error.load.w"] == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-12)
        assert row["error_max.load.w"] == np.max(np.abs(apart))
        assert (row["error.load.w"] == 0.0) == (step == 1e-4)
    named = run({**table, "step": 1e-3, "reference": {"step": 1e-4, "algorithm": "gauss_seidel"}})
    assert named.computed == 0  # all of it was there
    roles = [row["role"] for row in named.table.rows]
    assert roles == ["", "", "", "", "reference", "reference"]
    for row in named.table.rows[:4]:
        wanted = frame.loc[("gauss_seidel", row["param.load.J"], 1e-4), "key"]
        apart = named.recording(row["key"])["load.w"] - named.recording(wanted)["load.w"]
        assert row["error.load.w"] == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-12)


def test_signals_compared_by_default_are_those_that_the_scenario_compares(run: Any) -> None:
    result = run({"step": [1e-3, 5e-4], "reference": "finest"})
    names = {name for name in result.table.columns if name.startswith("error.")}
    assert names == {"error.encoder.w_meas", "error.motor.i_measured", "error.motor.u"}


def test_the_table_opens_in_pandas(run: Any) -> None:
    result = run(SWAP, picture=True)
    frame = pd.read_parquet(result.folder / "study.parquet")
    assert list(frame["set.gearbox"]) == ["ratio", "ratio", "elastic", "elastic"]
    assert frame["rms.speed"].dtype == np.float64
    assert frame.groupby("set.gearbox")["rms.speed"].mean().notna().all()
    text = pd.read_csv(result.folder / "study.csv")
    assert list(text["rms.speed [rad/s]"]) == list(frame["rms.speed"])  # every digit is kept
    fields = pq.read_schema(result.folder / "study.parquet")
    assert fields.field("rms.speed").metadata[b"unit"] == b"rad/s"
    assert (result.folder / "study.png").stat().st_size > 10_000
    own = result.to_pandas()
    assert own.attrs["units"]["step"] == "s" and list(own.columns) == list(frame.columns)


def test_variants_are_summed_up(run: Any) -> None:
    table = {**SWAP, "param": {"load.J": [0.07, 0.08, 0.09]}}
    result = run(table)
    items = result.table.variants()
    assert [(item["set.gearbox"], item["runs"], item["failed"]) for item in items] == [
        ("ratio", 3, 0), ("elastic", 3, 0)
    ]  # fmt: skip
    errors = [row["rms.speed"] for row in result.table.rows if row["set.gearbox"] == "ratio"]
    assert len(set(errors)) == 3
    assert items[0]["rms.speed"] == sorted(errors)[1]
    assert items[0]["worst.rms.speed"] == max(errors)


def test_a_parameter_that_some_variants_lack_is_left_out_there(run: Any) -> None:
    result = run(
        {"set": {"gearbox": ["ratio", "elastic"]}, "param": {"gearbox.k": [1e3, 2e3, 4e3]}}
    )
    assert [row["set.gearbox"] for row in result.table.rows] == ["ratio"] + 3 * ["elastic"]
    assert "param.gearbox.k" not in result.table.rows[0]
    assert result.notes == (
        "gearbox.k is left out: gearbox.lab_bench/ratio has none",
        "2 of 6 points are the same run as another one",
    )


def test_checks_that_are_not_judged_are_not_counted_as_failed(run: Any) -> None:
    settled = {"duration": 6.999, "set": {"gearbox": ["", "lossy"]}}
    own, swapped = run(settled).table.rows
    assert (own["checks_failed"], swapped["checks_failed"]) == (0, 0)
    checks = [name for name in swapped if name.startswith("check.")]
    assert checks and all(swapped[name] is not None for name in checks)


def test_a_check_of_a_signal_that_some_variants_lack_is_empty_there(
    run: Any, tmp_path: Path
) -> None:
    (tmp_path / "scenario.toml").write_text(
        """
system = "motor_bench"
duration = 0.01
step = 1e-3
variants.gearbox = "elastic+backlash"
[[checks]]
name = "loss"
signal = "gearbox.backlash.P_loss"
of = "mean"
limit = 100.0
"""
    )
    found = run(
        {"scenario": str(tmp_path / "scenario.toml"), "duration": 0.01,
         "set": {"gearbox": ["", "ratio"]}}
    ).table  # fmt: skip
    assert [row["check.loss"] is None for row in found.rows] == [False, True]
    assert [row["checks_failed"] for row in found.rows] == [0, 0]


def test_a_vector_of_several_units_is_refused_before_anything_runs(
    run: Any, tmp_path: Path
) -> None:
    variables = [
        V("time", "Float64", "independent"),
        V("q[1]", "Float64", "output", inner='unit="m"'),
        V("q[2]", "Float64", "output", inner='unit="rad"'),
    ]
    units = (
        '<UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit>'
        '<Unit name="rad"><BaseUnit rad="1"/></Unit></UnitDefinitions>'
    )
    tiny(tmp_path, variables, fmi=2, definitions=units)
    (tmp_path / "scenario.toml").write_text("system = 'pair.toml'\nduration = 1.0\nstep = 0.1\n")
    (tmp_path / "pair.toml").write_text("connections = []\ninstances.arm = 'm.fmu'\n")
    study = {"scenario": str(tmp_path / "scenario.toml"), "duration": 1.0, "step": [0.1, 0.05],
             "reference": "finest", "signals": ["arm.q"]}  # fmt: skip
    with pytest.raises(UnitError, match=r"distance of arm\.q\[1\], arm\.q\[2\].* m, rad"):
        run(study)
    assert not list(tmp_path.glob("out/runs/*"))
    assert len(run({**study, "signals": ["arm.q[1]"]}).table.rows) == 2


def test_several_runs_of_a_scenario(run: Any) -> None:
    result = run({"scenario": "motor_bench", "param": {"load.J": [0.07, 0.09]}})
    assert [row["scenario"] for row in result.table.rows] == [
        *2 * ["motor_bench/ST1"], *2 * ["motor_bench/MX1"]
    ]  # fmt: skip
    assert "scenario" in result.table.varied


def test_repeats_take_the_fastest(run: Any) -> None:
    result = run({**SWAP, "repeats": 3})
    assert not result.notes and figures(result.table.rows)[0]["fmu_steps"] == 2800


def test_workers_and_unknown_recordings(run: Any) -> None:
    with pytest.raises(ValueRangeError, match="0 workers: at least 1 is needed"):
        run(SWAP, workers=0)
    result = run({"param": {"load.J": 0.08}})
    with pytest.raises(UnknownNameError, match="has no recording; name signals in keep"):
        result.recording(result.table.rows[0]["key"])


# -- failures --------------------------------------------------------------------------------------


def failing(faulty: Path, mode: str, **more: Any) -> Any:
    table = {
        "scenario": "scenario.toml",
        "keep": ["good.y", "bad.y"],  # what is not recorded is not looked at for NaN
        "param": {"bad.mode": MODES[mode], "bad.fail_at": [1e9, 0.35, 2e9, 0.75]},
        **more,
    }
    return study_from(table, "pair", faulty)


@pytest.mark.parametrize("mode", ["error", "fatal", "nan"])
@pytest.mark.parametrize("workers", [1, 2])
def test_a_failing_run_is_kept_as_failure(run: Any, faulty: Path, mode: str, workers: int) -> None:
    study = failing(faulty, mode)
    result = run(study, workers=workers)
    assert [row["status"] for row in result.table.rows] == ["ok", "failed", "ok", "failed"]
    for row, end in ((result.failures[0], 0.3), (result.failures[1], 0.7)):
        seen = end + 0.1 if mode == "nan" else end  # NaN is seen after the step
        assert row["error"].startswith(f"run stopped at t = {seen:g} s: ")
        assert row["fmu_steps"] is None
        kept = result.recording(row["key"])
        # rows up to the bad step; times are k * 0.1 in another order of rounding
        np.testing.assert_allclose(kept.time, np.arange(round(end / 0.1) + 1) * 0.1, atol=1e-12)
        assert kept.error == row["error"]
    good = [result.recording(row["key"])["good.y"] for row in result.table.rows[::2]]
    assert np.array_equal(good[0], good[1]) and len(good[0]) == 11
    again = run(study, workers=workers)
    assert (again.computed, again.reused, len(again.failures)) == (0, 4, 2)
    retried = run(study, workers=workers, retry=True)
    assert (retried.computed, retried.reused, len(retried.failures)) == (2, 2, 2)


def test_all_runs_failing_is_a_table_too(run: Any, faulty: Path) -> None:
    study = failing(faulty, "error", param={"bad.mode": 1, "bad.fail_at": [0.3, 0.5]})
    result = run(study, picture=True)
    assert len(result.failures) == 2 and (result.folder / "study.png").is_file()


@pytest.mark.slow
def test_isolated_crashes_and_hangs_are_failures(run: Any, faulty: Path) -> None:
    crash = failing(faulty, "crash", param={"bad.mode": 5, "bad.fail_at": [0.35, 1e9]})
    result = run(crash, isolate=20.0, workers=2)
    assert [row["status"] for row in result.table.rows] == ["failed", "ok"]
    assert "bad (" in result.failures[0]["error"] and "SIGABRT" in result.failures[0]["error"]
    assert len(result.recording(result.failures[0]["key"])) == 4
    assert result.table.rows[1]["cpu"] is None  # of the other process
    hang = failing(faulty, "hang", param={"bad.mode": 6, "bad.fail_at": 0.35})
    [failure] = run(hang, isolate=1.0).failures
    assert "did not return within 1 s and was ended" in failure["error"]


def test_an_fmu_that_is_allowed_once_per_process_runs_in_one_thread(
    run: Any, tmp_path: Path, faulty: Path
) -> None:
    rewrite(
        faulty / "faulty.fmu",
        tmp_path / "once.fmu",
        xml=lambda text: text.replace(
            "canGetAndSet", 'canBeInstantiatedOnlyOncePerProcess="true" canGetAndSet'
        ),
    )
    (tmp_path / "one.toml").write_text('[instances]\nbad = "once.fmu"\n')
    (tmp_path / "alone.toml").write_text('system = "one.toml"\nduration = 1.0\nstep = 0.1\n')
    table = {
        "scenario": "alone.toml",
        "algorithm": ["jacobi", "gauss_seidel"],
        "param": {"bad.mode": 1, "bad.fail_at": [1e9, 0.35, 2e9]},
    }
    result = run(study_from(table, "once", tmp_path), workers=2)
    statuses = [row["status"] for row in result.table.rows]
    assert statuses == 2 * ["ok", "failed", "ok"]
    assert all("failed with status 'error'" in row["error"] for row in result.failures)
    assert any(note.startswith("one thread only: the FMU of bad") for note in result.notes)


def test_an_fmu_that_changes_during_the_study_is_noticed(
    tmp_path: Path, faulty: Path, provider: Any
) -> None:
    folder = tmp_path / "pair"
    folder.mkdir()
    for path in faulty.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    plan = plan_study(failing(folder, "error"), provider)
    task = next(iter(plan.tasks.values()))
    GroupRunner(task.group, plan.provider, None).close()
    with (folder / "faulty.fmu").open("ab") as file:
        file.write(b"\0")
    with pytest.raises(StudyChangedError, match="pair: FMU of good, FMU of bad is not what"):
        GroupRunner(task.group, plan.provider, None)


def test_building_meanwhile_does_not_change_the_study(
    run: Any, tmp_path: Path, provider: Any
) -> None:
    """A provider whose FMU becomes another one as soon as it was planned with."""
    names = {"gearbox.lab_bench/ratio": "lossy", "gearbox.lab_bench/elastic": "lossy"}
    folder = tmp_path / "built"
    folder.mkdir()

    class Rebuilding:
        def path(self, variant: str) -> Path:
            path = folder / (variant.replace("/", "-") + ".fmu")
            path.write_bytes(provider.path(variant).read_bytes())
            return path

    def rebuild(_: Any) -> None:
        for variant, other in names.items():
            path = folder / (variant.replace("/", "-") + ".fmu")
            path.write_bytes(provider.path(f"gearbox.lab_bench/{other}").read_bytes())

    plain = run(SWAP, out=tmp_path / "plain")
    study = study_from({**BASE, **SWAP})
    other = run_study(
        study, out=tmp_path / "other", provider=Rebuilding(), progress=rebuild, workers=1,
        picture=False,
    )  # fmt: skip
    assert figures(plain.table.rows) == figures(other.table.rows)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads Linux's statm")
def test_memory_does_not_grow_with_the_number_of_runs(run: Any, tmp_path: Path) -> None:
    pages: list[int] = []

    def note(_: Any) -> None:
        pages.append(int(Path("/proc/self/statm").read_text().split()[1]))

    table = {
        "duration": 0.02,
        "param": {"load.J": {"uniform": [0.07, 0.09]}},
        "sample": {"count": 300},
        "keep": ["load.w"],
    }
    run(table, progress=note, workers=2)
    assert len(pages) == 301
    # 200 runs; 5 kB each would be 250 pages of 4 kB; allocators' pools move by some
    assert pages[-1] - pages[100] < 250


def test_points_of_the_picture_are_medians_with_their_range() -> None:
    rows = [
        {"step": step, "error.x": error, "cpu": cost, "simulated": 2.0}
        for step, error, cost in (
            (1e-4, 1.0, 0.4), (1e-3, 5.0, 0.2), (1e-4, 3.0, 0.6), (1e-4, 2.0, 0.8),
            (1e-4, None, 9.0),
        )
    ]  # fmt: skip
    assert _points(rows, "error.x", "cpu") == [
        (pytest.approx(100.0), 5.0, 5.0, 5.0),
        (pytest.approx(300.0), 2.0, 1.0, 3.0),
    ]
