"""The same sources give the same archive; a second build does nothing."""

from __future__ import annotations

import hashlib
import subprocess
import zipfile
from pathlib import Path

import pytest

from sources.packaging import native
from sources.packaging.build import build, build_many
from sources.packaging.cache import cache_folder

pytestmark = pytest.mark.slow

VARIANT = "inertia/disc"  # small: compiled in a third of a second


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for FMUs and an empty cache, but for the C library that zig builds once."""
    return use_cache(tmp_path, monkeypatch)


def use_cache(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    zig = cache_folder("zig")
    monkeypatch.setenv("COSIM_CACHE", str(folder / "cache"))
    (folder / "cache").mkdir()
    (folder / "cache" / "zig").symlink_to(zig, target_is_directory=True)
    return folder / "fmus"


def test_two_folders_and_two_empty_caches_give_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: dict[tuple[int, str], set[str]] = {}
    for place in ("one", "another place"):
        with monkeypatch.context() as patch:
            (tmp_path / place).mkdir()
            out = use_cache(tmp_path / place, patch)
            for fmi, kind in ((2, "native"), (3, "native"), (2, "python")):
                path = build(VARIANT, out=out, fmi=fmi, kind=kind)  # type: ignore[arg-type]
                found.setdefault((fmi, kind), set()).add(digest(path))
    assert all(len(digests) == 1 for digests in found.values()), found
    assert len(found) == 3


def test_archive_holds_no_times_users_or_paths(fresh: Path) -> None:
    path = build(VARIANT, out=fresh)
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            assert info.date_time == (1980, 1, 1, 0, 0, 0)
            content = archive.read(info)
            for word in (str(Path.home()), str(fresh), str(native.C_SOURCES.parent)):
                assert word.encode() not in content, (info.filename, word)
        assert archive.namelist()[0] == "modelDescription.xml"


def test_each_version_has_its_own_library(fresh: Path) -> None:
    libraries = []
    for fmi in (2, 3):
        with zipfile.ZipFile(build(VARIANT, out=fresh, fmi=fmi)) as archive:  # type: ignore[arg-type]
            (name,) = [n for n in archive.namelist() if n.startswith("binaries/")]
            libraries.append(archive.read(name))
    assert libraries[0] != libraries[1]


def test_second_build_does_nothing(fresh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = build(VARIANT, out=fresh)
    before = path.stat()

    def never(*_: object, **__: object) -> None:
        raise AssertionError("compiled again")

    monkeypatch.setattr("sources.packaging.build.collect", never)
    monkeypatch.setattr(subprocess, "run", never)
    assert build(VARIANT, out=fresh) == path
    assert path.stat().st_mtime_ns == before.st_mtime_ns
    assert path.stat().st_ino == before.st_ino


def test_a_changed_file_is_built_again(fresh: Path) -> None:
    path = build(VARIANT, out=fresh)
    good = digest(path)
    path.write_bytes(path.read_bytes()[:-1])
    build(VARIANT, out=fresh)
    assert digest(path) == good


def test_many_are_the_same_as_one_by_one(fresh: Path, tmp_path: Path) -> None:
    names = ["inertia/disc", "gearbox/ratio", "inertia/disc+coulomb", "command_link/ideal"]
    done: list[str] = []
    paths = build_many(names, out=fresh, progress=lambda name, _: done.append(name))
    assert sorted(done) == sorted(names)
    for name, path in zip(names, paths, strict=True):
        assert digest(path) == digest(build(name, out=tmp_path / "single"))


@pytest.mark.parametrize("workers", [1, 2])
def test_the_first_failure_of_many_is_reported(fresh: Path, workers: int) -> None:
    with pytest.raises(ValueError, match="there is no component 'inertie'"):
        build_many(["inertia/disc", "inertie/disc"], out=fresh, workers=workers)
