"""Parameters are known only as well as all sets that the data do not tell apart agree on them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose import diagnose
from cosim.diagnose.verdict import decide
from cosim.intake.example import RADIUS, drive, write_csv
from tests.diagnose.test_elsewhere import TRACKED
from tests.diagnose.test_late_columns import MAPPING
from tests.diagnose.test_verdict import FAR, law, model, table
from tests.robot_logs import START, write_system

LARGER = 0.04


def test_a_law_of_two_sets_that_are_not_told_apart_holds_its_size_in_both() -> None:
    mine = law(value=0.40, half=0.01)
    theirs = law(value=0.50, half=0.02)
    ours = model(mine, law("delay", "motor.shaft"), gain=1.0)
    other = model(theirs, law("viscous", "motor.shaft"))
    for alike, ends in (((1, 2),), (0.39, 0.52)), ((), (0.39, 0.41)):
        found = decide(table(FAR, ours, other, alike=alike))
        (size,) = (x.size for x in found.laws if x.label == mine.label)
        assert size.value == 0.40 and (size.low, size.high) == pytest.approx(ends)
        assert found.alike == ((2,) if alike else ())
    # where the other set leaves it open, it says no more than its value
    (vague,) = theirs.values
    open_ = replace(theirs, values=(replace(vague, identifiable=False, high=9.0),))
    other = model(open_, law("viscous", "motor.shaft"))
    found = decide(table(FAR, ours, other, alike=((1, 2),)))
    assert found.laws[0].size.high == 0.50


@pytest.mark.slow
@pytest.mark.parametrize("larger", [LARGER, 0.0])
def test_a_wheel_is_larger_or_the_other_smaller_and_the_radius_holds_both(
    tmp_path: Path, larger: float
) -> None:
    """Both have exactly the same motion; without either, the radius is known sharply."""
    runs = ""
    for seed, purpose in enumerate(("identification", "validation")):
        write_csv(drive(40 + seed, larger=larger, duration=6.0), str(seed), tmp_path)
        runs += (
            f'[[run]]\nname = "{seed}"\npurpose = "{purpose}"\n'
            f'files = {{ cmd = "{seed}_cmd.csv", pose = "{seed}_pose.csv" }}\n'
        )
    write_system(tmp_path)
    (tmp_path / "dataset.toml").write_text(MAPPING + TRACKED + START + runs)
    found = diagnose(read_problem(tmp_path), workers=1, law=False).to_dict()
    low, high = found["parameters"]["r"]["after"]["ci95"]
    said = [line for line in found["warnings"] if "intervals hold both" in line]
    if not larger:
        assert found["verdict"] == "nothing_missing"
        assert low < RADIUS < high and high - low < 0.1 * LARGER * RADIUS and not said
        return
    assert [e["effect"] for e in found["effects"]] == ["gain"]
    assert found["effects"][0]["other_places"] == ["base.speed_right"]
    assert low < RADIUS and high > RADIUS * (1.0 + larger)
    assert len(said) == 1 and "with gain at base.speed_right instead" in said[0]
