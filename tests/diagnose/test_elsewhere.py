"""A law that does the same at another place of the set that is named is shown there, too."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.rivals import elsewhere
from cosim.diagnose.search import Search
from cosim.intake.example import drive, write_csv
from tests.diagnose.test_late_columns import MAPPING
from tests.problems import simulator
from tests.robot_logs import START, write_system

pytestmark = pytest.mark.slow
LARGER = 0.04
TRACKED = """[[parameter]]
name = "track"
unit = "m"
nominal = 0.2
min = 0.1
max = 0.3
targets = "base.track"
"""


def test_a_larger_left_wheel_is_a_smaller_right_one(tmp_path: Path) -> None:
    """With another radius and track; a gain of the turn is a track, and no answer at all."""
    runs = ""
    for seed, purpose in enumerate(("identification", "validation")):
        write_csv(drive(40 + seed, larger=LARGER, duration=6.0), str(seed), tmp_path)
        runs += (
            f'[[run]]\nname = "{seed}"\npurpose = "{purpose}"\n'
            f'files = {{ cmd = "{seed}_cmd.csv", pose = "{seed}_pose.csv" }}\n'
        )
    write_system(tmp_path)
    (tmp_path / "dataset.toml").write_text(MAPPING + TRACKED + START + runs)
    problem = read_problem(tmp_path)
    gains = {c.port: c for c in candidates(problem) if c.effect == "gain"}
    left, right, turn = (gains[port] for port in ("speed_left", "speed_right", "turn"))
    search = Search(simulator(problem, 1), only=[left])
    base = search.calibrated()
    winner = search.round(base).winner
    assert winner is not None and winner.effects == (left,)
    search.known = [left, right, turn]
    search.note(base)
    elsewhere(search, winner, [search.scored(winner)])
    search.close()
    same, other = (search.memo.get(frozenset([c.label])) for c in (right, turn))
    assert same is not None and other is not None
    assert sum(search.gains(winner, other)) < -1000.0  # beside left it did nothing, either
    # exactly the same motion; fits end within 0.2 nats of their minimum
    assert sum(search.gains(winner, same)) == pytest.approx(0.0, abs=1.0)
    value = same.estimate.values[f"{right.prefix}error"]
    assert value == pytest.approx(1.0 / (1.0 + LARGER) - 1.0, abs=2e-3)  # four deviations
