"""Co-simulation with event mode (FMI 3): clocks see the inputs of the point at which they tick."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest

from tests.fmus import Slave, fmu

SENSOR, PERIOD = "marker_sensor/camera", 0.02  # s, of the camera; its noise is drawn at the ticks
STEP, END = 0.01, 0.1


def after_events(kind: str, **more: bool) -> dict[float, float]:
    """The first marker's position after what happens at each point, while it moves."""
    path = str(fmu(SENSOR, fmi=3))
    names = [v.name for v in fmpy.read_model_description(path).modelVariables
             if v.causality == "input"]  # fmt: skip
    times = np.linspace(0.0, END, 101)
    signals = np.zeros(len(times), dtype=[("time", float), *((name, float) for name in names)])
    for name in ("time", *names):
        signals[name] = times
    result = fmpy.simulate_fmu(
        path, fmi_type=kind, stop_time=END, output_interval=STEP, input=signals,
        output=["x_m[1]"], record_events=True, **more,
    )  # fmt: skip
    rows = zip(result["time"], result["x_m[1]"], strict=True)
    return {round(float(time), 9): float(value) for time, value in rows}


@pytest.mark.slow
def test_a_sensor_samples_where_model_exchange_does() -> None:
    exchange = after_events("ModelExchange")
    ticks = np.arange(0.0, END, PERIOD).round(9)
    # the drawn noise is one of a tick; before it is that of the tick before
    with_events = after_events("CoSimulation", use_event_mode=True)
    assert [with_events[t] for t in ticks] == pytest.approx([exchange[t] for t in ticks], abs=1e-12)
    without = after_events("CoSimulation")
    assert min(abs(without[t] - exchange[t]) for t in ticks) > 1e-6


@pytest.mark.slow
def test_event_mode_has_its_calls_in_their_order() -> None:
    with Slave(fmu(SENSOR, fmi=3), initialize=False) as plain:
        assert plain.description.coSimulation.hasEventMode
    with Slave(fmu(SENSOR, fmi=3), initialize=False, event_mode=True) as slave:
        slave.initialize()
        with pytest.raises(Exception, match="status 3"):
            slave.fmu.doStep(0.0, STEP)
        assert slave.fmu.updateDiscreteStates()[-2:] == (True, pytest.approx(PERIOD))
        slave.fmu.enterStepMode()
        assert not slave.fmu.doStep(0.0, STEP)[0]
        assert slave.fmu.doStep(STEP, STEP)[0]  # ends at a tick
        slave.fmu.enterEventMode()
        slave.fmu.updateDiscreteStates()
        for call, arguments in (("EnterContinuousTimeMode", ()), ("SetTime", (0.5,))):
            with pytest.raises(Exception, match="status 3"):
                getattr(slave.fmu, f"fmi3{call}")(slave.fmu.component, *arguments)
        slave.fmu.enterStepMode()
        assert not slave.fmu.doStep(2 * STEP, STEP)[0]
        for text, words in zip(
            slave.messages,
            ("is not in step mode", "no continuous-time mode", "time of co-simulation is set by"),
            strict=True,
        ):
            assert words in text
