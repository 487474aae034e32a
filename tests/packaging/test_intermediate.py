"""Our FMUs of FMI 3 ask for inputs within a step: seen by FMPy, another importer."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from itertools import pairwise
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest

from cosim.fmu.check.whole import check
from sources.packaging.layout import METHODS
from tests.fmus import Slave, fmu
from tests.packaging.test_input_derivatives import NAME, SLOPES, VALUES, move

END = 0.004
STATES = ["i", "w_ref", "w"]
MOVES = pytest.mark.parametrize("method", METHODS)


class Asked(Slave):
    """A slave whose inputs follow the parabolas of `SLOPES`; `calls`: times, finished."""

    def __init__(self, name: str = NAME, *, moved: bool = True, **settings: float) -> None:
        self.calls: list[tuple[float, bool]] = []
        self.also: Callable[[], None] = lambda: None
        required = list(SLOPES) if moved else []
        super().__init__(fmu(name, fmi=3), settings, update=self.answer, required=required)

    def answer(self, _env, t, wanted, allowed, finished, early, _return, _when) -> None:
        self.calls.append((t, finished))
        self.also()
        assert not allowed and not early
        if wanted:
            half = 0.5 * t * t
            for name, (slope, curve) in SLOPES.items():
                self.set({name: VALUES[name] + t * slope + half * curve})


@MOVES
def test_states_are_those_of_version_2(method: str) -> None:
    settings = {**VALUES, "solver.method": METHODS[method][0]}
    with Slave(fmu(NAME), settings) as two:
        move(two)
        two.step(0.0, END)
        expected = two.get(STATES)
    with Asked(**settings) as three:
        three.step(0.0, END)
        found = three.get(STATES)
    if method.startswith("rodas3"):  # needs slopes, which it has from three values: rounding
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    else:
        np.testing.assert_array_equal(found, expected)
    with Slave(fmu(NAME, fmi=3), settings) as held:  # without a callback
        held.step(0.0, END)
        assert np.max(np.abs(held.get(STATES) - expected)) > 1e-3


@MOVES
def test_times_are_within_the_step_and_the_end_is_finished(method: str) -> None:
    with Asked(**VALUES, **{"solver.method": METHODS[method][0], "solver.step": 1e-3}) as slave:
        slave.step(0.0, END)
        times = [t for t, _ in slave.calls]
        assert min(times) >= 0.0 and max(times) == END and len(times) >= 8
        assert [t for t, finished in slave.calls if finished] == [END]
        repeated = [a == b for (a, _), (b, end) in pairwise(slave.calls) if not end]
        assert not any(repeated)  # it asks anew for new times only


def test_who_declares_no_input_is_told_of_ends_alone() -> None:
    with Asked(moved=False, **VALUES) as slave:
        for k in range(3):
            slave.step(k * END, END)
        assert slave.calls == [(END, True), (2 * END, True), (3 * END, True)]
        with Slave(fmu(NAME, fmi=3), VALUES) as held:
            for k in range(3):
                held.step(k * END, END)
            np.testing.assert_array_equal(held.get(STATES), slave.get(STATES))


def test_sample_clocks_see_the_input_of_their_instant() -> None:
    name = "dc_motor/sampled"
    with Asked(name, **VALUES) as slave, Slave(fmu(name), VALUES) as two:
        move(two)
        slave.step(0.0, 0.02)
        two.step(0.0, 0.02)
        ends = [t for t, finished in slave.calls if finished]
        assert len(ends) > 10 and ends[-1] == 0.02  # each tick is one
        # FMI 2 adds up its parabola from tick to tick: rounding of some hundred terms
        np.testing.assert_allclose(slave.get(STATES), two.get(STATES), rtol=1e-10)


def test_saved_states_are_returned_to() -> None:
    with Asked(**VALUES) as slave:
        slave.step(0.0, END)
        state = slave.fmu.getFMUState()
        found = []
        for _ in range(2):
            slave.fmu.setFMUState(state)
            slave.calls.clear()
            slave.step(END, END)
            found.append((slave.get(STATES).tolist(), list(slave.calls)))
        assert found[0] == found[1] and found[0][1]


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda slave: slave.get(["i"]), "getting a value is not allowed"),
        (lambda slave: slave.set({"solver.tolerance": 1e-5}), "setting a parameter is not allowed"),
        (lambda slave: slave.set({"current": 1.0}), "state current can only be set before"),
        (lambda slave: slave.step(0.0, 1e-3), "doStep is not allowed"),
        (lambda slave: slave.fmu.getFMUState(), "saving a state is not allowed"),
        (lambda slave: slave.fmu.reset(), "a reset is not allowed"),
        (lambda slave: slave.fmu.terminate(), "terminating is not allowed"),
    ],
)
def test_what_is_not_allowed_within_a_step_is_refused(call, text: str) -> None:
    with Asked(**VALUES) as slave:
        errors: list[str] = []

        def also() -> None:
            try:
                call(slave)
            except Exception as error:  # FMPy's, for a status above warning
                errors.append(str(error))

        slave.also = also
        slave.step(0.0, 1e-3)
        assert len(errors) == len(slave.calls) > 0
        assert any(text in message for message in slave.messages), slave.messages
        mode = "while the FMU is in intermediate update mode"
        assert mode in slave.messages[0] or "current" in text
        slave.also = lambda: None
        with Asked(**VALUES) as other:  # nothing has happened
            other.step(0.0, 1e-3)
            np.testing.assert_array_equal(slave.get(STATES), other.get(STATES))


@pytest.mark.parametrize("name", ["i", "R_a", "time"])
def test_only_inputs_can_be_declared(name: str) -> None:
    texts: list[str] = []
    with pytest.raises(Exception, match="Failed to instantiate"):
        Logged(fmu(NAME, fmi=3), texts, name)
    assert "has no intermediateUpdate; only inputs have" in texts[0]


class Logged(Slave):
    """A slave whose messages outlive its creation."""

    def __init__(self, path, texts: list[str], name: str) -> None:
        self.texts = texts
        super().__init__(path, required=[name], update=lambda *_: None)

    @property
    def messages(self) -> list[str]:
        return self.texts

    @messages.setter
    def messages(self, _: list[str]) -> None:
        pass


def test_descriptions_say_so() -> None:
    assert check(fmu(NAME, fmi=3)) == []
    interface = fmpy.read_model_description(str(fmu(NAME, fmi=3)), validate=True).coSimulation
    assert interface.providesIntermediateUpdate
    assert not interface.canReturnEarlyAfterIntermediateUpdate
    with zipfile.ZipFile(fmu(NAME, fmi=3)) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    for variable in root.iterfind("ModelVariables/*"):
        declared = variable.get("intermediateUpdate") == "true"
        assert declared == (variable.get("causality") == "input"), variable.get("name")


def test_fmus_of_version_2_carry_nothing_of_it() -> None:
    found = {}
    for fmi in (2, 3):
        with zipfile.ZipFile(fmu(NAME, fmi=fmi)) as archive:
            names = [name for name in archive.namelist() if name.endswith(".c")]
            found[fmi] = "".join(archive.read(name).decode() for name in names)
        assert "INTERMEDIATE" not in found[fmi]  # neither has both
    assert "UPDATING" in found[3] and "UPDATING" not in found[2]
