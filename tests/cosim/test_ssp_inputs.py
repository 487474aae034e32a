"""Inputs of every kind in SSP packages: the same when read back, or refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Constant, Master, System, Table, ssp
from cosim.errors import GraphError
from tests.tiny_fmus import V, tiny

BAR = """<UnitDefinitions><Unit name="bar"><BaseUnit kg="1" m="-1" s="-2" factor="1e5"/></Unit>
<Unit name="rad"><BaseUnit m="1"/></Unit></UnitDefinitions>"""
STEPS = Table([0.0, 0.2], [5.0, 6.0], extend=True)
BEYOND = 2**53 + 1
"""The first integer that a double does not carry."""


def export(folder: Path, variables: list[V], inputs: dict[str, Any], law: str = "") -> System:
    system = System()
    system.add("m", str(tiny(folder, variables, law, definitions=BAR)))
    experiment = ssp.Experiment(0.0, 0.4, 0.1, "jacobi")
    path = folder / "out.ssp"
    ssp.write(system, path, version="2.0", experiment=experiment, inputs=inputs)
    return system


def both(folder: Path, variables: list[V], inputs: dict[str, Any], law: str) -> list[Any]:
    """What runs give directly and by way of a package."""
    first = export(folder, variables, inputs, law)
    again = ssp.read_scenario(folder / "out.ssp")
    return [
        Master(system, step=0.1).run(0.4, inputs=given).values
        for system, given in ((first, inputs), (again.system.build(None), again.inputs))
    ]


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("u", ""),
        ("u", 'unit="bar"'),  # none of ours
        ("u", 'unit="rad"'),  # one of ours, of which the FMU has its own idea
        ("u v", ""),
        ("u v", 'unit="bar"'),
    ],
)
def test_names_and_units_of_inputs_over_time(tmp_path: Path, name: str, unit: str) -> None:
    variables = [V(name, "Float64", "input", "0", inner=unit), V("y", "Float64", "output")]
    direct, again = both(tmp_path, variables, {f"m.{name}": STEPS}, "v->r[1][0] = v->r[0][0];")
    assert direct[[0, -1], 0].tolist() == [5.0, 6.0]
    np.testing.assert_array_equal(again, direct)


@pytest.mark.parametrize("driver", [[STEPS, 2.0], [1.0, 2.0]])
@pytest.mark.parametrize("elements", [False, True])
def test_arrays_that_are_driven(tmp_path: Path, driver: list[Any], elements: bool) -> None:
    variables = [
        V("u", "Float64", "input", "0 0", (2,)),
        V("y", "Float64", "output", None, (2,)),
    ]
    inputs = {f"m.u[{i + 1}]": driver[i] for i in (0, 1)} if elements else {"m.u": driver}
    law = "v->r[1][0] = v->r[0][0]; v->r[1][1] = v->r[0][1];"
    direct, again = both(tmp_path, variables, inputs, law)
    assert direct[-1].tolist() == [1.0 if driver[0] == 1.0 else 6.0, 2.0]
    np.testing.assert_array_equal(again, direct)


@pytest.mark.parametrize(("type_", "value"), [("Int64", BEYOND), ("Int64", 5), ("String", "abc")])
def test_constants_that_numbers_do_not_carry(tmp_path: Path, type_: str, value: Any) -> None:
    variables = [V("u", type_, "input", "0"), V("y", "Float64", "output")]
    export(tmp_path, variables, {"m.u": Constant(value)})
    assert ssp.read(tmp_path / "out.ssp").members["m"].parameters == {"u": value}


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    integer = [V("u", "Int64", "input", "0"), V("y", "Float64", "output")]
    with pytest.raises(GraphError, match=r"input m\.u from .* only constant ones"):
        export(tmp_path, integer, {"m.u": Table([0.0], [BEYOND], extend=True)})
    binary = [V("u", "Binary", "input", "0a"), V("y", "Float64", "output")]
    with pytest.raises(GraphError, match=r"m\.u is of type Binary"):
        export(tmp_path, binary, {"m.u": b"\x01"})
