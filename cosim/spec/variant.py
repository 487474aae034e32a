"""Names of variants: `component[.device]/fidelity[slot=fidelity,…][+effect[@balance]…]`.

Examples: `gearbox/elastic+backlash`, `ur5_arm.ur5e/rigid`, `dc_motor/sampled+coulomb@shaft`,
`mobile_base/six_dof[wheel_contact=brush]`.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

from ..errors import VariantError

LONGEST = 160
"""Characters of a file name: file systems take 255, Windows that many for the whole path."""
_GRAMMAR = re.compile(
    r"(?P<component>\w+)(?:\.(?P<device>\w+))?/(?P<fidelity>\w+)"
    r"(?:\[(?P<slots>[\w=,]+)\])?(?P<effects>(?:\+\w+(?:@[\w.]+)?)*)"
)


@dataclass(frozen=True)
class Name:
    """A parsed variant name; `str()` gives its canonical spelling."""

    component: str
    fidelity: str
    device: str = ""
    slots: tuple[tuple[str, str], ...] = ()
    effects: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        slots = ",".join(f"{slot}={fidelity}" for slot, fidelity in self.slots)
        effects = "".join(f"+{name}" + (f"@{at}" if at else "") for name, at in self.effects)
        return f"{self.model}/{self.fidelity}" + (f"[{slots}]" if slots else "") + effects

    @property
    def model(self) -> str:
        """What all fidelities of a thing share: component and device."""
        return f"{self.component}.{self.device}" if self.device else self.component

    @property
    def identifier(self) -> str:
        """The name as a C identifier, FMI's `modelIdentifier`."""
        return _short(re.sub(r"\W+", "_", str(self)).strip("_"))

    @property
    def filename(self) -> str:
        """The name as a file name without suffix."""
        return file_stem(str(self))


def file_stem(variant: str) -> str:
    """The name of a variant's FMU without suffix; a long one ends in its hash."""
    return _short(variant.replace("/", "-"))


def _short(name: str) -> str:
    """A name that file systems take: the end of a long one is replaced by its hash."""
    if len(name) <= LONGEST:
        return name
    return f"{name[: LONGEST - 13]}_{hashlib.sha256(name.encode()).hexdigest()[:12]}"


def parse_name(text: str) -> Name:
    """Parse a variant name.

    Raises:
        VariantError: the text does not follow the grammar.
    """
    match = _GRAMMAR.fullmatch(text)
    if match is None:
        raise VariantError(
            f"{text!r} is not a variant name; write component/fidelity, then +effect or "
            f"+effect@balance as often as wanted, e.g. gearbox/elastic+backlash"
        )
    slots = tuple(
        (item.partition("=")[0], item.partition("=")[2])
        for item in (match["slots"] or "").split(",")
        if "=" in item
    )
    effects = tuple(
        (item.partition("@")[0], item.partition("@")[2])
        for item in match["effects"].split("+")
        if item
    )
    return Name(
        match["component"],
        match["fidelity"],
        match["device"] or "",
        slots,
        effects,
    )
