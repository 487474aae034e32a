"""What would have no effect, or another than it says, is refused when it is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim import Constant, Master, System, Table, Twin
from cosim.errors import (
    ConnectError,
    GraphError,
    ScenarioError,
    UnknownNameError,
    ValueRangeError,
)
from tests.tiny_fmus import V, tiny


def alone(fmu: Path, name: str = "a", **parameters: Any) -> System:
    system = System("alone")
    system.add(name, str(fmu), parameters)
    return system


def mixed(folder: Path) -> Path:
    """Vectors of FMI 2 whose second elements have another role than their first."""
    ends = [
        V("k[1]", "Float64", "parameter", "1"), V("k[2]", "Float64", "calculatedParameter"),
        V("y[1]", "Float64", "output"), V("y[2]", "Float64", "local"),
        V("u[1]", "Float64", "input", "0"),
        V("u[2]", "Float64", "parameter", "0", more='variability="fixed"'),
    ]  # fmt: skip
    return tiny(folder, ends, "v->r[3][0] = 2 * v->r[0][0];", fmi=2)


def test_all_elements_of_a_vector_must_take_what_it_is_given(tmp_path: Path) -> None:
    system = alone(mixed(tmp_path))
    system.add("b", str(tmp_path / "m.fmu"))
    with pytest.raises(GraphError, match=r"a\.k\[2\] is a calculatedParameter"):
        system.set("a.k", [3.0, 4.0])
    with pytest.raises(ConnectError, match=r"a\.y\[2\] is a local of .*, not an output"):
        system.connect("a.y", "b.u")
    with pytest.raises(UnknownNameError, match=r"a\.u\[2\] is not an input .*'parameter'"):
        Master(system, step=0.1).run(0.1, inputs={"a.u": [1.0, 7.0]})
    with (
        Twin(Master(system, step=0.1)) as twin,
        pytest.raises(UnknownNameError, match=r"a\.u\[2\] cannot be set in steps"),
    ):
        twin.set("a.u", [1.0, 7.0])
    system.set("a.k[1]", 3.0)
    system.connect("a.y[1]", "b.u[1]")


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_local_that_its_fmu_calculates_takes_no_value(fmi: int, tmp_path: Path) -> None:
    locals_ = [V("w", "Float64", "local"), V("s", "Float64", "local", "1"),
               V("x", "Float64", "local", "1", more='initial="exact"')]  # fmt: skip
    fmu = tiny(tmp_path, locals_, "v->r[0][0] = 7;", fmi=fmi)
    with pytest.raises(GraphError, match=r"a\.w is a local variable that its FMU calculates"):
        alone(fmu, w=5.0)
    for name in ("s", "x"):  # one has a start value, the other says `exact`, too
        system = alone(fmu, **{name: 5.0})
        assert Master(system, step=0.1).run(0.1, record=[f"a.{name}"]).values[-1] == 5.0


def test_constant_inputs_are_kept_within_bounds(tmp_path: Path) -> None:
    ends = [V("u", "Float64", "input", "0", inner='min="-1" max="1" unit="rad"'),
            V("n", "Int32", "input", "0", inner='min="0" max="3"')]  # fmt: skip
    radians = '<UnitDefinitions><Unit name="rad"><BaseUnit rad="1"/></Unit></UnitDefinitions>'
    master = Master(alone(tiny(tmp_path, ends, definitions=radians)), step=0.1)
    for name, value in (("a.u", 5.0), ("a.u", Constant(90.0, "deg")), ("a.n", 9)):
        with pytest.raises(ValueRangeError, match=f"input {name} .* outside its bounds"):
            master.run(0.1, inputs={name: value})
    master.run(0.1, inputs={"a.u": Constant(45.0, "deg"), "a.n": 3})


@pytest.mark.parametrize("tolerance", [-1.0, 0.0, float("nan"), float("inf")])
def test_a_tolerance_is_positive(tolerance: float, tmp_path: Path) -> None:
    fmu = tiny(tmp_path, [V("y", "Float64", "output")])
    with pytest.raises(ValueRangeError, match=r"tolerance of a Master.*no positive number"):
        Master(alone(fmu), tolerance=tolerance)


@pytest.mark.parametrize(
    ("entry", "named"),
    [
        ('constant = 1.0\ntimes = [0.0]\nvalues = [2.0]', "constant and times"),
        ('times = [0.0]\nvalues = [2.0]\nfile = "log.csv"\ncolumn = "u"', "times and file"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("place", ['inputs."a.u"', "compare.c"])
def test_two_sources_at_once_are_refused(
    entry: str, named: str, place: str, tmp_path: Path
) -> None:
    tiny(tmp_path, [V("u", "Float64", "input", "0"), V("y", "Float64", "output")])
    (tmp_path / "s.toml").write_text('[instances]\na = "m.fmu"\n', encoding="utf-8")
    signal = 'signal = "a.y"\n' if place == "compare.c" else ""
    text = f'system = "s.toml"\nduration = 1.0\nstep = 0.1\n[{place}]\n{signal}{entry}\n'
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match=f"has {named}; give one source"):
        cosim.run(str(tmp_path / "scenario.toml"))


def test_a_pause_in_a_table_does_not_let_it_end_early() -> None:
    even = np.arange(0.0, 10.0, 0.01)
    paused = Table(np.append(even, [70.0, 70.01]), np.zeros(even.size + 2))
    paused.at(np.array([0.0, 70.03]))  # logs end up to some samples before the run
    with pytest.raises(ValueRangeError, match=r"covers 0 s to 70\.01 s, but the run needs"):
        paused.at(np.array([0.0, 120.0]))
    commands = Table([0.0, 10.0, 20.0, 20.004, 20.008, 30.0, 40.0], np.zeros(7))
    commands.at(np.array([0.0, 50.0]))  # as long after the last as that came after the one before
