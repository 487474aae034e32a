"""What `cosim diagnose` prints of the places that data do not tell apart, for sets of laws, too."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from tests.diagnose import built

LATE, SMALL, LARGE = 0.02, 1e-4, 2e-4
"""Of the clock of a log [s], and drags of a disc [N.m.s2/rad2]: rounds lead to
the small one, efforts along the log's motion to the large one."""
AT_REST = ("sweep", "swing", "again")
"""Runs in which the torque rises from 0, so that who is late, drive or sensors, shows nowhere."""


def printed(folder: Path, names: Sequence[str], drag: float = SMALL) -> list[str]:
    """Lines of the verdict for a disc with drag that was logged late, in these runs."""
    built.problem(folder, lambda w, theta, t: drag * w * abs(w), late={"delay": LATE}, names=names)
    done = CliRunner().invoke(app, ["diagnose", str(folder), "--out", str(folder / "out")])
    assert done.exit_code == 0, done.output
    lines = [line.strip() for line in done.output.splitlines()]
    return lines[next(i for i, line in enumerate(lines) if ": effect_found." in line) :]


@pytest.mark.slow
@pytest.mark.parametrize("drag", [SMALL, LARGE])
def test_a_law_of_a_set_is_said_with_the_places_where_it_does_the_same(
    tmp_path: Path, drag: float
) -> None:
    """A drive that is late beside a drag: late sensors do as well."""
    lines = printed(tmp_path, AT_REST, drag)
    place = next(i for i, line in enumerate(lines) if line.startswith("delay at "))
    assert lines[place].startswith("delay at log.load.tau: t_d = 0.02")
    assert lines[place + 1] == "or at log.load.outputs: these runs do not tell which"
    assert any(line.startswith("quadratic_drag at load.flange: c = ") for line in lines)
    assert sum("do not tell which" in line for line in lines) == 1  # the drag is where it is


@pytest.mark.slow
def test_a_place_that_the_data_tell_is_said_alone(tmp_path: Path) -> None:
    """A run that begins with a torque tells that it moves at once, and is seen late."""
    lines = printed(tmp_path, built.FEW)
    (found,) = [line for line in lines if line.startswith("delay at log.load.outputs: t_d = ")]
    assert float(found.split()[5]) == pytest.approx(LATE, abs=2e-4)  # half the interval
    assert not any("do not tell which" in line for line in lines)
