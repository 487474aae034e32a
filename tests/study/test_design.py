"""What a study file may say, which points it means, and what is said of a wrong one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

from cosim.errors import InputError, ScenarioError, UnknownNameError, ValueRangeError, VariantError
from cosim.study import Distribution, Sample, read_study, study_from
from cosim.study.design import drawn, points, reference_of


def made(table: dict[str, Any]) -> list[Any]:
    return points(study_from({"scenario": "x", **table}), ["x"])


def draw(name: str, axis: Distribution, sample: Sample) -> list[float]:
    """Samples of one parameter."""
    return [row[name] for row in drawn({name: axis}, sample)]


def test_grid_combines_each_with_each() -> None:
    found = made(
        {
            "set": {"gearbox": ["ratio", "elastic"], "motor": "sampled"},
            "param": {"gearbox": {"eta": [0.7, 0.8]}, "load.J": 0.08},
            "algorithm": ["jacobi", {"name": "jacobi", "extrapolation": 1}],
            "step": [1e-3, 1e-4],
        }
    )
    assert len(found) == 16
    assert len({(*p.group, p.parameters["gearbox.eta"]) for p in found}) == 16
    assert {p.variants["motor"] for p in found} == {"sampled"}
    assert {p.parameters["load.J"] for p in found} == {0.08}
    assert {str(p.algorithm) for p in found} == {"jacobi", "jacobi(extrapolation=1)"}


def test_zip_takes_the_first_of_all_lists_then_the_second() -> None:
    found = made(
        {
            "combine": "zip",
            "set": {"gearbox": ["ratio", ""], "motor": "ideal"},
            "param": {"load.J": [1.0, 2.0]},
        }
    )
    assert [dict(p.variants) for p in found] == [
        {"gearbox": "ratio", "motor": "ideal"},
        {"motor": "ideal"},
    ]
    assert [p.parameters["load.J"] for p in found] == [1.0, 2.0]
    with pytest.raises(
        ScenarioError,
        match=r'"zip" takes lists of one length, but \[set\] gearbox has 2 values and '
        r"\[param\] load.J has 3",
    ):
        made({"combine": "zip", "set": {"gearbox": ["a", "b"]}, "param": {"load.J": [1, 2, 3]}})


def test_ranges() -> None:
    axes = {"x.a": {"from": 1, "to": 2, "count": 5}}
    assert [p.parameters["x.a"] for p in made({"param": axes})] == [1.0, 1.25, 1.5, 1.75, 2.0]
    axes = {"x.a": {"from": 0.1, "to": 10, "count": 3, "scale": "log"}}
    values = [p.parameters["x.a"] for p in made({"param": axes})]
    np.testing.assert_allclose(values, [0.1, 1.0, 10.0], rtol=1e-15)  # a root and a product


@pytest.mark.parametrize("method", ["latin_hypercube", "random"])
def test_samples_follow_their_distribution(method: str) -> None:
    sample = Sample(2000, method, 5)
    axes = {
        "u": (Distribution("uniform", 2.0, 4.0), ("uniform", (2.0, 2.0))),
        "n": (Distribution("normal", 1.0, 0.5), ("norm", (1.0, 0.5))),
    }
    for name, (axis, (law, arguments)) in axes.items():
        # a true law is refused once in 1e4 seeds; the seed is fixed
        assert kstest(draw(name, axis, sample), law, arguments).pvalue > 1e-4
    logs = np.log10(draw("l", Distribution("log_uniform", 1e2, 1e4), sample))
    assert kstest(logs, "uniform", (2.0, 2.0)).pvalue > 1e-4
    cut = np.array(draw("c", Distribution("normal", 0.0, 1.0, -0.5, np.inf), sample))
    assert cut.min() >= -0.5
    # mean of a normal distribution cut at -0.5: 0.5092; four standard errors of the mean
    assert abs(cut.mean() - 0.5092) < 4 * 0.65 / np.sqrt(2000)


def test_a_latin_hypercube_has_one_value_per_interval() -> None:
    values = np.array(draw("a", Distribution("uniform", 0.0, 1.0), Sample(50)))
    assert sorted((values * 50).astype(int)) == list(range(50))
    other = np.array(draw("b", Distribution("uniform", 0.0, 1.0), Sample(50)))
    # unpaired: five standard deviations (1/7) of the correlation of 50 independent pairs
    assert abs(np.corrcoef(values, other)[0, 1]) < 5 / 7


def test_random_samples_stay_when_more_are_drawn() -> None:
    axis = Distribution("uniform", 0.0, 1.0)
    assert draw("a", axis, Sample(20, "random")) == draw("a", axis, Sample(50, "random"))[:20]
    assert draw("a", axis, Sample(20, "random")) != draw("a", axis, Sample(20, "random", 1))
    assert draw("a", axis, Sample(20, "random")) != draw("b", axis, Sample(20, "random"))


def test_every_variant_sees_the_same_samples() -> None:
    table = {
        "set": {"gearbox": ["ratio", "elastic"]},
        "param": {"x.a": {"uniform": [0, 1]}, "x.b": {"normal": [0, 1]}},
        "sample": {"count": 3},
    }
    found = made(table)
    assert [p.parameters for p in found[:3]] == [p.parameters for p in found[3:]]
    assert len({p.parameters["x.a"] for p in found}) == 3


def test_the_reference_run_is_like_the_run_but_for_what_is_said() -> None:
    table = {
        "scenario": "x",
        "step": [1e-3, 1e-4],
        "param": {"a.b": [1, 2]},
        "set": {"gearbox": ["ratio", "elastic"]},
    }
    finest = study_from({**table, "reference": "finest"})
    named = study_from(
        {**table, "reference": {"set": {"gearbox": "elastic"}, "algorithm": "iterated"}}
    )
    for point in points(finest, ["x"]):
        other = reference_of(point, finest)
        assert (other.step, other.variants) == (1e-4, point.variants)
        assert other.parameters == point.parameters
        other = reference_of(point, named)
        assert (other.step, str(other.algorithm)) == (point.step, "iterated")
        assert other.variants == {"gearbox": "elastic"}


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"scenari": "x"}, r"bad: a study has no key 'scenari'; did you mean 'scenario'"),
        ({}, r'bad: scenario = "name" is missing'),
        ({"scenario": 3}, r"scenario must be a text or a list of texts, not 3"),
        ({"scenario": []}, r"scenario is an empty list; leave the key out instead"),
        ({"combine": "all"}, r"combine = 'all' is not grid or zip"),
        ({"step": [1e-3, -1]}, r"step = -1 must be positive"),
        ({"step": ["small"]}, r"step must be a number, not 'small'"),
        ({"repeats": 0}, r"repeats must be a whole number from 1 on, not 0"),
        ({"reuse": "no"}, r"reuse must be true or false, not 'no'"),
        ({"set": ["gearbox"]}, r"\[set\] must be a table, not \['gearbox'\]"),
        ({"set": {"gearbox": [1]}}, r"\[set\] gearbox must be a text or a list of texts"),
        ({"param": {"a.b": []}}, r"\[param\] a.b is an empty list"),
        ({"param": {"a.b": {}}}, r"\[param\] a.b is an empty table; write a number, a list"),
        ({"param": {"a.b": {"from": 1, "to": 2}}}, r"\[param\] a.b: count is missing; write"),
        (
            {"param": {"a.b": {"from": 1, "to": 2, "count": 1}}},
            r"\[param\] a.b: count must be a whole number from 2 on, not 1",
        ),
        (
            {"param": {"a.b": {"from": 0, "to": 2, "count": 3, "scale": "log"}}},
            r"\[param\] a.b: from = 0 must be positive",
        ),
        (
            {"param": {"a.b": {"uniform": [0, 1]}}},
            r"\[param\] a.b is a distribution; say how often it is sampled: \[sample\] count",
        ),
        ({"sample": {"count": 3}}, r"\[sample\] without a distribution in \[param\]"),
        ({"param": {"a.b": {"uniform": [2, 1]}}}, r"uniform goes from 2 to 1; write them in order"),
        ({"param": {"a.b": {"normal": [1]}}}, r"give \[mean, standard deviation\]"),
        ({"param": {"a.b": {"normal": [1, 0]}}}, r"the standard deviation = 0 must be positive"),
        (
            {"param": {"a.b": {"normal": [1, 1], "minimum": 2, "maximum": 1}}},
            r"minimum 2 is not below maximum 1",
        ),
        (
            {"param": {"a.b": {"uniform": [0, 1]}}, "sample": {"count": 3, "method": "halton"}},
            r"\[sample\] method = 'halton' is not one of latin_hypercube, random, sobol, morris",
        ),
        ({"algorithm": {"extrapolation": 1}}, r'algorithm .*: write "jacobi", or \{ name ='),
        ({"reference": "finest"}, r'reference "finest" needs a list of at least two steps'),
        ({"reference": "best"}, r"reference = 'best': write \"finest\", or a table \[reference\]"),
        ({"reference": {}}, r"\[reference\] is empty; say in what the reference run differs"),
        ({"signals": ["a.b"]}, r"signals are compared with a reference run, and there is none"),
    ],
)
def test_wrong_files_are_refused_by_name(table: dict[str, Any], text: str) -> None:
    whole = table if "scenario" in table or "scenari" in table or not table else {
        "scenario": "x", **table
    }  # fmt: skip
    with pytest.raises(ScenarioError, match=text) as caught:
        study_from(whole, "bad")
    assert caught.value.exit_code == 2


def test_no_file_and_no_toml(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="there is no such file"):
        read_study(tmp_path / "none.toml")
    with pytest.raises(
        UnknownNameError, match=r"no study 'motor_banch'; did you mean 'motor_bench'"
    ):
        read_study("motor_banch")
    assert read_study("motor_bench").scenarios == ("motor_bench/ST1",)
    path = tmp_path / "cut.toml"
    path.write_text("scenario = [")
    with pytest.raises(ScenarioError, match=rf"{re.escape(str(path))}: is not TOML"):
        read_study(path)


@pytest.mark.parametrize(
    ("table", "kind", "text"),
    [
        ({"scenario": "motor_banch"}, UnknownNameError, "there is no scenario 'motor_banch'; did"),
        ({"runs": ["ST9"]}, UnknownNameError, "no scenario has a run 'ST9'"),
        ({"set": {"gearbx": "elastic"}}, UnknownNameError, "'gearbx' is no instance"),
        ({"set": {"gearbox": "plastic"}}, VariantError, "plastic"),
        ({"algorithm": "euler"}, UnknownNameError, "there is no algorithm 'euler'"),
        (
            {"algorithm": {"name": "jacobi", "order": 1}},
            UnknownNameError,
            "algorithm 'jacobi' has no option 'order'",
        ),
        ({"step": 3e-3}, ValueRangeError, "is not a whole number of steps"),
        ({"param": {"load.mass": [1, 2]}}, UnknownNameError, "load.mass"),
        ({"param": {"load.J": [0.08, -1]}}, ValueRangeError, "J = -1 kg.m2 is outside its bounds"),
        ({"keep": ["load.speedy"]}, UnknownNameError, "load.speedy"),
        (
            {"scenario": ["motor_bench/ST1", "motor_bench"]},
            ScenarioError,
            "brings a second run 'motor_bench/ST1'; name it once",
        ),
    ],
)
def test_wrong_names_and_values_are_refused_before_anything_runs(
    run: Any, tmp_path: Path, table: dict[str, Any], kind: type[InputError], text: str
) -> None:
    with pytest.raises(kind, match=text) as caught:
        run(table)
    assert caught.value.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_a_reference_without_a_signal_is_refused(run: Any, faulty: Path) -> None:
    study = study_from({"scenario": "scenario.toml", "reference": {"step": 0.05}}, "pair", faulty)
    with pytest.raises(ScenarioError, match=r"no signal to compare with it; give\s+signals ="):
        run(study)
