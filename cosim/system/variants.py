"""Changing the variants of a system by short forms, as `cosim run --set` does.

    gearbox=elastic+backlash      other fidelity and effects, same component and device
    gearbox=+backlash             one more effect
    gearbox=gearbox.mir250/lossy  the whole variant
    gearbox=other/gearbox.fmu     an .fmu
    wheel_contact=brush           the fidelity of a part that an instance carries inside

The name is that of an instance, of a component (then all its instances change), or of a slot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ..errors import UnknownNameError, VariantError, listing
from ..fmu.archive import open_fmu
from ..spec.variant import Name, parse_name
from .provider import Provider, locate


def _parse(reference: str) -> Name | None:
    """The parsed name, None for what is no name: the path of a file."""
    try:
        return parse_name(reference)
    except VariantError:
        return None


def component(reference: str) -> str:
    """Component of a variant, "" for the path of an .fmu."""
    name = _parse(reference)
    return name.component if name else ""


def change(reference: str, wanted: str) -> str:
    """The variant `reference` changed by a short form.

    Raises:
        VariantError: the short form cannot be applied to the path of an .fmu.
    """
    if "/" in wanted or wanted.endswith(".fmu"):
        return wanted
    name = _parse(reference)
    if name is None:
        raise VariantError(
            f"{wanted!r} cannot change {reference!r}, which is a file; give a whole variant such "
            "as gearbox/elastic"
        )
    if wanted.startswith("+"):
        return reference + wanted
    return f"{name.model}/{wanted}"


def _with_slot(reference: str, slot: str, fidelity: str) -> str:
    name = parse_name(reference)
    return str(replace(name, slots=tuple({**dict(name.slots), slot: fidelity}.items())))


def _has_slot(reference: str, slot: str, provider: Provider | None) -> bool:
    name = _parse(reference)
    if name is None:
        return False
    if slot in dict(name.slots):
        return True
    fmu = open_fmu(locate(reference, provider))
    return slot in fmu.description.extra.get("slots", {})


def apply(
    instances: Mapping[str, str],
    changes: Mapping[str, str],
    provider: Provider | None = None,
    base: Path | None = None,
) -> dict[str, str]:
    """Instances with changed variants.

    Args:
        instances: name -> variant or path.
        changes: instance, component or slot -> short form.
        provider: asked for the slots of variants.
        base: folder against which paths of .fmu files in `changes` are taken.

    Raises:
        UnknownNameError: a name that is neither instance, component nor slot.
        VariantError: see `change`.
    """
    result = dict(instances)
    for name, wanted in changes.items():
        if wanted.endswith(".fmu") and base is not None:
            wanted = str((base / wanted).resolve())
        if name in result:
            result[name] = change(result[name], wanted)
            continue
        of_component = [key for key, ref in result.items() if component(ref) == name]
        if of_component:
            for key in of_component:
                result[key] = change(result[key], wanted)
            continue
        with_slot = [key for key, ref in result.items() if _has_slot(ref, name, provider)]
        if not with_slot:
            known = [*result, *sorted({component(ref) for ref in result.values()} - {""})]
            raise UnknownNameError(
                f"{name!r} is no instance, component or slot of the system; {listing(known, name)}"
            )
        for key in with_slot:
            result[key] = _with_slot(result[key], name, wanted)
    return result
