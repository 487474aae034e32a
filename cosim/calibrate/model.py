"""Which system describes a rig: a graph of instances, their variants, and who builds these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ..errors import UnknownNameError
from ..system.provider import Provider
from ..system.system import System
from ..system.toml import SystemFile
from ..system.variants import apply


@dataclass(frozen=True, eq=False)
class Model:
    """A system whose instances may be other variants than its file says.

    Attributes:
        file: the system.
        provider: where variants come from.
        instances: name -> variant.
    """

    file: SystemFile
    provider: Provider | None
    instances: Mapping[str, str]
    _plain: dict[frozenset[tuple[str, float]], System] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def of(cls, file: SystemFile, provider: Provider | None) -> Model:
        """The system as its file says."""
        return cls(file, provider, dict(file.instances))

    def changed(self, changes: Mapping[str, str]) -> Model:
        """The system with other variants.

        Args:
            changes: instance (component, slot) -> short form as of `cosim run --set`, e.g.
                `{"load": "+coulomb"}`.

        Raises:
            VariantError, UnknownNameError: it does not fit.
        """
        return replace(self, instances=apply(self.instances, changes, self.provider))

    def system(self, values: Mapping[str, float]) -> System:
        """A new system with these values over those of its file; those that a variant lacks go.

        Raises:
            UnknownNameError: a value that a system as of its file lacks.
        """
        system = replace(self.file, instances=dict(self.instances), parameters={}).build(
            self.provider
        )
        for name, value in {**self.file.parameters, **values}.items():
            if name.partition(".")[0] in self.instances:
                try:
                    system.set(name, value)
                except UnknownNameError:
                    if self.instances == self.file.instances:
                        raise
        return system

    def plain(self, values: Mapping[str, float]) -> System:
        """The same, built once and shared: nobody sets anything in it."""
        key = frozenset(values.items())
        if key not in self._plain:
            self._plain.setdefault(key, self.system(values))
        return self._plain[key]
