"""Runs that need another system are judged by the model that was found, and by nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.parts import Parameter
from cosim.calibrate.problem import Problem
from cosim.cli.diagnose import _spread
from cosim.diagnose import Diagnosis
from cosim.diagnose.answer import Verdict
from cosim.diagnose.candidates import Candidate
from cosim.diagnose.diagnosis import _look_further
from cosim.diagnose.further import Further, carried, looked
from cosim.diagnose.story.facts import Facts
from cosim.errors import ScenarioError, UnknownNameError, VariantError
from cosim.installation import places
from cosim.report import sections
from tests.problems import simulator

COULOMB = Candidate("load", "inertial_load", "coulomb", "flange")
MAPPING = """base = "{base}"
system = "{system}"
only = {{ warm = {warm} }}
further = {further}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two motor runs, one of which is `warm` and has a system file of its own."""
    place = tmp_path_factory.mktemp("two")
    bench = places.scenarios() / "motor_bench"
    described = (bench / "data/MB-12/set.toml").read_text("utf-8")
    parts = [p for p in described.split("[[run]]") if "run" not in p or "ST1" in p or "MX1" in p]
    parts = [p + f"warm = {str('MX1' in p).lower()}\n" if "file" in p else p for p in parts]
    (place / "set.toml").write_text("[[run]]".join(parts), "utf-8")
    (place / "runs").mkdir()
    for name in ("ST1", "MX1"):
        source = bench / f"data/MB-12/runs/{name}.npz"
        (place / f"runs/{name}.npz").write_bytes(source.read_bytes())
    (place / "motor_bench.toml").write_bytes((bench / "data/motor_bench.toml").read_bytes())
    system = (places.scenarios() / "systems/motor_bench.toml").read_text("utf-8")
    (place / "warm_bench.toml").write_text(system, "utf-8")
    base = (bench / "dataset.toml").as_posix()
    (place / "dataset.toml").write_text(
        MAPPING.format(base=base, system="motor_bench", warm="false", further='["warm.toml"]')
    )
    (place / "warm.toml").write_text(
        MAPPING.format(base="dataset.toml", system="warm_bench.toml", warm="true", further="[]")
        .replace("further = []\n", "")
    )  # fmt: skip
    return place


@pytest.fixture(scope="module")
def raw(folder: Path) -> Iterator[Problem]:
    """The runs that the data set's own system describes."""
    problem = read_problem(folder)
    yield problem
    simulator(problem).close()


def model(problem: Problem, **values: float) -> SimpleNamespace:
    """A fitted model, as far as runs of another system need one."""
    theta = problem.nominal.copy()
    for name, value in values.items():
        theta[[n.endswith(name) for n in problem.names].index(True)] = value
    return SimpleNamespace(effects=(), problem=problem, estimate=SimpleNamespace(theta=theta))


def judged(problem: Problem, raw: Problem, before: Any, after: Any) -> Further:
    """Two models on another system."""
    found = Further(simulator(problem))
    found.judge("before", raw, before)
    found.judge("after", raw, after)
    return found


def test_other_runs_are_left_to_the_other_mapping(raw: Problem) -> None:
    (read,) = raw.further
    other = read()
    assert [run.name for run in raw.runs] == ["ST1"]
    assert [run.name for run in other.runs] == ["MX1"]
    assert other.file.path.stem == "warm_bench"
    assert other.further == ()  # not taken from the base
    assert raw.only(["ST1"]).further == raw.further


def test_the_model_that_was_found_is_what_judges(raw: Problem, folder: Path) -> None:
    other = raw.further[0]()
    before = model(raw, R_a=0.3)
    after = model(COULOMB.added_to(raw), R_a=0.3, tau_c=0.4)
    after.effects = (COULOMB,)
    found = judged(other, raw, before, after)
    direct = COULOMB.added_to(read_problem(folder, mapping=folder / "warm.toml"))
    theta = model(direct, R_a=0.3, tau_c=0.4).estimate.theta
    ((_, expected),) = simulator(direct).residuals(theta, None)
    np.testing.assert_array_equal(found.residuals["after", "MX1"], expected)
    assert np.nanmax(np.abs(found.residuals["before", "MX1"] - expected)) > 1.0
    assert found.rms("after", 0) == pytest.approx(float(np.sqrt(np.nanmean(expected[:, 0] ** 2))))
    row = found.to_dict()["channels"]["speed"]
    assert row["after"] == pytest.approx(found.rms("after", 0) * row["noise_rms"])
    page = sections.further(Facts({"further_runs": [found.to_dict()]}))
    assert "Runs MX1, which need the system warm_bench" in page and page.count("<tr>") == 5
    assert _spread(found).startswith("MX1 with warm_bench, residuals over the noise: before ")
    simulator(direct).close()


