"""C sources of a variant and their compilation for all platforms by the `ziglang` package."""

from __future__ import annotations

import hashlib
import importlib.metadata
import itertools
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from cosim.spec.cache import sealed

from ..function import Functions
from .c_code import Wanted, Writer
from .cache import cache_folder, keep
from .elimination import Block, eliminate
from .layout import Entry, lags, owners, stiff
from .platforms import PLATFORMS

C_SOURCES = Path(__file__).parent / "c"
_COMPILERS = threading.BoundedSemaphore(os.cpu_count() or 1)
"""As many compilers at a time as there are processors."""


class CompilerError(RuntimeError):
    """The C compiler failed; the text carries what it said."""


def _number(value: float) -> str:
    return repr(float(value))


ARGUMENTS = ("t", "x", "z", "u", "p")
SEEDS = ("dt", "dx", "dz", "du", "dp")


def _functions_code(functions: Functions, entries: Sequence[Entry]) -> tuple[str, int]:
    """All functions in C, and how many numbers `f_constants` gives."""
    parameters = [entry for entry in entries if entry.part == "parameter"]
    writer = Writer(strengths=[k for k, e in enumerate(parameters) if e.quantity.strength])

    def write(function: ca.Function, *results: str, places: Sequence[int] | None = None) -> str:
        """With the places of the last result's elements."""
        ends = [(name, None) for name in results[:-1]] + [(results[-1], places)]
        return writer.write(Wanted(function, ARGUMENTS, tuple(ends)))

    code = [write(functions.outputs, "xdot", "y"), write(functions.derivatives, "xdot")]
    if functions.derivatives.numel_out():
        code.append(write(functions.jacobian, "xdot", "j", "xdot_t"))
    if functions.quick_outputs:
        code.append(write(functions.quick, "y", places=functions.quick_outputs))
    if functions.coupled_outputs:
        code.append(write(functions.coupled, "xdot", "y", places=functions.coupled_outputs))
    for function, changed in zip(functions.updates, functions.updated, strict=True):
        places = [-1] * function.numel_out()
        for place, element in enumerate(changed):
            places[element] = place
        code.append(write(function, "z_next", places=places))
    if functions.updates:
        periods = Wanted(functions.periods, ("p",), (("periods", None),))
        code.append(writer.write(periods, sharing=False))
    ends = (("xdot", None), ("y", None))
    directional = Wanted(functions.directional, ARGUMENTS + SEEDS, ends)
    code.append(writer.write(directional, sharing=False))
    return "\n".join([*code, writer.constants()]), writer.kept


