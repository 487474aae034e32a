"""FMUs that an installed wheel carries, in packs.

A pack is a .tar.xz of what some twenty FMUs contain, folder by folder; they share nearly all of it.
An FMU is written into the cache when it is first asked for, byte for byte as it was built.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import lzma
import tarfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from ..errors import CosimError, VariantError, listing
from ..files import atomic
from ..spec.archive import pack
from ..spec.cache import cache_folder, seal, sealed
from ..spec.variant import file_stem, parse_name

CATALOGUE = "catalogue.json.gz"
"""What the library holds and what the sources would say of it: components, candidates."""


@lru_cache(maxsize=3)
def _members(path: Path, changed: int) -> dict[str, bytes]:
    """Files of a pack; who asks for one of its FMUs soon asks for more, and it must be read whole.

    Args:
        path: of the pack.
        changed: when, so that another file of the name is read.
    """
    with tarfile.open(path, "r|xz") as archive:
        return {
            member.name: file.read()
            for member in archive
            if (file := archive.extractfile(member)) is not None
        }


class Library:
    """Provider of the FMUs in a folder that `python -m sources.distribution` made.

    Args:
        folder: with `catalogue.json.gz` and `packs`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def _text(self) -> bytes:
        try:
            return gzip.decompress((self.folder / CATALOGUE).read_bytes())
        except FileNotFoundError:
            return b"{}"
        except (gzip.BadGzipFile, EOFError, zlib.error) as error:
            raise CosimError(
                f"{self.folder / CATALOGUE}: is damaged ({error}); reinstall"
            ) from error
        except OSError as error:
            raise CosimError(
                f"{self.folder / CATALOGUE}: cannot be read ({error.strerror})"
            ) from error

    @cached_property
    def content(self) -> Mapping[str, Any]:
        """The catalogue: `components`, `variants`, `packs`, `candidates`, `refinements`.

        Raises:
            CosimError: it is damaged.
        """
        try:
            found: dict[str, Any] = json.loads(self._text)
        except ValueError as error:
            raise CosimError(
                f"{self.folder / CATALOGUE}: is damaged ({error}); reinstall"
            ) from error
        return found

    @cached_property
    def _packed(self) -> dict[str, str]:
        """FMI version and stem of an FMU, as in `2/gearbox-elastic` -> its pack."""
        packs: Mapping[str, Sequence[str]] = self.content.get("packs", {})
        return {key: name for name, keys in packs.items() for key in keys}

    @cached_property
    def _impossible(self) -> frozenset[str]:
        """Stems of variants whose effects do not fit together."""
        return frozenset(self.content.get("impossible", ()))

    def has(self, variant: str) -> bool:
        """Whether the library has a variant's FMU for FMI 2, or knows that there is none."""
        stem = file_stem(str(parse_name(variant)))
        return f"2/{stem}" in self._packed or stem in self._impossible

    def find(self, variant: str, fmi: int = 2) -> Path | None:
        """Path of a variant's FMU, None if the library has none.

        Raises:
            VariantError: the name does not follow the grammar, or an effect fits no balance.
            CosimError: a pack is damaged.
        """
        stem = file_stem(str(parse_name(variant)))
        if stem in self._impossible:
            raise VariantError(f"{variant}: its effects do not fit")
        key = f"{fmi}/{stem}"
        if key not in self._packed:
            return None
        kept = cache_folder() / "library" / hashlib.sha256(self._text).hexdigest()[:16]
        path = kept / f"fmi{fmi}" / f"{stem}.fmu"
        if path.is_file() and sealed(path, path.read_bytes()):
            return path
        content = self._unpacked(self._packed[key], key)
        with atomic(seal(path)) as temporary:
            temporary.write_text(hashlib.sha256(content).hexdigest(), encoding="ascii")
        with atomic(path) as temporary:
            temporary.write_bytes(content)
        return path

    def _unpacked(self, name: str, key: str) -> bytes:
        path = self.folder / "packs" / name
        try:
            files = _members(path, path.stat().st_mtime_ns)
        except (OSError, tarfile.TarError, lzma.LZMAError, EOFError) as error:
            raise CosimError(f"{path}: is damaged ({error}); reinstall") from error
        begin = f"{key}/"
        return pack({n.removeprefix(begin): c for n, c in files.items() if n.startswith(begin)})

    def near(self, variant: str) -> list[str]:
        """Variants with the same effect at a named balance."""
        name = str(parse_name(variant))
        if not parse_name(name).effects or "@" in name:
            return []
        begin = f"2/{file_stem(f'{name}@')}"
        ends = [key.removeprefix(begin) for key in self._packed if key.startswith(begin)]
        return [f"{name}@{end}" for end in ends if "+" not in end]

    def check(self, variant: str) -> None:
        """Say which part of a variant's name does not exist, where the library knows that.

        Raises:
            VariantError: with near names.
        """
        name = parse_name(variant)
        known = {entry["component"]: entry for entry in self.components()}
        if not known:
            return
        if name.component not in known:
            raise VariantError(
                f"there is no component {name.component!r}; {listing(known, name.component)}"
            )
        entry = known[name.component]
        if name.fidelity not in entry["fidelities"]:
            raise VariantError(
                f"there is no fidelity of {name.component!r} called {name.fidelity!r}; "
                f"{listing(entry['fidelities'], name.fidelity)}"
            )
        if name.device and name.device not in entry["devices"]:
            raise VariantError(
                f"component {name.component!r} has no device {name.device!r}; "
                f"{listing(entry['devices'], name.device)}"
            )
        for effect, _ in name.effects:
            if effect not in self.content["effects"]:
                raise VariantError(
                    f"there is no effect {effect!r}; {listing(self.content['effects'], effect)}"
                )

    def components(self) -> list[dict[str, Any]]:
        """Every component with its fidelities and devices."""
        return list(self.content.get("components", []))

    def variants(self) -> list[dict[str, Any]]:
        """What the catalogued variants offer, as `cosim fmus list --json` says it."""
        return list(self.content.get("variants", []))

    def names(self) -> Iterator[str]:
        """Of the variants without effects, and those with effects that scenarios ask for."""
        yield from self.content.get("names", ())

    def candidates(self, variant: str) -> list[tuple[str, str, str]] | None:
        """Effects that could be added to a variant, None if the library does not know."""
        found = self.content.get("candidates", {}).get(str(parse_name(variant)))
        if found is None:
            return None
        texts = self.content["effects"]
        return [(effect, port, texts[effect]) for effect, port in found]

    def contained(self, effect: str) -> tuple[str, ...] | None:
        """Effects that an effect's law becomes, None if the library does not know the effects."""
        found = self.content.get("contained")
        return None if found is None else tuple(found.get(effect, ()))

    def needs(self, effect: str) -> tuple[str, ...] | None:
        """Signals that an effect's law reads, None if the library does not know the effects."""
        found = self.content.get("needs")
        return None if found is None else tuple(found.get(effect, ()))

    def refinements(self, variant: str) -> list[dict[str, Any]] | None:
        """Fidelities of which a variant is the limit, None if the library does not know."""
        found = self.content.get("refinements", {}).get(str(parse_name(variant)))
        return None if found is None else list(found)
