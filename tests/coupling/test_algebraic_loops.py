"""Algebraic loops: two gains in a ring, and arm and base by wrench and acceleration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.errors import AlgebraicLoopError, StepError
from cosim.master.master import Master
from cosim.master.newton import invert
from cosim.system.system import System
from tests.tiny_fmus import CAN, SHELL, V, tiny

EXECUTORS = ["python", "c"]


def ring(affine: Path, first: float, second: float) -> System:
    system = System("ring")
    system.add("a", str(affine), {"a": first, "b": 1.0})
    system.add("b", str(affine), {"a": second, "b": 1.0})
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    return system


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize(("first", "second"), [(0.5, -0.8), (0.5, -2.5), (3.0, 4.0)])
def test_a_ring_of_gains_is_solved_at_every_point(
    affine: Path, algorithm: str, executor: str, first: float, second: float
) -> None:
    master = Master(ring(affine, first, second), algorithm, 0.1, executor=executor)
    recording = master.run(0.8)
    exact = (first + 1.0) / (1.0 - first * second)  # y0 = a u0 + 1, u0 = b y0 + 1
    # solved to a relative Newton step of 1e-10 by definition, plain exchange to 1e-12
    np.testing.assert_allclose(recording["a.y"], exact, rtol=1e-10)
    if (first, second) == (0.5, -0.8):
        assert {f"{value:.10f}" for value in recording["a.y"]} == {"1.0714285714"}


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("gain", [0.2, 2.0, -3.0])  # plain exchange settles; Newton has to; too
def test_initial_states_behind_a_loop_follow_its_solution(
    affine: Path, tmp_path: Path, executor: str, gain: float
) -> None:
    begins = tiny(
        tmp_path,
        [V("u", "Float64", "input", "0"), V("y", "Float64", "output", late=True)],
        "if (!v->begun) v->r[9][0] = v->r[0][0]; v->r[1][0] = v->r[9][0];",
    )
    system = ring(affine, gain, 1.0)
    for name, source in (("first", "a.y"), ("second", "first.y"), ("third", "second.y")):
        system.add(name, str(begins))
        system.connect(source, f"{name}.u")
    assert len(system.algebraic_loops()) == 1
    recording = Master(system, step=0.1, executor=executor).run(0.2)
    # y = k u + 1, u = y + 1; loops are solved to 1e-10
    for name in ("a", "first", "second", "third"):
        np.testing.assert_allclose(recording[f"{name}.y"], (gain + 1) / (1 - gain), rtol=1e-9)


def test_a_loop_without_solution_is_refused_port_by_port(affine: Path) -> None:
    with pytest.raises(AlgebraicLoopError) as caught:
        Master(ring(affine, 0.5, 2.0), step=0.1).run(0.1)
    text = str(caught.value)
    assert "no solution that Newton's method finds" in text and "at t = 0 s" in text
    assert "a.u is direct feedthrough to a.y" in text and "a.y is connected to b.u" in text
    assert "Take a component with a state in the loop" in text


ARM_AND_BASE = [
    ("arm.wrench", "base.arm_bias"),
    *[(f"base.mount_{name}", f"arm.mount_{name}")
      for name in ("position", "quaternion", "velocity", "rate", "acceleration",
                   "angular_acceleration")],
]  # fmt: skip


def arm_and_base(provider) -> System:
    """Arm on base, coupled by wrench and acceleration instead of the arm's inertia."""
    system = System("arm on base", provider)
    system.add("base", "mobile_base/six_dof")
    system.add("arm", "ur5_arm/rigid_moving")
    for source, target in ARM_AND_BASE:
        system.connect(source, target)
    return system


def test_arm_and_base_diverge_by_plain_exchange(provider, monkeypatch) -> None:
    monkeypatch.setattr("cosim.master.newton.ITERATIONS", 0)
    monkeypatch.setattr(
        "cosim.master.initialization.PATIENCE", 1000
    )  # ended early by runaway values
    with pytest.raises(AlgebraicLoopError, match="algebraic loop"):
        Master(arm_and_base(provider), step=1e-3, executor="python").run(1e-3)


def test_arm_and_base_by_newton_move_as_with_the_arms_inertia(provider) -> None:
    torque = {f"arm.tau[{i + 1}]": value for i, value in enumerate([3.0, 40.0, 20.0, 1, 1, 0.5])}
    wrench = Master(arm_and_base(provider), step=1e-3, executor="c").run(0.05, inputs=torque)
    plain = Master(arm_and_base(provider), step=1e-3, executor="python").run(0.05, inputs=torque)
    np.testing.assert_array_equal(wrench.values, plain.values)

    inertia = System("reference", provider)
    inertia.add("base", "mobile_base/six_dof")
    inertia.add("arm", "ur5_arm/rigid_moving")
    for source, target in [*ARM_AND_BASE[1:], ("arm.arm_bias", "base.arm_bias"),
                           ("arm.arm_inertia", "base.arm_inertia")]:  # fmt: skip
        inertia.connect(source, target)
    reference = Master(inertia, step=1e-3).run(0.05, inputs=torque)
    # after initialization both solve the same equations: [F; M] = inertia * acceleration + bias
    for name in ("base.mount_acceleration[1]", "base.mount_angular_acceleration[2]"):
        assert wrench[name][0] == pytest.approx(reference[name][0], abs=1e-8)


