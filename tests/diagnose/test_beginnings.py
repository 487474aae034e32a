"""Where fits and trials begin when first orders do not lead to what is missing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.parts import Parameter
from cosim.diagnose import rivals
from cosim.diagnose.fitter import Fitter
from cosim.diagnose.secant import Bench
from cosim.errors import FmuCallError
from cosim.spec.hints import SearchHints


def search(best: float, place: int = 0) -> Any:
    """Costs that are least at one value, as of play or of a smoothed sign."""
    cost = lambda _, theta: 1e3 * abs(np.log(theta[place] / best))  # noqa: E731
    return SimpleNamespace(cost=cost, simulator=SimpleNamespace(of=lambda problem: problem))


@pytest.mark.parametrize(("best", "found"), [(9.0, 8.0), (0.5, 1.0), (1e9, 16.0)])
def test_a_strength_is_doubled_as_long_as_that_is_better(best: float, found: float) -> None:
    """And never past its bound; not at all where the first order was right or asked for more."""
    problem: Any = SimpleNamespace(index=lambda _: 0, lower=np.array([0.0]), upper=np.array([16.0]))
    start, it = np.array([1.0]), search(best)
    end = Fitter._doubled(it, SimpleNamespace(problem=problem), start, it.cost(None, start), "gap")
    assert end[0] == found and start[0] == 1.0


def test_up_to_the_usual_strength_all_are_tried() -> None:
    """Play far below the right one shifts an oscillation the wrong way, and does harm."""
    costs = {1e-4: 50.0, 2e-4: 90.0, 4e-4: 120.0, 8e-4: 99.0, 1.6e-3: 10.0, 3.2e-3: 80.0}
    asked: list[float] = []

    def cost(_: Any, theta: Any) -> float:
        asked.append(theta[0])
        return costs[min(costs, key=lambda gap: abs(gap - theta[0]))]

    problem: Any = SimpleNamespace(index=lambda _: 0, lower=np.array([0.0]), upper=np.array([1.0]))
    it, start = SimpleNamespace(cost=cost), np.array([1e-4])
    simulator: Any = SimpleNamespace(problem=problem)
    end = Fitter._doubled(it, simulator, start, 50.0, "gap", 1e-3)  # type: ignore[arg-type]
    assert end[0] == pytest.approx(1.6e-3) and len(asked) == 5
    # not where the first order holds
    asked.clear()
    end = Fitter._doubled(it, simulator, start, 50.0, "gap")  # type: ignore[arg-type]
    assert end[0] == 1e-4 and len(asked) == 1


@pytest.mark.parametrize(("best", "power"), [(2e-3, 0), (1e-5, 2), (1e-9, 3)])
def test_a_law_begins_as_sharp_as_the_data_want_it(
    monkeypatch: pytest.MonkeyPatch, best: float, power: int
) -> None:
    w_0 = Parameter("w_0", "rad/s", 2e-3, 1e-6, 1.0, ())
    angle = Parameter("angle", "rad", 0.1, -1.0, 1.0, ())  # smooths nothing: its bound is not 0
    whole: Any = SimpleNamespace(parameters=[w_0, angle])
    monkeypatch.setattr(rivals, "_begun", lambda _, values, fixed: (None, np.array([fixed["w_0"]])))
    fixed = {"w_0": 2e-3, "angle": 0.1}
    found = rivals._sharpest(search(best), whole, {}, fixed)
    assert found == {"w_0": pytest.approx(2e-3 * 0.1**power), "angle": 0.1}


def test_of_usual_strengths_the_best_is_kept_though_none_leads_there() -> None:
    """A residual that swings at one frequency says nothing at another."""
    gains = {1.0: 0.1, 2.0: 50.0, 4.0: 0.2}

    def measured(_: Any, value: float, change: float) -> Any:
        return SimpleNamespace(value=value, score=SimpleNamespace(gain=gains[value]))

    def simulated(_: Any, values: dict[str, float]) -> float:
        if values["c"] == 8.0:
            raise FmuCallError("it took too long")
        return 0.0

    probe = SimpleNamespace(
        strength=SimpleNamespace(hints=SearchHints(tries=(1.0, 2.0, 4.0, 8.0))), problem=None,
        values=lambda value, *_: {"c": value},
    )  # fmt: skip
    trials: Any = SimpleNamespace(probe=probe, second=0.0, fixed={}, best=None, open=True)
    bench: Any = SimpleNamespace(_measure=measured, at=simulated, model=0.0)
    Bench._scanned(bench, trials)
    assert trials.best.value == 2.0 and not trials.open


@pytest.mark.parametrize(
    ("unstable", "cost", "sharp"),
    [(True, 5.0, True), (True, 99.0, False), (False, 5.0, False), (True, None, False)],
)
def test_a_law_that_smooths_a_sign_is_fitted_sharp_where_runs_turn_unstable(
    monkeypatch: pytest.MonkeyPatch, unstable: bool, cost: float | None, sharp: bool
) -> None:
    """And kept so only if it is better; one that cannot be simulated changes nothing."""
    tau_c = Parameter("law.tau_c", "N.m", 0.0, 0.0, 10.0, (), strength=True, span=0.3)
    w_0 = Parameter("law.w_0", "rad/s", 2e-3, 1e-6, 1.0, ())
    held: list[dict[str, float]] = []

    whole = SimpleNamespace(names=["law.tau_c"], parameters=[], runs=())
    whole.with_parameters = lambda _: whole
    whole.changed = lambda **_: whole
    whole.hold = lambda values: held.append(values) or whole

    def fitted(problem: Any, theta: Any, close: Any) -> Any:
        assert theta.tolist() == [0.5]
        if cost is None:
            raise FmuCallError("it took too long")
        return SimpleNamespace(estimate=SimpleNamespace(robust=cost))

    monkeypatch.setattr("cosim.diagnose.fitter.new_parameters", lambda *_: ([tau_c], [w_0]))
    monkeypatch.setattr("cosim.diagnose.fitter.replace", lambda item, **new: (item, new))
    candidate = SimpleNamespace(label="law", added_to=lambda _: whole)
    item = SimpleNamespace(candidate=candidate, fixed={})
    estimate = SimpleNamespace(values={"law.tau_c": 0.5}, robust=90.0, count=2)
    problem = SimpleNamespace(parameters=[], runs=())
    model: Any = SimpleNamespace(
        signature=item, estimate=estimate, effects=[candidate], problem=problem
    )
    it: Any = SimpleNamespace(
        raw=SimpleNamespace(unstable=unstable), say=lambda _: None, fitted=fitted,
        simulator=SimpleNamespace(of=lambda problem: problem),
        again=lambda found, *_: found,
    )  # fmt: skip
    found = Fitter.sharper(it, model, SimpleNamespace(problem=None))  # type: ignore[arg-type]
    assert (found is not model) is sharp
    if unstable:
        assert held == [{"law.w_0": pytest.approx(2e-5)}]
    if sharp:
        assert found.signature == (item, {"fixed": {"law.w_0": pytest.approx(2e-5)}})
