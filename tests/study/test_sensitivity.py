"""Indices of sampled parameters, against functions whose indices are known."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.errors import InputError, ScenarioError
from cosim.study import Study, StudyTable, read_study, run_study, study_from
from cosim.study.design import points
from cosim.study.sensitivity import sensitivities
from cosim.study.sensitivity_picture import parallel, tornado

THREE = {f"x.{name}": {"uniform": [-math.pi, math.pi]} for name in "abc"}
Row = dict[str, Any]


def ishigami(p: Row) -> float:
    a, b, c = (p[f"x.{name}"] for name in "abc")
    return float(np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a))


def linear(p: Row) -> float:
    return float(3.0 * p["x.a"] - 1.0 * p["x.b"] + 0.0 * p["x.c"])


def tabled(
    method: str, count: int, function: Callable[[Row], float], **more: Any
) -> tuple[Study, StudyTable, list[str]]:
    """A study whose runs were a function."""
    sample = {"count": count, "method": method, "seed": 3}
    study = study_from({"scenario": "x", "sample": sample, "param": THREE, **more})
    rows, keys = [], []
    for number, point in enumerate(points(study, ["x"])):
        keys.append(str(number))
        row = {f"param.{name}": value for name, value in point.parameters.items()}
        row |= {f"set.{name}": value for name, value in point.variants.items()}
        row |= {"key": str(number), "role": "", "status": "ok", "scenario": "x", "step": 0.1}
        rows.append({**row, "rms.y": function(dict(point.parameters)), "rms.none": 1.0})
    return study, StudyTable(rows, {"rms.y": "m"}), keys


def test_sobol_indices_of_ishigamis_function() -> None:
    study, table, keys = tabled("sobol", 1024, ishigami)
    assert len(keys) == 1024 * (3 + 2)
    (found,) = sensitivities(study, table, keys)  # what does not vary has none
    first, total = ([found.indices[f"x.{n}"][index] for n in "abc"] for index in ("S1", "ST"))
    widths = [found.half_width(f"x.{n}") for n in "abc"]
    # the exact ones (Saltelli et al.), within twice the half width of the interval of 95 %
    for value, exact, width in zip(total, (0.5576, 0.4424, 0.2437), widths, strict=True):
        assert width is not None and abs(value - exact) < 2 * width < 0.2
    for value, exact in zip(first, (0.3139, 0.4424, 0.0), strict=True):
        assert abs(value - exact) < 0.1
    assert found.ordered() == ["x.a", "x.b", "x.c"]
    assert found.sentence().startswith("rms.y: ST of x.a 0.5")


def test_elementary_effects_of_a_plane_are_its_slopes() -> None:
    study, table, keys = tabled("morris", 10, linear)
    (found,) = sensitivities(study, table, keys)
    span = 2.0 * math.pi  # effects are per range of a parameter; 1e-9 is rounding
    for name, slope in (("a", 3.0), ("b", -1.0), ("c", 0.0)):
        index = found.indices[f"x.{name}"]
        assert index["mu"] == pytest.approx(slope * span, abs=1e-9)
        assert index["mu_star"] == pytest.approx(abs(slope) * span, abs=1e-9)
        assert index["sigma"] < 1e-9
    assert not found.significant("x.c") and found.significant("x.b")


@pytest.mark.parametrize("method", ["latin_hypercube", "random"])
def test_correlations_have_a_limit(method: str) -> None:
    study, table, keys = tabled(method, 60, linear)
    (found,) = sensitivities(study, table, keys)
    assert found.indices["x.a"]["correlation"] > 0.9
    assert found.significant("x.a") and not found.significant("x.c")
    assert "x.c" in found.sentence().partition("(chance)")[0]


def test_a_block_with_a_failed_run_is_left_out_and_counted() -> None:
    study, table, keys = tabled("sobol", 256, ishigami)
    whole = sensitivities(study, table, keys)[0]
    table.rows[12].update({"status": "failed", "rms.y": None})
    (found,) = sensitivities(study, table, keys)
    assert (whole.lost, found.lost, found.runs) == (0, 5, 255 * 5)
    assert "; 5 runs of incomplete blocks left out" in found.sentence()
    assert abs(found.indices["x.b"]["ST"] - whole.indices["x.b"]["ST"]) < 0.05


def test_every_variant_has_its_own() -> None:
    study, table, keys = tabled("morris", 10, linear, set={"gear": ["one", "two"]})
    for row in table.rows:
        if row["set.gear"] == "two":
            row["rms.y"] *= 2.0
    one, two = sensitivities(study, table, keys)
    assert (one.made, two.made) == ({"set.gear": "one"}, {"set.gear": "two"})
    assert two.indices["x.a"]["mu"] == pytest.approx(2 * one.indices["x.a"]["mu"], rel=1e-12)


def test_pictures(tmp_path: Path) -> None:
    for method, count in (("sobol", 16), ("morris", 10), ("random", 20)):
        study, table, keys = tabled(method, count, ishigami)
        tornado(sensitivities(study, table, keys), method, tmp_path / f"{method}.png")
        assert parallel(study, table, keys, method, tmp_path / f"{method}_lines.png")
    assert len(list(tmp_path.iterdir())) == 6
    study, table, keys = tabled("random", 20, ishigami)
    for row in table.rows:
        row["status"] = "failed"
    assert not parallel(study, table, keys, "nothing", tmp_path / "none.png")
    assert not sensitivities(study, table, keys)


def test_wrong_designs_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    table = {"scenario": "x", "param": THREE}
    with pytest.raises(ScenarioError, match=r"count = 100 is no power of 2, .*give 64 or 128"):
        study_from({**table, "sample": {"count": 100, "method": "sobol"}})
    endless = study_from(
        {
            **table,
            "param": {"x.a": {"normal": [1.0, 2.0]}, "x.b": {"uniform": [0.0, 1.0]}},
            "sample": {"count": 5, "method": "morris"},
        }
    )
    with pytest.raises(ScenarioError, match=r"x\.a: morris takes both ends .*minimum and maximum"):
        points(endless, ["x"])
    monkeypatch.setitem(__import__("sys").modules, "SALib.sample.sobol", None)
    study = study_from({**table, "sample": {"count": 4, "method": "sobol"}})
    with pytest.raises(InputError, match=r"'sobol' of \[sample\] needs SALib, .*\[study\]"):
        points(study, ["x"])


@pytest.mark.slow
def test_the_shipped_study_writes_them(tmp_path: Path, provider: Any) -> None:
    study = read_study("tolerances")
    short = study_from(
        {
            "scenario": "motor_bench/ST1", "duration": 0.7, "step": 1e-3,
            "param": {"load.J": {"uniform": [0.07, 0.09]}, "load.b": {"uniform": [0.04, 0.16]}},
            "sample": {"count": 10, "method": "morris"},
        },
        study.name,
    )  # fmt: skip
    result = run_study(short, out=tmp_path, provider=provider)
    assert {p.name for p in result.files} >= {"sensitivity.csv", "sensitivity.png", "parallel.png"}
    with (tmp_path / "sensitivity.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["parameter"] for row in rows} == {"load.J", "load.b"}
    assert len(json.loads(json.dumps(result.to_dict()))["sensitivity"]) == len(rows)
    assert len(result.table.rows) <= 10 * 3  # trajectories of two parameters; some points coincide
