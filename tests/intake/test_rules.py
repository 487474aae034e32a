"""What is odd about a log: each rule finds its kind, and not in a column that is in order."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.calibrate.checks.finding import Finding
from cosim.data.cells import Gaps
from cosim.data.logs import Log
from cosim.intake.inspect import inspect_topic
from cosim.intake.topic import Topic

COUNT = 1000
TIME = 0.01 * np.arange(COUNT)
CHANCE = np.random.default_rng(4)
GOOD = np.sin(TIME) + CHANCE.normal(0.0, 0.01, COUNT)
OTHER = np.cos(3 * TIME) + CHANCE.normal(0.0, 0.01, COUNT)


def found(**columns: np.ndarray) -> list[Finding]:
    log = Log("x", {"time": TIME, **columns})
    return list(inspect_topic(Topic("x", "CSV", log)).findings)


def kinds(**columns: np.ndarray) -> list[tuple[str, str]]:
    return [(f.kind, f.column) for f in found(**columns)]


def test_nothing_is_said_of_a_good_log() -> None:
    assert found(a=GOOD, b=OTHER, steps=np.sign(np.sin(TIME)), sine=np.round(np.sin(TIME), 4)) == []


def _spiked() -> np.ndarray:
    values = GOOD.copy()
    values[[200, 700]] += 1.0
    return values


@pytest.mark.parametrize(
    ("kind", "values", "text"),
    [
        ("constant", np.full(COUNT, 3.0), "is 3 throughout"),
        ("held", np.repeat(GOOD[::5], 5), "every 5 samples"),
        ("saturated", np.clip(GOOD, -2.0, 0.8), "largest value 0.8"),
        ("spikes", _spiked(), "2 single samples"),
        ("wrapped", (40 * TIME) % 360.0, "begins anew at a turn of 360 deg, 1 times"),
    ],
)
def test_a_column(kind: str, values: np.ndarray, text: str) -> None:
    (finding,) = found(a=values, b=OTHER)
    assert (finding.kind, finding.column) == (kind, "a")
    assert text in finding.text


def test_copies_are_named_with_their_factor() -> None:
    (finding,) = found(a=GOOD, b=np.degrees(GOOD) + 2.0, c=OTHER)
    assert finding.text == "is 57.2958 times a plus 2"
    (finding,) = found(a=GOOD, b=GOOD)
    assert finding.text == "is a copy of a"
    assert found(a=GOOD, b=GOOD + CHANCE.normal(0.0, 1e-6, COUNT)) == []


def test_clocks() -> None:
    twice, jumped = TIME.copy(), TIME.copy()
    twice[500] = twice[499]
    jumped[500:] += 1e5
    for times, kind, text in (
        (twice, "clock", "1 times that are there twice"),
        (jumped, "gap", "jumps by 1e+05 s after 4.99 s"),
        (TIME + np.where(TIME > 5.0, 0.2, 0.0), "gap", "has a gap of 0.21 s after 5 s"),
        (TIME + CHANCE.uniform(0, 0.009, COUNT), "jitter", "jitters"),
    ):
        findings = list(
            inspect_topic(Topic("x", "CSV", Log("x", {"time": times, "a": GOOD}))).findings
        )
        assert [f.kind for f in findings if f.column == "time"] == [kind]
        assert text in findings[0].text
    (finding,) = inspect_topic(Topic("x", "CSV", Log("x", {"a": GOOD}))).findings
    assert finding.severity == "error" and "--clock" in finding.text


def test_cells_without_numbers_and_text_are_counted() -> None:
    values = GOOD.copy()
    values[:7] = np.nan
    log = Log(
        "x", {"time": TIME, "a": values, "b": np.full(COUNT, np.nan)},
        gaps={"a": Gaps(7, 0, "", 0, COUNT), "b": Gaps(COUNT, 0, "", 0, COUNT)},
        texts={"mode": Gaps(0, COUNT, "auto", 1, COUNT)}, notes=("was read as Latin-1",),
    )  # fmt: skip
    texts = {f.column: f.text for f in inspect_topic(Topic("x", "CSV", log)).findings}
    assert texts["a"] == "7 of 1000 cells hold no number"
    assert "no number at all" in texts["b"] and "'auto'" in texts["mode"]
    assert texts[""] == "was read as Latin-1"


def test_noise_and_resolution_are_measured() -> None:
    log = Log("x", {"time": TIME, "a": np.round(GOOD, 3)})
    (column,) = inspect_topic(Topic("x", "CSV", log)).columns
    # the deviation of the estimate is 1.2 / sqrt(n / 8)
    assert column.noise == pytest.approx(0.01, rel=0.3)
    assert column.resolution == pytest.approx(0.001, rel=1e-6)  # of sums of decimals
