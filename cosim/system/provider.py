"""Where the FMU of a variant comes from."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from ..errors import FmuFileError, VariantError, listing
from ..files import is_file
from ..spec.variant import file_stem


class Provider(Protocol):
    """Gives the path of an .fmu for the name of a variant."""

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU.

        Raises:
            VariantError: there is no such variant.
        """
        ...


class FolderProvider:
    """FMUs that are already built: `<folder>/[fmi2/|fmi3/|python/]<component>-<fidelity>.fmu`.

    Needs neither the sources of the components nor a compiler.
    """

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)

    def path(self, variant: str) -> Path:
        """Path of the variant's FMU."""
        name = file_stem(variant) + ".fmu"
        for place in ("", "fmi2", "fmi3", "python"):
            path = self.folder / place / name
            if is_file(path):
                return path
        present = sorted({item.stem.replace("-", "/", 1) for item in self.folder.rglob("*.fmu")})
        raise VariantError(
            f"{self.folder}: has no FMU of {variant!r}; {listing(present, variant)}. "
            "Build it with 'cosim fmus build' or give the path of an .fmu"
        )


def get_ready(provider: Provider | None, references: Iterable[str]) -> None:
    """Have variants built together, if the provider can do that better than one by one."""
    prepare = getattr(provider, "prepare", None)
    if prepare is not None:
        prepare([item for item in references if not item.endswith(".fmu")])


def expected(provider: Provider | None, references: Iterable[str]) -> None:
    """Say which variants will be asked for, if the provider counts them."""
    expect = getattr(provider, "expect", None)
    if expect is not None:
        expect([item for item in references if not item.endswith(".fmu")])


def locate(reference: str, provider: Provider | None, base: Path | None = None) -> Path:
    """The .fmu file that `reference` names: a path that ends with .fmu, else a variant.

    Args:
        reference: path or variant.
        provider: asked for variants.
        base: folder against which relative paths are taken.

    Raises:
        VariantError, FmuFileError: there is no such thing.
    """
    if reference.endswith(".fmu"):
        path = (base or Path()) / reference
        if not is_file(path):
            raise FmuFileError(f"{path}: there is no such file")
        return path
    if provider is None:
        raise VariantError(
            f"{reference!r} is not the path of an .fmu, and there is no provider of variants; "
            "pass provider=FolderProvider(...)"
        )
    return provider.path(reference)
