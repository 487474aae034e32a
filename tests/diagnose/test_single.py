"""One law at one place, asked before sets of named laws are compared."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose.grey_box import Begun, single, site
from cosim.diagnose.grey_box.along import Along
from cosim.diagnose.grey_box.bench import LawBench
from cosim.diagnose.grey_box.single import ALL
from cosim.diagnose.grey_box.trial import Maker
from cosim.diagnose.localise import everywhere
from cosim.diagnose.search import Search
from tests.diagnose import disc
from tests.problems import simulator

RUNS = ("sweep", "steps", "check")


def asked(folder: Path, law: disc.Law) -> Begun:
    """The best law for a disc, of whose catalogue nothing is asked."""
    problem = read_problem(disc.write(folder, law, seconds=2.0, names=RUNS))
    search = Search(simulator(problem), only=[])
    base = search.calibrated()
    located = everywhere(search, base)
    assert (located[0].label, len({p.label for p in located})) == ("load.flange", len(located))
    one = single(search, base, located)
    search.close()
    assert one is not None
    return one


@pytest.mark.parametrize(
    ("law", "words", "value"),
    [
        (lambda w, theta, t: 0.03 * theta, "angle", -0.03),
        (lambda w, theta, t: 0.1 * math.sin(theta), "sin(angle)", -0.1),
        (lambda w, theta, t: 2e-3 * w * abs(w), "velocity |velocity|", -2e-3),
    ],
    ids=["spring", "unbalance", "drag"],
)
def test_a_law_of_terms_is_found_at_its_place(
    tmp_path: Path, law: disc.Law, words: str, value: float
) -> None:
    one = asked(tmp_path / "disc", law)
    assert one.law is not None and one.enough and one.label == "load.flange"
    found = dict(zip(one.law.trial.words, one.law.free, strict=True))
    assert found[words] == pytest.approx(value, rel=0.05)  # three of its standard deviations


def test_friction_that_falls_with_speed_is_a_curve(tmp_path: Path) -> None:
    one = asked(
        tmp_path / "disc",
        lambda w, theta, t: 0.1 * math.tanh(w / 0.02) * math.exp(-((w / 0.5) ** 2)),
    )
    assert one.law is not None and not one.maker.search.lacking(one.law.fitted)
    assert (one.label, one.law.shape.label) == ("load.flange", "velocity")


def test_a_law_of_two_signals_is_found(tmp_path: Path) -> None:
    one = asked(tmp_path / "disc", lambda w, theta, t: 0.01 * abs(theta) * w)
    assert one.law is not None and one.enough
    assert {axis.signal for axis in one.law.shape.axes} == {"angle", "velocity"}


@pytest.mark.parametrize(
    "law",
    [lambda w, theta, t: 0.0, lambda w, theta, t: 0.1 * math.sin(9.0 * t)],
    ids=["none", "time"],
)
def test_no_law_does_where_there_is_none(tmp_path: Path, law: disc.Law) -> None:
    assert not asked(tmp_path / "disc", law).enough


def test_a_law_promises_a_share_of_what_is_missing(tmp_path: Path) -> None:
    problem = read_problem(
        disc.write(tmp_path, lambda w, theta, t: 0.03 * theta, seconds=2.0, names=RUNS)
    )
    search = Search(simulator(problem), only=[])
    place = site(problem, "load.flange")
    along = Along(Maker(LawBench(search, search.calibrated(), place)))
    shares = {t.words: along.share(t) for t in along.terms()}
    search.close()
    # noise is a few per cent of what so short runs hold beyond it
    assert shares["angle",] == pytest.approx(1.0, abs=0.05)
    assert shares["velocity",] < ALL


def test_little_more_than_noise_has_shares_too(tmp_path: Path) -> None:
    """A law that takes all of it does so where less than the noise's power is missing."""
    problem = read_problem(
        disc.write(tmp_path, lambda w, theta, t: 3e-4 * theta, seconds=2.0, names=RUNS)
    )
    search = Search(simulator(problem), only=[])
    base = search.calibrated()
    assert base.estimate.robust < base.estimate.count
    along = Along(Maker(LawBench(search, base, site(problem, "load.flange"))))
    shares = [along.share(t) for t in along.terms()]
    search.close()
    # what is missing is told from noise to a fifth
    assert max(shares) == pytest.approx(1.0, abs=0.2)
