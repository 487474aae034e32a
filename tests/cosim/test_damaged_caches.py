"""What is kept in the cache and was damaged is made again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from cosim.master import kernel
from cosim.spec.cache import seal
from sources.packaging import kernel as compiling
from sources.packaging.cache import keep
from sources.packaging.native import compile_c

DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "cut": lambda content: content[: len(content) // 2],
    "garbage": lambda content: b"x" * len(content),
}


@pytest.mark.slow
@pytest.mark.parametrize("how", DAMAGE)
def test_a_damaged_executor_is_not_loaded_and_compiled_again(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel, "cache_folder", lambda: tmp_path)
    target = tmp_path / kernel.library_name()
    arguments = (kernel.SOURCES, target, compiling_platform())
    compiling.build_kernel(*arguments)
    whole = target.read_bytes()
    assert kernel.find() == target
    target.write_bytes(DAMAGE[how](whole))
    assert kernel.find() is None
    compiling.build_kernel(*arguments)
    assert target.read_bytes() == whole and kernel.find() == target


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty one: the compiler first makes what it links to everything, for 2 s."""
    return tmp_path_factory.mktemp("cache")


@pytest.mark.slow
@pytest.mark.parametrize("how", DAMAGE)
def test_a_damaged_library_of_an_fmu_is_compiled_again(
    how: str, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COSIM_CACHE", str(cache))
    files = {"a.c": "int answer(void) { return 42; }"}
    whole = compile_c(files, "a.c", "a", compiling_platform())
    (kept,) = (path for path in cache.glob("libraries/*") if path.suffix != ".sha256")
    kept.write_bytes(DAMAGE[how](whole))
    assert compile_c(files, "a.c", "a", compiling_platform()) == whole == kept.read_bytes()


def test_a_seal_is_kept_beside_its_file(tmp_path: Path) -> None:
    keep(tmp_path / "kept", b"content")
    assert seal(tmp_path / "kept").read_text().startswith("ed7002b439e9ac84")


def compiling_platform() -> str:
    from sources.packaging.platforms import host_platform

    return host_platform()
