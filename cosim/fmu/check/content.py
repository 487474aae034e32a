"""Rules for the archive: names of files and folders, and what lies where."""

from __future__ import annotations

import re
import stat
import zipfile
from collections.abc import Iterable, Mapping
from difflib import get_close_matches

from ...reading import archives
from .finding import DESCRIPTION, Findings
from .model import Model

FOLDERS = ("binaries", "documentation", "extra", "licenses", "resources", "sources",
           "terminalsAndIcons")  # fmt: skip
_FILES = (DESCRIPTION, "model.png")
PLATFORMS = {
    "win32": "x86-windows", "win64": "x86_64-windows", "linux32": "x86-linux",
    "linux64": "x86_64-linux", "darwin64": "x86_64-darwin",
}  # fmt: skip
"""Folders of FMI 2 below `binaries` (2.0.4, 2.3), and what FMI 3 calls them."""
_TUPLE = re.compile(
    r"(?P<machine>aarch32|aarch64|riscv32|riscv64|x86|x86_64|ppc32|ppc64)-"
    r"(?P<system>darwin|linux|windows)(-[a-z][a-z0-9_]*)?"
)
"""Platform tuples of FMI 3.0 (2.5.1.4); FMI 2 FMUs for other machines use them, too."""
_SUFFIX = {"windows": ".dll", "linux": ".so", "darwin": ".dylib"}
_ELF = {3: "x86", 40: "aarch32", 62: "x86_64", 183: "aarch64", 243: "riscv64", 21: "ppc64"}
_MACH = (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe", b"\xca\xfe\xba\xbe", b"\xca\xfe\xba\xbf")


def check_entries(archive: zipfile.ZipFile, findings: Findings) -> None:
    """Check the names of all entries and how they are packed."""
    names: dict[str, str] = {}
    seen: set[str] = set()
    for info in archive.filelist:
        name = info.orig_filename
        shown = repr(name[:100])
        if "\\" in name:
            findings.error(
                f"its entry {shown} has a backslash", "separate folders by slashes: pack it again "
                "with another tool",
            )  # fmt: skip
        if reason := archives.fault(name):
            findings.error(f"its entry {shown} {reason}", "pack it again")
        if stat.S_ISLNK(info.external_attr >> 16):
            findings.error(f"its entry {shown} is a symbolic link", "pack the file instead")
        if info.flag_bits & 1:
            findings.error(f"its entry {shown} is encrypted", "pack it without a password")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            findings.error(
                f"its entry {shown} is packed by method {info.compress_type}",
                "FMI allows stored and deflated entries",
            )  # fmt: skip
        plain = name.replace("\\", "/")
        if plain in seen and not plain.endswith("/"):
            findings.warning(f"its entry {shown} is there twice", "pack it once")
        seen.add(plain)
        other = names.setdefault(plain.lower(), plain)
        if other != plain:
            findings.warning(
                f"its entries {other!r} and {plain!r} differ in case only",
                "on Windows and macOS they are one file: rename one",
            )  # fmt: skip


def check_folders(names: Iterable[str], findings: Findings) -> None:
    """Check the names at the top of the archive."""
    names = list(names)
    if DESCRIPTION not in names:
        inside = sorted(name for name in names if name.endswith(f"/{DESCRIPTION}"))
        near = [name for name in names if name.lower() == DESCRIPTION.lower()]
        if near:
            findings.error(f"has {near[0]!r}, not {DESCRIPTION}", "rename it")
        elif inside:
            findings.error(
                f"has no {DESCRIPTION} at its top, but {inside[0]!r}",
                "pack the content of that folder, not the folder",
            )  # fmt: skip
        else:
            findings.error(f"has no {DESCRIPTION}", "so it is not an FMU: export it again")
        return
    tops = sorted({name.partition("/")[0] for name in names if "/" in name})
    for top in tops:
        if top in FOLDERS:
            continue
        near = [item for item in FOLDERS if item.lower() == top.lower()]
        near = near or get_close_matches(top, FOLDERS, n=1, cutoff=0.75)
        if near:
            findings.error(
                f"has a folder {top!r}, which FMI calls {near[0]!r}", f"rename it to {near[0]}"
            )
        else:
            findings.warning(
                f"has a folder {top!r}, which FMI does not know", "put it into resources or extra"
            )
    for name in sorted(names):
        if "/" not in name and name not in _FILES:
            findings.warning(
                f"has a file {name!r} beside {DESCRIPTION}, which FMI does not know",
                "put it into resources or extra",
            )  # fmt: skip


def check_binaries(
    model: Model, entries: Mapping[str, zipfile.ZipInfo], archive: zipfile.ZipFile,
    findings: Findings,
) -> None:  # fmt: skip
    """Check the folders below `binaries`, the names of libraries and what their first bytes say."""
    identifiers = {
        item.get("modelIdentifier", "")
        for item in model.root
        if item.tag in ("CoSimulation", "ModelExchange", "ScheduledExecution")
    }
    folders = sorted({name.split("/")[1] for name in entries if re.match("binaries/[^/]+/", name)})
    loose = [name for name in entries if re.fullmatch("binaries/[^/]+", name)]
    if loose:
        findings.error(
            f"has {loose[0]!r} in no folder of a platform", "e.g. binaries/"
            + ("linux64" if model.fmi == 2 else "x86_64-linux"),
        )  # fmt: skip
    if not folders and not any(name.startswith("sources/") for name in entries):
        findings.error("has neither binaries nor sources", "export it with one of them")
    for folder in folders:
        known = _TUPLE.fullmatch(PLATFORMS.get(folder, folder))
        if known is None:
            near = get_close_matches(folder, _common(model), n=1, cutoff=0.6)
            findings.warning(
                f"has binaries for {folder!r}, which FMI {model.fmi} does not know",
                f"it knows {', '.join(near or _common(model))}",
            )  # fmt: skip
            continue
        if folder in PLATFORMS and model.fmi == 3:
            findings.error(
                f"has binaries in {folder!r}, a name of FMI 2",
                f"FMI 3 calls it {PLATFORMS[folder]}",
            )  # fmt: skip
        suffix = _SUFFIX[known["system"]]
        for identifier in sorted(identifiers):
            name = f"binaries/{folder}/{identifier}{suffix}"
            if name not in entries:
                present = sorted(
                    item.rpartition("/")[2]
                    for item in entries
                    if item.startswith(f"binaries/{folder}/") and not item.endswith("/")
                )
                findings.error(
                    f"has no {name}, but {', '.join(present[:5]) or 'nothing'} there",
                    "name the library after modelIdentifier",
                )  # fmt: skip
                continue
            with archive.open(entries[name]) as file:
                problem = _format(file.read(20), known["machine"], known["system"])
            if problem:
                findings.error(f"has {name}, which {problem}", "build it for that platform")


def _common(model: Model) -> tuple[str, ...]:
    return tuple(PLATFORMS) if model.fmi == 2 else (*PLATFORMS.values(), "aarch64-linux",
                                                    "aarch64-darwin")  # fmt: skip


def _format(head: bytes, machine: str, system: str) -> str:
    """What the first bytes of a library say against its platform, "" if nothing."""
    if system == "linux":
        if head[:4] != b"\x7fELF" or len(head) < 20:
            return "is no library for Linux"
        order = "little" if head[5] == 1 else "big"
        found = _ELF.get(int.from_bytes(head[18:20], order), "another machine")  # type: ignore[arg-type]
        return "" if found in (machine, "another machine") else f"is for {found}"
    if system == "windows":
        return "" if head[:2] == b"MZ" else "is no library for Windows"
    return "" if head[:4] in _MACH else "is no library for macOS"


def check_sources(model: Model, entries: Mapping[str, zipfile.ZipInfo], findings: Findings) -> None:
    """Check that the source files that the description names are there (FMI 2)."""
    for item in model.root.iterfind("*/SourceFiles/File"):
        name = item.get("name", "")
        if f"sources/{name}" not in entries:
            findings.error(
                f"names the source file {name!r}, which is not in sources",
                "pack it, or take it off the list", model.line(item),
            )  # fmt: skip
