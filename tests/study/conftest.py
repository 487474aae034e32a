"""Short studies of the motor bench, and of an FMU that fails when it is told to."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cosim.installation.builder import default_provider
from cosim.study import Study, StudyResult, run_study, study_from
from tests.coupling.faulty import build_faulty

BASE = {"scenario": "motor_bench/ST1", "duration": 0.7, "step": 1e-3}
"""The motor starts at 0.5 s."""


@pytest.fixture(scope="session")
def provider() -> Any:
    return default_provider()


@pytest.fixture
def run(tmp_path: Path, provider: Any) -> Callable[..., StudyResult]:
    """Runs a study given as a table; what it warns of ends in `run.warnings`."""
    warnings: list[str] = []

    def start(table: dict[str, Any] | Study, **arguments: Any) -> StudyResult:
        study = table if isinstance(table, Study) else study_from({**BASE, **table})
        arguments = {"out": tmp_path / "out", "picture": False, **arguments}
        return run_study(study, provider=provider, warn=warnings.append, **arguments)

    start.warnings = warnings
    return start


@pytest.fixture(scope="session")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a scenario of an FMU that fails at `bad.fail_at` as `bad.mode` says."""
    if sys.platform != "linux":
        pytest.skip("the test's FMU is for Linux")
    folder = tmp_path_factory.mktemp("faulty")
    build_faulty(folder)
    (folder / "pair.toml").write_text(
        """
connections = ["good.y -> bad.u"]
[instances]
good = "faulty.fmu"
bad = "faulty.fmu"
"""
    )
    (folder / "scenario.toml").write_text(
        """
system = "pair.toml"
duration = 1.0
step = 0.1
"""
    )
    return folder