def model_source(functions: Functions, entries: list[Entry], identifier: str) -> str:
    """The generated C file `model.c` of a variant: sizes, tables, CasADi functions, elimination.

    The instantiation token is left out; `with_token` puts it in.
    """
    counts = {
        part: sum(entry.part == part for entry in entries)
        for part in ("state", "input", "output", "parameter", "discrete")
    }
    nx = counts["state"]
    elimination = eliminate(nx, functions.jacobian_pattern, owners(entries))
    code, kept = _functions_code(functions, entries)
    sizes = {
        "NX": nx,
        "NU": counts["input"],
        "NY": counts["output"],
        "NP": counts["parameter"],
        "NZ": counts["discrete"],
        "NC": len(functions.updates),
        "NSTIFF": len(stiff(entries)),
        "NLAGS": len(lags(entries)),
        "NJ": len(functions.jacobian_pattern),
        "NLU": elimination.size,
        "NK": kept,
        "NQ": len(functions.quick_outputs),
        "COUPLED": int(bool(functions.coupled_outputs)),
        "COUPLED_RATES": int(bool(functions.coupled.numel_out(0))),
        "TIMED": int(any(functions.outputs.jac_sparsity(k, 0).nnz() for k in (0, 1))),
    }
    infinity = float("inf")

    def bound(value: float | None, default: float) -> str:
        value = default if value is None else value
        return ("-" if value < 0 else "") + "INFINITY" if abs(value) == infinity else _number(value)

    nominal = [entry.quantity.nominal or 1.0 for entry in entries if entry.part == "state"]
    quoted = ", ".join(f'"{entry.name}"' for entry in entries)
    lines = [
        f"/* Model {identifier}: generated, do not edit. */",
        code,
        *(f"#define {name} {value}" for name, value in sizes.items()),
        f'#define MODEL "{identifier}"',
        '#define TOKEN "@TOKEN@"',
        f"static const char *const NAMES[] = {{{quoted}}};",
        f"static const double START[] = {{{', '.join(_number(e.start) for e in entries)}}};",
        "static const double MINIMUM[] = {"
        + ", ".join(bound(e.quantity.minimum, -infinity) for e in entries)
        + "};",
        "static const double MAXIMUM[] = {"
        + ", ".join(bound(e.quantity.maximum, infinity) for e in entries)
        + "};",
        "static const char FIXED[] = {"
        + ", ".join(
            str(int(e.part == "parameter" and e.quantity.variability == "fixed")) for e in entries
        )
        + "};",
        f"static const int OWNER[] = {{{', '.join(map(str, [*owners(entries), 0]))}}};",
        f"static const int STIFF[] = {{{', '.join(map(str, [*stiff(entries), 0]))}}};",
        f"static const int LAGS[] = {{{', '.join(map(str, [*lags(entries), 0]))}}};",
        f"static const double NOMINAL[] = {{{', '.join(map(_number, [*nominal, 1.0]))}}};",
    ]
    for name, some in (("QUICK", functions.quick_outputs), ("ASKED", functions.coupled_outputs)):
        few = [str(int(k in some)) for k in range(counts["output"])]
        lines.append(f"static const char {name}[] = {{{', '.join([*few, '0'])}}};")
    if functions.updates:
        names = ", ".join(function.name() for function in functions.updates)
        lines.append(
            f"static void (*const UPDATES[])({'const double *, ' * 6}double *) = {{{names}}};"
        )
        flat = [element for changed in functions.updated for element in changed]
        ends = itertools.accumulate(map(len, functions.updated), initial=0)
        lines += [
            f"static const int UPDATED_VALUES[] = {{{', '.join(map(str, [*flat, 0]))}}};",
            f"static const int UPDATED_FROM[] = {{{', '.join(map(str, ends))}}};",
        ]
    if nx:
        lines += [
            "static void f_factor(const double *j, double d, double *w) {",
            "  (void)j;",
            *(
                f"  w[{flag}] = {' || '.join(f'j[{k}] != 0.0' for k in places) or '0.0'};"
                for flag, places in elimination.asked.items()
            ),
            *_blocks_code(elimination.factor),
            "}",
            "static void f_solve(const double *w, double *b) {",
            *_blocks_code(elimination.solve),
            "}",
        ]
    return "\n".join(lines) + "\n"


def _blocks_code(blocks: Sequence[Block]) -> list[str]:
    """Statements in C, each block asking its flags."""
    lines = []
    for block in blocks:
        statements = [f"  {statement};" for statement in block.statements]
        if block.flags:
            asked = " && ".join(f"w[{flag}] != 0.0" for flag in block.flags)
            statements = [f"  if ({asked}) {{", *statements, "  }"]
        lines += statements
    return lines


def with_token(source: str, token: str) -> str:
    """The C source with its instantiation token."""
    return source.replace("@TOKEN@", token)


def compiler_version() -> str:
    """Name and version of the compiler, part of every cache key."""
    return f"ziglang {importlib.metadata.version('ziglang')}"


