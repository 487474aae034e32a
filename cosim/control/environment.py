"""A scenario as an environment of Gymnasium, for controllers that learn or plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, ValueRangeError
from ..running.opening import open as open_twin
from ..spec.distribution import way_out


def environment(
    scenario: Path | str,
    *,
    actions: Mapping[str, tuple[float, float]],
    observations: Sequence[str],
    reward: Callable[[Mapping[str, float]], float],
    step: float,
    **how: Any,
) -> Any:
    """A `gymnasium.Env`: an action sets inputs, a step goes on, an observation is what outputs are.

    Every reset returns to the begin; the same actions give the same observations, bit for bit. It
    has no randomness of its own, ends (`truncated`) with the last step that fits into the scenario,
    and is never `terminated` before. `env.unwrapped.twin` is the twin.

    Args:
        scenario: as of `cosim.open`.
        actions: inputs -> their lower and upper bounds, in their units.
        observations: full scalar names.
        reward: of the observations and actions by name.
        step: time between actions [s], a whole number of communication steps.
        how: as of `cosim.open`, e.g. `duration=5.0`.

    Raises:
        ValueRangeError: bounds that are not rising, or a step longer than the scenario.
        InputError: Gymnasium is not installed; as of `cosim.open`.
    """
    try:
        import gymnasium
    except ImportError:
        raise InputError(
            f"an environment needs gymnasium, which is not installed; {way_out('gym')}"
        ) from None
    for name, (low, high) in actions.items():
        if not low < high:
            raise ValueRangeError(f"action {name}: its bounds {low:g} and {high:g} are not rising")

    class Environment(gymnasium.Env):
        """See `environment`."""

        metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

        def __init__(self) -> None:
            self.twin = open_twin(scenario, **how)
            for name in actions:
                self.twin.unit(name)
            if not self._fits():
                whole = self.twin.end - self.twin.time
                self.twin.close()
                raise ValueRangeError(
                    f"a step of {step:g} s is longer than the whole, {whole:g} s; shorten it, or "
                    "give a longer duration"
                )
            low, high = np.array(list(actions.values()), dtype=np.float64).T
            self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
            shape = (len(observations),)
            self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, shape, np.float64)

        def _fits(self) -> bool:
            """Whether another step ends within the scenario; times are whole numbers of steps."""
            return self.twin.time + step < self.twin.end + 0.5 * self.twin.master.step

        def _observed(self) -> np.ndarray[Any, np.dtype[np.float64]]:
            return np.array([self.twin.get(name) for name in observations], dtype=np.float64)

        def reset(
            self, *, seed: int | None = None, options: dict[str, Any] | None = None
        ) -> tuple[Any, dict[str, Any]]:
            super().reset(seed=seed)
            self.twin.restart()
            return self._observed(), {"time": self.twin.time}

        def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
            given = dict(zip(actions, np.asarray(action, dtype=np.float64).tolist(), strict=True))
            for name, value in given.items():
                self.twin.set(name, value)
            self.twin.step(step)
            seen = self._observed()
            value = float(reward({**dict(zip(observations, seen.tolist(), strict=True)), **given}))
            over = bool(self.twin.ended) or not self._fits()
            return seen, value, False, over, {"time": self.twin.time}

        def close(self) -> None:
            self.twin.close()

    return Environment()
