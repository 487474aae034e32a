"""Bytes of an SSP archive: XML attributes, units, and a zip that depends on its content alone."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..spec.units import BASE, Unit

_EPOCH = (1980, 1, 1, 0, 0, 0)


def pack(files: Mapping[str, bytes]) -> bytes:
    """A zip archive with fixed times, order and permissions."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name in sorted(files, key=lambda item: (item != "SystemStructure.ssd", item)):
            info = zipfile.ZipInfo(name, _EPOCH)
            # FMUs are archives already
            info.compress_type = (
                zipfile.ZIP_STORED if name.endswith(".fmu") else zipfile.ZIP_DEFLATED
            )
            info.create_system = 3
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name])
    return buffer.getvalue()


@dataclass
class Units:
    """Units that a file refers to, with names that are unique in it."""

    used: dict[str, Unit] = field(default_factory=dict)

    def name(self, unit: Unit) -> str:
        """The name under which a unit is referred to."""
        name, number = unit.symbol, 2
        while name in self.used and _definition(self.used[name]) != _definition(unit):
            name, number = f"{unit.symbol} ({number})", number + 1
        self.used[name] = unit
        return name

    def lines(self, prefix: str) -> list[str]:
        """The element `Units` of a file whose root element has this prefix."""
        if not self.used:
            return []
        lines = [f"  <{prefix}:Units>"]
        for name, unit in sorted(self.used.items()):
            lines += [
                f"    <ssc:Unit{attributes(name=name)}>",
                f"      <ssc:BaseUnit{attributes(**_definition(unit))}/>",
                "    </ssc:Unit>",
            ]
        return [*lines, f"  </{prefix}:Units>"]


def _definition(unit: Unit) -> dict[str, Any]:
    content: dict[str, Any] = {
        name: power for name, power in zip(BASE, unit.exponents, strict=True) if power
    }
    if unit.factor != 1.0:
        content["factor"] = unit.factor
    if unit.offset != 0.0:
        content["offset"] = unit.offset
    return content


def attributes(**values: Any) -> str:
    """Attributes of an element; those that are None are left out."""
    from xml.sax.saxutils import quoteattr  # loads what fetches web pages

    return "".join(
        f" {name}={quoteattr(text(value))}" for name, value in values.items() if value is not None
    )


def text(value: Any) -> str:
    """A value as XML has it; numbers with all their digits."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def encode(lines: Iterable[str]) -> bytes:
    """Lines of a text file."""
    return ("\n".join(lines) + "\n").encode("utf-8")
