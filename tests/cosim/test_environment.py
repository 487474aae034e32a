"""A scenario as an environment of Gymnasium."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from cosim.control.environment import environment
from cosim.errors import GraphError, InputError, UnknownNameError, ValueRangeError

GIVEN = {
    "actions": {"motor.w_ref": (-50.0, 50.0)},
    "observations": ["load.w", "motor.i"],
    "reward": lambda seen: -((seen["load.w"] - 3.0) ** 2),
    "step": 0.01,
    "duration": 0.1,
}


# it recommends spaces from -1 to 1; ours are in the units of the FMUs
@pytest.mark.filterwarnings("ignore:.*(symmetric and normalized|infinity):UserWarning")
def test_it_follows_the_rules_of_gymnasium() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    env = environment("motor_bench/ST1", **GIVEN)
    assert isinstance(env, gymnasium.Env)
    check_env(env, skip_render_check=True)
    env.close()


def test_the_same_actions_give_the_same_bits_and_reward_the_goal() -> None:
    pytest.importorskip("gymnasium")
    env = environment("motor_bench/ST1", **GIVEN)

    def episode(speed: float) -> tuple[np.ndarray, float]:
        env.reset(seed=0)
        seen, total, over = [], 0.0, False
        while not over:
            observation, reward, done, over, about = env.step([speed])
            assert not done
            seen.append(observation)
            total += reward
        assert len(seen) == 10
        assert about["time"] == pytest.approx(0.1)
        return np.array(seen), total

    first, good = episode(30.0)
    _, bad = episode(-30.0)
    again, _ = episode(30.0)
    assert np.array_equal(first, again)
    assert good > bad  # 30 rad/s over a ratio of 10 is the goal
    env.close()


@pytest.mark.parametrize(("step", "steps"), [(0.04, 2), (0.05, 2), (0.1, 1)])
def test_it_ends_with_the_last_step_that_fits(step: float, steps: int) -> None:
    pytest.importorskip("gymnasium")
    env = environment("motor_bench/ST1", **{**GIVEN, "step": step})
    env.reset()
    assert [env.step([10.0])[3] for _ in range(steps)] == [False] * (steps - 1) + [True]
    env.close()


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"actions": {"motor.w_ref": (1.0, 1.0)}}, ValueRangeError, "bounds 1 and 1 are not"),
        ({"step": 0.2}, ValueRangeError, r"0\.2 s is longer than the whole, 0\.1 s"),
        ({"actions": {"motor.w_reff": (0.0, 1.0)}}, UnknownNameError, "did you mean 'w_ref'"),
    ],
)
def test_wrong_actions_are_refused(change, error, text) -> None:
    pytest.importorskip("gymnasium")
    with pytest.raises(error, match=text):
        environment("motor_bench/ST1", **{**GIVEN, **change})


def test_an_input_that_an_fmu_drives_is_no_action() -> None:
    pytest.importorskip("gymnasium")
    env = environment("motor_bench/ST1", **{**GIVEN, "actions": {"gearbox.w_b": (0.0, 1.0)}})
    env.reset()
    with pytest.raises(GraphError, match=r"driven by load\.w"):
        env.step([0.5])


def test_without_gymnasium_it_says_what_to_install(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(InputError, match=r"cosim-robotics\[gym\]"):
        environment("motor_bench/ST1", **GIVEN)
