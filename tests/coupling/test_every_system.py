"""Every system of the library: both executors, and a twin in steps, give the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim import Master, Twin, read_system
from cosim.system.provider import Provider

SYSTEMS = sorted((Path(__file__).parents[2] / "scenarios" / "systems").glob("*.toml"))
STEP, COUNT = 5e-4, 100
"""The rigs' tick, and enough steps for limits, sampled controllers and delays to act."""
ALGORITHMS = [("jacobi", {}), ("gauss_seidel", {}), ("gauss_seidel", {"extrapolation": 2})]


@pytest.mark.slow
@pytest.mark.parametrize("path", SYSTEMS, ids=lambda path: path.stem)
def test_bit_for_bit(path: Path, provider: Provider) -> None:
    system = read_system(path).build(provider)
    for algorithm, options in ALGORITHMS:
        runs = [
            Master(system, algorithm, STEP, options=options, executor=executor).run(STEP * COUNT)
            for executor in ("c", "python")
        ]
        first, second = (run.values for run in runs)
        assert first.shape == second.shape
        assert first.tobytes() == second.tobytes(), (algorithm, options)
        assert np.isfinite(first).all()
        master = Master(system, algorithm, STEP, options=options)
        with Twin(master, STEP * COUNT) as twin:
            for steps in (1, 2, COUNT - 3):
                twin.step(steps * STEP)
        assert first.tobytes() == twin.recording.values.tobytes(), (algorithm, options)
