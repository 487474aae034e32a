"""Values that twins and sessions take later on arrive at FMUs, whatever their type."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.data.signals import Constant, Table
from cosim.master.master import Master
from cosim.master.session import Session
from cosim.master.twin import Twin
from cosim.system.system import System
from tests.tiny_fmus import V, tiny

ECHO = [
    V("n", "Int64", "input", "0"),
    V("m", "Int64", "output"),
    V("k", "UInt64", "input", "0"),
    V("l", "UInt64", "output"),
    V("s", "String", "input", "a"),
    V("t", "String", "output"),
    V("b", "Binary", "input", "0a"),
    V("c", "Binary", "output"),
    V("u", "Float64", "input", "0 0 7", (3,)),
    V("y", "Float64", "output", None, (3,)),
]
OUTPUTS = (
    "v->n[1][0] = v->n[0][0]; v->n[3][0] = v->n[2][0]; strcpy(v->s[5], v->s[4]);"
    "memcpy(v->s[7], v->s[6], sizeof v->s[6]); v->length[7] = v->length[6];"
    "for (int i = 0; i < 3; i++) v->r[9][i] = v->r[8][i];"
)
SAME = "for (int i = 0; i < 3; i++) v->r[1][i] = v->r[0][i];"
LARGE = 2**53 + 1


@pytest.fixture
def echo(tmp_path: Path) -> System:
    system = System()
    system.add("m", str(tiny(tmp_path, ECHO, OUTPUTS)))
    return system


@pytest.mark.parametrize(
    ("name", "out", "first", "then"),
    [
        ("n", "m", 7, LARGE),
        ("k", "l", 7, 2**64 - 1),
        ("s", "t", "abc", "def"),
        ("b", "c", b"\x01", b"\x02\x03"),
    ],
)
@pytest.mark.parametrize("driven", [True, False])
def test_a_twin_sets_what_numbers_do_not_carry(
    echo: System, name: str, out: str, first: Any, then: Any, driven: bool
) -> None:
    inputs = {f"m.{name}": first} if driven else {}
    with Twin(Master(echo, step=0.1), 1.0, inputs=inputs, record=[f"m.{out}"]) as twin:
        if not driven:
            twin.set(f"m.{name}", first)
        twin.step(0.2)
        assert (twin.get(f"m.{name}"), twin.get(f"m.{out}")) == (first, first)
        saved = twin.save()
        twin.set(f"m.{name}", then)
        twin.step(0.2)
        assert (twin.get(f"m.{name}"), twin.get(f"m.{out}")) == (then, then)
        twin.restore(saved)
        twin.step(0.2)
        assert (twin.get(f"m.{name}"), twin.get(f"m.{out}")) == (first, first)
        twin.restart()
        twin.step(0.2)
        assert twin.get(f"m.{out}") == (first if driven else twin.get(f"m.{name}"))


def test_a_twin_lets_an_integer_follow_a_signal(echo: System) -> None:
    with Twin(Master(echo, step=0.1), 1.0, inputs={"m.n": 7}) as twin:
        twin.step(0.2)
        twin.set("m.n", Table([0.0, 0.4], [3.0, 5.0], extend=True))
        twin.step(0.1)
        assert twin.get("m.m") == 3
        twin.step(0.3)
        assert twin.get("m.m") == 5


def test_a_session_drives_what_numbers_do_not_carry(echo: System) -> None:
    inputs = {"m.n": 7, "m.s": "abc"}
    with Session(Master(echo, step=0.1), 0.5, inputs=inputs, record=["m.m", "m.n"]) as session:
        assert session.run()[1][-1].tolist() == [7.0, 7.0]
        session.drive({"m.n": Constant(42), "m.s": Constant("def")})
        assert session.run()[1][-1].tolist() == [42.0, 42.0]
        session.drive({})
        assert session.run()[1][-1].tolist() == [7.0, 7.0]
        session.drive({"m.n": Table([0.0, 0.2], [3.0, 5.0], extend=True)})
        rows = session.run()[1][:, 1]
        assert rows.tolist() == [3.0, 3.0, 5.0, 5.0, 5.0, 5.0]
        np.testing.assert_array_equal(rows, session.record()["m.n"])


@pytest.mark.parametrize("executor", ["c", "python"])
def test_an_element_beside_driven_ones_keeps_what_it_was_set_to(
    tmp_path: Path, executor: str
) -> None:
    system = System()
    system.add("m", str(tiny(tmp_path, ECHO[-2:], SAME, begin="v->r[0][2] = 7;")))
    master = Master(system, step=0.1, executor=executor)
    with Twin(master, inputs={"m.u[1]": 3.0}) as twin:
        twin.step()
        assert twin.get("m.y").tolist() == [3.0, 0.0, 7.0]  # what nothing sets keeps its start
        saved = twin.save()
        twin.set("m.u[2]", 42.0)
        for _ in range(3):
            twin.step()
            assert twin.get("m.u").tolist() == twin.get("m.y").tolist() == [3.0, 42.0, 7.0]
        twin.set("m.u", [4.0, 5.0, 6.0])
        twin.step(0.2)
        assert twin.get("m.y").tolist() == [4.0, 5.0, 6.0]
        twin.restore(saved)
        twin.step(0.2)
        assert twin.get("m.y").tolist() == [3.0, 0.0, 7.0]


@pytest.mark.parametrize(
    ("own", "given", "expected"),
    [
        ({}, {"m.x[2]": 9.0}, [1.0, 9.0, 3.0, 4.0]),
        ({"x": 5.0}, {"m.x[2]": 9.0}, [5.0, 9.0, 5.0, 4.0]),
        ({"x": [5.0, 6.0, 7.0]}, {"m.x[2]": 9.0}, [5.0, 9.0, 7.0, 4.0]),
        ({"x[1]": 5.0}, {"m.x[2]": 9.0, "m.x[3]": 8.0}, [5.0, 9.0, 8.0, 4.0]),
        ({"A": [[2.0, 3.0], [5.0, 6.0]]}, {"m.A[2,2]": 9.0}, [1.0, 2.0, 3.0, 9.0]),
        ({}, {"m.x": [7.0, 7.0, 7.0], "m.x[2]": 9.0}, [7.0, 9.0, 7.0, 4.0]),
        ({}, {"m.x[2]": 9.0, "m.x": [7.0, 7.0, 7.0]}, [7.0, 9.0, 7.0, 4.0]),
        ({}, {"m.xx": [7.0, 7.0, 7.0], "m.x[2]": 9.0}, [7.0, 9.0, 7.0, 4.0]),
        ({}, {"m.x": 7.0, "m.xx[2]": 9.0}, [7.0, 9.0, 7.0, 4.0]),
    ],
)
def test_a_session_gives_elements_beside_what_the_whole_is(
    tmp_path: Path, own: dict[str, Any], given: dict[str, Any], expected: list[float]
) -> None:
    fmu = tiny(
        tmp_path,
        [
            V("x", "Float64", "parameter", "1 2 3", (3,), alias="xx"),
            V("A", "Float64", "parameter", "1 2 3 4", (2, 2)),
            V("y", "Float64", "output", None, (4,)),
        ],
        "for (int i = 0; i < 3; i++) v->r[2][i] = v->r[0][i]; v->r[2][3] = v->r[1][3];",
        begin="for (int i = 0; i < 4; i++) { v->r[0][i] = i + 1; v->r[1][i] = i + 1; }",
    )
    system = System()
    system.add("m", str(fmu), own)
    with Session(Master(system, step=0.1), 0.2, record=["m.y"]) as session:
        assert session.run(given)[1][-1].tolist() == expected


def test_the_last_word_on_a_vector_of_fmi_2_counts(tmp_path: Path) -> None:
    system = System()
    names = [V(f"q[{i}]", "Float64", "parameter", "0") for i in (1, 2)]
    outputs = [V(f"y[{i}]", "Float64", "output") for i in (1, 2)]
    law = "v->r[2][0] = v->r[0][0]; v->r[3][0] = v->r[1][0];"
    system.add("m", str(tiny(tmp_path, names + outputs, law, fmi=2)))
    for name, value, expected in (
        ("m.q", 1.0, [1.0, 1.0]),
        ("m.q[1]", 5.0, [5.0, 1.0]),
        ("m.q", 2.0, [2.0, 2.0]),
        ("m.q[2]", 3.0, [2.0, 3.0]),
        ("m.q", [7.0, 8.0], [7.0, 8.0]),
    ):
        system.set(name, value)
        rows = Master(system, step=0.1).run(0.2, record=["m.y"]).values
        assert rows[-1].tolist() == expected


def test_a_vector_of_fmi_2_is_set_with_its_driven_elements(tmp_path: Path) -> None:
    fmu = tiny(
        tmp_path,
        [
            *(V(f"q[{i}]", "Float64", "input", "0") for i in (1, 2)),
            *(V(f"y[{i}]", "Float64", "output") for i in (1, 2)),
        ],
        "v->r[2][0] = v->r[0][0]; v->r[3][0] = v->r[1][0];",
        fmi=2,
    )
    system = System()
    system.add("m", str(fmu))
    with Twin(Master(system, step=0.1), inputs={"m.q[1]": 3.0}) as twin:
        twin.step()
        twin.set("m.q[2]", 6.0)
        twin.step(0.2)
        assert twin.get("m.y").tolist() == [3.0, 6.0]
        twin.set("m.q", [5.0, 7.0])
        twin.step(0.2)
        assert twin.get("m.y").tolist() == [5.0, 7.0]


def test_shifts_and_signals_of_a_session_add_up(echo: System) -> None:
    ramp = Table([0.0, 0.2], [0.0, 1.0], extend=True)
    own = {"m.u[1]": ramp, "m.u[2]": 0.0}
    with Session(Master(echo, step=0.1), 0.5, inputs=own, record=["m.u"]) as session:

        def rows() -> list[list[float]]:
            return session.run()[1].T[:2].tolist()

        held, shifted, zero = [0.0, 0.0, 1.0, 1.0, 1.0, 1.0], [0.0] * 3 + [1.0] * 3, [0.0] * 6
        assert rows() == [held, zero]
        session.drive({"m.u[2]": Constant(2.0)})
        session.shift({"m.u[1]": 0.1})
        np.testing.assert_allclose(rows(), [shifted, [2.0] * 6], atol=1e-12)  # rounding of means
        session.shift({})
        assert rows() == [held, [2.0] * 6]
        session.drive({}, {"m.u[1]": 0.1})
        np.testing.assert_allclose(rows(), [shifted, zero], atol=1e-12)
        session.shift({})
        assert rows() == [held, zero]


def test_a_table_that_is_driven_otherwise_is_not_shared(tmp_path: Path) -> None:
    fmu = tiny(tmp_path, [V("u", "Float64", "input", "0"), V("y", "Float64", "output")])

    def session(**like: Any) -> Session:
        system = System()
        system.add("m", str(fmu))
        master = Master(system, step=0.1)
        return Session(master, 0.5, inputs={"m.u": signal}, record=["m.u"], **like)

    signal = Table([0.0, 0.2], [0.0, 1.0], extend=True)
    own = [0.0, 0.0, 1.0, 1.0, 1.0, 1.0]
    with session() as first:
        first.drive({"m.u": Constant(9.0)})
        with session(like=first.outline) as second:
            assert second.run()[1][:, 0].tolist() == own
        assert first.run()[1][:, 0].tolist() == [9.0] * 6
        first.drive({})
        with session(like=first.outline) as third:
            assert third.outline.external is first.outline.external
            assert third.run()[1][:, 0].tolist() == own
