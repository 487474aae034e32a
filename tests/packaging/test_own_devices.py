"""An FMU of a user's device is out of date once a file changes that its values are from."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cosim.spec.variant import parse_name
from sources.packaging.ready import stamp_path


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
