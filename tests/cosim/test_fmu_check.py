"""`fmus check`: each rule broken once, by name, line and way out; never unpacked or loaded."""

from __future__ import annotations

import ctypes
import sys
import zipfile
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

from cosim.fmu import archive
from cosim.fmu.check import Finding, check
from tests.fmus import fmu
from tests.small_fmus import REAL, STRUCTURE2, T3, U3, Y3, U, Y, fmi2, fmi3, pack

ELF = b"\x7fELF\x02\x01\x01" + bytes(9) + b"\x03\x00\x3e\x00"
"""Head of a library for Linux on x86_64."""
UNITS = (
    '<UnitDefinitions><Unit name="m"><BaseUnit m="1"/><DisplayUnit name="mm" factor="1000"/></Unit>'
    "</UnitDefinitions>"
)
MODES = (
    '<TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="off" value="1"/>'
    '<Item name="on" value="3"/></Enumeration></SimpleType></TypeDefinitions>'
)
STATE = (
    REAL.format(name="x", vr=2, more='initial="exact"', real='start="1.0"')
    + REAL.format(name="der(x)", vr=3, more="", real='derivative="3"')
)  # fmt: skip
BOTH = '<ModelExchange modelIdentifier="m"/><CoSimulation modelIdentifier="m"/>'
OUTPUTS = '<Outputs><Unknown index="2"/></Outputs>'
INITIAL = '<InitialUnknowns><Unknown index="2"/></InitialUnknowns>'


def mode(start: str, more: str = 'declaredType="Mode"') -> str:
    return (
        '<ScalarVariable name="mode" valueReference="9" causality="parameter" variability="fixed">'
        f'<Enumeration {more} start="{start}"/></ScalarVariable>'
    )


def real(more: str = "", inner: str = 'start="1.0"', name: str = "p") -> str:
    given = more or 'causality="parameter" variability="fixed"'
    return REAL.format(name=name, vr=5, more=given, real=inner)


def made(tmp_path: Path, xml: str, files: dict[str, bytes] | None = None) -> Path:
    folder = "x86_64-linux" if 'fmiVersion="3' in xml else "linux64"
    return pack(tmp_path / "x.fmu", xml, {f"binaries/{folder}/m.so": ELF, **(files or {})})


def found(path: Path, severity: str = "error") -> list[str]:
    return [str(finding) for finding in check(path) if finding.severity == severity]


@pytest.fixture(autouse=True)
def nothing_is_loaded_or_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    import fmpy.model_description  # noqa: F401 - its parts load libraries when imported

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a check must not load or unpack anything")

    monkeypatch.setattr(ctypes, "CDLL", refuse)
    monkeypatch.setattr(archive, "cache_folder", refuse)


@pytest.mark.parametrize("xml", [
    fmi2(), fmi3(), fmi3().replace('causality="input"', 'causality="input" initial="exact"'),
    fmi2(U + Y + mode("3"), definitions=MODES),
    fmi2(U + Y + STATE, interface=BOTH, structure=f'{OUTPUTS}<Derivatives><Unknown index="4"/>'
         '</Derivatives><InitialUnknowns><Unknown index="2"/><Unknown index="4"/>'
         "</InitialUnknowns>"),
    fmi2(U + Y + real(inner='start="1.0" unit="m" displayUnit="mm" min="1" max="1"'),
         definitions=UNITS),
])  # fmt: skip
def test_nothing_is_found_in_good_ones(tmp_path: Path, xml: str) -> None:
    assert check(made(tmp_path, xml)) == []


