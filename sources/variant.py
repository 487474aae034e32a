"""From the name of a variant to its model: components, fidelities, effects and devices by name."""

from __future__ import annotations

import importlib
import pkgutil
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from cosim.errors import VariantError
from cosim.spec import variant as spec
from cosim.spec.variant import Name

from .component import Component, Solver
from .effect import Effect, Law
from .model import Attachment, Model
from .units import parse

_ROOT = Path(__file__).parent


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


@lru_cache(maxsize=None)
def components() -> dict[str, Component]:
    """All components: the folders whose `__init__` declares a `COMPONENT`."""
    found = {}
    for info in pkgutil.iter_modules([str(_ROOT)]):
        if info.ispkg:
            module = importlib.import_module(f"{__package__}.{info.name}")
            declared = getattr(module, "COMPONENT", None)
            if isinstance(declared, Component):
                found[info.name] = declared
    return dict(sorted(found.items()))


@lru_cache(maxsize=None)
def fidelities(component: str) -> dict[str, ModuleType]:
    """The fidelities of a component: the modules of its folder with `equations`, simplest first."""
    package = importlib.import_module(f"{__package__}.{component}")
    found = {}
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{info.name}")
        if hasattr(module, "equations"):
            found[info.name] = module
    return dict(sorted(found.items(), key=lambda item: (getattr(item[1], "LEVEL", 0), item[0])))


@lru_cache(maxsize=None)
def effects() -> dict[str, ModuleType]:
    """All effects: the modules of `sources/effects` that declare an `EFFECT`."""
    package = importlib.import_module(f"{__package__}.effects")
    found = {}
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{info.name}")
        if isinstance(getattr(module, "EFFECT", None), Effect):
            found[info.name] = module
    return dict(sorted(found.items()))


def devices(component: str) -> dict[str, Path]:
    """Parameter files of a component by device name."""
    return {path.stem: path for path in sorted((_ROOT / component / "parameters").glob("*.toml"))}


@dataclass(frozen=True)
class Origin:
    """One value of a device file.

    Attributes:
        value: number or list of numbers.
        unit: its unit, checked against the declaration.
        origin: where it comes from.
        assumed: True if nobody measured or printed it.
        uncertainty: standard uncertainty in the same unit, None if unknown.
    """

    value: Any
    unit: str
    origin: str
    assumed: bool = False
    uncertainty: float | None = None


@lru_cache(maxsize=None)
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
            f"component {component!r} has no device {device!r}; it has "
            f"{', '.join(available) or 'none'}"
        )
    table = tomllib.loads(available[device].read_text(encoding="utf-8"))
    values = {}
    for name, entry in table.items():
        if not isinstance(entry, dict):
            continue
        missing = {"value", "unit", "origin"} - set(entry)
        if missing:
            raise ValueError(
                f"{available[device].name}: {name!r} lacks {', '.join(sorted(missing))}"
            )
        parse(entry["unit"])
        values[name] = Origin(
            tuple(entry["value"]) if isinstance(entry["value"], list) else entry["value"],
            entry["unit"],
            entry["origin"],
            entry.get("assumed", False),
            entry.get("uncertainty"),
        )
    return values


def _choose(kind: str, wanted: str, available: dict[str, Any]) -> Any:
    if wanted not in available:
        raise UnknownVariantError(
            f"there is no {kind} {wanted!r}; there is {', '.join(available) or 'none'}"
        )
    return available[wanted]


def fidelity(component: str, name: str) -> tuple[Component, Callable[[Model], None], Solver]:
    """A component's declaration, the equations of one fidelity and their solver."""
    declared = _choose("component", component, components())
    module = _choose(f"fidelity of {component!r} called", name, fidelities(component))
    return declared, module.equations, getattr(module, "SOLVER", Solver())


def build_model(name: Name | str) -> Model:
    """Collect the equations of a variant.

    Raises:
        UnknownVariantError: unknown component, device, fidelity, slot or effect.
        ModelError: an effect that fits no balance of the component.
    """
    if isinstance(name, str):
        name = parse_name(name)
    component, equations, solver = fidelity(name.component, name.fidelity)
    module = fidelities(name.component)[name.fidelity]
    offered: dict[str, str] = getattr(module, "SLOTS", {})
    for slot, _ in name.slots:
        _choose(f"slot of {name.component}/{name.fidelity} called", slot, offered)
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
        slots={**offered, **dict(name.slots)},
        device=name.device or component.device,
    )
    model.solver = solver
    equations(model)
    model.finish()
    for key, origin in origins.items():
        declared = next(
            (v.quantity for n, v in model.variables.items() if n.partition("[")[0] == key), None
        )
        if declared is not None and parse(declared.unit).exponents != parse(origin.unit).exponents:
            raise ValueError(
                f"device file {name.device or component.device}.toml gives {key!r} in "
                f"{origin.unit}, but it is declared in {declared.unit}"
            )
    return model
