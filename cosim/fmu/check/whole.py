"""The whole check of one .fmu file, from the archive inwards.

Our own rules name the variable, the line and the way out. What they leave is covered by the XML
schemas of the standard and by FMPy's validation, which run on the description alone where FMPy is
installed (the extra `validate`). Nothing is unpacked, loaded or run.
"""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

from ...errors import FmuFileError
from ...reading import archives, markup
from ...reading.limits import TEXT, UNPACKED
from ...spec.distribution import has
from ..description import fmi_of, parse_description
from ..metadata import ENTRY, parse_metadata
from .content import check_binaries, check_entries, check_folders, check_sources
from .definitions import check_definitions
from .finding import DESCRIPTION, Finding, Findings
from .model import Model, read_model
from .ours import check_ours
from .structure import check_structure
from .variables import check_variables

_BUILD = "sources/buildDescription.xml"
_AGAIN = "build or fetch it again"
MOST = 1000
"""Findings that are given; more come from a mistake that is repeated in every variable."""
_MORE = 100
"""Findings of the schema that are given, and errors of our own rules with which it is not asked: a
description of another kind has one per element."""


def check(path: Path) -> list[Finding]:
    """Findings about an FMU, the gravest first, an empty list if there is none.

    Raises:
        InputError: a limit of the environment that is no number.
    """
    about = Findings("")
    found: list[Finding] = []
    try:
        if excess := UNPACKED.excess(path.stat().st_size):
            about.error(excess, "or export it smaller")
            return about.found
        with archives.opened(path) as archive:
            found = _content(archive, about)
    except archives.ArchiveError as error:
        about.error(str(error), _AGAIN)
    except archives.DAMAGE as error:
        size = path.stat().st_size
        about.error(
            f"is not a complete FMU archive ({archives.reason(error)}) of {size} bytes", _AGAIN
        )
    except OSError as error:
        about.error(f"cannot be read ({error.strerror})", _AGAIN)
    found = list(dict.fromkeys([*about.found, *found]))
    found.sort(key=lambda finding: finding.severity != "error")
    if len(found) > MOST:
        rest = Finding("error", f"has {len(found) - MOST} more findings", "mend these first")
        found = [*found[:MOST], rest]
    return found


def _content(archive: zipfile.ZipFile, about: Findings) -> list[Finding]:
    check_entries(archive, about)
    if any(finding.severity == "error" for finding in about.found):
        blocked = [f for f in about.found if f.severity == "error" and "backslash" not in f.text]
        if blocked:
            return []
    entries = archives.members(archive)
    for name, info in entries.items():
        with archive.open(info) as file:
            try:
                while file.read(1 << 20):  # to the end, where the checksum is
                    pass
            except (*archives.DAMAGE, OSError) as error:
                about.error(f"its entry {name!r} is damaged ({archives.reason(error)})", _AGAIN)
                return []
    check_folders(entries, about)
    if DESCRIPTION not in entries:
        return []
    for name in (DESCRIPTION, ENTRY, _BUILD):
        if name in entries and (excess := TEXT.excess(entries[name].file_size)):
            about.error(f"{name}: {excess}", "or export it smaller")
            return []
    return _description(archive, entries, about)


def _description(
    archive: zipfile.ZipFile, entries: dict[str, zipfile.ZipInfo], about: Findings
) -> list[Finding]:
    xml = archive.read(entries[DESCRIPTION])
    inside = Findings(DESCRIPTION)
    try:
        parsed = markup.parse(xml)
    except markup.MarkupError as error:
        inside.error(f"cannot be read: {error}", _AGAIN)
        return inside.found
    version = parsed.root.get("fmiVersion", "")
    if parsed.root.tag != "fmiModelDescription" or not version:
        inside.error(f"is <{parsed.root.tag[:50]}>, not <fmiModelDescription>", _AGAIN, 1)
        return inside.found
    fmi = fmi_of(version)
    if fmi is None:
        inside.error(
            f"is of FMI version {version!r}", "2.0 and 3.0 can be run: export it for one of them",
            parsed.lines[parsed.root],
        )  # fmt: skip
        return inside.found
    model = read_model(parsed, fmi)
    check_definitions(model, inside)
    check_variables(model, inside)
    check_structure(model, inside)
    check_sources(model, entries, inside)
    check_binaries(model, entries, archive, about)
    if ENTRY in entries:
        try:
            metadata = parse_metadata(archive.read(entries[ENTRY]), "")
            check_ours(model, metadata, entries, inside)
        except FmuFileError as error:
            about.error(str(error).removeprefix(": "), "or export it again")
    build = archive.read(entries[_BUILD]) if _BUILD in entries else None
    errors = [finding for finding in inside.found if finding.severity == "error"]
    if has("fmpy") and len(errors) < _MORE:  # FMPy's time grows with the square of what is wrong
        inside.found += _of_fmpy(xml, build, model, errors)
    if not any(f.severity == "error" for f in inside.found):
        _as_run(xml, model, inside)
    return inside.found


def _as_run(xml: bytes, model: Model, inside: Findings) -> None:
    """What would keep `cosim run` from reading it."""
    if model.root.find("CoSimulation") is None:
        return
    try:
        parse_description(xml, {}, "")
    except FmuFileError as error:
        inside.error(str(error).removeprefix(": "), _AGAIN)


def _of_fmpy(xml: bytes, build: bytes | None, model: Model, known: list[Finding]) -> list[Finding]:
    """What FMPy and the schemas find in lines, or about lists, where we found nothing."""
    from fmpy.model_description import ValidationError, read_model_description

    alone = io.BytesIO()  # FMPy reads archives; it gets one with the texts only
    with zipfile.ZipFile(alone, "w") as archive:
        archive.writestr(DESCRIPTION, xml)
        if build is not None:
            archive.writestr(_BUILD, build)
    try:
        read_model_description(alone, validate=True, validate_model_structure=True)
    except ValidationError as error:
        problems = list(error.problems)
    except Exception as error:  # FMPy raises plain Exception and errors of its parts
        problems = [str(error) or type(error).__name__]
    else:
        return []
    lines = {finding.line for finding in known}
    structure = any(
        "Unknowns l" in finding.text or "Outputs l" in finding.text for finding in known
    )
    found = []
    for problem in problems[:_MORE]:
        match = re.search(r"line (\d+)", problem)
        line = int(match[1]) if match else None
        if line in lines and line is not None:
            continue
        if line is None and known and (structure or not problem.startswith("ModelStructure")):
            continue
        found.append(
            Finding("error", problem.rstrip("."), "see the standard of FMI", DESCRIPTION, line)
        )
    return found
