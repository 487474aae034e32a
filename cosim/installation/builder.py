"""The FMUs of this installation: those that are there, and those that the sources build.

The only module that knows the sources of the components; it finds them by name at run time.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import CosimError, InputError, VariantError
from ..spec.cache import cache_folder
from ..system.provider import FolderProvider, Provider
from . import places


def sources(module: str) -> ModuleType:
    """A module of the components' sources.

    Raises:
        VariantError: they, CasADi or the compiler are not installed.
    """
    root = places.import_root()
    if root is not None and str(root) not in sys.path:
        sys.path.append(str(root))
    try:
        return importlib.import_module(f"{places.sources_package()}.{module}")
    except ModuleNotFoundError as error:
        raise VariantError(
            f"building FMUs needs {error.name}, which is not installed: "
            "pip install 'cosim[build]', or use FMUs that are built already"
        ) from error


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


class Builder:
    """Provider that builds variants from the sources (once; they are cached)."""

    def __init__(self, out: Path | None = None) -> None:
        self.out = out or cache_folder() / "fmus"
        from ..master import kernel  # needs numpy, which lists of variants do not

        self._build = sources("packaging.build").build
        if kernel.find() is None:  # a checkout's first run: compile the executor as an FMU
            sources("packaging.kernel").build_kernel(
                kernel.SOURCES,
                kernel.cache_folder() / kernel.library_name(),
                sources("packaging.build").host_platform(),
            )

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU, built if it is not there."""
        with naming_errors():
            return Path(self._build(variant, out=self.out))

    def written(self, variant: str, starts: Mapping[str, float], path: Path) -> Path:
        """Write the variant's FMU with start values (by variable) of its own; returns the path."""
        with naming_errors():
            return Path(sources("packaging.build").build_with(variant, starts, path))

    def candidates(self, variant: str) -> list[tuple[str, str, str]]:
        """(effect, balance, one line) for every effect that could be added to a variant."""
        with naming_errors():
            return list(sources("packaging.catalog").candidates(variant))

    def refinements(self, variant: str) -> list[dict[str, Any]]:
        """Fidelities of which a variant is the limit, see the protocol `Catalogue`."""
        with naming_errors():
            return list(sources("packaging.catalog").refinements(variant))


class Installed:
    """Provider for an installed wheel: FMUs that it carries, the rest built if that is possible."""

    def __init__(self) -> None:
        self._folder = FolderProvider(places.fmus())

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU."""
        try:
            return self._folder.path(variant)
        except VariantError as missing:
            try:
                return Builder().path(variant)
            except VariantError as error:
                raise error from missing

    def written(self, variant: str, starts: Mapping[str, float], path: Path) -> Path:
        """Write the variant's FMU with start values (by variable) of its own; returns the path."""
        return Builder().written(variant, starts, path)

    def candidates(self, variant: str) -> list[tuple[str, str, str]]:
        """(effect, balance, one line) for every effect that could be added to a variant."""
        return Builder().candidates(variant)

    def refinements(self, variant: str) -> list[dict[str, Any]]:
        """Fidelities of which a variant is the limit, see the protocol `Catalogue`."""
        return Builder().refinements(variant)


def default_provider() -> Provider:
    """Where variants come from if nobody says otherwise."""
    return Builder() if places.in_checkout() else Installed()
