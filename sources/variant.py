"""From the name of a variant to its model: components, fidelities, effects and devices by name."""

from __future__ import annotations

import importlib
import pkgutil
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import isnan
from pathlib import Path
from types import ModuleType
from typing import Any

from cosim.errors import VariantError, listing
from cosim.spec import devices as own_devices
from cosim.spec import variant as spec
from cosim.spec.variant import Name

from .component import Component, Fidelity
from .effect import Effect, Law
from .model import Attachment, Model, ModelError
from .units import coherent

_ROOT = Path(__file__).parent
_OTHER_FOLDERS = ("distribution", "effects", "laws", "packaging", "tools")
"""Folders of `sources/` that are no components."""


class UnknownVariantError(ValueError):
    """The name of a variant that does not exist; the text lists what does."""


def parse_name(text: str) -> Name:
    """Parse a variant name.

    Raises:
        UnknownVariantError: when the text does not follow the grammar.
    """
    try:
        return spec.parse_name(text)
    except VariantError as error:
        raise UnknownVariantError(str(error)) from error


def _modules(package: ModuleType) -> dict[str, ModuleType]:
    """The modules of a package by their short names."""
    return {
        info.name: importlib.import_module(f"{package.__name__}.{info.name}")
        for info in pkgutil.iter_modules(package.__path__)
    }


def _declared(module: ModuleType, name: str, kind: type[Any]) -> Any:
    """A module's declaration, or an error that says where it is missing."""
    declared = vars(module).get(name)
    if not isinstance(declared, kind):
        raise ModelError(
            f"{module.__name__} needs `{name} = {kind.__name__}(...)`; it has "
            + (f"{name} = {declared!r}" if name in vars(module) else f"no {name}")
        )
    return declared


def _named(module: ModuleType, name: str, kind: type[Any]) -> Any:
    """A declaration that bears the name of its module."""
    declared, short = _declared(module, name, kind), module.__name__.rpartition(".")[2]
    if declared.name != short:
        raise ModelError(
            f"{module.__name__}: {name} is named {declared.name!r} instead of {short!r}"
        )
    return declared


@lru_cache(maxsize=None)
def components() -> dict[str, Component]:
    """All components: the folders below `sources/` that are none of the others.

    Raises:
        ModelError: a folder whose `__init__` declares no `COMPONENT` of its name.
    """
    package = importlib.import_module(__package__ or "")
    found = {}
    for info in pkgutil.iter_modules(package.__path__):
        if info.ispkg and info.name not in _OTHER_FOLDERS:
            module = importlib.import_module(f"{package.__name__}.{info.name}")
            found[info.name] = _named(module, "COMPONENT", Component)
    return dict(sorted(found.items()))


@lru_cache(maxsize=None)
def fidelities(component: str) -> dict[str, ModuleType]:
    """The fidelities of a component: modules with `FIDELITY` and `equations`, simplest first.

    Raises:
        ModelError: a module with one of the two only, or a limit that is no fidelity.
    """
    package = importlib.import_module(f"{__package__}.{component}")
    found = {}
    for name, module in _modules(package).items():
        written = callable(vars(module).get("equations"))
        if "FIDELITY" in vars(module) and not written:
            raise ModelError(f"{module.__name__} declares a FIDELITY but has no `equations(m)`")
        if written:
            _declared(module, "FIDELITY", Fidelity)
            found[name] = module
    found = dict(sorted(found.items(), key=lambda item: (item[1].FIDELITY.level, item[0])))
    for module in found.values():
        for limit in module.FIDELITY.limits:
            _choose(f"fidelity, named as a limit by {module.__name__}, called", limit, found)
    return found


@lru_cache(maxsize=None)
def effects() -> dict[str, ModuleType]:
    """All effects: every module of `sources/effects`.

    Raises:
        ModelError: a module without `EFFECT` of its name or without `law`.
    """
    found = _modules(importlib.import_module(f"{__package__}.effects"))
    for module in found.values():
        _named(module, "EFFECT", Effect)
        if not callable(vars(module).get("law")):
            raise ModelError(f"{module.__name__} declares an EFFECT but has no `law(e)`")
    return dict(sorted(found.items()))


def shipped_devices(component: str) -> dict[str, Path]:
    """Parameter files of a component that come with cosim, by device name."""
    declared = components().get(component)
    owner = (declared.devices_of if declared else "") or component
    return {path.stem: path for path in sorted((_ROOT / owner / "parameters").glob("*.toml"))}


def devices(component: str) -> dict[str, Path]:
    """Parameter files of a component by device name; the user's own come last.

    Raises:
        UnknownVariantError: one of the user's has the name of one that comes with cosim.
    """
    found = shipped_devices(component)
    try:
        own = own_devices.own(component)
    except VariantError as error:
        raise UnknownVariantError(str(error)) from error
    for name, path in own.items():
        if name in found:
            raise UnknownVariantError(
                f"{path}: component {component!r} has a device {name!r} already, which comes with "
                "cosim; give the file another name"
            )
        found[name] = path
    return found


@dataclass(frozen=True)
class Origin:
    """One value of a device file.

    Attributes:
        value: number or list of numbers.
        unit: its unit, checked against the declaration; a list where elements differ.
        origin: where it comes from.
        assumed: True if nobody measured or printed it.
        uncertainty: standard uncertainty in the same unit, None if unknown.
    """

    value: Any
    unit: str | tuple[str, ...]
    origin: str
    assumed: bool = False
    uncertainty: float | None = None


