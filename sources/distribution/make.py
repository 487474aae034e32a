"""Makes what a wheel carries: `python -m sources.distribution`, then `pip wheel` (`make wheel`).

FMUs of the catalogue and of the devices of all systems, in FMI 2 and 3, and variants with effects,
which diagnoses need, in FMI 2, all in packs; the compiled executor; and what the sources would say,
so that nothing of it needs CasADi.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import lzma
import shutil
import tarfile
import time
import zipfile
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Literal

from cosim.files import atomic
from cosim.installation.builder import Builder
from cosim.installation.library import CATALOGUE
from cosim.master import kernel
from cosim.spec.cache import cache_folder
from cosim.spec.variant import file_stem, parse_name
from sources.packaging import catalog
from sources.packaging.build import build_many
from sources.packaging.kernel import build_kernel
from sources.packaging.platforms import PLATFORMS, host_platform
from sources.variant import effects

from . import contents

Choice = Literal["host", "all"]
TAGS = {
    "x86_64-linux": "manylinux_2_17_x86_64", "aarch64-linux": "manylinux_2_17_aarch64",
    "x86_64-windows": "win_amd64", "x86_64-darwin": "macosx_11_0_x86_64",
    "aarch64-darwin": "macosx_11_0_arm64",
}  # fmt: skip
"""Platform tags of wheels: the oldest systems that `PLATFORMS` compiles for."""
PACKED = 48
"""FMUs in a pack: all are unpacked to get one, which takes a tenth of a second."""
PRESET = 9
"""Of xz: what FMUs share lies further apart than the usual dictionary reaches."""


def make(
    out: Path,
    platform: Choice = "host",
    say: Callable[[str], None] = lambda text: None,
    mappings: Sequence[Path] | None = None,
    plain: Sequence[str] | None = None,
) -> None:
    """Build all FMUs of a wheel into a folder, which is emptied before.

    Args:
        out: the folder.
        platform: this machine, or all five.
        say: told what is done.
        mappings: whose diagnoses the wheel serves, all if not given.
        plain: variants for FMI 2 and 3; those of `contents.plain` if not given.
    """
    begun = time.monotonic()

    def told(text: str) -> None:
        say(f"{time.monotonic() - begun:6.0f} s  {text}")

    provider = Builder()
    shutil.rmtree(out, ignore_errors=True)
    (out / "packs").mkdir(parents=True)
    plain = contents.plain(provider) if plain is None else list(plain)
    systems = [contents.declared(path, provider) for path in mappings or contents.searched()]
    if mappings is None:
        systems += [*contents.of_templates(provider), contents.geared_motor(provider)]
        systems += [contents.beside_foreign(provider)]
    asked = list(dict.fromkeys(name for item in systems for name in contents.of_diagnosis(item)))
    fitting, impossible = contents.sorted_out(asked)
    extra = [name for name in fitting if name not in set(plain)]
    kept = cache_folder() / f"distribution-{platform}"
    packed: dict[str, list[tuple[str, Path]]] = {}
    wanted: tuple[tuple[Literal[2, 3], list[str]], ...] = ((2, plain), (3, plain), (2, extra))
    for fmi, names in wanted:
        told(f"{len(names)} FMUs {'with effects' if names is extra else 'without'}, FMI {fmi}")
        paths = _built(names, kept, fmi, platform, told)
        for name, path in zip(names, paths, strict=True):
            packed.setdefault(_group(name), []).append((f"{fmi}/{path.stem}", path))
    for fmus in packed.values():  # both versions of a variant share most
        fmus.sort(key=lambda fmu: fmu[1].stem)
    jobs = [
        (out / "packs" / f"{group}.{first // PACKED}.tar.xz", fmus[first : first + PACKED])
        for group, fmus in sorted(packed.items())
        for first in range(0, len(fmus), PACKED)
    ]
    told(f"{len(jobs)} packs")
    with ProcessPoolExecutor() as pool:
        list(pool.map(_keep_pack, *zip(*jobs, strict=True)) if jobs else ())
    instances = [name for item in systems for name in item.instances.values()]
    catalogue = _catalogue(list(dict.fromkeys([*plain, *map(_canonical, instances)])))
    catalogue["packs"] = {path.name: [key for key, _ in fmus] for path, fmus in jobs}
    catalogue["impossible"] = [file_stem(name) for name in impossible]
    content = json.dumps(catalogue, separators=(",", ":")).encode()
    (out / CATALOGUE).write_bytes(gzip.compress(content, mtime=0))
    targets = list(PLATFORMS) if platform == "all" else [host_platform()]
    for target in targets:
        build_kernel(kernel.SOURCES, out / "kernel" / kernel.library_name(target), target)
    (out / "tag").write_text("any" if platform == "all" else TAGS[targets[0]], encoding="ascii")
    told(f"done: {sum(p.stat().st_size for p in out.rglob('*') if p.is_file()) / 1e6:.1f} MB")


def _group(name: str) -> str:
    """Of FMUs that share most: those of one component, or of one fidelity of a device."""
    parsed = parse_name(name)
    many = f"{parsed.model}/{parsed.fidelity}" if parsed.effects else parsed.component
    return file_stem(many)


def _canonical(name: str) -> str:
    return str(parse_name(name))


def _built(
    names: Sequence[str],
    out: Path,
    fmi: Literal[2, 3],
    platform: Choice,
    say: Callable[[str], None],
) -> list[Path]:
    done, last = 0, time.monotonic()

    def progress(name: str, path: Path) -> None:
        nonlocal done, last
        done += 1
        if time.monotonic() - last > 10.0:
            last = time.monotonic()
            say(f"{done} of {len(names)}: {name[:80]}")

    return build_many(names, out=out, fmi=fmi, platform=platform, progress=progress)


def _keep_pack(path: Path, fmus: Sequence[tuple[str, Path]]) -> None:
    """Write a pack, or take the same one from the cache: compressing takes most of the time."""
    digest = hashlib.sha256(f"{PRESET}\0".encode())
    for key, fmu in fmus:
        digest.update(f"{key}\0{hashlib.sha256(fmu.read_bytes()).hexdigest()}\0".encode())
    kept = cache_folder() / "packs" / digest.hexdigest()
    if not kept.is_file():
        with atomic(kept) as temporary:
            write_pack(temporary, fmus)
    shutil.copyfile(kept, path)


def write_pack(path: Path, fmus: Sequence[tuple[str, Path]]) -> None:
    """Write what several FMUs contain, each below its key; the same bytes for the same FMUs."""
    with (
        lzma.open(path, "wb", preset=PRESET) as stream,
        tarfile.open(fileobj=stream, mode="w", format=tarfile.PAX_FORMAT) as archive,
    ):
        for key, fmu in fmus:
            with zipfile.ZipFile(fmu) as content:
                for name in content.namelist():
                    info = tarfile.TarInfo(f"{key}/{name}")
                    info.size = content.getinfo(name).file_size
                    archive.addfile(info, io.BytesIO(content.read(name)))


def _catalogue(names: Sequence[str]) -> dict[str, Any]:
    """What the sources say of variants, as `installation.library` reads it."""
    return {
        "components": catalog.overview(),
        "names": list(names),
        "variants": [catalog.describe(name) for name in names],
        "effects": {name: module.EFFECT.text for name, module in effects().items()},
        "contained": {name: catalog.contained(name) for name in effects()},
        "needs": {name: catalog.needs(name) for name in effects()},
        "candidates": {
            name: [(effect, port) for effect, port, _ in catalog.candidates(name)] for name in names
        },
        "refinements": {name: catalog.refinements(name) for name in names},
    }