@pytest.mark.parametrize("fmi", [2, 3])
def test_nothing_is_found_in_ours(fmi: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()  # it may have to be built
    assert check(fmu("gearbox/ratio", fmi=fmi)) == []
    assert check(fmu("inertia/disc", fmi=fmi)) == []


BAD2 = {
    # names
    "has the name of a variable in line 5; give each variable a name of its own":
        fmi2(U.replace('"u"', '"y"') + Y),
    "variable '1a' has no name of the naming convention structured": fmi2(
        U + Y + real(name="1a"), root='variableNamingConvention="structured"'),
    "has a tab or a line break in its name": fmi2(U + Y + real(name="a&#9;b")),
    "variableNamingConvention is 'mixed'": fmi2(root='variableNamingConvention="mixed"'),
    # references
    "has the value reference '4294967296', not a whole number of 32 bits":
        fmi2(U + Y.replace('valueReference="1"', 'valueReference="4294967296"')),
    "is an alias of 'p' (line 5), and both have start values":
        fmi2(U + Y + real() + real(name="q", more='initial="exact"')),
    "is an alias of 'u' (line 5), and both are set from outside":
        fmi2(U.replace('"0"', '"5"') + Y + real().replace('start="1.0"', "")),
    "is of declaredType 'Mod', which is not defined":
        fmi2(U + Y + mode("1", 'declaredType="Mod"'), definitions=MODES),
    "its declaredType 'Mode' is a Enumeration":
        fmi2(U + Y + real(inner='start="1" declaredType="Mode"'), definitions=MODES),
    "is an enumeration without a declaredType": fmi2(U + Y + mode("1", ""), definitions=MODES),
    "is the derivative of index 99, which no variable has":
        fmi2(U + Y + real(more='causality="local"', inner='derivative="99"')),
    "is the derivative of itself":
        fmi2(U + Y + real(more='causality="local"', inner='derivative="3"')),
    # combinations
    "has causality parameter and variability continuous, which do not go together; with parameter "
    "the variability is fixed or tunable":
        fmi2(U + Y + real(more='causality="parameter" variability="continuous"')),
    "has causality local, variability fixed and initial exact, which do not go together":
        fmi2(U + Y + real(more='variability="fixed" initial="exact"')),
    "has causality input and initial='exact'; leave initial out":
        fmi2(U.replace('causality="input"', 'causality="input" initial="exact"') + Y),
    "is of type Enumeration and has variability continuous":
        fmi2(U + Y + mode("1").replace('"fixed"', '"continuous"'), definitions=MODES),
    "has the unknown causality 'structuralParameter'":
        fmi2(U + Y + real(more='causality="structuralParameter" variability="fixed"')),
    "is of initial exact and has no start value": fmi2(U + Y + real(inner="")),
    "is an input and has no start value": fmi2(U.replace('start="1.0"', "") + Y),
    "is of initial calculated and has a start value":
        fmi2(U + Y.replace("<Real />", '<Real start="1"/>')),
    # values
    "has min = 2 above max = 1; swap them":
        fmi2(U + Y + real(inner='start="1.0" min="2" max="1"')),
    "has start = 1.0 outside its bounds [2, inf]":
        fmi2(U + Y + real(inner='start="1.0" min="2"')),
    "has start = 1.0 outside its bounds [-inf, -3]":
        fmi2(U + Y + real(inner='start="1.0" max="-3"')),
    "has start = 'one', which is no Real": fmi2(U + Y + real(inner='start="one"')),
    "has nominal = 0": fmi2(U + Y + real(inner='start="1.0" nominal="0"')),
    "has start = 2, which is no item of its enumeration; use one of off = 1, on = 3":
        fmi2(U + Y + mode("2"), definitions=MODES),
    # definitions
    "has the unit 'yd', which is not defined":
        fmi2(U + Y + real(inner='start="1.0" unit="yd"'), definitions=UNITS),
    "has the display unit 'km', which unit 'm' does not define; define it there; there is mm":
        fmi2(U + Y + real(inner='start="1.0" unit="m" displayUnit="km"'), definitions=UNITS),
    "unit 'm' is defined twice": fmi2(definitions=UNITS.replace(
        "<Unit ", '<Unit name="m"><BaseUnit/></Unit><Unit ', 1)),
    "BaseUnit of unit 'm' has factor '0'": fmi2(definitions=UNITS.replace(
        'm="1"', 'm="1" factor="0"')),
    "type 'Mode' has two items 'on' or two of the value 1": fmi2(
        definitions=MODES.replace('value="3"', 'value="1"')),
    "DefaultExperiment has stepSize = -0.1": fmi2(
        definitions='<DefaultExperiment stepSize="-0.1"/>'),
    "DefaultExperiment stops at 1 s, before its start at 2 s": fmi2(
        definitions='<DefaultExperiment startTime="2" stopTime="1"/>'),
    "guid is missing": fmi2().replace('guid="g"', 'guid=""'),
    "has modelIdentifier 'a b', which is no name of C": fmi2(
        interface='<CoSimulation modelIdentifier="a b"/>'),
    "declares canSerializeFMUstate without canGetAndSetFMUstate": fmi2(
        interface='<CoSimulation modelIdentifier="m" canSerializeFMUstate="true"/>'),
    "has no interface": fmi2(interface=""),
    "names the source file 'all.c', which is not in sources": fmi2(
        interface='<CoSimulation modelIdentifier="m"><SourceFiles><File name="all.c"/>'
        "</SourceFiles></CoSimulation>"),
    # structure
    "Outputs lack 'y'; list each variable with causality=\"output\"": fmi2(structure=INITIAL),
    "Outputs list 'u'": fmi2(structure=OUTPUTS.replace(
        "</O", '<Unknown index="1"/></O') + INITIAL),
    "Outputs list it twice": fmi2(structure=OUTPUTS.replace(
        "</O", '<Unknown index="2"/></O') + INITIAL),
    "Outputs list index '7', which no variable has": fmi2(structure=OUTPUTS.replace(
        "</O", '<Unknown index="7"/></O') + INITIAL),
    "InitialUnknowns lack 'y'; list each variable with a value that is computed": fmi2(
        structure=OUTPUTS),
    "InitialUnknowns list 'u'": fmi2(structure=OUTPUTS + INITIAL.replace('"2"', '"1"')),
    "Outputs depend on index '9', which no variable has": fmi2(
        structure=STRUCTURE2.replace('dependencies="1"', 'dependencies="9"', 1)),
    "Outputs have dependenciesKind without dependencies": fmi2(structure=STRUCTURE2.replace(
        'dependencies="1"', 'dependenciesKind="constant"', 1)),
    "Outputs have 1 dependencies and 2 kinds": fmi2(structure=STRUCTURE2.replace(
        'dependencies="1"', 'dependencies="1" dependenciesKind="fixed fixed"', 1)),
    "Derivatives lack 'der(x)', which have the attribute derivative": fmi2(
        U + Y + STATE, interface=BOTH),
    "is listed in Derivatives, but has no attribute derivative": fmi2(
        structure=f'{OUTPUTS}<Derivatives><Unknown index="2"/></Derivatives>{INITIAL}'),
    # versions
    "is of FMI version '1.0'; 2.0 and 3.0 can be run": fmi2().replace(
        'fmiVersion="2.0"', 'fmiVersion="1.0"'),
    "cannot be read: ": fmi2()[:-10],
}  # fmt: skip
BAD3 = {
    "variable 'u' has intermediateUpdate and variability discrete": fmi3(
        T3 + U3.replace("/>", ' variability="discrete" intermediateUpdate="true"/>') + Y3),
    "declares canReturnEarlyAfterIntermediateUpdate without providesIntermediateUpdate": fmi3(
        interface='<CoSimulation modelIdentifier="m" '
        'canReturnEarlyAfterIntermediateUpdate="true"/>'),
    "has no independent variable": fmi3(U3 + Y3),
    "is a second independent variable beside 'time'": fmi3(
        T3 + U3 + Y3 + T3.replace('"time"', '"t2"').replace('"0"', '"8"')),
    "has the value reference 1 of 'u' (line 5); give it one of its own": fmi3(
        T3 + U3 + Y3 + '<Float64 name="p" valueReference="1" causality="parameter" start="1"/>'),
    "has a dimension by value reference 77, which no variable has": fmi3(
        T3 + U3 + Y3 + '<Float64 name="v" valueReference="5"><Dimension valueReference="77"/>'
        "</Float64>"),
    "has a dimension by value reference 1, which is of type Float64": fmi3(
        T3 + U3 + Y3 + '<Float64 name="v" valueReference="5"><Dimension valueReference="1"/>'
        "</Float64>"),
    "has a dimension that is not positive": fmi3(
        T3 + U3 + Y3 + '<Float64 name="v" valueReference="5"><Dimension start="0"/></Float64>'),
    "is too large: 2000000000 values are more than the limit": fmi3(
        T3 + U3 + Y3 + '<Float64 name="v" valueReference="5"><Dimension start="2000000000"/>'
        "</Float64>"),
    "has 2 start values for 3 elements": fmi3(
        T3 + U3 + Y3 + '<Float64 name="v" valueReference="5" causality="parameter" start="1 2">'
        '<Dimension start="3"/></Float64>'),
    "has start = '300', which is no UInt8": fmi3(
        T3 + U3 + Y3 + '<UInt8 name="n" valueReference="5" causality="parameter" start="300"/>'),
    "has clocks = 1, which is no clock": fmi3(
        T3 + U3 + Y3 + '<Float64 name="c" valueReference="5" variability="discrete" clocks="1"/>'),
    "has a variable of the unknown type 'Float16'": fmi3(
        T3 + U3 + Y3 + '<Float16 name="c" valueReference="5"/>'),
    "InitialUnknowns lack 'y'": fmi3(structure='<Output valueReference="2"/>'),
    "instantiationToken is missing": fmi3().replace('instantiationToken="t"', ""),
    "has the name of a variable in line": fmi3(
        T3 + U3 + '<Float64 name="y" valueReference="2" causality="output"><Alias name="u"/>'
        "</Float64>"),
}  # fmt: skip


@pytest.mark.parametrize("message", [*BAD2, *BAD3])
def test_a_broken_rule_is_named(tmp_path: Path, message: str) -> None:
    texts = found(made(tmp_path, {**BAD2, **BAD3}[message]))
    assert any(message in text for text in texts), texts


@pytest.mark.parametrize("message", [*BAD2, *BAD3])
def test_no_less_strict_than_fmpy(tmp_path: Path, message: str) -> None:
    # every rule above that FMPy knows, and those of the schemas
    path = made(tmp_path, {**BAD2, **BAD3}[message])
    assert bool(found(path)) >= bool(validate_fmu(str(path)))


@pytest.mark.parametrize(
    "xml",
    [
        fmi2(definitions="<Unheard/>"),
        fmi2(root='unheard="1"'),
        fmi2().replace("<ModelStructure>", "<ModelStructure><Unheard/>"),
        fmi3().replace('causality="output"', 'causality="output" unheard="1"'),
    ],
)
def test_the_schema_is_checked(tmp_path: Path, xml: str) -> None:
    (text,) = found(made(tmp_path, xml))
    assert "nheard" in text and text.startswith("error: modelDescription.xml, line")


def test_line_variable_and_severity() -> None:
    finding = Finding("error", "is bad", "mend it", "modelDescription.xml", 7, "u")
    assert str(finding) == "error: modelDescription.xml, line 7: variable 'u' is bad; mend it"
    assert finding.to_dict()["line"] == 7
    assert str(Finding("warning", "is odd", "mend it")) == "warning: is odd; mend it"


def test_a_mistake_in_every_variable(tmp_path: Path) -> None:
    same = "".join(REAL.format(name=f"v{i}", vr=i + 5, more="", real='unit="yd"')
                   for i in range(1200))  # fmt: skip
    findings = check(made(tmp_path, fmi2(U + Y + same)))
    assert len(findings) == 1001
    assert str(findings[-1]) == "error: has 200 more findings; mend these first"


# -- archives --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"Resources/a": b""}, "error: has a folder 'Resources', which FMI calls 'resources'"),
        ({"resource/a": b""}, "error: has a folder 'resource', which FMI calls 'resources'"),
        ({"stuff/a": b""}, "warning: has a folder 'stuff', which FMI does not know"),
        ({"note.txt": b""}, "warning: has a file 'note.txt' beside modelDescription.xml"),
        ({"binaries/m.so": ELF}, "error: has 'binaries/m.so' in no folder of a platform"),
        ({"binaries/linux63/m.so": ELF}, "warning: has binaries for 'linux63', which FMI 2 does"),
        ({"binaries/win64/x.dll": b"MZ"}, "error: has no binaries/win64/m.dll, but x.dll there"),
        ({"binaries/win64/m.dll": ELF}, "which is no library for Windows"),
        ({"binaries/darwin64/m.dylib": ELF}, "which is no library for macOS"),
        ({"binaries/aarch64-linux/m.so": ELF}, "which is for x86_64; build it for that platform"),
        ({"binaries\\win64\\m.dll": b"MZ"}, "has a backslash; separate folders by slashes"),
        ({"../a": b""}, "error: its entry '../a' leads out of the archive"),
        ({"resources/a": b"", "Resources/a": b""}, "differ in case only"),
        ({"extra/cosim/component.json": b"[]"}, "component.json: is a list, not an object"),
    ],
)
def test_entries(tmp_path: Path, files: dict[str, bytes], message: str) -> None:
    texts = [str(finding) for finding in check(made(tmp_path, fmi2(), files))]
    assert any(message in text for text in texts), texts


