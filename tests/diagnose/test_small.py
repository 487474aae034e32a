"""A law too small to be named bends parameters: their intervals hold them with it and without."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose import diagnose
from cosim.diagnose.small import small_laws
from tests.diagnose import disc

DRAG = 4e-7
"""[N.m.s2/rad2]: 0.13 of the noise beside friction that makes up for it, and a hundred half
intervals of that friction; in runs of 40 s it shows."""
SECONDS = 40.0


@pytest.mark.parametrize("size", [DRAG, 0.0])
def test_intervals_hold_the_truth_beside_a_law_without_a_name(tmp_path: Path, size: float) -> None:
    folder = disc.write(tmp_path, lambda w, theta, t: size * w * abs(w), seconds=SECONDS)
    found = diagnose(read_problem(folder), law=False)
    assert found.verdict == "nothing_missing" and found.after is not None
    told = found.to_dict()
    assert told["small_laws"] == [law.to_dict() for law in found.small]
    assert [law.effect for law in found.small] == (["quadratic_drag"] if size else [])
    assert [law.sentence in found.warnings for law in found.small] == ([True] if size else [])
    estimate = found.after.estimate
    half = {
        name: 1.96 * float(estimate.covariance[i, i]) ** 0.5
        for i, name in enumerate(estimate.problem.names)
    }
    off = {"J": estimate.values["J"] - disc.J, "b": estimate.values["b"] - disc.B}
    assert abs(off["b"]) > 10.0 * half["b"] if size else abs(off["b"]) < 2.5 * half["b"]
    for name, truth in {"J": disc.J, "b": disc.B}.items():
        low, high = told["parameters"][name]["after"]["ci95"]
        assert low <= truth <= high
        if not size:  # no wider than what noise does
            assert high - low == pytest.approx(2.0 * half[name], rel=0.05)
    if size:
        (law,) = found.small
        assert law.shifts.keys() == half.keys()
        assert law.change < 0.15 and law.shifts["b"] < -3.0 * half["b"]
        assert "quadratic_drag at load.flange shows, too" in law.sentence
        assert found.search is not None
        for stage in found.search.rounds:  # scored around other values, it says nothing of these
            stage.scored_elsewhere = True
        assert not small_laws(found.search, found.after)