def test_start_values_of_those_runs_are_estimated(raw: Problem) -> None:
    other = raw.further[0]()
    (run,) = other.runs
    other = other.with_data({run.name: simulator(other).simulate(other.nominal, run)})
    (run,) = other.runs
    wrong = run.starts["encoder.theta"] + 0.05
    moved = [replace(run, starts={**run.starts, "encoder.theta": wrong})]
    own = Parameter(
        "angle@MX1",
        "rad",
        wrong,
        wrong - 0.2,
        wrong + 0.2,
        (("encoder.theta", 1.0),),
        "nuisance",
        "MX1",
    )
    held = other.changed(runs=moved)
    free = held.with_parameters([*other.parameters, own])
    plain = model(raw)
    first, second = (judged(p, raw, plain, plain) for p in (held, free))
    column = [c.name for c in other.channels].index("angle")
    assert first.rms("before", column) > 5.0
    assert second.rms("before", column) < 0.01
    assert second.rms("after", column) == second.rms("before", column)


def test_an_effect_on_another_instance_is_refused(raw: Problem) -> None:
    other = raw.further[0]()
    after = model(COULOMB.added_to(raw), tau_c=0.4)
    after.effects = (COULOMB,)
    changed = other.changed(model=other.model.changed({"load": "free"}))
    with pytest.raises(
        VariantError, match=r"coulomb at load\.flange was found on load = .*here it is"
    ):
        carried(changed, raw, after)


def test_the_verdict_stands_where_they_cannot_be_judged(raw: Problem) -> None:
    base: Any = model(raw)

    def broken() -> Problem:
        raise ScenarioError("warm.toml: there is no entry 'x'")

    found, warnings = looked(replace_further(raw, broken), base, simulator(raw))
    assert found == []
    assert warnings == ["further runs are not judged: warm.toml: there is no entry 'x'"]

    def frozen() -> Problem:
        other = raw.further[0]()
        stuck = {run.name: np.where(np.isnan(run.data), np.nan, 0.5) for run in other.runs}
        return other.with_data(stuck)

    found, warnings = looked(replace_further(raw, frozen), base, simulator(raw))
    assert found == []
    assert "further runs are not judged: error: run MX1 speed:" in warnings[0]


def test_they_are_judged_before_and_after(raw: Problem) -> None:
    said: list[str] = []
    before: Any = model(raw)
    search: Any = SimpleNamespace(say=said.append)
    found, warnings = looked(raw, before, simulator(raw))
    result = Diagnosis(raw, Verdict("nothing_missing"), search=search, before=before, after=before)
    result.further = found
    _look_further(result)
    assert [run.name for run in result.further[0].problem.runs] == ["MX1"]
    assert {which for which, _ in result.further[0].residuals} == {"before", "after"}
    assert said == ["further runs: MX1"]
    assert warnings == result.warnings == []

    after: Any = model(COULOMB.added_to(raw), tau_c=0.4)
    after.effects = (replace(COULOMB, instance="gearbox"),)  # it does not fit there
    result = replace(result, after=after, further=list(found))
    _look_further(result)
    assert result.further == []
    assert result.warnings[0].startswith("further runs are not judged: ")


def test_only_what_shows_most_in_channels_of_its_own_is_unseen(raw: Problem) -> None:
    """Channels that both systems have are what the smaller one is judged by."""
    base: Any = model(raw)
    (item,), _ = looked(raw, base, simulator(raw))
    smaller = raw.changed(channels=[c for c in raw.channels if c.name != "angle"])
    column = [c.name for c in raw.channels].index("angle")
    (key,) = item.residuals
    noise = np.random.default_rng(4).standard_normal(item.residuals[key].shape)
    slow = 3.0 * np.sin(np.arange(noise.shape[0]) / 50.0)

    def shown(added: dict[int, float], purpose: str = "identification") -> list[str]:
        values = noise.copy()
        for one, size in added.items():
            values[:, one] += size * slow
        item.residuals[key] = values
        run = replace(item.problem.runs[0], purpose=purpose)
        item.simulator.problem = item.problem.changed(runs=[run])
        return [t.channel for t in item.unseen(smaller, "before")]

    other = 0 if column else 1
    assert shown({}) == []
    assert shown({column: 1.0}) == ["angle"]
    assert shown({column: 1.0, other: 1.0}) == []  # it may be what moves the other one
    assert shown({column: 3.0, other: 1.0}) == ["angle"]
    assert shown({column: 1.0}, "validation") == []  # nothing can be fitted there
    beside = [replace(c, by="encoder") if c.name == "angle" else c for c in item.problem.channels]
    item.simulator.problem = item.problem.changed(channels=beside)
    assert "encoder" in smaller.instances
    assert shown({column: 3.0}) == []  # what a late encoder does, say


def test_a_channel_names_a_sensor_of_the_system(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "by.toml"
    base, system = ((folder / name).as_posix() for name in ("warm.toml", "warm_bench.toml"))
    by = '[channels.angle]\nsignal = "encoder.phi_meas"\nby = "encodr"\n'
    text = f'base = "{base}"\nsystem = "{system}"\n{by}'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UnknownNameError, match=r"channel angle: by: did you mean 'encoder'\?"):
        read_problem(folder, mapping=path)


def replace_further(problem: Problem, read: object) -> Problem:
    """The problem with other further runs."""
    return problem.changed(further=(read,))