def test_names_of_fmi_2_in_fmi_3(tmp_path: Path) -> None:
    path = made(tmp_path, fmi3(), {"binaries/linux64/m.so": ELF})
    (text,) = found(path)
    assert "has binaries in 'linux64', a name of FMI 2; FMI 3 calls it x86_64-linux" in text


def test_archives_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = made(tmp_path, fmi2(), {"resources/a": bytes(5_000_000)})
    monkeypatch.setenv("COSIM_MAX_UNPACKED", "1MB")
    (text,) = found(path)
    assert (
        "unpacked, 5.001 MB are more than the limit of 1 MB" in text
        and "COSIM_MAX_UNPACKED" in text
    )
    monkeypatch.delenv("COSIM_MAX_UNPACKED")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    (text,) = found(path)
    assert f"is not a complete FMU archive (File is not a zip file) of {len(content) // 2}" in text
    place = content.index(b"modelDescription.xml") + 60
    path.write_bytes(content[:place] + b"\xff\xff" + content[place + 2 :])
    (text,) = found(path)
    assert "its entry 'modelDescription.xml' is damaged" in text


def test_no_description(tmp_path: Path) -> None:
    path = tmp_path / "x.fmu"
    for name, message in (
        ("model/modelDescription.xml", "pack the content of that folder, not the folder"),
        ("ModelDescription.xml", "has 'ModelDescription.xml', not modelDescription.xml"),
        ("a.txt", "has no modelDescription.xml; so it is not an FMU"),
    ):
        with zipfile.ZipFile(path, "w") as opened:
            opened.writestr(name, fmi2())
        (text,) = found(path)
        assert message in text


def test_neither_binary_nor_sources(tmp_path: Path) -> None:
    path = tmp_path / "x.fmu"
    with zipfile.ZipFile(path, "w") as opened:
        opened.writestr("modelDescription.xml", fmi2())
    assert found(path) == ["error: has neither binaries nor sources; export it with one of them"]


def test_model_exchange_alone_is_a_warning(tmp_path: Path) -> None:
    path = made(tmp_path, fmi2(interface='<ModelExchange modelIdentifier="m"/>'))
    (finding,) = check(path)
    assert finding.severity == "warning"
    assert "has ModelExchange only, so it cannot be run here" in finding.text


def test_it_needs_no_sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] in ("sources", "casadi")]:
        monkeypatch.setitem(sys.modules, name, None)
    path = made(tmp_path, fmi2(), {"extra/cosim/component.json": b'{"ports": []}'})
    texts = found(path)
    assert any("variable 'u' has no unit; build it again" in text for text in texts)
    assert any("CoSimulation: canGetAndSetFMUstate is not declared" in text for text in texts)
