"""The generated machine with a tool in its hand has what it says, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.arm_question import TOOL, WHOLE, write
from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from tests.diagnose.test_caster_question import left

pytestmark = pytest.mark.slow


def test_with_the_tool_the_logs_hold_noise_alone(tmp_path: Path) -> None:
    truth = write(tmp_path, {TOOL: 2.0}, 1)
    declared = read_problem(tmp_path, mapping=WHOLE)
    lacking = left(declared, truth)
    assert lacking["joint_current_3"] > 20.0 > 10.0 * lacking["base_phi"]
    (item,) = [c for c in candidates(declared) if c.label == TOOL]
    found = left(item.added_to(declared), truth)
    # 8000 samples per channel: the RMS of white noise is within 4 % of 1, five deviations
    assert found == pytest.approx(dict.fromkeys(found, 1.0), abs=0.04)


def test_the_base_alone_leaves_out_the_run_in_which_the_arm_swings(tmp_path: Path) -> None:
    truth = write(tmp_path, {}, 2)
    base, whole = read_problem(tmp_path), read_problem(tmp_path, mapping=WHOLE)
    assert {r.name for r in whole.runs} - {r.name for r in base.runs} == {"IN3"}
    found = left(whole, truth)
    assert found == pytest.approx(dict.fromkeys(found, 1.0), abs=0.04)  # as above
