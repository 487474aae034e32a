"""Algebraic loops of short floats, and beside values that have no part in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim import Master, System
from cosim.errors import StepError
from tests.tiny_fmus import V, tiny

EXECUTORS = ["python", "c"]


def ring(folder: Path, type_: str = "Float64", *more: V, law: str = "") -> System:
    """a.y = 1 + a.x - 3 b.y, b.y = a.y: plain exchange runs away."""
    ends = [V("u", type_, "input", "0"), V("y", type_, "output")]
    drive = V("x", "Float64", "input", "0")
    first = tiny(
        folder, [*ends, drive, *more], f"v->r[1][0] = 1 + v->r[2][0] - 3 * v->r[0][0]; {law}"
    )
    system = System("ring")
    system.add("a", str(first))
    system.add("b", str(tiny(folder, ends, "v->r[1][0] = v->r[0][0];", name="n")))
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    return system


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "iterated"])
def test_loops_of_short_floats_are_solved_to_their_resolution(
    algorithm: str, executor: str, tmp_path: Path
) -> None:
    master = Master(ring(tmp_path, "Float32"), algorithm, 0.1, executor=executor)
    found = master.run(1.0, inputs={"a.x": lambda t: 0.3 * np.sin(5.0 * t)})
    exact = (1.0 + 0.3 * np.sin(5.0 * found.time)) / 4.0
    # a loop of them is solved to 1e-6, and what follows is off by the gain of 3 times that
    np.testing.assert_allclose(found["a.y"], exact, atol=4e-6)


@pytest.mark.parametrize("large", ["1.7e18", "2.1e12"])
def test_a_large_value_beside_a_loop_does_not_end_it(large: str, tmp_path: Path) -> None:
    system = ring(tmp_path)
    system.add(
        "clock",
        str(tiny(tmp_path, [V("t", "Float64", "output")], f"v->r[0][0] = {large};", name="t")),
    )
    found = Master(system, step=0.1).run(0.2)
    np.testing.assert_allclose(found["a.y"], 0.25, rtol=1e-9)


@pytest.mark.parametrize("value", ["0.0 / 0.0", "1.0 / 0.0"])
def test_what_is_no_number_and_nobody_takes_does_not_hinder(value: str, tmp_path: Path) -> None:
    fmu = tiny(
        tmp_path, [V("y", "Float64", "output", size=(2,))], f"v->r[0][0] = 1; v->r[0][1] = {value};"
    )
    system = System("array")
    system.add("a", str(fmu))
    system.add(
        "b",
        str(
            tiny(
                tmp_path,
                [V("u", "Float64", "input", "0"), V("y", "Float64", "output")],
                "v->r[1][0] = v->r[0][0];",
                name="n",
            )
        ),
    )
    system.connect("a.y[1]", "b.u")
    found = Master(system, step=0.1).run(0.2, record=["a.y[1]", "b.y"])
    assert (found.values == 1.0).all()
    with pytest.raises(StepError, match=r"a\.y\[2\] became (nan|inf)"):  # asked for, it is named
        Master(system, step=0.1).run(0.2)


def test_what_is_recorded_does_not_change_a_loop(tmp_path: Path) -> None:
    # z is a million times how far y is from its solution, so it settles later than the loop does
    solution = (4.0 - np.sqrt(16.0 - 0.4)) / 0.2
    system = ring(
        tmp_path, "Float64", V("z", "Float64", "output"),
        law="v->r[1][0] += 0.1 * v->r[0][0] * v->r[0][0];"
        f"v->r[3][0] = 1e6 * (v->r[0][0] - {float(solution)!r});",
    )  # fmt: skip
    master = Master(system, step=0.1)
    everything, one = master.run(0.5), master.run(0.5, record=["a.y"])
    assert np.array_equal(everything["a.y"], one["a.y"])
