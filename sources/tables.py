"""Pages of symbol tables, written from the declarations: `python -m sources.tables`.

Writes `docs/components/<component>.md`, an index of them, and `docs/effects.md`; with names of
components only their pages. With `--check` it writes nothing and fails if a page is out of date.
The result depends on the sources only.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca

from .component import Component, Fidelity
from .effect import KINDS, Effect
from .model import Balance, Declared, Model, misfit
from .packaging.catalog import names
from .quantity import Quantity
from .variant import (
    build_model,
    components,
    device_values,
    devices,
    effects,
    fidelities,
    parse_name,
)

DOCS = Path(__file__).parent.parent / "docs"
COMMAND = "python -m sources.tables"
_NOTE = f"<!-- Written by `{COMMAND}` from the declarations in sources/; edit those. -->\n"
_ROLES = {
    "input": "input",
    "output": "output",
    "parameter": "parameter",
    "state": "state",
    "discrete": "sampled",
}
_CAUSALITY = {
    "gives_motion": "takes effort, gives motion",
    "gives_effort": "takes motion, gives effort",
}


# -- pieces ----------------------------------------------------------------------------------------


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(_cell(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return f"{value:.6g}"


def _values(values: Iterable[float]) -> str:
    found = [_number(value) for value in values]
    return found[0] if len(set(found)) == 1 else ", ".join(found)


def _bounds(quantity: Quantity) -> str:
    low, high = quantity.minimum, quantity.maximum
    if low is None and high is None:
        return ""
    if high is None:
        return f"≥ {_number(low or 0.0)}"
    return f"≤ {_number(high)}" if low is None else f"{_number(low)} to {_number(high)}"


def _docstring(module: Any) -> str:
    return inspect.cleandoc(module.__doc__ or "") + "\n"


def _symbols(variables: Iterable[Declared]) -> list[tuple[str, ...]]:
    """Rows of a symbol table; the elements of a vector share one row."""
    groups: dict[str, list[Declared]] = {}
    for variable in variables:
        groups.setdefault(re.sub(r"\[\d+\]$", "", variable.name), []).append(variable)
    rows = []
    for name, group in groups.items():
        quantity, role = group[0].quantity, group[0].role
        size = f"[1..{quantity.size}]" if quantity.size else ""
        kind = _ROLES[role]
        if role == "parameter" and quantity.strength:
            kind += ", strength"
        if role == "parameter" and quantity.variability == "fixed":
            kind += ", fixed"
        unit = ", ".join(dict.fromkeys(v.quantity.unit for v in group))
        start = "" if role == "output" else _values(v.start for v in group)
        rows.append((f"`{name}{size}`", unit, kind, start, _bounds(quantity), quantity.text))
    order = {"input": 0, "output": 1, "parameter": 2, "state": 3, "sampled": 4}
    return sorted(rows, key=lambda row: order[row[2].split(",")[0]])


_SYMBOL_HEAD = ("name", "unit", "role", "start", "bounds", "meaning")


@lru_cache(maxsize=None)
def _model(component: str, fidelity: str) -> Model:
    return build_model(f"{component}/{fidelity}")


def _fitting(balance: Balance) -> list[str]:
    """Names of the effects that can act on a balance."""
    return [name for name, module in effects().items() if not misfit(module.EFFECT, balance)]


# -- pages -----------------------------------------------------------------------------------------


def _readme(component: str) -> str:
    path = Path(__file__).parent / component / "README.md"
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return re.sub(r"\A# .*\n+", "", text).strip() + "\n"


def _ports(component: Component) -> str:
    rows = [
        (
            f"`{port.name}`",
            f"`{port.effort.name}` [{port.effort.unit}]",
            f"`{port.flow.name}` [{port.flow.unit}]",
            _CAUSALITY[port.causality],
            f"{'+' if port.sign > 0 else '−'} effort · flow",
            port.text,
        )
        for port in component.ports
    ]
    head = ("port", "effort", "flow", "causality", "power into the component", "place")
    return "## Ports\n\n" + _table(head, rows) if rows else ""


def _fidelity(component: str, fidelity: str, module: Any) -> str:
    model = _model(component, fidelity)
    own: Fidelity = module.FIDELITY
    parts = [f"### `{component}/{fidelity}`\n", _docstring(module)]
    if model.of_role("state"):
        parts.append(f"Solver: {own.solver.method}, step {_number(own.solver.step)} s.\n")
    if model.clocks:
        parameters = model.of_role("parameter")
        symbols = ca.vertcat(*[v.symbol for v in parameters])
        periods = ca.Function("periods", [symbols], [ca.vertcat(*[c.period for c in model.clocks])])
        found = periods(ca.DM([v.start for v in parameters])).full().ravel()
        listed = ", ".join(
            f"`{clock.name}` {_number(period)} s"
            for clock, period in zip(model.clocks, found.tolist(), strict=True)
        )
        parts.append(f"Sample clocks: {listed}.\n")
    for slot, default in own.slots.items():
        parts.append(f"Slot `{slot}`: `{default}` unless the variant names another.\n")
    parts.append(_table(_SYMBOL_HEAD, _symbols(model.variables.values())))
    rows = [
        (
            f"`{balance.name}`",
            balance.kind,
            balance.unit,
            ", ".join(balance.signals),
            ", ".join(f"`{name}`" for name in _fitting(balance)) or "none",
        )
        for balance in model.balances.values()
    ]
    if rows:
        parts.append(_table(("balance", "kind", "unit", "signals", "effects that fit"), rows))
    return "\n".join(parts)


def _device(component: str, device: str) -> str:
    rows = []
    for name, value in device_values(component, device).items():
        listed = value.value if isinstance(value.value, tuple) else (value.value,)
        numbers = str(value.value)
        if all(isinstance(item, int | float) for item in listed):
            numbers = ", ".join(_number(item) for item in listed)
        rows.append(
            (
                f"`{name}`",
                numbers,
                value.unit if isinstance(value.unit, str) else ", ".join(value.unit),
                "" if value.uncertainty is None else _number(value.uncertainty),
                "assumed" if value.assumed else "",
                value.origin,
            )
        )
    head = ("name", "value", "unit", "uncertainty", "", "origin")
    return f"### `{device}`\n\n" + _table(head, rows)


def component_page(name: str) -> str:
    """Page of one component: its README, fidelities with symbol tables, devices."""
    component = components()[name]
    parts = [f"# {name}\n", _NOTE, f"{component.text}\n", _readme(name)]
    if component.source:
        parts.append(f"Source: {component.source}.\n")
    parts.append(_ports(component))
    parts.append("## Fidelities\n")
    if component.device:
        parts.append(f"Start values are those of the device `{component.device}`.\n")
    parts += [_fidelity(name, fidelity, module) for fidelity, module in fidelities(name).items()]
    if devices(name):
        parts.append("## Devices\n")
        parts += [_device(name, device) for device in devices(name)]
    return "\n".join(part for part in parts if part.strip())


def index_page() -> str:
    """Table of all components."""
    rows = [
        (
            f"[{name}]({name}.md)",
            component.text,
            ", ".join(f"`{fidelity}`" for fidelity in fidelities(name)),
            ", ".join(f"`{device}`" for device in devices(name)),
        )
        for name, component in components().items()
    ]
    head = ("component", "is", "fidelities, simplest first", "devices")
    return "\n".join(["# Components\n", _NOTE, _table(head, rows)])


Place = tuple[str, str, str]
"""Component, fidelity and balance."""


def _places() -> dict[str, list[Place]]:
    """Where each effect fits."""
    found: dict[str, list[Place]] = {name: [] for name in effects()}
    for component in components():
        for fidelity in fidelities(component):
            model = _model(component, fidelity)
            for balance in model.balances.values():
                for name in _fitting(balance):
                    found[name].append((component, fidelity, balance.name))
    return found


def _effect_symbols(name: str, places: list[Place]) -> list[tuple[str, ...]]:
    """Rows for an effect's own variables, as they are on the smallest balance that it fits."""
    declared = {
        item.name: item for item in vars(effects()[name]).values() if isinstance(item, Quantity)
    }
    if not places:
        return [
            (f"`{name}.{q.name}`", q.unit, "", _values(q.starts()), _bounds(q), q.text)
            for q in declared.values()
        ]

    def size(place: Place) -> tuple[int, int]:
        model = _model(place[0], place[1])
        return int(model.balances[place[2]].effort.numel()), len(model.variables)

    component, fidelity, balance = min(places, key=size)
    model = build_model(f"{component}/{fidelity}+{name}@{balance}")
    prefix, added = f"{balance}.{name}.", model.balances[balance].unit
    rows = _symbols(v for v in model.variables.values() if v.name.startswith(prefix))
    result = []
    for symbol, unit, *rest in rows:
        local = symbol.strip("`").removeprefix(prefix)
        known = declared.get(local.split("[")[0])
        own = known.unit if known else "1"
        general = "by balance" if unit != own and (known or unit == added) else unit
        result.append((f"`{name}.{local}`", general, *rest))
    return result


