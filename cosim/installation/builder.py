"""The FMUs of this installation: those that are there, and those that the sources build.

The only module that knows the sources of the components; it finds them by name at run time.
"""

from __future__ import annotations

import importlib
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import CosimError, InputError, UnbuiltError, VariantError
from ..master.cores import cores
from ..spec import devices
from ..spec.cache import cache_folder
from ..spec.distribution import way_out
from ..spec.variant import parse_name
from ..system.provider import FolderProvider, Provider
from . import places
from .library import Library


def sources(module: str) -> ModuleType:
    """A module of the components' sources.

    Raises:
        UnbuiltError: they, CasADi or the compiler are not installed.
    """
    root = places.import_root()
    if root is not None and str(root) not in sys.path:
        sys.path.append(str(root))
    try:
        return importlib.import_module(f"{places.sources_package()}.{module}")
    except ModuleNotFoundError as error:
        raise needed(error.name) from error


def needed(package: str | None) -> UnbuiltError:
    """That a package is missing which builds FMUs."""
    return UnbuiltError(
        f"building FMUs needs {package}, which is not installed: {way_out('build')}"
    )


def carried() -> Library | None:
    """What an installed wheel carries; None in a checkout, and in a wheel without FMUs."""
    found = None if places.in_checkout() else Library(places.root())
    return found if found is not None and found.content else None


def components() -> list[dict[str, Any]]:
    """The catalogue by component, as the wheel says, else from the sources.

    Raises:
        UnbuiltError: there is neither.
    """
    library = carried()
    if library is not None:
        return library.components()
    found: list[dict[str, Any]] = sources("packaging.catalog").overview()
    return found


@contextmanager
def naming_errors() -> Iterator[None]:
    """Errors of the sources as ours: bad names and models are wrong input, the rest failed."""
    try:
        yield
    except ValueError as error:  # UnknownVariantError, ModelError and wrong combinations
        raise VariantError(str(error)) from error
    except RuntimeError as error:  # the C compiler
        raise CosimError(str(error)) from error
    except OSError as error:  # a folder that cannot be written, most likely the given one
        raise InputError(
            f"{error.filename}: cannot be written ({error.strerror}); choose another folder with "
            "--out or COSIM_CACHE"
        ) from error


SHOWN = 80
"""Characters of a variant's name in an error."""
Told = Callable[[str, int, int], None]
"""Told of FMUs that are built: what is in work ("" for nothing), how many are done, of how many."""


def _beside_device(variant: str) -> Path | None:
    """The folder of a device file of the user's own, where its FMUs are kept."""
    name = parse_name(variant)
    own = devices.find(name.component, name.device)
    return None if own is None else own.parent


class _Count:
    """FMUs that are asked for and not there yet."""

    def __init__(self, told: Told | None) -> None:
        self.told = told
        self._lock = threading.Lock()
        self._open: dict[str, None] = {}
        self._done = 0

    def expect(self, variants: Iterable[str]) -> None:
        with self._lock:
            self._open |= dict.fromkeys(variants)

    def begin(self, variant: str) -> None:
        with self._lock:
            self._open[variant] = None
            self._tell(variant)

    def end(self, variant: str) -> None:
        with self._lock:
            self._open.pop(variant, None)
            self._done += 1
            self._tell(next(iter(self._open), ""))
            if not self._open:
                self._done = 0

    def _tell(self, variant: str) -> None:
        if self.told is not None:
            self.told(variant, self._done, self._done + len(self._open))


