from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.cosim_fmus import SLAVE2, SLAVE3, slave
from tests.fmus import fmu
from tests.ssp_files import package


class Built:
    """Provider of the tests: FMUs of our variants, built once."""

    fmi = 2

    def path(self, variant: str) -> Path:
        return fmu(variant, "native", self.fmi)


@pytest.fixture
def provider() -> Built:
    return Built()


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    # unpacked FMUs of tests do not belong into the user's cache; built ones stay cached
    patch = pytest.MonkeyPatch()
    patch.setattr(
        "cosim.fmu.archive.cache_folder", lambda: tmp_path_factory.getbasetemp() / "cache"
    )


@pytest.fixture(scope="session")
def affine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Foreign FMI 2 FMU: y = a u + b, next = n + 1, off = not on; fails at `fail_at`."""
    return slave(tmp_path_factory.mktemp("slave2"), "affine", SLAVE2, "pythonfmu")


@pytest.fixture(scope="session")
def foreign3(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Foreign FMI 3 FMU: y = 2 u, next = n + 1, off = not on, after a step."""
    return slave(tmp_path_factory.mktemp("slave3"), "foreign", SLAVE3, "pythonfmu3")


@pytest.fixture
def make(tmp_path: Path, affine: Path):
    """Writes a package with the FMU y = a u + b at resources/affine.fmu."""

    def write(structure: str, files: Mapping[str, str | Path] | None = None) -> Path:
        content = {"resources/affine.fmu": affine, **(files or {})}
        return package(tmp_path / "foreign.ssp", structure, content)

    return write
