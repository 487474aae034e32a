"""A variant as plain Python behind pythonfmu: the proof twin, and a model that people can edit.

The slave file needs nothing but the standard library and pythonfmu. Its arithmetic follows the C
code operation by operation, so both agree bit for bit wherever the C library's functions do.
"""

from __future__ import annotations

import importlib.metadata
import inspect
import math
import re
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import casadi as ca

from cosim.spec.variant import Name

from ..function import Functions
from ..model import Model
from . import c_functions, runtime
from .elimination import Block, eliminate
from .layout import Entry, lags, owners, stiff

_BINARY = {
    ca.OP_ADD: "{} + {}",
    ca.OP_SUB: "{} - {}",
    ca.OP_MUL: "{} * {}",
    ca.OP_DIV: "_div({}, {})",
    ca.OP_POW: "_pow({}, {})",
    ca.OP_CONSTPOW: "_pow({}, {})",
    ca.OP_LT: "float({} < {})",
    ca.OP_LE: "float({} <= {})",
    ca.OP_EQ: "float({} == {})",
    ca.OP_NE: "float({} != {})",
    ca.OP_AND: "float({} != 0.0 and {} != 0.0)",
    ca.OP_OR: "float({} != 0.0 or {} != 0.0)",
    ca.OP_IF_ELSE_ZERO: "({1} if {0} else 0.0)",
    ca.OP_FMIN: "_fmin({}, {})",
    ca.OP_FMAX: "_fmax({}, {})",
    ca.OP_ATAN2: "_math.atan2({}, {})",
    ca.OP_COPYSIGN: "_math.copysign({}, {})",
    ca.OP_FMOD: "_fmod({}, {})",
    ca.OP_HYPOT: "_math.hypot({}, {})",
}
_UNARY = {
    ca.OP_ASSIGN: "{}",
    ca.OP_NEG: "-{}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {}",
    ca.OP_INV: "_div(1.0, {})",
    ca.OP_SQRT: "_sqrt({})",
    ca.OP_EXP: "_exp({})",
    ca.OP_LOG: "_log({})",
    ca.OP_SIN: "_sin({})",
    ca.OP_COS: "_cos({})",
    ca.OP_TAN: "_tan({})",
    ca.OP_ASIN: "_asin({})",
    ca.OP_ACOS: "_acos({})",
    ca.OP_ATAN: "_math.atan({})",
    ca.OP_SINH: "_sinh({})",
    ca.OP_COSH: "_cosh({})",
    ca.OP_TANH: "_math.tanh({})",
    ca.OP_ASINH: "_math.asinh({})",
    ca.OP_FABS: "abs({})",
    ca.OP_FLOOR: "_floor({})",
    ca.OP_CEIL: "_ceil({})",
    ca.OP_SIGN: "_sign({})",
    ca.OP_NOT: "float(not {})",
    ca.OP_LOG1P: "_log1p({})",
    ca.OP_EXPM1: "_expm1({})",
}


def function_source(function: ca.Function) -> str:
    """A CasADi SX function as a Python function of lists that fills its result lists.

    Raises:
        ValueError: an operation that has no counterpart here.
    """
    arguments = ", ".join(f"i{k}" for k in range(function.n_in()))
    results = ", ".join(f"o{k}" for k in range(function.n_out()))
    lines = [f"def {function.name()}({', '.join(filter(None, (arguments, results)))}):"]
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            lines.append(f"    a{outputs[0]} = {_literal(function.instruction_constant(k))}")
        elif operation == ca.OP_INPUT:
            lines.append(f"    a{outputs[0]} = i{inputs[0]}[{inputs[1]}]")
        elif operation == ca.OP_OUTPUT:
            lines.append(f"    o{outputs[0]}[{outputs[1]}] = a{inputs[0]}")
        elif operation in _BINARY:
            expression = _BINARY[operation].format(*(f"a{i}" for i in inputs))
            lines.append(f"    a{outputs[0]} = {expression}")
        elif operation in _UNARY:
            lines.append(f"    a{outputs[0]} = {_UNARY[operation].format(f'a{inputs[0]}')}")
        else:
            raise ValueError(f"{function.name()}: CasADi operation {operation} has no Python form")
    if len(lines) == 1:
        lines.append("    pass")
    return "\n".join(lines) + "\n"


def _literal(value: float) -> str:
    names = {math.inf: "_math.inf", -math.inf: "-_math.inf"}
    return "_math.nan" if math.isnan(value) else names.get(value, repr(value))


def _below_the_line(module: ModuleType) -> str:
    return inspect.getsource(module).split("# -- run time ", 1)[1].split("\n", 1)[1]