def device_values(component: str, device: str) -> dict[str, Origin]:
    """Read a device file.

    Raises:
        UnknownVariantError: no such device, with those that exist.
        ValueError: an entry without value, unit or origin.
    """
    if not device:
        return {}
    available = devices(component)
    if device not in available:
        raise UnknownVariantError(
            f"component {component!r} has no device {device!r}; {listing(available, device)}"
        )
    path = available[device]
    return _read_device(component, path, path.read_text(encoding="utf-8"))


@lru_cache(maxsize=None)
def _read_device(component: str, path: Path, text: str) -> dict[str, Origin]:
    table = tomllib.loads(text)
    # a device of several components has what only one of them means in [component.name]
    for each in table.pop("components", ()):
        own = table.pop(each, {})
        if each == component:
            table |= own
    values = {}
    for name, entry in table.items():
        if not isinstance(entry, dict):
            raise ValueError(
                f"{path}: {name} = {entry!r} stands alone; "
                f"write [{name}] with value, unit and origin"
            )
        missing = {"value", "unit", "origin"} - set(entry)
        if missing:
            raise ValueError(f"{path.name}: {name!r} lacks {', '.join(sorted(missing))}")
        if not _numbers(entry["value"]):
            raise ValueError(
                f"{path}: the value of {name!r} is {entry['value']!r}; write a number without "
                "quotes, or a list of numbers"
            )
        unit = tuple(entry["unit"]) if isinstance(entry["unit"], list) else entry["unit"]
        for each in (unit,) if isinstance(unit, str) else unit:
            coherent(each)
        values[name] = Origin(
            tuple(entry["value"]) if isinstance(entry["value"], list) else entry["value"],
            unit,
            entry["origin"],
            entry.get("assumed", False),
            entry.get("uncertainty"),
        )
    return values


def _numbers(value: Any) -> bool:
    """Whether this is a number (infinite where there is no limit), or a list of what is."""
    if isinstance(value, list):
        return all(_numbers(each) for each in value)
    return isinstance(value, int | float) and not isinstance(value, bool) and not isnan(value)


def _check_names(model: Model, device: str, origins: Mapping[str, Origin]) -> None:
    """Refuse values of a user's device that no fidelity of its components has a place for."""
    component, known = model.component.name, _places(model) | {*own_devices.TOLD}
    path = own_devices.find(component, device)
    if path is None or set(origins) <= known:
        return
    listed = tomllib.loads(path.read_text(encoding="utf-8"))["components"]
    for each in sorted(components().keys() & listed, key=lambda name: (name != component, name)):
        for name in fidelities(each):
            if set(origins) <= known:
                return
            try:
                other, _ = _collected(Name(each, name, device))
            except ValueError:  # the device lacks what this one needs: it cannot be asked
                return
            known |= _places(other)
    for key in origins:
        if key not in known:
            raise ValueError(
                f"{path}: no fidelity of {', '.join(listed)} has a quantity {key!r}; "
                f"{listing(sorted(known), key)}"
            )


def _places(model: Model) -> set[str]:
    """Names under which a device may give this model a value."""
    given = {n.partition("[")[0] for n, v in model.variables.items() if v.role != "output"}
    return given | model.asked


def _choose(kind: str, wanted: str, available: Mapping[str, Any]) -> Any:
    if wanted not in available:
        raise UnknownVariantError(f"there is no {kind} {wanted!r}; {listing(available, wanted)}")
    return available[wanted]


def fidelity(component: str, name: str) -> tuple[Component, Callable[[Model], None]]:
    """A component's declaration and the equations of one of its fidelities, for `Model.part`."""
    declared = _choose("component", component, components())
    module = _choose(f"fidelity of {component!r} called", name, fidelities(component))
    return declared, module.equations


def build_model(name: Name | str) -> Model:
    """Collect the equations of a variant.

    Raises:
        UnknownVariantError: unknown component, device, fidelity, slot or effect.
        ModelError: an effect that fits no balance of the component.
        ValueError: a device file whose names, units or values do not fit.
    """
    if isinstance(name, str):
        name = parse_name(name)
    model, origins = _collected(name)
    for key, origin in origins.items():
        _check_units(model, model.device, key, origin)
    _check_names(model, model.device, origins)
    return model


def _collected(name: Name) -> tuple[Model, Mapping[str, Origin]]:
    """A variant's model, and what its device gives."""
    component, equations = fidelity(name.component, name.fidelity)
    own: Fidelity = fidelities(name.component)[name.fidelity].FIDELITY
    for slot, _ in name.slots:
        _choose(f"slot of {name.component}/{name.fidelity} called", slot, own.slots)
    attachments = []
    for effect, balance in name.effects:
        law_module = _choose("effect", effect, effects())
        law: Law = law_module.law
        attachments.append(Attachment(law_module.EFFECT, law, balance))
    spellings = [attachment.spelling for attachment in attachments]
    if len(set(spellings)) != len(spellings):
        raise UnknownVariantError(f"variant {name}: an effect is named twice")
    origins = device_values(name.component, name.device or component.device)
    model = Model(
        component,
        name.fidelity,
        values={key: origin.value for key, origin in origins.items()},
        attachments=tuple(attachments),
        slots={**own.slots, **dict(name.slots)},
        device=name.device or component.device,
    )
    model.solver = own.solver
    equations(model)
    model.finish()
    return model, origins


def _check_units(model: Model, device: str, key: str, origin: Origin) -> None:
    """Raise ValueError where a device gives a quantity in units of another kind."""
    declared = [v.quantity for n, v in model.variables.items() if n.partition("[")[0] == key]
    given = origin.unit
    units = (given,) * len(declared) if isinstance(given, str) else given
    for quantity, unit in zip(declared, units, strict=False):
        if coherent(quantity.unit).exponents != coherent(unit).exponents:
            raise ValueError(
                f"device file {device}.toml gives {key!r} in {unit}, but it is declared in "
                f"{quantity.unit}"
            )