class Builder:
    """Provider that builds variants from the sources (once; they are cached).

    Args:
        out: folder for the FMUs, that of the cache if not given.
        told: of what is built.
    """

    def __init__(self, out: Path | None = None, told: Told | None = None) -> None:
        self.out = out or cache_folder() / "fmus"
        self._count = _Count(told)
        from ..master import kernel  # needs numpy, which lists of variants do not

        self._ready = sources("packaging.ready")
        try:
            self._ready.sources_key()
        except PackageNotFoundError as error:
            raise needed(error.name) from error
        if kernel.find() is None:  # a checkout's first run: compile the executor as an FMU
            sources("packaging.kernel").build_kernel(
                kernel.SOURCES,
                kernel.cache_folder() / kernel.library_name(),
                sources("packaging.platforms").host_platform(),
            )

    @property
    def _packaging(self) -> ModuleType:
        """What builds, with CasADi, which FMUs that are there do not need."""
        return sources("packaging.build")

    def loaded(self) -> Builder:
        """Itself, that can build.

        Raises:
            UnbuiltError: it cannot: CasADi is not installed.
        """
        sources("packaging.build")
        return self

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU, built if it is not there."""
        with naming_errors():
            folder = _beside_device(variant) or self.out
            done = self._ready.ready(variant, out=folder)
            if done is not None:
                return Path(done)
            self._count.begin(variant)
            try:
                return Path(self._packaging.build(variant, out=folder))
            finally:
                self._count.end(variant)

    def expect(self, variants: Iterable[str]) -> None:
        """Count variants that will be asked for, so that what is told has a total."""
        with naming_errors():
            self._count.expect(self._missing(variants))

    def prepare(self, variants: Iterable[str]) -> None:
        """Build variants, as many at a time as there are processors.

        Names that do not exist are left to those who ask for them one by one, as are devices of
        the user's own, whose FMUs lie beside them.
        """
        names = [n for n in self._known(self._missing(variants)) if _beside_device(n) is None]
        if len(names) < 2:
            return
        self._count.expect(names)
        self._count.begin(names[0])
        with naming_errors():
            self._packaging.build_many(
                names,
                out=self.out,
                workers=cores(),
                progress=lambda name, path: self._count.end(name),
            )

    def _missing(self, variants: Iterable[str]) -> list[str]:
        return [
            n for n in dict.fromkeys(variants)
            if not self._ready.ready(n, out=_beside_device(n) or self.out)
        ]  # fmt: skip

    def _known(self, variants: Iterable[str]) -> list[str]:
        names = list(variants)
        if not names:
            return []
        build_model, found = sources("variant").build_model, []
        for name in names:
            try:
                build_model(name)
            except (ValueError, CosimError):
                continue
            found.append(name)
        return found

    def written(self, variant: str, starts: Mapping[str, float], path: Path) -> Path:
        """Write the variant's FMU with start values (by variable) of its own; returns the path."""
        with naming_errors():
            return Path(self._packaging.build_with(variant, starts, path))

    def candidates(self, variant: str) -> list[tuple[str, str, str]]:
        """(effect, balance, one line) for every effect that could be added to a variant."""
        with naming_errors():
            return list(sources("packaging.catalog").candidates(variant))

    def refinements(self, variant: str) -> list[dict[str, Any]]:
        """Fidelities of which a variant is the limit, see the protocol `Catalogue`."""
        with naming_errors():
            return list(sources("packaging.catalog").refinements(variant))

    def contained(self, effect: str) -> tuple[str, ...]:
        """Effects that the law of an effect becomes for some values of its parameters."""
        with naming_errors():
            return tuple(sources("packaging.catalog").contained(effect))

    def needs(self, effect: str) -> tuple[str, ...]:
        """Signals that an effect's law reads beyond those of every balance of its kind."""
        with naming_errors():
            return tuple(sources("packaging.catalog").needs(effect))


class Installed:
    """Provider for an installed wheel: FMUs that it carries, the rest built if that is possible."""

    def __init__(self, told: Told | None = None) -> None:
        self.library = Library(places.root())
        self._told = told
        self._builder: Builder | None = None

    def _built(self, variant: str) -> Builder:
        """The builder of what the library lacks.

        Raises:
            UnbuiltError: the sources cannot build here.
        """
        try:
            self._builder = (self._builder or Builder(told=self._told)).loaded()
        except UnbuiltError as error:
            self.library.check(variant)
            short = variant if len(variant) <= SHOWN else f"{variant[:SHOWN]}…"
            near = self.library.near(variant)
            there = f" (there is {' and '.join(near[:3])})" if near else ""
            raise UnbuiltError(
                f"{short} is not among the FMUs of this installation{there}, and {error}"
            ) from error
        return self._builder

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU."""
        beside = _beside_device(variant)
        if beside is not None:
            try:
                self._builder = (self._builder or Builder(told=self._told)).loaded()
            except UnbuiltError:
                return FolderProvider(beside).path(variant)
            return self._builder.path(variant)  # the device file may have changed
        found = self.library.find(variant)
        return found if found is not None else self._built(variant).path(variant)

    def _lacks(self, variants: Iterable[str]) -> list[str]:
        return [
            name for name in variants
            if _beside_device(name) is None and not self.library.has(name)
        ]  # fmt: skip

    def expect(self, variants: Iterable[str]) -> None:
        """As of `Builder`, for those that must be built."""
        if names := self._lacks(variants):
            self._built(names[0]).expect(names)

    def prepare(self, variants: Iterable[str]) -> None:
        """As of `Builder`, for those that must be built."""
        if names := self._lacks(variants):
            self._built(names[0]).prepare(names)

    def written(self, variant: str, starts: Mapping[str, float], path: Path) -> Path:
        """Write the variant's FMU with start values (by variable) of its own; returns the path."""
        return self._built(variant).written(variant, starts, path)

    def candidates(self, variant: str) -> list[tuple[str, str, str]]:
        """(effect, balance, one line) for every effect that could be added to a variant."""
        found = self.library.candidates(variant)
        return found if found is not None else self._built(variant).candidates(variant)

    def refinements(self, variant: str) -> list[dict[str, Any]]:
        """Fidelities of which a variant is the limit, see the protocol `Catalogue`."""
        found = self.library.refinements(variant)
        return found if found is not None else self._built(variant).refinements(variant)

    def contained(self, effect: str) -> tuple[str, ...]:
        """Effects that the law of an effect becomes for some values of its parameters."""
        found = self.library.contained(effect)
        return found if found is not None else self._built(effect).contained(effect)

    def needs(self, effect: str) -> tuple[str, ...]:
        """Signals that an effect's law reads beyond those of every balance of its kind."""
        found = self.library.needs(effect)
        return found if found is not None else self._built(effect).needs(effect)


def default_provider(told: Told | None = None) -> Provider:
    """Where variants come from if nobody says otherwise; `told` hears of what is built."""
    return Builder(told=told) if places.in_checkout() else Installed(told)
