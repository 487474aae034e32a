"""The checker of the FMU manipulation toolbox finds nothing in any native FMU.

It validates against the standard's schemas and checks rules that these cannot express (causality
with variability and initial, start values, references, model structure).
"""

from __future__ import annotations

import logging
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import pytest
from fmu_manipulation_toolbox import checker
from fmu_manipulation_toolbox.operations import FMU
from lxml import etree

from tests.fmus import catalogue, fmu

pytestmark = pytest.mark.slow

SCHEMAS = Path(checker.__file__).parent / "resources" / "fmi-3.0"


class Schema:
    """The toolbox's schemas as libxml2 reads them: a hundred times as fast as its own reader."""

    def __init__(self, path: str) -> None:
        self._schema = etree.XMLSchema(etree.parse(path))

    def iter_errors(self, path: str) -> list[SimpleNamespace]:
        self._schema.validate(etree.parse(path))
        log = self._schema.error_log
        return [SimpleNamespace(reason=entry.message, path=entry.path) for entry in log]


schema = lru_cache(Schema)


@pytest.fixture
def quick_schemas(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checker.xmlschema, "XMLSchema", schema)


class Complaints(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


def complaints(path: Path) -> list[str]:
    handler = Complaints()
    logger = logging.getLogger("fmu_manipulation_toolbox")
    logger.addHandler(handler)
    try:
        with FMU(str(path)) as opened:
            for operation in checker.get_checkers():
                opened.apply_operation(operation())
            handler.texts += further_complaints(Path(opened.tmp_directory))
    finally:
        logger.removeHandler(handler)
    return handler.texts


def further_complaints(folder: Path) -> list[str]:
    """Of the other XML files of FMI 3, which the toolbox has schemas for but does not check."""
    found = []
    for name, xsd in (
        ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd"),
        ("sources/buildDescription.xml", "fmi3BuildDescription.xsd"),
    ):
        if (folder / name).exists():
            errors = checker.xmlschema.XMLSchema(str(SCHEMAS / xsd)).iter_errors(str(folder / name))
            found += [f"{name}: {error.reason}" for error in errors]
    return found


@pytest.mark.parametrize("name", catalogue())
@pytest.mark.usefixtures("quick_schemas")
def test_nothing_is_found(name: str) -> None:
    assert complaints(fmu(name)) == []
    assert complaints(fmu(name, fmi=3)) == []


def test_nothing_is_found_by_its_own_reader_either() -> None:
    name = "dc_motor/sampled"
    assert complaints(fmu(name)) == []
    assert complaints(fmu(name, fmi=3)) == []


@pytest.mark.parametrize(
    ("member", "old", "new", "expected"),
    [
        ("modelDescription.xml", 'causality="output"', 'causality="local"', "is not an output"),
        ("modelDescription.xml", 'initial="calculated"', 'initial="exact"', "start value is requ"),
        ("modelDescription.xml", "<Float64 ", '<Float64 colour="red" ', "colour"),
        ("sources/buildDescription.xml", "<SourceFile ", "<Source ", "Source"),
        ("terminalsAndIcons/terminalsAndIcons.xml", "matchingRule", "rule", "rule"),
    ],
)
@pytest.mark.usefixtures("quick_schemas")
def test_a_fault_is_found(member: str, old: str, new: str, expected: str, tmp_path: Path) -> None:
    """The negative twin: what nothing is found in above would have been found."""
    import zipfile

    path = tmp_path / "sample.fmu"
    with zipfile.ZipFile(fmu("inertia/disc", fmi=3)) as source:
        contents = {name: source.read(name) for name in source.namelist()}
    assert old.encode() in contents[member]
    contents[member] = contents[member].replace(old.encode(), new.encode(), 1)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    assert any(expected in text for text in complaints(path))
