"""The catalogue: every fidelity of every component, and every effect on what it was made for."""

from __future__ import annotations

import inspect
from functools import lru_cache
from typing import Any

from ..model import ModelError
from ..variant import build_model, components, devices, effects, fidelities, parse_name


@lru_cache(maxsize=1)
def names() -> tuple[str, ...]:
    """Canonical names of all catalogued variants.

    Every fidelity of every component; every fidelity of further devices whose constants are baked
    in; and for each component its highest fidelity with each single effect that fits one of its
    balances.
    """
    found: list[str] = []
    for component, declared in components().items():
        plain = list(fidelities(component))
        found += [f"{component}/{fidelity}" for fidelity in plain]
        for device in devices(component):
            if device != declared.device:
                found += [f"{component}.{device}/{fidelity}" for fidelity in plain]
        for effect in effects():
            for fidelity in reversed(plain):
                name = f"{component}/{fidelity}+{effect}"
                if _fits(name):
                    found.append(name)
                    break
    return tuple(found)


def _fits(name: str) -> bool:
    try:
        build_model(name)
    except ModelError:
        return False
    return True


def describe(name: str) -> dict[str, Any]:
    """What a variant offers, in the form of `cosim fmus list --json`."""
    parsed = parse_name(name)
    model = build_model(parsed)
    module = fidelities(parsed.component)[parsed.fidelity]
    summary = (inspect.getdoc(module) or model.component.text).split("\n\n")[0].replace("\n", " ")

    def listed(role: Any) -> list[dict[str, str]]:
        return [
            {"name": v.name, "unit": v.quantity.unit, "description": v.quantity.text}
            for v in model.of_role(role)
        ]

    return {
        "variant": str(parsed),
        "component": parsed.component,
        "fidelity": parsed.fidelity,
        "effects": [effect + (f"@{at}" if at else "") for effect, at in parsed.effects],
        "inputs": listed("input"),
        "outputs": listed("output"),
        "parameters": listed("parameter"),
        "states": listed("state") + listed("discrete"),
        "description": summary,
    }