def universal(libraries: Sequence[bytes]) -> bytes:
    """One macOS library that holds those of several processors, a "fat" Mach-O file."""
    if len(libraries) == 1:
        return libraries[0]
    page = 1 << 14
    header = struct.pack(">II", 0xCAFEBABE, len(libraries))
    body = b""
    for library in libraries:
        _, processor, variant = struct.unpack_from("<III", library)
        body += b"\0" * (-len(body) % page)
        header += struct.pack(">5I", processor, variant, page + len(body), len(library), 14)
        body += library
    return header.ljust(page, b"\0") + body


def c_files(fmi: int) -> dict[str, str]:
    """The C files that all FMUs of a version of FMI have in common, by name.

    Lines between `#if INTERMEDIATE` and `#else` are those of FMI 3, which asks for inputs within a
    step, the ones behind it those of FMI 2.
    """
    found = {}
    for path in C_SOURCES.glob("*.c"):
        kept, mine, branching = [], True, False
        for line in path.read_text(encoding="utf-8").splitlines(keepends=True):
            match line.strip():
                case "#if INTERMEDIATE":
                    branching, mine = True, fmi == 3
                case "#else" if branching:
                    mine = fmi != 3
                case "#endif" if branching:
                    branching, mine = False, True
                case _ if mine:
                    kept.append(line)
        found[path.name] = "".join(kept)
    return found


def compile_library(source: str, identifier: str, platform: str, fmi: int) -> bytes:
    """Compile a variant for one platform and version of FMI.

    Raises:
        CompilerError: with the compiler's message.
    """
    return compile_c({**c_files(fmi), "model.c": source}, "all.c", identifier, platform)


def compile_c(files: dict[str, str], main: str, identifier: str, platform: str) -> bytes:
    """Compile a shared library for one platform; cached by the content of its files.

    Args:
        files: C files by name; `main` is compiled and includes the others.
        main: the translation unit.
        identifier: name of the library without suffix.
        platform: key of `PLATFORMS`.

    Raises:
        CompilerError: with the compiler's message.
    """
    target = PLATFORMS[platform]
    flags = [
        *("-target", target.target, "-std=c99", "-O2", "-shared", "-fPIC", "-s", "-g0"),
        # no fused multiply-add: every platform and the Python twin round alike
        *("-fvisibility=hidden", "-ffp-contract=off", "-w"),
        "-fno-slp-vectorize",  # a quarter less compiling, the same speed
    ]
    if "macos" in target.target:
        # -x: names that are not exported stay out
        flags += ["-Wl,-x", f"-Wl,-install_name,@rpath/{identifier}.dylib"]
    elif "windows" not in target.target:
        flags.append(f"-Wl,-soname,{identifier}.so")
    content = [f"{name}\0{files[name]}" for name in sorted(files)]
    text = "\0".join([*content, *flags, main, identifier, compiler_version()])
    key = hashlib.sha256(text.encode()).hexdigest()
    cached = cache_folder("libraries") / f"{key}{target.suffix}"
    if cached.exists():
        content_kept = cached.read_bytes()
        if sealed(cached, content_kept) is not False:  # older ones have no seal
            return content_kept
    folder = Path(tempfile.mkdtemp(prefix=key[:16], dir=cache_folder("compile")))
    try:
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
        output = folder / f"{identifier}{target.suffix}"
        command = [sys.executable, "-m", "ziglang", "cc", *flags, "-o", output.name, main]
        if "windows" not in target.target:
            command.append("-lm")
        zig = str(cache_folder("zig"))
        with _COMPILERS:
            result = subprocess.run(
                command,
                cwd=folder,
                env={**os.environ, "ZIG_GLOBAL_CACHE_DIR": zig, "ZIG_LOCAL_CACHE_DIR": zig},
                capture_output=True,
                text=True,
                check=False,
                start_new_session=True,  # Ctrl-C is for the program, which may have more to do
            )
        if result.returncode:
            raise CompilerError(
                f"compiling {identifier} for {platform} failed (is ziglang complete?):\n"
                f"{result.stderr[-4000:]}"
            )
        library = output.read_bytes()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    keep(cached, library)
    return library
