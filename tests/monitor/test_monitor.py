"""Monitoring: what changed is named with its date, and nothing is where nothing changed."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.cli import app as cli
from cosim.diagnose.candidates import candidates
from cosim.errors import InputError, ScenarioError
from cosim.monitor import Monitored, monitor, read_series
from cosim.monitor.profiles import chances, constants, profiles, regress
from cosim.monitor.series import SOURCES, date_in
from cosim.report.monitor import monitor_page
from tests.monitor.bench import LOGS, day, write

JUMP, NEW = 9, 13
"""First logs with more friction and with another encoder."""


def plain(folder: Path) -> Monitored:
    """Monitored with declared parameters and sensors alone: no FMU but the disc is built."""
    series = read_series(folder)
    return monitor(series, without={c.effect for c in candidates(series.problem)})


def step(first: int, size: float):  # type: ignore[no-untyped-def]
    """So much from a log on."""
    return lambda log: size * (log >= first)


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Monitored]:
    """More viscous friction from one log on, another zero of the angle from a later one on."""
    folder = write(
        tmp_path_factory.mktemp("logs") / "disc", viscous=step(JUMP, 0.0012), zero=step(NEW, 0.02)
    )
    return folder, plain(folder)


def test_what_changed_is_named_with_its_date(changed: tuple[Path, Monitored]) -> None:
    found = changed[1]
    assert found.verdict == "changed"
    assert [(c.direction.name, c.profile.kind, c.profile.first) for c in found.changes
            if c.direction] == [("b", "step", JUMP), ("offset of theta", "step", NEW)]  # fmt: skip
    friction, zero = found.to_dict()["changes"]
    assert friction["since"] == str(day(JUMP)) and friction["last_before"] == str(day(JUMP - 1))
    assert zero["between"][0] <= zero["since"] <= zero["between"][1]
    for entry, truth in ((friction, 0.0012), (zero, 0.02)):
        low, high = entry["ci95"]
        # an interval of 95 % misses in one of twenty: twice as wide is never far off
        assert abs(entry["change"] - truth) < high - low
        assert high - low < truth
    assert found.dated(NEW) in found.sentence(found.changes[1])


def test_nothing_is_found_where_nothing_changed(tmp_path: Path) -> None:
    found = plain(write(tmp_path / "disc"))
    assert found.verdict == "nothing_changed" and found.changes == []
    assert all(chart.outside == () for chart in found.charts())


def test_creeping_friction_is_told_from_a_jump(tmp_path: Path) -> None:
    found = plain(write(tmp_path / "disc", viscous=lambda log: 0.0005 * max(log - JUMP + 1, 0)))
    (change,) = found.changes
    assert change.direction is not None and change.direction.name == "b"
    assert change.profile.kind == "creep"
    assert change.low <= JUMP <= change.high
    entry, truth = found.entry(change), 0.0005 * (LOGS - JUMP)
    low, high = entry["ci95"]
    assert abs(entry["change"] - truth) < high - low < truth  # twice the interval of 95 %
    assert entry["per_day"] > 0.0


def test_one_odd_log_is_no_change(tmp_path: Path) -> None:
    found = plain(write(tmp_path / "disc", zero=lambda log: 0.02 * (log == JUMP)))
    assert [(c.profile.kind, c.profile.first) for c in found.changes] == [("outlier", JUMP)]


def test_a_law_that_no_name_fits_is_unexplained(tmp_path: Path) -> None:
    found = plain(write(tmp_path / "disc", dry=step(JUMP, 0.08)))
    assert found.verdict == "unexplained"
    assert {c.profile.first for c in found.changes} == {JUMP}
    assert any("unexplained" in found.sentence(c) for c in found.changes)


@pytest.mark.slow
def test_the_same_law_is_named_if_the_catalogue_has_it(tmp_path: Path) -> None:
    found = monitor(write(tmp_path / "disc", dry=step(JUMP, 0.08)))
    assert found.verdict == "changed"
    (change,) = found.changes
    assert change.direction is not None and change.profile.first == JUMP
    assert "coulomb at load.flange" in {change.direction.name, *change.rivals}


def test_what_is_undone_later_is_no_scatter(tmp_path: Path) -> None:
    first, last = JUMP - 4, NEW
    found = plain(
        write(tmp_path / "disc", viscous=lambda log: 0.0012 * (first <= log < last))
    )  # fmt: skip
    (change,) = found.changes
    assert change.direction is not None and change.direction.name == "b"
    assert (change.profile.kind, change.profile.first, change.profile.last) == (
        "spell",
        first,
        last,
    )
    entry = found.entry(change)
    assert entry["until"] == str(day(last)) and entry["since"] == str(day(first))
    assert f"as before again from {day(last)}" in found.sentence(change)
    low, high = entry["ci95"]
    assert abs(entry["change"] - 0.0012) < high - low < 0.0012  # twice the interval of 95 %


def test_two_changes_do_not_hide_each_other(tmp_path: Path) -> None:
    spells = (4, 7), (11, 15)
    found = plain(write(
        tmp_path / "disc", zero=lambda log: 0.02 * any(a <= log < b for a, b in spells)
    ))  # fmt: skip
    assert found.verdict == "changed"
    assert [(c.profile.first, c.profile.last) for c in found.changes] == list(spells)
    assert {c.direction.name for c in found.changes if c.direction} == {"offset of theta"}


def test_one_quantity_may_jump_twice(tmp_path: Path) -> None:
    found = plain(write(
        tmp_path / "disc", viscous=lambda log: 0.0012 * ((log >= 6) + (log >= 12))
    ))  # fmt: skip
    assert [(c.direction.name, c.profile.kind, c.profile.first) for c in found.changes
            if c.direction] == [("b", "step", 6), ("b", "step", 12)]  # fmt: skip


def test_a_small_change_beside_a_large_one_is_told(tmp_path: Path) -> None:
    found = plain(write(
        tmp_path / "disc", viscous=lambda log: 0.006 * (5 <= log < 9),
        zero=lambda log: 0.02 * (12 <= log < 15),
    ))  # fmt: skip
    assert [(c.direction.name, c.profile.first) for c in found.changes if c.direction] == [
        ("b", 5), ("offset of theta", 12)
    ]  # fmt: skip


def test_ways_to_change_are_compared_whoever_made_them() -> None:
    """Weighed again, a change may have the same way as another object; its values are an array."""
    one = profiles(np.arange(9.0))[0]
    same = replace(one, values=one.values.copy())
    other = replace(one, first=one.first + 1)
    assert one == same and one != other and [(1, one)] == [(1, same)]


def test_limits_come_from_logs_without_the_change(tmp_path: Path) -> None:
    found = plain(write(tmp_path / "disc", viscous=step(3, 0.003)))
    chart = next(chart for chart in found.parameter_charts() if chart.name == "b")
    assert chart.centre == pytest.approx(0.03, abs=2e-4)  # a fifth of the change would be 6e-4


OTHERWISE = ("slow", "sweep", "again", "steps", "swing", "check")
"""Torques of logs that are driven otherwise one after the other: they tell a friction by weights
that differ tenfold."""


@pytest.mark.parametrize("size", [0.0012, 0.01])
@pytest.mark.parametrize("first", [8, 9, 10])
def test_what_changed_is_named_where_each_log_is_driven_otherwise(
    tmp_path: Path, size: float, first: int
) -> None:
    found = plain(write(
        tmp_path / "disc", viscous=step(first, size),
        drive=lambda log: OTHERWISE[log % len(OTHERWISE)],
    ))  # fmt: skip
    (change,) = found.changes
    assert change.direction is not None and change.direction.name == "b", found.sentence(change)
    assert change.profile.kind == "step" and change.low <= first <= change.high
    (entry,) = found.to_dict()["changes"]
    low, high = entry["ci95"]
    assert low <= size <= high


def test_nothing_is_found_where_each_log_is_driven_otherwise(tmp_path: Path) -> None:
    found = plain(write(
        tmp_path / "disc", drive=lambda log: OTHERWISE[log % len(OTHERWISE)]
    ))  # fmt: skip
    assert found.verdict == "nothing_changed"


def test_wear_that_was_repaired_is_not_quiet(tmp_path: Path) -> None:
    first, last = JUMP - 5, NEW
    found = plain(write(
        tmp_path / "disc",
        viscous=lambda log: 0.0005 * (log - first + 1) * (first <= log < last),
    ))  # fmt: skip
    assert found.verdict != "nothing_changed"
    assert all(c.direction is not None and c.direction.name == "b" for c in found.changes)
    assert {c.profile.last for c in found.changes} & {last}


@pytest.fixture(scope="module")
def dry_only() -> Callable[[Path], Monitored]:
    """Monitored with declared parameters, sensors and plain dry friction."""

    def look(folder: Path) -> Monitored:
        series = read_series(folder)
        others = {c.effect for c in candidates(series.problem)} - {"coulomb"}
        return monitor(series, without=others)

    return look


@pytest.mark.slow
def test_less_of_a_law_than_none_is_no_name(
    tmp_path: Path, dry_only: Callable[[Path], Monitored]
) -> None:
    found = dry_only(write(tmp_path / "disc", dry=step(JUMP, -0.08)))
    assert found.verdict == "unexplained"
    assert not any("coulomb" in c.direction.name for c in found.changes if c.direction)


@pytest.mark.slow
def test_a_law_that_was_there_before_may_go(
    tmp_path: Path, dry_only: Callable[[Path], Monitored]
) -> None:
    found = dry_only(write(tmp_path / "disc", dry=lambda log: 0.08 * (log < NEW)))
    names = {c.direction.name: float(c.amounts[0]) for c in found.changes if c.direction}
    assert names["coulomb at load.flange"] < 0.0


def test_the_rate_of_false_alarms_is_at_most_the_stated_one() -> None:
    random = np.random.default_rng(2)
    shapes = np.array([p.values for p in profiles(7.0 * np.arange(15.0))])
    known = constants(["same"] * 15)
    rate, count = 0.2, 300
    alarms = sum(
        bool(regress(values, np.ones(15), known, shapes).p.min() < rate / len(shapes))
        for values in random.standard_normal((count, 15))
    )
    # binomial: three deviations above the most that is stated
    assert 0 < alarms < rate * count + 3.0 * np.sqrt(count * rate * (1.0 - rate))


@pytest.mark.parametrize("scatter", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("often", [0.05, 0.5])
def test_logs_of_unequal_precision_give_no_more_false_alarms(often: float, scatter: float) -> None:
    random, logs, rate, count = np.random.default_rng(3), 12, 0.01, 400
    shapes = np.array([p.values for p in profiles(7.0 * np.arange(logs))])
    known = constants(["same"] * logs)
    own = np.where(np.arange(logs) % 3 == 0, 0.55 - often, often)  # a third is another kind
    values = np.hypot(own, scatter) * random.standard_normal((count, logs))
    alarms = sum(bool(chances(v, own, known, shapes).min() < rate / len(shapes)) for v in values)
    # binomial: three deviations above the most that is stated
    assert alarms < rate * count + 3.0 * np.sqrt(count * rate * (1.0 - rate))
    jump = np.where(np.arange(logs) < logs // 2, 0.0, 12.0 * np.hypot(0.5, scatter))
    assert all(chances(v + jump, own, known, shapes).min() < rate / len(shapes) for v in values[:9])


def test_dates_come_from_names_and_from_times_of_files(tmp_path: Path) -> None:
    named = write(tmp_path / "named", dated=False, names=lambda log: f"bench_{day(log)}_0930")
    series = read_series(named)
    assert series.dated == SOURCES[1]
    assert [log.date for log in series.logs][:2] == [
        datetime(day(k).year, day(k).month, day(k).day, 9, 30) for k in (0, 1)
    ]
    timed = write(tmp_path / "timed", dated=False)
    for log in range(LOGS):
        os.utime(timed / f"log{log:02d}.csv", (1.7e9 + 86400 * log,) * 2)
    series = read_series(timed)
    assert series.dated == SOURCES[2] and len(series.logs) == LOGS


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("2025-03-14", datetime(2025, 3, 14)),
        ("run_20250314T0930.csv", datetime(2025, 3, 14, 9, 30)),
        ("2025-03-14_2500", datetime(2025, 3, 14)), ("20250314_3001", datetime(2025, 3, 14)),
        ("2025-03-14_0061.csv", datetime(2025, 3, 14)),
        ("SN10001231_2025-03-14", datetime(2025, 3, 14)),
        ("2025-13-14", None), ("bench12", None), ("120250314", None),
    ],
)  # fmt: skip
def test_a_date_in_a_name(name: str, found: datetime | None) -> None:
    assert date_in(name) == found


def test_wrong_dates_are_refused_with_the_way_out(tmp_path: Path) -> None:
    folder = write(tmp_path / "disc")
    text = (folder / "dataset.toml").read_text()
    for wrong, said in (
        (f"date = {day(3)}\n", "'R03' has no date, but 'R00' has; give each run"),
        (None, "date 'spring' is no ISO date; write 2025-03-14"),
    ):
        if wrong is None:
            changed = text.replace(f"date = {day(3)}", 'date = "spring"')
        else:
            changed = text.replace(wrong, "")
        (folder / "dataset.toml").write_text(changed)
        with pytest.raises(ScenarioError, match=said):
            read_series(folder)
    few = text[: text.index('[[run]]\nname = "R03"')]
    (folder / "dataset.toml").write_text(few)
    with pytest.raises(ScenarioError, match=r"has 3 logs of different dates .* it takes 6"):
        read_series(folder)


def test_a_folder_of_data_sets_is_a_series(changed: tuple[Path, Monitored], tmp_path: Path) -> None:
    folder, whole = changed
    text = (folder / "dataset.toml").read_text()
    head, *runs = text.split("\n[[run]]\n")
    for log, run in enumerate(runs):  # as recordings of a twin lie: one data set per visit
        place = tmp_path / "visits" / f"{day(log)}"
        place.mkdir(parents=True)
        shutil.copyfile(folder / "system.toml", place / "system.toml")
        shutil.copyfile(folder / f"log{log:02d}.csv", place / f"log{log:02d}.csv")
        bare = run.replace(f"date = {day(log)}\n", "")
        (place / "dataset.toml").write_text(f"{head}\n[[run]]\n{bare}")
    found = plain(tmp_path / "visits")
    assert found.series.dated == SOURCES[1]
    assert [found.sentence(c) for c in found.changes] == [
        whole.sentence(c) for c in whole.changes
    ]  # fmt: skip


def test_logs_that_cannot_be_used_are_left_out(
    changed: tuple[Path, Monitored], tmp_path: Path
) -> None:
    folder = shutil.copytree(changed[0], tmp_path / "disc")
    shutil.copyfile(folder / "log04.csv", folder / "log05.csv")
    found = plain(folder)
    assert len(found.series.logs) == LOGS - 1 and "(1 more cannot be used)" in found.span
    assert "log R05 is not used: it is a copy of log R04" in found.warnings
    assert [c.profile.first for c in found.changes] == [JUMP - 1, NEW - 1]


def test_wrong_settings_are_refused(changed: tuple[Path, Monitored]) -> None:
    series = changed[1].series
    with pytest.raises(InputError, match="rate of false alarms is 2, not between 0 and 1"):
        monitor(series, rate=2.0)
    with pytest.raises(InputError, match=f"a baseline of 17 of {LOGS} logs: take 2 to 15"):
        monitor(series, baseline=17)
    with pytest.raises(InputError, match=r"no effect 'coulombs'.*'coulomb'"):
        monitor(series, without=["coulombs"])


def test_page_json_and_notebook_say_the_same(changed: tuple[Path, Monitored]) -> None:
    found = changed[1]
    table = found.to_dict()
    json.dumps(table, allow_nan=False)
    assert table["verdict"] == "changed" and len(table["logs"]) == LOGS
    assert set(table["parameters"]) == {"J", "b"} and set(table["channels"]) == {"w", "theta"}
    assert table["effects"]["offset of theta"]["outside"] == list(range(NEW, LOGS))
    assert table["parameters"]["J"]["outside"] == []
    page, view = monitor_page(found), found._repr_html_()
    for entry in table["changes"]:
        assert entry["since"] in page and entry["since"] in view
        assert entry["what"] in page and entry["what"] in view
    assert page.count("<svg") == len(found.charts())


def test_from_the_shell(
    changed: tuple[Path, Monitored], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    effects = {c.effect for c in candidates(read_problem(changed[0]))}
    left = [word for name in sorted(effects) for word in ("--without", name)]

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["cosim", "monitor", *map(str, arguments)])
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
        done = capfd.readouterr()
        return code, done.out, done.err

    code, out, _ = call(changed[0], *left, "--out", tmp_path / "out", "--json")
    content = json.loads(out)
    assert code == 0 and content["verdict"] == "changed"
    assert json.loads((tmp_path / "out/monitor.json").read_text()) == content
    assert "Control charts" in (tmp_path / "out/report.html").read_text()
    code, out, _ = call(changed[0], *left, "--out", tmp_path / "again")
    assert code == 0 and f"since {day(JUMP)}" in out and "offset of theta" in out
    code, _, err = call(tmp_path / "nowhere")
    assert code == 2 and "nowhere" in err
