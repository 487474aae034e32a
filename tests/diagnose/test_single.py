"""One law of one signal at one place, asked before sets of named laws are compared."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose.grey_box import Single, single
from cosim.diagnose.localise import everywhere
from cosim.diagnose.search import Search
from tests.diagnose import disc
from tests.problems import simulator

RUNS = ("sweep", "steps", "check")


def asked(folder: Path, law: disc.Law) -> Single:
    """The best law of one signal for a disc, of whose catalogue nothing is asked."""
    problem = read_problem(disc.write(folder, law, seconds=2.0, names=RUNS))
    search = Search(simulator(problem), only=[])
    base = search.calibrated()
    located = everywhere(search, base, print)
    assert (located[0].label, len({p.label for p in located})) == ("load.flange", len(located))
    one = single(search, base, base, located)
    search.close()
    assert one is not None
    return one


@pytest.mark.parametrize(
    ("law", "signal"),
    [
        (lambda w, theta, t: 0.03 * (theta - 0.3), "angle"),
        (lambda w, theta, t: 0.1 * math.sin(theta + 0.5), "angle"),
        (lambda w, theta, t: 2e-3 * w * abs(w), "velocity"),
    ],
    ids=["spring", "unbalance", "drag"],
)
def test_one_law_is_found_at_its_place_over_its_signal(
    tmp_path: Path, law: disc.Law, signal: str
) -> None:
    one = asked(tmp_path / "disc", law)
    assert one.begun.law is not None and one.begun.enough
    assert (one.place.label, one.begun.law.shape.label) == ("load.flange", signal)


@pytest.mark.parametrize(
    "law",
    [
        lambda w, theta, t: 0.0,
        lambda w, theta, t: 0.1 * math.sin(theta + 0.5) * math.tanh(w / 0.5),
    ],
    ids=["none", "two signals"],
)
def test_no_law_of_one_signal_does_where_there_is_none(tmp_path: Path, law: disc.Law) -> None:
    assert not asked(tmp_path / "disc", law).begun.enough
