"""JSON that other programs read: no numbers that it lacks."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import cosim
from cosim.errors import StepError, ValueRangeError
from cosim.files import json_text


def test_numbers_that_json_lacks_are_null() -> None:
    content = {"limit": [0.0, math.inf], "rms": math.nan, "nested": ({"x": -math.inf},), "n": 3}
    found = json.loads(json_text(content), parse_constant=pytest.fail)
    assert found == {"limit": [0.0, None], "rms": None, "nested": [{"x": None}], "n": 3}


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"record_period": math.inf}, "record period inf s: must be finite"),
        ({"record_period": math.nan}, "record period nan s: must be finite"),
        ({"duration": 1e300}, "the times alone take more than .*COSIM_MAX_DATA"),
    ],
)
def test_times_that_no_run_can_have_are_refused(given: dict[str, float], text: str) -> None:
    with pytest.raises(ValueRangeError, match=text):
        cosim.open("motor_bench/ST1", **given)  # type: ignore[arg-type]


def test_results_of_a_run_before_do_not_stay_beside_a_failed_one(tmp_path: Path) -> None:
    cosim.run("motor_bench/ST1", duration=0.05, out=tmp_path)
    (tmp_path / "report.html").write_text("all checks are met")
    assert (tmp_path / "result.json").exists()
    # a load of 1e-9 kg m2 behind an elastic gearbox swings faster than the step can follow
    swung = {"variants": {"gearbox": "elastic"}, "parameters": {"load.J": 1e-9}}
    with pytest.raises(StepError, match="stopped at"):
        cosim.run("motor_bench/ST1", out=tmp_path, **swung)  # type: ignore[arg-type]
    left = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {"recording.parquet"}
