"""Build the FMU of a variant: native (C for all platforms) or python (pythonfmu)."""

from __future__ import annotations

import hashlib
import inspect
import json
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from pathlib import Path
from typing import Any, Literal

import casadi as ca

from cosim.errors import listing
from cosim.spec import hints
from cosim.spec.archive import pack
from cosim.spec.variant import Name

from ..function import Functions, build_functions
from ..model import Model, ModelError
from ..scene import model_scene
from ..variant import build_model, fidelities, parse_name
from . import description, native, python, rights
from .cache import write_atomically
from .layout import Entry, layout
from .platforms import PLATFORMS
from .ready import Kind, platforms, ready, stamp_path, target_path

_EQUATIONS = threading.Lock()
"""Held while CasADi works: it counts references without locks. Compilers run beside it."""


@dataclass(frozen=True)
class Variant:
    """Everything that packaging needs of a variant."""

    name: Name
    model: Model
    functions: Functions
    entries: list[Entry]


def collect(name: str, starts: Mapping[str, float] | None = None) -> Variant:
    """Collect the equations, functions and variables of a variant.

    Args:
        name: of the variant.
        starts: variable -> start value, in place of that of the device and the declaration.

    Raises:
        UnknownVariantError, ModelError: see `variant.build_model`.
        ModelError: the period of a sample clock is not fixed, or no variable has such a name.
    """
    parsed = parse_name(name)
    model = build_model(parsed)
    fixed = {v.name for v in model.of_role("parameter") if v.quantity.variability == "fixed"}
    for clock in model.clocks:
        varying = {symbol.name() for symbol in ca.symvar(clock.period)} - fixed
        if varying:
            raise ModelError(
                f"{parsed}: the period of clock {clock.name!r} depends on "
                f"{', '.join(sorted(varying))}; it may depend on fixed parameters only"
            )
    entries, given = layout(model), dict(starts or {})
    for unknown in sorted(given.keys() - {entry.name for entry in entries}):
        raise ModelError(f"{parsed}: {listing([e.name for e in entries], unknown)} as variable")
    entries = [replace(e, start=given.get(e.name, e.start)) for e in entries]
    return Variant(parsed, model, build_functions(model), entries)