def test_what_is_recorded_besides_needs_no_derivative(provider) -> None:
    system = arm_and_base(provider)
    base = system.members["base"].description.variables.values()
    state = next(v.name for v in base if v.causality == "local")
    names = [*system.signals(), "base.mount_x", f"base.{state}"]
    with_more = Master(system, step=1e-3).run(2e-3, record=names)
    plain = Master(system, step=1e-3).run(2e-3)
    np.testing.assert_array_equal(with_more.values[:, :-2], plain.values)


DERIVATIVE = r"""
EXPORT int fmi3GetDirectionalDerivative(Model *m, const Ref *u, size_t nu, const Ref *k, size_t nk,
                                        const double *seed, size_t ns, double *out, size_t no) {
  size_t values = 0, seeds = 0;
  for (size_t i = 0; i < nu; i++) values += SIZE[u[i]];
  for (size_t i = 0; i < nk; i++) seeds += SIZE[k[i]];
  if (values != no || seeds != ns) { say(m, 3, "too little room"); return 3; }
  for (size_t i = 0; i < nu; i++) if (u[i] != 1) { say(m, 3, "no continuous output"); return 3; }
  for (size_t i = 0; i < no; i++) out[i] = 2 * seed[i];
  return 0;
}
"""


@pytest.mark.parametrize("size", [(), (2,)])
def test_loops_of_arrays_and_beside_integers_are_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: tuple[int, ...]
) -> None:
    monkeypatch.setattr("tests.tiny_fmus.SHELL", SHELL + DERIVATIVE)
    fmu = tiny(
        tmp_path,
        [
            V("u", "Float64", "input", "0 0" if size else "0", size),
            V("y", "Float64", "output", None, size),
            V("n", "Int32", "output"),
        ],
        "for (int i = 0; i < 2; i++) v->r[1][i] = 2 * v->r[0][i] + 1 + i; v->n[2][0] = 3;",
        interface=f'{CAN} providesDirectionalDerivatives="true"',
    )
    system = System("pair")
    for name in "ab":
        system.add(name, str(fmu))
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    recording = Master(system, step=0.1).run(0.2, record=["a.y", "b.n"])
    exact = [-1.0, -2.0, 3.0] if size else [-1.0, 3.0]  # y = 2 y + 1 + i
    np.testing.assert_allclose(recording.values, [exact] * 3, rtol=1e-9)


def test_inverse() -> None:
    matrix = np.random.default_rng(1).normal(size=(7, 7))
    found = invert(matrix.tolist())
    np.testing.assert_allclose(np.array(found) @ matrix, np.eye(7), atol=1e-12)  # condition < 1e3
    assert invert([[1.0, 2.0], [2.0, 4.0]]) is None


def test_a_loop_that_is_lost_on_the_way_ends_the_run(affine: Path) -> None:
    system = ring(affine, 0.5, 0.5)
    system.set("a.fail_at", 0.35)
    with pytest.raises(StepError) as caught:
        Master(system, step=0.1).run(0.8)
    assert caught.value.recording is not None
    assert caught.value.recording.time[-1] == pytest.approx(0.3)  # the last point before


@pytest.mark.parametrize("executor", EXECUTORS)
@pytest.mark.parametrize("algorithm", ["jacobi", "iterated"])
def test_small_signals_that_say_their_nominal_value_are_solved_as_well(
    tmp_path: Path, algorithm: str, executor: str
) -> None:
    # a.y = 1e-9 t - 3 b.y, b.y = a.y: relative to 1, any value of these is a solution
    small = 'nominal="1e-9"'
    law = "v->r[1][0] = {} v->r[0][0]"
    feeding = V("u", "Float64", "input", "0", inner=small), V("y", "Float64", "output", inner=small)
    line = V("x", "Float64", "input", "0", inner=small)
    system = System()
    system.add("a", str(tiny(tmp_path, [*feeding, line], law.format("v->r[2][0] - 3.0 *") + ";")))
    system.add("b", str(tiny(tmp_path, feeding, law.format("1.0 *") + ";", name="n")))
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    master = Master(system, algorithm, 0.1, executor=executor)
    found = master.run(1.0, inputs={"a.x": lambda t: 1e-9 * (1.0 + np.sin(5.0 * t))})
    exact = 0.25e-9 * (1.0 + np.sin(5.0 * found.time))
    # loops are solved to 1e-10 of the nominal value
    np.testing.assert_allclose(found["a.y"], exact, rtol=1e-9, atol=1e-18)
