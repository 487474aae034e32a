"""The campaign of generated sets: rows of two states of the program never come together."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import campaign


def test_a_folder_belongs_to_the_state_that_began_it(tmp_path: Path) -> None:
    campaign.claim(tmp_path / "new", "motor")
    campaign.claim(tmp_path / "new", "motor")  # the same state goes on


def test_a_folder_of_another_state_is_refused(tmp_path: Path) -> None:
    (tmp_path / "state.txt").write_text("0123456789abcdef\n", encoding="utf-8")
    with pytest.raises(SystemExit, match=r"by state 0123456789abcdef .* another --out"):
        campaign.claim(tmp_path, "motor")


def test_the_state_is_that_of_the_program_and_of_the_plant(tmp_path: Path) -> None:
    (tmp_path / "cosim" / "deep").mkdir(parents=True)
    (tmp_path / "benchmarks").mkdir()
    law, plant = tmp_path / "cosim" / "deep" / "law.py", tmp_path / "benchmarks" / "arm_plant.py"
    law.write_text("a", encoding="utf-8")
    first = campaign.state("arm", tmp_path), campaign.state("motor", tmp_path)
    assert (campaign.state("arm", tmp_path), campaign.state("motor", tmp_path)) == first
    plant.write_text("a", encoding="utf-8")
    second = campaign.state("arm", tmp_path), campaign.state("motor", tmp_path)
    assert second[0] != first[0] and second[1] == first[1]
    law.write_text("b", encoding="utf-8")
    assert campaign.state("motor", tmp_path) != first[1]