def slave_source(model: Model, name: Name, equations: str) -> str:
    """The slave file of a variant: the class that pythonfmu makes instances of.

    pythonfmu looks for the class in the text of this file whenever it makes an instance, which
    takes 0.1 s for the equations of an arm: those are in a module of their own.

    Args:
        model: of the variant.
        name: of the variant.
        equations: the module with its equations, see `equations_source`.
    """
    class_name = re.sub(r"\W", "_", name.identifier)
    body = _below_the_line(runtime).replace("class Slave(", f"class {class_name}(")
    return "\n".join(
        [
            f'"""{model.component.text} Variant {name}; generated from its equations."""',
            "",
            "import math as _math",
            "from typing import Any",
            "",
            "from pythonfmu import Fmi2Slave",
            "",
            f"from {equations} import *",
            "",
            body.replace("  # type: ignore[misc]", ""),
        ]
    )


def equations_source(model: Model, functions: Functions, entries: list[Entry], name: Name) -> str:
    """The file of a variant's equations: generated functions and tables."""
    nx = sum(entry.part == "state" for entry in entries)
    elimination = eliminate(nx, functions.jacobian_pattern, owners(entries))
    used = [functions.outputs, functions.derivatives]
    if nx:
        used.append(functions.jacobian)
    if functions.updates:
        used += [functions.periods, *functions.updates]
    counts = {
        letter: sum(entry.part == part for entry in entries)
        for letter, part in (
            ("NX", "state"),
            ("NU", "input"),
            ("NY", "output"),
            ("NP", "parameter"),
            ("NZ", "discrete"),
        )
    }
    infinity = "_math.inf"

    def bounds(values: list[float | None], default: str) -> str:
        return "[" + ", ".join(default if v is None else repr(float(v)) for v in values) + "]"

    fixed = [e.part == "parameter" and e.quantity.variability == "fixed" for e in entries]
    nominal = [float(e.quantity.nominal or 1.0) for e in entries if e.part == "state"]
    tables = [
        f"MODEL = {name.identifier!r}",
        *(f"{key} = {value}" for key, value in counts.items()),
        f"NC = {len(functions.updates)}",
        f"NJ = {len(functions.jacobian_pattern)}",
        f"NLU = {elimination.size}",
        f"NAMES = {[entry.name for entry in entries]!r}",
        f"START = {[float(entry.start) for entry in entries]!r}",
        f"MINIMUM = {bounds([e.quantity.minimum for e in entries], '-' + infinity)}",
        f"MAXIMUM = {bounds([e.quantity.maximum for e in entries], infinity)}",
        f"FIXED = {fixed!r}",
        f"NOMINAL = {nominal!r}",
        f"OWNER = {owners(entries)!r}",
        f"STIFF = {stiff(entries)!r}",
        f"LAGS = {lags(entries)!r}",
    ]
    factor = ["def f_factor(j, d, w):", *_lines(elimination.factor), "    return"]
    factor = [
        line.replace("1.0 / ", "_div(1.0, ", 1) + ")" if "1.0 / " in line else line
        for line in factor
    ]
    solve = ["def f_solve(w, b):", *_lines(elimination.solve), "    return"]
    updates = ", ".join(function.name() for function in functions.updates)
    return "\n".join(
        [
            f'"""Equations of {name}, as functions that fill lists, and its variables."""',
            "",
            "import math as _math",
            "from typing import Any",
            "",
            *tables,
            "",
            _below_the_line(c_functions),
            *(function_source(function) for function in used),
            *factor,
            "",
            *solve,
            "",
            f"UPDATES = [{updates}]",
            "",
        ]
    )


def _lines(blocks: Sequence[Block]) -> list[str]:
    """Statements of a function, all of them: those whose flags are 0 change nothing."""
    return [f"    {statement}" for block in blocks for statement in block.statements]


def binaries(identifier: str) -> dict[str, bytes]:
    """pythonfmu's prebuilt libraries, from the installed package, named as FMI asks.

    Raises:
        FileNotFoundError: pythonfmu is not installed or has no binaries.
    """
    try:
        # not find_spec: FMUs that ran in this process have put packages of that name on the path
        package = importlib.metadata.distribution("pythonfmu").locate_file("pythonfmu")
    except importlib.metadata.PackageNotFoundError:
        package = None
    folder = None if package is None else Path(str(package)) / "resources" / "binaries"
    if folder is None or not folder.is_dir():
        raise FileNotFoundError("the package pythonfmu has no binaries; reinstall it")
    return {
        f"binaries/{path.parent.name}/{identifier}{path.suffix}": path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.suffix in (".so", ".dll", ".dylib")
    }
