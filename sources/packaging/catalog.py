"""The catalogue: every fidelity of every component, and every effect on what it was made for."""

from __future__ import annotations

import inspect
from functools import lru_cache
from typing import Any

from cosim.spec import devices as own_devices

from ..component import Fidelity
from ..laws.base_parameters import find, standard_parameters
from ..model import Model, misfit
from ..quantity import Quantity
from ..variant import (
    build_model,
    components,
    device_values,
    devices,
    effects,
    fidelities,
    parse_name,
)


@lru_cache(maxsize=None)
def _plain(component: str) -> dict[str, Model]:
    return {name: build_model(f"{component}/{name}") for name in fidelities(component)}


@lru_cache(maxsize=None)
def names(component: str = "") -> tuple[str, ...]:
    """Canonical names of all catalogued variants, or of those of one component.

    Every fidelity of every component, for the other devices too where their values are baked into
    the code (elsewhere they only change start values); and every effect once per component, on the
    highest fidelity that has a balance for it (not where a component is `like` another). Any other
    combination can be built by its name.
    """
    if not component:
        return tuple(name for each in components() for name in names(each))
    found: list[str] = []
    declared = components()[component]
    models = _plain(component)
    found += [f"{component}/{fidelity}" for fidelity in models]
    own = own_devices.own(component)
    for device in devices(component):
        if device != declared.device and device not in own:
            found += [
                f"{component}.{device}/{fidelity}"
                for fidelity, model in models.items()
                if model.baked
            ]
    for effect, module in effects().items() if not declared.like else ():
        fitting = [
            fidelity
            for fidelity, model in models.items()
            if any(not misfit(module.EFFECT, b) for b in model.balances.values())
        ]
        if fitting:
            found.append(f"{component}/{fitting[-1]}+{effect}")
    return tuple(found)


def own_names(component: str = "") -> list[str]:
    """Variants of the user's own devices, every fidelity of each component that has such."""
    return [
        f"{each}.{device}/{fidelity}"
        for each in ([component] if component else components())
        for device in own_devices.own(each)
        for fidelity in fidelities(each)
    ]


def overview() -> list[dict[str, Any]]:
    """Every component with its fidelities, simplest first, and its devices.

    No model is built, so that this answers at once; `describe` says what a variant offers.
    """
    return [
        {
            "component": name,
            "description": declared.text,
            "fidelities": list(fidelities(name)),
            "devices": list(devices(name)),
        }
        for name, declared in components().items()
    ]


def candidates(name: str) -> list[tuple[str, str, str]]:
    """(effect, balance, its sentence) for every effect that could be added to a variant.

    Balances that share parameters are named by their group and, where it has several members, one
    by one; only by their group for effects at a place in the world, which every wheel meets that
    comes there. Random effects (with a seed) are left out: their values say nothing about a log; so
    are effects of which a more special one has the same law there.
    """
    parsed = parse_name(name)
    model = build_model(parsed)
    present = {effect + (f"@{at}" if at else "") for effect, at in parsed.effects}
    groups: dict[str, list[str]] = {}
    for balance in model.balances.values():
        groups.setdefault(balance.group or balance.name, []).append(balance.name)
    found = []
    for group, members in groups.items():
        places = [group, *members] if len(members) > 1 else [group]
        fitting = {
            effect: module.EFFECT
            for effect, module in effects().items()
            if not (module.EFFECT.random or module.EFFECT.probe)
            and not misfit(module.EFFECT, model.balances[members[0]])
        }
        special = {item.general for item in fitting.values()}
        for effect, item in fitting.items():
            if f"{effect}@{group}" not in present and effect not in special:
                some = [group] if _has_place(effect) else places
                found += [(effect, place, item.text) for place in some]
    return found


def contained(effect: str) -> tuple[str, ...]:
    """Effects that the law of an effect becomes for some values of its parameters; () if unknown.

    Refinements and effects of other sources declare none.
    """
    known = effects().get(effect)
    return known.EFFECT.contains if known is not None else ()


def needs(effect: str) -> tuple[str, ...]:
    """Signals that an effect's law reads beyond those that every balance of its kind has."""
    known = effects().get(effect)
    return known.EFFECT.needs if known is not None else ()


def _has_place(effect: str) -> bool:
    """Whether an effect sits at a point in the world."""
    values = vars(effects()[effect]).values()
    return any(isinstance(v, Quantity) and v.hints.visits for v in values)


def refinements(name: str) -> list[dict[str, Any]]:
    """Fidelities of which a variant is the limit, with the variant's effects.

    A fidelity's declaration says so (`component.Fidelity`). An effect that is looked for `alone`
    comes with its fidelity.

    Returns:
        One mapping each: `effect` (what it is called), `fidelity` (short form), `parameter` (its
        strength), `stiff` (that is infinite in the limit, or ""), `port` (the element's balance, or
        ""), `others` (further parameters of the element), `held`, `text`.
    """
    parsed = parse_name(name)
    carried = "".join(f"+{effect}" + (f"@{at}" if at else "") for effect, at in parsed.effects)
    found = []
    for fidelity, module in fidelities(parsed.component).items():
        own: Fidelity = module.FIDELITY
        if parsed.fidelity not in own.limits:
            continue
        text = (inspect.getdoc(module) or "").split("\n\n")[0].replace("\n", " ")
        known = {"held": dict(own.limits[parsed.fidelity]), "text": text}
        short = fidelity + carried
        if own.stiff is None:
            found += [
                {**known, "effect": own.called, "fidelity": short, "stiff": "", "port": place,
                 "parameter": f"{own.soft[0].name}[{i + 1}]",
                 "others": tuple(f"{q.name}[{i + 1}]" for q in own.soft[1:])}
                for i, place in enumerate(own.places)
            ]  # fmt: skip
            continue
        stiff = own.stiff.name
        known["stiff"] = stiff
        found.append({**known, "effect": fidelity, "fidelity": short, "port": "",
                      "parameter": stiff})  # fmt: skip
        for balance in _plain(parsed.component)[fidelity].balances.values():
            found += [
                {**known, "effect": effect, "fidelity": f"{short}+{effect}@{balance.name}",
                 "port": "", "parameter": f"{balance.name}.{effect}.{item.strength.name}",
                 "text": item.text}
                for effect, item in ((n, module.EFFECT) for n, module in effects().items())
                if item.alone and not misfit(item, balance)
            ]  # fmt: skip
    return found


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


def base_parameters(device: str) -> list[dict[str, Any]]:
    """Name, value, unit and formula of the base parameters of an arm, a device of `serial_arm`.

    Raises:
        UnknownVariantError: no such device.
    """
    values = {key: item.value for key, item in device_values("serial_arm", device).items()}
    standard = standard_parameters(values["mass"], values["centre"], values["inertia"])
    return [
        {"name": each.name, "value": each.value(standard), "unit": each.unit,
         "formula": each.formula()}
        for each in find(values["rotation"], values["offset"], values["prismatic"])
    ]  # fmt: skip
