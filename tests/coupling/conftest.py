from __future__ import annotations

from pathlib import Path

import pytest

from cosim.master import kernel
from sources.packaging.kernel import build_kernel
from sources.packaging.platforms import host_platform
from tests.cosim_fmus import SLAVE2, slave
from tests.fmus import fmu


class Built:
    """Provider of the tests: FMUs of our variants, built once."""

    def __init__(self, fmi: int = 2) -> None:
        self.fmi = fmi

    def path(self, variant: str) -> Path:
        return fmu(variant, "native", self.fmi)


@pytest.fixture
def provider() -> Built:
    return Built()


@pytest.fixture(scope="session", autouse=True)
def library() -> Path:
    return build_kernel(
        kernel.SOURCES, kernel.cache_folder() / kernel.library_name(), host_platform()
    )


@pytest.fixture(scope="session", autouse=True)
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> None:
    # unpacked FMUs of tests do not belong into the user's cache; built ones stay cached
    patch = pytest.MonkeyPatch()
    patch.setattr(
        "cosim.fmu.archive.cache_folder", lambda: tmp_path_factory.getbasetemp() / "cache"
    )


@pytest.fixture(scope="session")
def affine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Foreign FMI 2 FMU: y = a u + b; fails at `fail_at`; cannot save its state."""
    return slave(tmp_path_factory.mktemp("affine"), "affine", SLAVE2, "pythonfmu")
