"""Faulty FMUs of FMI 3 and of pythonfmu, for the rows of `matrix` that are theirs."""

from __future__ import annotations

from pathlib import Path

from tests.cosim_fmus import slave
from tests.tiny_fmus import V, tiny

VARIABLES = [V("u", "Float64", "input", "0"), V("y", "Float64", "output")]
ACTS = {
    "error": "return 3;", "discard": "return 2;", "fatal": "return 4;", "status7": "return 7;",
    "warning": "return 1;", "exit0": "exit(0);", "segv": "*(volatile int *)8 = 1;",
    "abort": "abort();", "hang": "for (;;) ;", "nan": "v->r[1][0] = 0.0 / zero;",
}  # fmt: skip
"""What the C code of FMI 3 does, by kind."""
LAST = "static volatile double zero = 0.0; (void)zero; "
SLAVE = """
import os
import sys
from pythonfmu import Fmi2Causality as C, Fmi2Slave, Real


class {name}(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.u, self.y = 0.0, 0.0
        _, self.phase, self.kind = (self.instance_name + "__").split("_")[:3]
        self.register_variable(Real("u", causality=C.input))
        self.register_variable(Real("y", causality=C.output, getter=self.read))
        self.act("create")

    def act(self, phase):
        if phase != self.phase:
            return True
        if self.kind == "raises":
            raise ValueError("belt came off")
        if self.kind == "leaves":
            sys.exit(0)
        if self.kind == "exit0":
            os._exit(0)
        if self.kind == "abort":
            os.abort()
        if self.kind == "hang":
            while True:
                pass
        if self.kind == "prints":
            print("printed by the FMU")
        if self.kind == "nan":
            self.y = float("nan")
        return self.kind != "false"

    def read(self):
        self.act("get" if self.y > 0.25 else "")
        return self.y

    def enter_initialization_mode(self):
        self.act("init")

    def do_step(self, time, size):
        self.y += size
        return self.act("step" if time > 0.15 else "")
"""


def third(folder: Path, phase: str, kind: str) -> Path:
    """An FMU of FMI 3 (y' = 1) that fails in creation, giving outputs, or a step."""
    act = ACTS[kind]
    return tiny(
        folder,
        VARIABLES,
        f"if (v->r[1][0] > 0.25) {{ {act} }}" if phase == "get" else "",
        LAST + "v->r[1][0] += h; " + (f"if (t > 0.15) {{ {act} }}" if phase == "step" else ""),
        begin=act if phase == "create" else "",
        name=f"third_{phase}_{kind}",
    )


def python(folder: Path) -> Path:
    """A slave (y' = 1) that fails as its instance's name says."""
    path = folder / "Faulty.fmu"
    return path if path.exists() else slave(folder, "Faulty", SLAVE, "pythonfmu")
