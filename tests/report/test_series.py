"""Signals in a page: what is thinned hides no peak, and all of it stays small."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.display.series import LEVELS, Store, axis, envelope, packed, stretch
from cosim.report.figures import ROOM, Signals
from cosim.report.page import rendered
from tests.report.stories import material

Vector = NDArray[np.float64]


def unpacked(item: dict[str, Any]) -> Vector:
    """As the page's script reads it."""
    levels = np.frombuffer(base64.b64decode(item["data"]), "<i2").astype(np.float64)
    values = item["low"] + (levels + 32767.0) * item["step"]
    values[levels == -32768.0] = np.nan
    return values


def test_numbers_come_back_to_half_a_level_and_gaps_stay_gaps() -> None:
    values = np.random.default_rng(2).normal(size=1000) * 50.0
    values[[3, 500]] = np.nan
    found = unpacked(packed(values))
    assert np.array_equal(np.isnan(found), np.isnan(values))
    level = (np.nanmax(values) - np.nanmin(values)) / LEVELS
    # half a level, and rounding
    assert np.nanmax(np.abs(found - values)) <= 0.5 * level * (1.0 + 1e-9)


@pytest.mark.parametrize("values", [np.zeros(0), np.full(5, np.nan), np.full(4, 7.25)])
def test_empty_missing_and_constant_signals_come_back(values: Vector) -> None:
    np.testing.assert_array_equal(unpacked(packed(values)), values)


def test_an_envelope_holds_every_sample() -> None:
    values = np.random.default_rng(3).normal(size=1003)
    values[417] = 40.0  # a peak of one sample
    values[10:20] = np.nan
    store = Store()
    store.put("y", values, 10)
    low, high = unpacked(store.content["y"]), unpacked(store.content["y^"])
    assert low.size == high.size == 101 and np.isnan(low[1]) and np.isnan(high[1])
    for k, value in enumerate(values):
        if np.isfinite(value):
            assert low[k // 10] <= value <= high[k // 10]
    assert high[41] >= 40.0


def test_without_thinning_there_is_no_envelope() -> None:
    store = Store()
    store.put("y", np.arange(5.0))
    assert set(store.content) == {"y"}


def test_even_times_are_told_by_their_step_others_one_by_one() -> None:
    times = 0.25 + 1e-3 * np.arange(7000)
    assert axis(times) == pytest.approx({"first": 0.25, "step": 1e-3, "count": 7000})
    times[3] += 2e-6  # two thousandths of a step
    assert isinstance(axis(times), list) and len(axis(times)) == 7000


def test_envelope_of_a_stretch_without_values_is_a_gap() -> None:
    low, high = envelope(np.array([np.nan, np.nan, 1.0, 2.0, np.nan]), 2)
    np.testing.assert_array_equal(low, [np.nan, 1.0, np.nan])
    np.testing.assert_array_equal(high, [np.nan, 2.0, np.nan])


def test_signals_are_thinned_only_where_there_is_no_room() -> None:
    assert stretch(1000, 1e6, 1000) == 1
    assert stretch(10_000_000, 1e6, 1_000_000) > 10


def test_a_large_data_set_keeps_its_page_below_2_mb() -> None:
    small, large = material("effect_found"), material("effect_found", samples=30_000, count=12)
    signals = Signals(large, "R1")
    assert set(signals.thinned) == {run.name for run in large.runs} - {"R1"}
    assert len(json.dumps(signals.store.content)) < 1.2 * ROOM  # names and axes on top
    assert len(rendered(large)) < 2_000_000
    assert not Signals(small, "R1").thinned
