"""An FMU of a user's device is out of date once a file changes that its values are from."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cosim.spec.variant import parse_name
from sources.packaging.ready import stamp_path
from sources.variant import build_model


def test_the_file_of_a_part_counts_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folders = [tmp_path / "base", tmp_path / "wheels"]
    for folder, component in zip(folders, ("mobile_base", "wheel_contact"), strict=True):
        folder.mkdir()
        (folder / "mine.toml").write_text(f'components = ["{component}"]\n')
    monkeypatch.setenv("COSIM_DEVICES", os.pathsep.join(map(str, folders)))
    name = parse_name("mobile_base.mine/planar")
    stamps = [stamp_path(name, 2, "native", "host")]
    for folder in folders:
        with (folder / "mine.toml").open("a") as handle:
            handle.write("[r]\nvalue = 0.123\n")
        stamps.append(stamp_path(name, 2, "native", "host"))
    (folders[0] / "other.toml").write_text('components = ["mobile_base"]\n')
    assert len(set(stamps)) == 3
    assert stamp_path(name, 2, "native", "host") == stamps[-1]


R = '[r]\nvalue = 0.1\nunit = "m"\norigin = "drawing"\n'


def test_a_device_gives_its_values(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of quantities that other fidelities have, too, and other components of the file."""
    text = 'components = ["tricycle", "command_link"]\n' + R + R.replace("[r]", "[l]")
    delay = '[command_link.t_d]\nvalue = 0.1\nunit = "s"\norigin = "log"\n'
    (tmp_path / "mine.toml").write_text(text + delay)
    monkeypatch.setenv("COSIM_DEVICES", str(tmp_path))
    # an arm's file has limits that no equation takes, infinite where there is none
    (tmp_path / "turning.toml").write_text(
        text + R.replace("[r]", "[q_max]").replace("0.1", "[0.5, inf]")
    )
    assert build_model("tricycle.turning/rolling").variables["r"].start == 0.1
    assert build_model("tricycle.mine/rear_driven").variables["r"].start == 0.1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (R.replace("[r]", "[R]"), "did you mean 'r'"),
        (R + R.replace("[r]", "[trak]"), "did you mean 'track'"),
        ("track = 0.5\n", r"write \[track\] with value, unit and origin"),
        (R.replace("0.1", "true"), "the value of 'r' is True; write a number"),
        (R.replace("0.1", '"0.5"'), "the value of 'r' is '0.5'; write a number"),
        (R.replace("0.1", "nan"), "the value of 'r' is nan; write a number"),
    ],
    ids=["case", "misspelt", "plain", "truth", "quoted", "nan"],
)
def test_what_no_quantity_can_take_is_refused(
    text: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.toml").write_text('components = ["diff_drive"]\n' + text)
    monkeypatch.setenv("COSIM_DEVICES", str(tmp_path))
    with pytest.raises(ValueError, match=told) as caught:
        build_model("diff_drive.mine/rolling")
    assert str(tmp_path / "mine.toml") in str(caught.value)


def test_components_that_are_no_list_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.toml").write_text('components = "diff_drive"\n' + R)
    monkeypatch.setenv("COSIM_DEVICES", str(tmp_path))
    with pytest.raises(ValueError, match=r'mine.toml: .* write components = \["diff_drive"\]'):
        build_model("diff_drive.mine/rolling")
