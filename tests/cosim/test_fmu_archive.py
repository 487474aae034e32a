"""Opening FMUs: whole, broken, and for other machines."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import pytest

from cosim.errors import FmuFileError, InputError, PlatformError
from cosim.fmu import archive
from cosim.fmu.archive import open_fmu
from cosim.fmu.instance import Instance
from tests.cosim_fmus import rewrite
from tests.fmus import fmu


def test_unpacked_once_by_content(tmp_path: Path) -> None:
    source = fmu("gearbox/ratio")
    copy = tmp_path / "other name.fmu"
    copy.write_bytes(source.read_bytes())
    assert open_fmu(source).folder == open_fmu(copy).folder
    assert open_fmu(copy).description.name == "gearbox/ratio"


def test_missing_file() -> None:
    with pytest.raises(FmuFileError, match=r"nowhere\.fmu: there is no such file"):
        open_fmu("nowhere.fmu")


def _truncated(source: Path, target: Path) -> Path:
    content = source.read_bytes()
    target.write_bytes(content[: len(content) // 2])
    return target


def _flipped(source: Path, target: Path) -> Path:
    with zipfile.ZipFile(source) as archive:
        info = archive.getinfo("modelDescription.xml")
    content = bytearray(source.read_bytes())
    content[info.header_offset + 200] ^= 0xFF  # inside the compressed description
    target.write_bytes(content)
    return target


def _text(source: Path, target: Path) -> Path:
    target.write_text("not a zip archive")
    return target


@pytest.mark.parametrize("damage", [_truncated, _flipped, _text])
def test_damaged_archive(tmp_path: Path, damage) -> None:
    path = damage(fmu("gearbox/ratio"), tmp_path / "broken.fmu")
    with pytest.raises(FmuFileError, match=r"broken\.fmu: is not a complete FMU archive .* again"):
        open_fmu(path)
    assert list((archive.cache_folder() / "unpacked").glob(".unpack-*")) == []


def test_archive_without_description(tmp_path: Path) -> None:
    path = rewrite(
        fmu("gearbox/ratio"), tmp_path / "x.fmu", keep=lambda name: name != "modelDescription.xml"
    )
    with pytest.raises(FmuFileError, match=r"has no modelDescription.xml, so it is not an FMU"):
        open_fmu(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[:300], "modelDescription.xml cannot be read"),
        (lambda text: text.replace('Version="2.0"', 'Version="1.0"', 1), "is of FMI version 1.0"),
        (lambda text: text.replace("CoSimulation", "OtherInterface"), "has no co-simulation"),
        (lambda text: text.replace('valueReference="', 'valueReference="x', 1), "'x1', which is"),
    ],
)  # fmt: skip
def test_bad_description(tmp_path: Path, change, message: str) -> None:
    path = rewrite(fmu("gearbox/ratio"), tmp_path / "x.fmu", xml=change)
    with pytest.raises(FmuFileError, match=message):
        open_fmu(path)


def test_no_binary_for_this_platform(tmp_path: Path) -> None:
    source = fmu("gearbox/ratio")
    foreign = tmp_path / "foreign.fmu"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(foreign, "w") as new:
        for name in old.namelist():
            new.writestr(re.sub("binaries/[^/]+/", "binaries/riscv64-plan9/", name), old.read(name))
    with pytest.raises(
        PlatformError, match=r"has no binary for this machine .* riscv64-plan9\. Build"
    ):
        Instance(foreign)
    none = rewrite(source, tmp_path / "none.fmu", keep=lambda name: not name.startswith("binaries"))
    with pytest.raises(PlatformError, match=r"it has none at all"):
        Instance(none)


def test_a_binary_that_is_no_library(tmp_path: Path) -> None:
    path = tmp_path / "x.fmu"
    with zipfile.ZipFile(fmu("gearbox/ratio")) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            new.writestr(name, b"text" if name.startswith("binaries") else old.read(name))
    with pytest.raises(FmuFileError, match=r"its binary cannot be loaded"):
        Instance(path)


def test_file_errors_are_wrong_input() -> None:
    assert issubclass(PlatformError, FmuFileError) and issubclass(FmuFileError, InputError)
    assert InputError.exit_code == 2
