"""Connections and recordings by the second names of FMI 3 variables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.master.master import Master
from cosim.system.system import System
from tests.tiny_fmus import V, tiny


def ramp(times: np.ndarray) -> np.ndarray:
    return 10.0 * times


@pytest.fixture
def halves(tmp_path: Path) -> Path:
    """y = u / 2 + w, directly."""
    variables = [
        V("u", "Float64", "input", "0", alias="uu"),
        V("w", "Float64", "input", "0", alias="ww"),
        V("y", "Float64", "output", alias="yy"),
    ]
    return tiny(tmp_path, variables, "v->r[2][0] = 0.5 * v->r[0][0] + v->r[1][0];")


@pytest.mark.parametrize("executor", ["python", "auto"])
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "iterated"])
@pytest.mark.parametrize(("output", "entry"), [("y", "u"), ("yy", "u"), ("y", "uu"), ("yy", "uu")])
def test_a_loop_through_aliases_is_solved(
    halves: Path, algorithm: str, executor: str, output: str, entry: str
) -> None:
    system = System("ring")
    for name in "ab":
        system.add(name, str(halves))
    system.connect(f"a.{output}", f"b.{entry}")
    system.connect(f"b.{output}", f"a.{entry}")
    assert len(system.algebraic_loops()) == 1
    master = Master(system, algorithm, step=0.1, executor=executor)
    recording = master.run(0.5, inputs={"a.w": ramp}, record=["a.y", "a.yy", "b.uu"])
    exact = ramp(recording.time) / 0.75  # y = (y / 2) / 2 + w
    for name in recording.names:
        np.testing.assert_allclose(recording[name], exact, rtol=1e-9, atol=1e-12)  # to 1e-10


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "iterated", "adaptive"])
def test_an_input_is_recorded_alike_by_all_its_names(halves: Path, algorithm: str) -> None:
    system = System("alone")
    system.add("a", str(halves))
    recording = Master(system, algorithm, step=0.1).run(
        0.5, inputs={"a.ww": ramp}, record=["a.w", "a.ww", "a.y", "a.yy"]
    )
    assert recording["a.ww"].tolist() == recording["a.w"].tolist() == ramp(recording.time).tolist()
    assert recording["a.yy"].tolist() == recording["a.y"].tolist()
