"""The state machines of FMI 2 and 3: what is refused when, with its words; what stays allowed."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from fmpy.fmi2 import FMU2Model, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model

from tests.fmus import Slave, _unpacked, fmu

NAME = "dc_motor/sampled"


class Exchange:
    """A model-exchange instance and what it logged."""

    def __init__(self, fmi: int) -> None:
        self.fmi = fmi
        description, folder = _unpacked(fmu(NAME, fmi=fmi))
        self.vr = {v.name: v.valueReference for v in description.modelVariables}
        self.vr_of = {v.causality: v.valueReference for v in description.modelVariables}
        self.tunable = next(
            v.valueReference
            for v in description.modelVariables
            if v.variability == "tunable" and v.type in ("Real", "Float64")
        )
        self.size = description.numberOfContinuousStates
        self.messages: list[str] = []
        arguments = {
            "guid": description.guid,
            "unzipDirectory": str(folder),
            "modelIdentifier": description.modelExchange.modelIdentifier,
            "instanceName": "x",
        }
        if fmi == 2:

            def log(_: Any, _name: Any, _status: int, _category: Any, text: bytes) -> None:
                self.messages.append(text.decode())

            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = fmi2CallbackLoggerTYPE(log)
            self.fmu = FMU2Model(**arguments)
            self.fmu.instantiate(callbacks=self._callbacks)
        else:
            self.fmu = FMU3Model(**arguments)
            self.fmu.instantiate(
                logMessage=lambda _e, _s, _c, text: self.messages.append(text.decode())
            )

    def call(self, name: str, *arguments: Any) -> None:
        """The function of that version, straight from the library."""
        getattr(self.fmu, f"fmi{self.fmi}{name}")(self.fmu.component, *arguments)

    def initialize(self) -> None:
        if self.fmi == 2:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def update(self) -> None:
        if self.fmi == 2:
            self.fmu.newDiscreteStates()
        else:
            self.fmu.updateDiscreteStates()

    def set(self, reference: int, value: float = 0.01) -> None:
        (self.fmu.setReal if self.fmi == 2 else self.fmu.setFloat64)([reference], [value])

    def states(self) -> Any:
        return (ctypes.c_double * self.size)()


@pytest.fixture(params=[2, 3])
def exchange(request: pytest.FixtureRequest) -> Iterator[Exchange]:
    made = Exchange(request.param)
    yield made
    made.fmu.freeInstance()


Act = Callable[[Exchange], object]
ACTS: dict[str, tuple[Act, str]] = {
    "enter initialization": (Exchange.initialize, "initializ"),
    "terminate": (lambda e: e.fmu.terminate(), "terminating is not allowed"),
    "enter event mode": (lambda e: e.fmu.enterEventMode(), "entering event mode is not allowed"),
    "update": (Exchange.update, "updating discrete states is not allowed"),
    "enter continuous": (
        lambda e: e.fmu.enterContinuousTimeMode(),
        "entering continuous-time mode is not allowed",
    ),
    "complete step": (
        lambda e: e.fmu.completedIntegratorStep(),
        "completing an integrator step is not allowed",
    ),
    "set time": (lambda e: e.fmu.setTime(0.1), "setting the time is not allowed"),
    "set states": (
        lambda e: e.call("SetContinuousStates", e.states(), e.size),
        "setting continuous states is not allowed",
    ),
    "set input": (lambda e: e.set(e.vr_of["input"]), "setting a value is not allowed"),
    "set parameter": (lambda e: e.set(e.tunable), "can be set in event mode, not in continuous"),
}
"""What one may try, and the words in which it is refused."""

MODES: dict[str, tuple[list[str], set[str]]] = {
    "instantiated": ([], {"enter initialization", "set input", "set parameter"}),
    "event": (
        ["enter initialization"],
        {"terminate", "update", "enter continuous", "set time", "set input", "set parameter"},
    ),
    "continuous": (
        ["enter initialization", "update", "enter continuous"],
        {"terminate", "enter event mode", "complete step", "set time", "set states", "set input"},
    ),
    "terminated": (["enter initialization", "terminate"], set()),
}
"""How to get there, and what is allowed there."""


@pytest.mark.parametrize("act", ACTS)
@pytest.mark.parametrize("mode", MODES)
def test_model_exchange_allows_what_the_standard_allows(
    exchange: Exchange, mode: str, act: str
) -> None:
    way, allowed = MODES[mode]
    for step in way:
        ACTS[step][0](exchange)
    assert exchange.messages == []
    do, words = ACTS[act]
    if act in allowed:
        do(exchange)
        assert exchange.messages == []
        return
    with pytest.raises(Exception, match=r"status 3|Error|error"):
        do(exchange)
    words = "setting a value is not allowed" if mode == "terminated" and "set p" in act else words
    assert len(exchange.messages) == 1 and words in exchange.messages[0]
    exchange.fmu.reset()
    exchange.initialize()
    assert len(exchange.messages) == 1


def test_a_time_that_is_not_finite_is_refused(exchange: Exchange) -> None:
    exchange.initialize()
    with pytest.raises(Exception, match="status 3"):
        exchange.fmu.setTime(float("nan"))
    assert "time cannot be set to nan: not finite" in exchange.messages[0]


@pytest.mark.parametrize("fmi", [2, 3])
def test_log_categories_are_those_of_the_description(fmi: int) -> None:
    with Slave(fmu(NAME, fmi=fmi)) as slave:
        slave.fmu.setDebugLogging(True, ["logStatusError"])
        with pytest.raises(Exception, match="status 3"):
            slave.fmu.setDebugLogging(True, ["logEverything"])
        assert (
            "there is no log category logEverything; there are logStatusError"
            in (slave.messages[0])
        )


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_missing_place_for_a_state_is_refused(fmi: int) -> None:
    """Null pointers give an error, no crash."""
    state = "FMUstate" if fmi == 2 else "FMUState"
    with Slave(fmu(NAME, fmi=fmi)) as slave:
        for name, arguments in (
            (f"Get{state}", (None,)),
            (f"Set{state}", (None,)),
            (f"Serialize{state}", (None, None, 10**6)),
            (f"{'DeS' if fmi == 2 else 'Des'}erialize{state}", (None, 0, None)),
        ):
            function = getattr(ctypes.CDLL(slave.fmu.dll._name), f"fmi{fmi}{name}")
            component = ctypes.c_void_p(slave.fmu.component)
            sized = [ctypes.c_size_t(a) if isinstance(a, int) else a for a in arguments]
            assert function(component, *sized) == 3, name
        assert len(slave.messages) == 4
        assert all("given" in text for text in slave.messages)


def test_modes_that_fmi_3_offers_and_we_do_not_are_refused() -> None:
    with Slave(fmu(NAME, fmi=3)) as slave:
        for name in (
            "EnterStepMode",
            "EnterEventMode",
            "EnterConfigurationMode",
            "EvaluateDiscreteStates",
        ):
            with pytest.raises(Exception, match="status 3"):
                getattr(slave.fmu, f"fmi3{name}")(slave.fmu.component)
        expected = (
            "no event mode is used that could be left",
            "entering event mode is not allowed while",
            "no str",
        )
        for text, words in zip(slave.messages, (*expected, "is not provided"), strict=True):
            assert words in text
        slave.step(0.0, 1e-3)
