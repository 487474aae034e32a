"""Libraries for all platforms: format, processor, dependencies, exported names."""

from __future__ import annotations

import struct
import zipfile
from functools import lru_cache
from pathlib import Path

import pytest

from sources.packaging.build import build
from sources.packaging.cache import cache_folder

VARIANT = "inertia/disc"
X86_64, ARM64 = 0x01000007, 0x0100000C  # Mach-O processors


@lru_cache
def archive(fmi: int) -> Path:
    out = cache_folder("all-platforms")
    return build(VARIANT, out=out, fmi=fmi, platform="all")  # type: ignore[arg-type]


def libraries(fmi: int) -> dict[str, bytes]:
    """Contents by folder."""
    with zipfile.ZipFile(archive(fmi)) as opened:
        return {
            name.split("/")[1]: opened.read(name)
            for name in opened.namelist()
            if name.startswith("binaries/")
        }


def test_every_platform_has_its_folder() -> None:
    assert set(libraries(2)) == {"linux64", "win64", "darwin64", "aarch64-linux", "aarch64-darwin"}
    assert set(libraries(3)) == {
        *("x86_64-linux", "x86_64-windows", "x86_64-darwin"),
        *("aarch64-linux", "aarch64-darwin"),
    }


@pytest.mark.parametrize(("folder", "machine"), [("x86_64-linux", 62), ("aarch64-linux", 183)])
def test_linux_libraries_are_elf(folder: str, machine: int) -> None:
    library = libraries(3)[folder]
    assert library[:6] == b"\x7fELF\x02\x01"  # 64 bit, little-endian
    assert struct.unpack_from("<H", library, 18)[0] == machine
    assert b"GLIBC_2.17" in library or b"GLIBC_2.2.5" in library
    newer = [f"GLIBC_2.{minor}\0".encode() for minor in range(18, 60)]
    assert not [version for version in newer if version in library]


def test_windows_library_is_pe_for_x86_64() -> None:
    library = libraries(3)["x86_64-windows"]
    start = struct.unpack_from("<I", library, 0x3C)[0]
    assert library[:2] == b"MZ" and library[start : start + 4] == b"PE\0\0"
    assert struct.unpack_from("<H", library, start + 4)[0] == 0x8664


@pytest.mark.parametrize(
    ("folder", "processor"), [("x86_64-darwin", X86_64), ("aarch64-darwin", ARM64)]
)
def test_mac_libraries_are_mach_o(folder: str, processor: int) -> None:
    magic, found, _, kind = struct.unpack_from("<4I", libraries(3)[folder])
    assert (magic, found, kind) == (0xFEEDFACF, processor, 6)  # 64 bit, dynamic library


def test_fmi_2_has_a_universal_mac_library() -> None:
    library = libraries(2)["darwin64"]
    magic, count = struct.unpack_from(">II", library)
    assert (magic, count) == (0xCAFEBABE, 2)
    slices = {}
    for k in range(count):
        processor, _, offset, size, align = struct.unpack_from(">5I", library, 8 + 20 * k)
        assert offset % (1 << align) == 0
        slices[processor] = library[offset : offset + size]
    magic, found, _, kind = struct.unpack_from("<4I", slices[X86_64])
    assert (magic, found, kind) == (0xFEEDFACF, X86_64, 6)  # as above
    assert slices[ARM64] == libraries(2)["aarch64-darwin"]


@pytest.mark.parametrize("folder", ["linux64", "aarch64-linux", "win64", "darwin64"])
def test_both_versions_are_exported_everywhere(folder: str) -> None:
    library = libraries(2)[folder]
    for name in (
        "fmi2DoStep",
        "fmi2NewDiscreteStates",
        "fmi3DoStep",
        "fmi3GetOutputDerivatives",
        "cosim_work",
    ):
        assert name.encode() in library
    for name in ("f_outputs", "rodas3", "check_finite"):  # nothing of ours
        assert name.encode() + b"\0" not in library
