"""Odd FMUs for tests of the master: small pythonfmu slaves, and archives with something wrong."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

SLAVE2 = """
from pythonfmu import Boolean, Fmi2Causality as C, Fmi2Slave, Integer, Real


class {name}(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.a, self.b, self.u, self.state, self.fail_at = 1.0, 0.0, 0.0, 0.0, 1e9
        self.n, self.on, self.next, self.off = 2, True, 0, False
        for item in ("a", "b", "fail_at"):
            self.register_variable(Real(item, causality=C.parameter, variability="tunable"))
        self.register_variable(Real("u", causality=C.input))
        law = lambda: self.a * self.u + self.b
        self.register_variable(Real("y", causality=C.output, getter=law))
        self.register_variable(Integer("n", causality=C.input))
        self.register_variable(Integer("next", causality=C.output, getter=lambda: self.n + 1))
        self.register_variable(Boolean("on", causality=C.input))
        self.register_variable(Boolean("off", causality=C.output, getter=lambda: not self.on))

    def do_step(self, time, size):
        if time + size > self.fail_at:
            raise ValueError("belt came off")
        return True
"""

SLAVE3 = """
from pythonfmu3 import Boolean, Fmi3Causality as C, Fmi3Slave, Float64, Int32


class {name}(Fmi3Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.time, self.u, self.y, self.n, self.next = 0.0, 0.0, 0.0, 2, 0
        self.on, self.off = True, False
        self.register_variable(Float64("time", causality=C.independent))
        self.register_variable(Float64("u", causality=C.input))
        self.register_variable(Float64("y", causality=C.output))
        self.register_variable(Int32("n", causality=C.input))
        self.register_variable(Int32("next", causality=C.output))
        self.register_variable(Boolean("on", causality=C.input))
        self.register_variable(Boolean("off", causality=C.output))

    def do_step(self, time, size):
        self.y, self.next, self.off = 2.0 * self.u, self.n + 1, not self.on
        return True
"""


def slave(folder: Path, name: str, text: str, tool: str) -> Path:
    """Build a slave; `{name}` in the text stands for its class."""
    script = folder / f"{name}.py"
    script.write_text(text.format(name=name))
    subprocess.run(
        [sys.executable, "-W", "ignore", "-m", tool, "build", "-f", str(script), "-d", str(folder)],
        check=True,
        capture_output=True,
        cwd=folder,
    )
    return folder / f"{name}.fmu"


def rewrite(
    source: Path,
    target: Path,
    xml: Callable[[str], str] = lambda text: text,
    keep: Callable[[str], bool] = lambda name: True,
    limit: int | None = None,
) -> Path:
    """A copy of an FMU with another description, without some files, or with short binaries."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            if not keep(name):
                continue
            content = old.read(name)
            if name == "modelDescription.xml":
                content = xml(content.decode()).encode()
            if name.startswith("binaries/"):
                content = content[:limit]
            new.writestr(name, content)
    return target