def effects_page() -> str:
    """Page of all effects: law, parameters, where they fit."""
    places = _places()
    kinds = [
        (f"`{name}`", kind.effort_unit or "of the balance", kind.flow, _signals(kind))
        for name, kind in KINDS.items()
    ]
    parts = [
        "# Effects\n",
        _NOTE,
        "An effect adds a law to a balance of a component: `component/fidelity+effect@balance`, or",
        "without `@balance` to the first one that fits. At strength 0 it is exactly absent.\n",
        "## Kinds of balances\n",
        _table(("kind", "unit of what is added", "flow", "signals (optional in brackets)"), kinds),
    ]
    for name, module in effects().items():
        effect: Effect = module.EFFECT
        balances: dict[str, list[str]] = {}
        for component, _, balance in places[name]:
            known = balances.setdefault(component, [])
            if balance not in known:
                known.append(balance)
        fits = "; ".join(f"`{key}`: {', '.join(names)}" for key, names in balances.items())
        parts += [
            f"## `{name}`\n",
            _docstring(module),
            f"Kinds: {', '.join(effect.kinds)}."
            + (f" Needs: {', '.join(effect.needs)}." if effect.needs else "")
            + (f" Not where there is: {', '.join(effect.unless)}." if effect.unless else "")
            + f" Strength: `{effect.strength.name}`.\n",
            _table(_SYMBOL_HEAD, _effect_symbols(name, places[name])),
            f"Fits: {fits or 'no balance yet'}.\n",
        ]
    return "\n".join(parts)


