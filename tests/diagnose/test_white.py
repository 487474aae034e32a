"""Noise that is larger than stated is told as that, soon; beside a law, the law is looked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose import Diagnosis, diagnose
from tests.diagnose import disc

pytestmark = pytest.mark.slow


@pytest.fixture
def diagnosed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[disc.Law], Diagnosis]:
    """A disc with a law whose speed sensor has 1.27 times the noise of its sheet."""
    monkeypatch.setitem(disc.SIGMA, "w", 1.27 * disc.SIGMA["w"])

    def of(law: disc.Law) -> Diagnosis:
        return diagnose(read_problem(disc.write(tmp_path / "disc", law, seed=11)))

    return of


def test_larger_noise_has_no_law(diagnosed: Callable[[disc.Law], Diagnosis]) -> None:
    found = diagnosed(lambda w, theta, t: 0.0)
    assert found.verdict == "unexplained" and found.answer.white
    assert "is left in w (1.3 times its noise). What is left is white" in found.answer.reason
    assert found.law is None and not found.everywhere  # nobody looks for its place


def test_a_law_beside_larger_noise_is_looked_for(
    diagnosed: Callable[[disc.Law], Diagnosis],
) -> None:
    found = diagnosed(lambda w, theta, t: 0.02 * w * abs(w))
    assert [law.effect for law in found.answer.laws] == ["quadratic_drag"]
    assert found.answer.white  # what is left then
