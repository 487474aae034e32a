"""The papers' machines as plants of their own, against figures that others computed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cosim.data.logs import read_data_set
from cosim.errors import UnknownNameError
from cosim.intake.plants import mobile_manipulator as manipulator
from cosim.intake.plants import omni_base as omni
from cosim.intake.plants import writing

STATE = np.array([0.0, 0.0, 0.3, 0.2, 1.1, -2.0, 0.0, 0.0, 0.0])
TWIST = np.array([0.5, -0.2, 0.4])
"""Of the omnidirectional base; its figures below are of a symbolic derivation (SymPy)."""


class Frictionless(omni.Plant):
    """The base without axle friction."""

    def friction(self, rates: np.ndarray) -> np.ndarray:
        return np.zeros(9)


def test_the_wheels_of_the_omnidirectional_base_turn_as_its_motion_asks() -> None:
    rates = omni.Plant(omni.Machine()).free(STATE, TWIST)
    expected = [-4.43171556, -7.77777188, 7.13396849, -2.37986269, 2.36875405, -0.19804773]
    assert rates[3:] == pytest.approx(expected, abs=1e-8)  # digits of the figures


def test_the_omnidirectional_base_moves_as_an_independent_derivation() -> None:
    plant = Frictionless(omni.Machine())
    torques = np.array([0.5, -0.3, 0.2, -2.0, -1.5, -1.0])

    def rates(_time: float, state: np.ndarray) -> np.ndarray:
        moving = plant.free(state[:9], state[9:])
        return np.concatenate([moving, plant.accelerations(state[:9], moving, torques)[:3]])

    start = np.concatenate([STATE, TWIST])
    end = solve_ivp(rates, (0.0, 2.0), start, rtol=1e-8, atol=1e-10, method="DOP853").y[:, -1]
    expected = [1.26839035, -0.4762851, 1.41060631, 0.8013881, -0.28119505, 0.61598665]
    # tolerance of the solver over 2 s, and of the differences that stand for A'
    assert end[[0, 1, 2, 9, 10, 11]] == pytest.approx(expected, abs=1e-7)


def test_friction_of_the_omnidirectional_base_takes_power() -> None:
    machine = omni.Machine(M_pa=3.0, K=1.4)
    plant = omni.Plant(machine)
    for seed in range(20):
        chance = np.random.default_rng(seed)
        rates = plant.free(np.append(chance.uniform(-3, 3, 6), np.zeros(3)), chance.normal(size=3))
        assert plant.friction(rates) @ rates < 0.0
    without = omni.Plant(omni.Machine()).friction(rates)
    assert plant.friction(rates)[2] != without[2] == 0.0  # the patches hold the platform, too


def test_the_torques_that_a_move_needs_move_the_base_there() -> None:
    machine = omni.Machine(M_pa=3.0)
    times = 0.02 * np.arange(76)
    asked = omni.torques(machine, times, (0.4, 0.1, 0.3), 0.2, 1.2)
    found = omni.simulate(machine, times, asked)
    ends = [found[name][-1] for name in ("x", "y", "theta")]
    # torques are linear over 20 ms; axle friction turns over within 20 ms at start and end
    assert ends == pytest.approx([0.4, 0.1, 0.3], abs=0.01)


def test_the_arm_needs_the_torques_that_another_library_finds() -> None:
    q = np.array([0.3, -1.1, 1.4, -0.8, 0.6, -0.4])
    qd = np.array([0.5, -0.4, 0.3, 0.2, -0.6, 0.7])
    qdd = np.array([1.0, -0.8, 0.6, 0.5, -0.3, 0.2])
    links = manipulator.chain(q, qd)
    mass = manipulator.LINK_MASS
    turning = links.angular @ qd
    inertia = np.einsum("l,lxi,lxj->ij", mass, links.linear, links.linear) + np.einsum(
        "lxi,lxy,lyj->ij", links.angular, links.inertia, links.angular
    )
    momentum = np.einsum("lxy,ly->lx", links.inertia, turning)
    moment = np.einsum("lxy,ly->lx", links.inertia, links.angular_0) + np.cross(turning, momentum)
    force = mass[:, None] * (links.linear_0 + np.array([0.0, 0.0, 9.81]))
    bias = np.einsum("lxi,lx->i", links.linear, force) + np.einsum(
        "lxi,lx->i", links.angular, moment
    )
    expected = [1.805137, -39.586517, -18.647769, -1.070996, 0.179182, 0.000155]
    assert inertia @ qdd + bias == pytest.approx(expected, abs=1e-6)  # pinocchio, its digits
    height = manipulator.MOUNT - manipulator.R_DRIVE
    assert links.tool - [0.0, 0.0, height] == pytest.approx(
        [-0.571244, -0.402285, 0.364827], abs=1e-6
    )


def test_the_base_stands_under_its_weight_and_rolls_as_it_is_told() -> None:
    times = np.array([0.0, 0.5, 1.0, 2.0])
    speed = np.array([0.0, 0.0, 0.2, 0.2])
    command = manipulator.Command(times, speed, np.zeros(4))
    found = manipulator.simulate(manipulator.Machine(), command)
    # 0.05 m on the ramp and 0.2 m after it; the speed loops' integral parts give back what they lag
    # but for 2.1 A over 8.4 A/rad of motor angle, 2.5 mm
    assert found["x"][-1] == pytest.approx(0.25, abs=3e-3)
    # the arm's weight lies 0.4 m to the side: that turns a base on creeping wheels by a milliradian
    assert abs(found["y"][-1]) < 1e-3 and abs(found["phi"][-1]) < 2e-3
    assert found["x"][:2] == pytest.approx([0.0, 0.0], abs=1e-6)  # it has come to rest before


def test_a_set_is_written_with_its_noise_and_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = 0.02 * np.arange(400)
    still = {"time": times, "v_set": 0.1 * times, "x": np.zeros(400), "qd_2": np.zeros(400)}
    kind = writing.Kind("some_rig", "Nothing moves.", lambda: iter([("A", "validation", still)]))
    monkeypatch.setitem(writing.KINDS, "still", kind)
    writing.write("still", tmp_path / "S-1")
    data = read_data_set(tmp_path / "S-1")
    log = data.log("A")
    assert (data.rig, data.name, data.rate) == ("some_rig", "S-1", 50.0)
    assert log.columns["v_set"] == pytest.approx(0.1 * times, abs=0.0)  # commands are exact
    assert (log.units["x"], log.noise["x"], log.units["qd_2"]) == ("m", 5e-4, "rad/s")
    # 400 samples: the deviation is known to 3.5 %, four of these
    assert np.std(log.columns["x"]) == pytest.approx(5e-4, rel=0.14)
    writing.write("still", tmp_path / "S-2")
    same = read_data_set(tmp_path / "S-2").log("A").columns["x"]
    writing.write("still", tmp_path / "S-3", seed=1)
    other = read_data_set(tmp_path / "S-3").log("A").columns["x"]
    assert np.array_equal(same, log.columns["x"]) and not np.array_equal(other, same)


def test_a_machine_that_is_not_there_is_named_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"no machine 'mir20'.*'mir250'"):
        writing.write("mir20", tmp_path / "set")
