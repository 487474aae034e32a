"""FMUs of pythonfmu3 with arrays of its own: numbers, 64-bit integers, texts; by element."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import Master, System
from cosim.errors import InputError
from tests.cosim_fmus import slave

pytestmark = pytest.mark.slow

ARRAYS = """
import numpy as np
from pythonfmu3 import Dimension, Fmi3Causality as C, Fmi3Slave, Fmi3Variability as V
from pythonfmu3 import Float64, Int32, Int64, String, UInt64

THREE, TWO, N = Dimension(start="3"), Dimension(start="2"), Dimension(valueReference="1")


class {name}(Fmi3Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.time, self.n, self.big, self.text = 0.0, 3, 0, ""
        self.u, self.A, self.k = np.ones(3), np.eye(2, 3), np.zeros(3, dtype=int)
        self.y, self.z, self.k1, self.big_out, self.text_out = self.u, np.ones(2), self.k, 0, ""
        self.register_variable(Float64("time", causality=C.independent))
        self.register_variable(
            UInt64("n", causality=C.structuralParameter, variability=V.fixed, start=3))
        for type_, name, causality, sizes in (
            (Float64, "u", C.input, [N]), (Float64, "y", C.output, [N]),
            (Float64, "z", C.output, [TWO]), (Int32, "k", C.input, [THREE]),
            (Int32, "k1", C.output, [THREE]),
        ):
            self.register_variable(type_(
                name, causality=causality, dimensions=sizes, setter=self.taking(name)))
        self.register_variable(Float64("A", causality=C.parameter, variability=V.tunable,
                                       dimensions=[TWO, THREE], setter=self.taking("A")))
        for type_, name in (Int64, "big"), (String, "text"):
            self.register_variable(type_(name, causality=C.input))
            self.register_variable(type_(name + "_out", causality=C.output))

    def taking(self, name):  # its own setters pass reshape() a word that numpy 2 has no more
        shape = getattr(self, name).shape
        return lambda values: setattr(self, name, np.reshape(values, shape))

    def do_step(self, time, size):
        self.y, self.z, self.k1 = 2.0 * self.u, self.A @ self.u, self.k + 1
        self.big_out, self.text_out = self.big, self.text + "!"
        return True
"""


def test_arrays_of_pythonfmu3(tmp_path: Path) -> None:
    path = str(slave(tmp_path, "arrays", ARRAYS, "pythonfmu3"))
    system = System("two")
    system.add("a", path)
    system.add("b", path)
    for source, target in ("y", "u"), ("k1", "k"), ("big_out", "big"), ("text_out", "text"):
        system.connect(f"a.{source}", f"b.{target}")
    with pytest.raises(InputError, match="A takes 2 x 3 values, but 3 x 2 are given"):
        system.set("a.A", [[1, 0], [0, 1], [0, 0]])
    with pytest.raises(InputError, match="n is a structural parameter"):
        system.set("a.n", 2)
    system.set("b.A", [[1.0, 0.0, 1.0], [0.0, 3.0, 0.0]])
    system.set("b.A[2,1]", -1.0)  # after rows
    inputs = {
        "a.u": [0.5, 1.0, 2.0], "a.k": [7, -8, 9], "a.big": 2**62 + 1, "a.text": "\u00fc",
    }  # fmt: skip
    found = Master(system, step=0.1).run(0.3, inputs=inputs).to_pandas().iloc[-1]
    assert [found[f"a.y[{i}]"] for i in (1, 2, 3)] == [1.0, 2.0, 4.0]
    assert [found[f"b.z[{i}]"] for i in (1, 2)] == [1.0 + 4.0, -1.0 + 6.0]
    assert [found[f"b.k1[{i}]"] for i in (1, 2, 3)] == [9, -6, 11]
    assert found["b.big_out"] == 2**62 + 1 != float(2**62)
    assert found["b.text_out"] == "\u00fc!!"
