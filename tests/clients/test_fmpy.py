"""FMPy alone runs our FMUs: co-simulation and model exchange, FMI 2 and 3."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import fmpy
import numpy as np
import pytest

from tests.fmus import fmu

Values = Mapping[str, float]


def vector(name: str, *values: float) -> dict[str, float]:
    return {f"{name}[{k + 1}]": value for k, value in enumerate(values)}


# variant: inputs and start values off the symmetric points, simulated time
CASES: dict[str, tuple[Values, float]] = {
    "gearbox/ratio": ({"tau_a": 0.7, "w_b": 3.0}, 0.05),  # no states
    "inertia/pendulum": ({"tau": 1.0, "angle": 0.5}, 0.5),
    "dc_motor/electrical": ({"w_ref": 100.0, "w": 20.0}, 0.05),
    "gearbox/elastic": ({"tau_a": 0.5, "w_b": 2.0}, 0.05),
    "ur5_arm/rigid": (vector("tau", 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), 0.1),
    "wheel_contact/brush": ({"tau": 2.0, "v_x": 0.1, "f_n": 200.0}, 0.05),  # stiff
    "crawler/track_contact": ({"w2": 3.0, "w3": 4.0}, 0.3),  # stiff
    "dc_motor/sampled": ({"w_ref": 100.0, "w": 20.0}, 0.02),  # two clocks, 0.5 ms and 50 us
    "ur5_drive/sampled": (vector("q_set", 0.1, 0.2, 0.3, 0.4, 0.5, 0.6), 0.02),
}


def simulate(
    name: str, fmi: int, kind: str, *, outputs: list[str] | None = None, **arguments: Any
) -> np.ndarray:
    path = str(fmu(name, fmi=fmi))
    description = fmpy.read_model_description(path)
    values = dict(arguments.pop("start_values", {}))
    variables = description.modelVariables
    if any(v.name == "solver.method" for v in variables):
        # error-controlled to 1e-9 like CVode below, so that both approach the same solution
        values |= {"solver.method": 4, "solver.tolerance": 1e-9, "solver.step": 1e-3}
    return fmpy.simulate_fmu(
        path,
        fmi_type=kind,
        start_values=values,
        relative_tolerance=1e-9,
        output=outputs or [v.name for v in variables if v.causality == "output"],
        **arguments,
    )


@pytest.mark.parametrize("name", CASES)
def test_co_simulation_is_model_exchange_and_fmi_3_is_fmi_2(name: str) -> None:
    """The solver inside (linearly implicit) and CVode outside (BDF) share nothing but the model.

    Inputs are constant, because co-simulation holds them over a step and model exchange does not.
    Samples lie off the ticks: at a tick co-simulation shows the value before, CVode the one after.
    """
    values, stop = CASES[name]
    run = {
        (fmi, kind): simulate(
            name,
            fmi,
            kind,
            start_values=values,
            stop_time=stop,
            output_interval=stop / 10.137,
            record_events=False,
        )
        for fmi in (2, 3)
        for kind in ("CoSimulation", "ModelExchange")
    }
    two = run[2, "CoSimulation"][1:11]
    outside = run[2, "ModelExchange"][1:]
    assert len(two) == len(outside) == 10
    for output in two.dtype.names:
        for kind in ("CoSimulation", "ModelExchange"):  # one binary serves both versions
            np.testing.assert_array_equal(run[3, kind][output], run[2, kind][output])
        # local errors of 1e-9 of a state's size add up over some 1000 steps, and outputs amplify
        # them (energy about a rest position by 10); 5e-6 of the largest value is above that. A tick
        # at the wrong instant, or a missed one, errs by 1e-2.
        bound = 5e-6 * np.abs(two[output]).max()
        np.testing.assert_allclose(outside[output], two[output], rtol=0, atol=bound, err_msg=output)
    assert any(np.ptp(two[output]) > 0 for output in two.dtype.names) or name == "gearbox/ratio"


def ramp(stop: float, *, name: str) -> np.ndarray:
    return np.array([(0.0, 0.0), (stop, stop)], dtype=[("time", float), (name, float)])


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("start", [0.0, 0.013])
def test_time_events_of_model_exchange_are_the_ticks(fmi: int, start: float) -> None:
    """A link that holds a command: what is held is the time of the last tick, k * 10 ms."""
    result = simulate(
        "command_link/held",
        fmi,
        "ModelExchange",
        outputs=["v_d"],
        start_time=start,
        stop_time=0.1,
        output_interval=0.0037,
        input=ramp(1.0, name="v_set"),
        start_values={"T": 0.01},
        record_events=True,
    )
    # before the first tick the link passes the command on
    result = result[result["time"] > (0.0 if start == 0.0 else 0.0201)]
    time, held = result["time"], result["v_d"]
    jumps = np.flatnonzero(np.diff(held) > 1e-3)
    ticks = 0.01 * np.arange(1 if start == 0.0 else 3, 10)
    # event times come from k * T on both sides: rounding only
    np.testing.assert_allclose(time[jumps + 1][: len(ticks)], ticks, rtol=0, atol=1e-12)
    np.testing.assert_allclose(held[jumps + 1][: len(ticks)], ticks, rtol=0, atol=1e-12)
    assert len(jumps) in (len(ticks), len(ticks) + 1)  # one more at the stop time


@pytest.mark.parametrize("fmi", [2, 3])
def test_two_clocks_tick_in_their_own_rhythm(fmi: int) -> None:
    """The servo amplifier's set current changes every 0.5 ms, its voltage every 50 us."""
    result = simulate(
        "dc_motor/sampled",
        fmi,
        "ModelExchange",
        outputs=["i_set", "u"],
        stop_time=0.005,
        output_interval=0.0013,
        start_values={"w_ref": 100.0, "w": 20.0},
        record_events=True,
    )
    for output, period in (("i_set", 5e-4), ("u", 5e-5)):
        changes = result["time"][1:][np.diff(result[output]) != 0.0]
        assert len(changes) >= 9
        # distance to the grid k * period: rounding of times up to 5 ms
        distance = np.abs(changes - period * np.round(changes / period))
        assert distance.max() < 1e-15
    assert np.ptp(result["u"]) > 0


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_default_start_values_are_those_of_the_description(fmi: int, kind: str) -> None:
    """Setting every declared start value explicitly changes nothing."""
    results = [
        simulate(
            "dc_motor/sampled",
            fmi,
            kind,
            stop_time=0.003,
            output_interval=0.00101,
            start_values={"w_ref": 50.0},
            apply_default_start_values=apply,
        )
        for apply in (False, True)
    ]
    np.testing.assert_array_equal(*results)