def _token(*contents: str) -> str:
    digest = hashlib.sha256("\0".join(contents).encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def component_json(variant: Variant) -> bytes:
    """`extra/cosim/component.json`: ports, balances and effects, for masters that look for them."""
    model, name = variant.model, variant.name
    content: dict[str, Any] = {
        "variant": str(name),
        "component": name.component,
        "fidelity": name.fidelity,
        "effects": [effect + (f"@{at}" if at else "") for effect, at in name.effects],
        "ports": [
            {
                "name": port_name,
                "effort": list(port.effort.names()),
                "flow": list(port.flow.names()),
                "sign": port.sign,
                "causality": port.causality,
            }
            for port, port_name in model.ports
        ],
        "balances": [
            {"name": balance.name, "kind": balance.kind, "unit": balance.unit}
            | ({"sensor": balance.sensor} if balance.sensor else {})
            for balance in model.balances.values()
        ],
        "slots": model.slots,
        "strengths": [
            variable.name
            for variable in model.of_role("parameter")
            if variable.of_effect and variable.quantity.strength
        ],
    }
    content |= hints.to_json({v.name: v.quantity.hints for v in model.of_role("parameter")})
    passed_on = {v.name: v.quantity.text for v in model.of_role("output") if v.quantity.passed_on}
    if passed_on:
        content["passed_on"] = passed_on
    if model.left_out:
        content["left_out"] = [
            {"what": what, "amount": amount, "unit": unit} for what, amount, unit in model.left_out
        ]
    if model.component.relay:
        content["relay"] = True
    looks = model_scene(model, {entry.name for entry in variant.entries})
    if looks:
        content["scene"] = looks
    return (json.dumps(content, indent=2) + "\n").encode()


def _documentation(variant: Variant) -> bytes:
    rows = "".join(
        f"<tr><td>{escape(entry.name)}</td><td>{entry.part}</td><td>{escape(entry.quantity.unit)}</td>"
        f"<td>{entry.start:g}</td><td>{escape(entry.quantity.text)}</td></tr>\n"
        for entry in variant.entries
        if entry.part not in ("time", "derivative")
    )
    text = inspect.getdoc(fidelities(variant.name.component)[variant.name.fidelity]) or ""
    page = (
        "<!DOCTYPE html><html><head><meta charset='utf-8'>"
        f"<title>{escape(str(variant.name))}</title></head><body>"
        f"<h1>{escape(str(variant.name))}</h1><p>{escape(variant.model.component.text)}"
        f"</p><pre>{escape(text)}</pre><table border='1'><tr><th>variable</th><th>role</th>"
        f"<th>unit</th><th>start</th><th>meaning</th></tr>\n{rows}</table></body></html>\n"
    )
    return page.encode()


def _native_files(variant: Variant, fmi: int) -> tuple[dict[str, bytes], str]:
    """All files but the libraries, and the generated C source that these are compiled from."""
    identifier = variant.name.identifier
    template = native.model_source(variant.functions, variant.entries, identifier)
    fixed = native.c_files(fmi)

    describe: Callable[..., bytes] = description.describe_fmi3
    if fmi == 2:
        describe = partial(description.describe_fmi2, kind="native")

    def described(token: str) -> bytes:
        arguments = (variant.model, variant.functions, variant.entries)
        return describe(*arguments, identifier=identifier, name=str(variant.name), token=token)

    blank = described("").decode()
    token = _token(template, *(fixed[name] for name in sorted(fixed)), blank)
    source = native.with_token(template, token)
    files = {"modelDescription.xml": described(token)}
    if fmi == 3:
        files["sources/buildDescription.xml"] = description.build_description(identifier)
        if (terminals := description.terminals(variant.model)) is not None:
            files["terminalsAndIcons/terminalsAndIcons.xml"] = terminals
    for name, text in {**fixed, "model.c": source}.items():
        files[f"sources/{name}"] = text.encode()
    return files, source


def _libraries(source: str, identifier: str, fmi: int, platforms: list[str]) -> dict[str, bytes]:
    with ThreadPoolExecutor(len(platforms)) as pool:
        compiled = pool.map(lambda p: native.compile_library(source, identifier, p, fmi), platforms)
        made = dict(zip(platforms, compiled, strict=True))
    files = {}
    for platform, library in made.items():
        target = PLATFORMS[platform]
        folder = target.fmi2 if fmi == 2 else target.fmi3
        files[f"binaries/{folder}/{identifier}{target.suffix}"] = library
    mac = [library for platform, library in made.items() if platform.endswith("darwin")]
    if fmi == 2 and mac:
        # importers of FMI 2, FMPy among them, look there on every Mac
        files[f"binaries/darwin64/{identifier}.dylib"] = native.universal(mac)
    return files


def _short(text: str) -> str:
    """Of a module's text, for its name: Python keeps one module of a name in a process."""
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _python_files(variant: Variant) -> tuple[dict[str, bytes], str]:
    arguments = (variant.model, variant.functions, variant.entries)
    identifier = variant.name.identifier
    equations = python.equations_source(*arguments, variant.name)
    part = f"{identifier}_equations_{_short(equations)}"
    source = python.slave_source(variant.model, variant.name, part)
    blank = description.describe_fmi2(
        *arguments, identifier=identifier, name=str(variant.name), token="", kind="python"
    )
    token = _token(source, blank.decode())
    module = f"{identifier}_{_short(source)}"
    files = {
        "modelDescription.xml": description.describe_fmi2(
            *arguments, identifier=identifier, name=str(variant.name), token=token, kind="python"
        ),
        "resources/slavemodule.txt": module.encode(),
        f"resources/{module}.py": source.encode(),
        f"resources/{part}.py": equations.encode(),
    }
    return files | python.binaries(identifier) | rights.pythonfmu(), source


def build(
    name: str,
    *,
    out: Path,
    fmi: Literal[2, 3] = 2,
    kind: Kind = "native",
    platform: Literal["host", "all"] = "host",
) -> Path:
    """Build the FMU of a variant unless it is there and up to date; returns its path.

    The same sources give the same archive, byte for byte, in any folder.

    Raises:
        UnknownVariantError, ModelError: see `variant.build_model`.
        CompilerError: the C compiler failed.
        ValueError: FMI 3 asked of the python kind (pythonfmu is FMI 2.0 co-simulation only).
    """
    if kind == "python" and fmi != 2:
        raise ValueError("python FMUs are FMI 2.0 (pythonfmu writes no other version)")
    parsed = parse_name(name)
    done = ready(name, out=out, fmi=fmi, kind=kind, platform=platform)
    if done is not None:
        return done
    path = target_path(parsed, out, fmi, kind)
    content = _packed(name, fmi, kind, platform)
    write_atomically(path, content)
    stamp = stamp_path(parsed, fmi, kind, platform)
    write_atomically(stamp, hashlib.sha256(content).hexdigest().encode())
    return path


def build_with(
    name: str,
    starts: Mapping[str, float],
    path: Path,
    *,
    fmi: Literal[2, 3] = 2,
    platform: Literal["host", "all"] = "host",
) -> Path:
    """Build a native FMU of a variant with start values of its own; returns its path.

    Args:
        name: of the variant.
        starts: variable -> start value; the others keep that of the device or the declaration.
        path: of the file.
        fmi, platform: as in `build`.

    Raises:
        as `build`; ModelError: no variable has such a name.
    """
    write_atomically(path, _packed(name, fmi, "native", platform, starts))
    return path


def _packed(
    name: str, fmi: int, kind: Kind, platform: str, starts: Mapping[str, float] | None = None
) -> bytes:
    """The archive of a variant."""
    with _EQUATIONS:
        variant = collect(name, starts)
        files, source = _native_files(variant, fmi) if kind == "native" else _python_files(variant)
        files["documentation/index.html"] = _documentation(variant)
        files["extra/cosim/component.json"] = component_json(variant)
        files |= rights.files()
    if kind == "native":
        files |= _libraries(source, variant.name.identifier, fmi, platforms(platform))
    return pack(files)


def build_many(
    names: Sequence[str],
    *,
    out: Path,
    fmi: Literal[2, 3] = 2,
    kind: Kind = "native",
    platform: Literal["host", "all"] = "host",
    workers: int = 2,
    progress: Callable[[str, Path], None] | None = None,
) -> list[Path]:
    """Build several FMUs, compilers in parallel; returns their paths in the order of the names.

    Args:
        names: variants.
        out, fmi, kind, platform: as in `build`.
        workers: variants in work at the same time.
        progress: called with name and path of each FMU as it is finished.

    Raises:
        as `build`, for the first variant that fails; those not begun are left out then.
    """
    with ThreadPoolExecutor(workers) as pool:
        jobs = {
            pool.submit(build, name, out=out, fmi=fmi, kind=kind, platform=platform): name
            for name in dict.fromkeys(names)
        }
        try:
            for job in as_completed(jobs):
                path = job.result()
                if progress:
                    progress(jobs[job], path)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    paths = {name: job.result() for job, name in jobs.items()}
    return [paths[name] for name in names]