def _signals(kind: Any) -> str:
    items = [f"{name}: {meaning}" for name, meaning in kind.signals.items()]
    items += [f"({name}: {meaning})" for name, meaning in kind.optional.items()]
    return "; ".join(items)


def catalogue_page() -> str:
    """What `cosim fmus build` builds, by component."""
    listed: dict[str, list[str]] = {}
    for name in names():
        listed.setdefault(parse_name(name).component, []).append(name)
    rows = [
        (
            f"[{component}](../docs/components/{component}.md)",
            ", ".join(
                f"`{n.partition('/')[2]}`" for n in variants if "+" not in n and "." not in n
            ),
            ", ".join(f"`{n}`" for n in variants if parse_name(n).device),
            ", ".join(f"`+{n.partition('+')[2]}`" for n in variants if "+" in n),
        )
        for component, variants in listed.items()
    ]
    return "\n".join(
        [
            "# FMUs",
            "",
            "This folder receives the built FMUs: `fmi2/` and `fmi3/` (native, co-simulation and",
            "model exchange), `python/` (pythonfmu twins). `cosim fmus build --platform all`",
            f"builds the catalogue below, {len(names())} variants; any other combination builds",
            "by its name.",
            "Written by `python -m sources.tables`.",
            "",
            _table(
                ("component", "fidelities", "for other devices", "effects, one at a time"), rows
            ),
        ]
    )


def pages() -> dict[str, str]:
    """All pages by their path below `docs/`."""
    found = {f"components/{name}.md": component_page(name) for name in components()}
    found["components/index.md"] = index_page()
    found["effects.md"] = effects_page()
    found["../fmus/README.md"] = catalogue_page()
    return found


def outdated(expected: dict[str, str]) -> list[str]:
    """Those pages below `docs/` that are missing or differ."""
    wrong = []
    for name, text in expected.items():
        path = DOCS / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            wrong.append(name)
    return wrong


def orphans() -> list[str]:
    """Pages of components that no longer exist."""
    known = {*components(), "index"}
    present = (DOCS / "components").glob("*.md")
    return sorted(f"components/{path.name}" for path in present if path.stem not in known)


def main(arguments: list[str]) -> int:
    """Write the pages, or check them; returns the exit code."""
    names = [argument for argument in arguments if not argument.startswith("-")]
    unknown = sorted(set(names) - set(components()))
    if unknown:
        print(f"there is no component {', '.join(unknown)}", file=sys.stderr)
        return 2
    expected = {f"components/{name}.md": component_page(name) for name in names} or pages()
    wrong = outdated(expected)
    if "--check" in arguments:
        wrong += orphans()
        for name in wrong:
            print(f"docs/{name} is out of date; run {COMMAND}", file=sys.stderr)
        return 1 if wrong else 0
    for name in wrong:
        path = DOCS / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(expected[name], encoding="utf-8", newline="\n")
        print(f"docs/{name}")
    for name in orphans():
        (DOCS / name).unlink()
        print(f"docs/{name} removed")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
