"""Archives that ask for too much, lead elsewhere or were damaged after unpacking."""

from __future__ import annotations

import cProfile
import stat
import time
import zipfile
from pathlib import Path

import pytest

from cosim import ssp
from cosim.errors import FmuFileError, InputError, ScenarioError
from cosim.fmu import archive
from cosim.fmu.archive import open_fmu
from cosim.fmu.check import check
from cosim.reading import archives, limits, markup
from cosim.reading.limits import DATA, UNPACKED
from tests.small_fmus import T3, Y3, U, Y, fmi2, fmi3, pack

LARGE = 40_000_000
"""Bytes of the large files here, above the limits that the tests set."""
LONGEST = 20.0
"""Time within which a file must be refused, on a busy machine [s]; unlimited it takes minutes."""


def refused(path: Path) -> str:
    """The error for a file, which must come at once."""
    begin = time.perf_counter()
    with pytest.raises(FmuFileError) as caught:
        open_fmu(path)
    assert time.perf_counter() - begin < LONGEST
    assert str(path) in str(caught.value)
    return str(caught.value)


def test_a_small_archive_that_unpacks_to_much(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = pack(tmp_path / "zeros.fmu", fmi2(), {"resources/zeros": bytes(LARGE)})
    assert path.stat().st_size < LARGE // 500
    monkeypatch.setenv(UNPACKED.variable, "30MB")
    text = refused(path)
    assert "unpacked, 40 MB are more than the limit of 30 MB" in text
    assert "raise it: COSIM_MAX_UNPACKED=40" in text
    assert list(tmp_path.parent.rglob("zeros")) == []
    monkeypatch.setenv(UNPACKED.variable, "41MB")
    assert open_fmu(path).description.name == "m"


def test_an_entry_that_claims_more_than_there_is(tmp_path: Path) -> None:
    path = pack(tmp_path / "claims.fmu", fmi2())
    content = bytearray(path.read_bytes())
    place = content.index(b"PK\x01\x02") + 20  # the packed size in the directory
    content[place : place + 4] = (4_000_000_000).to_bytes(4, "little")
    path.write_bytes(content)
    assert "claims 4000000000 bytes of an archive of" in refused(path)
    assert "claims 4000000000 bytes" in str(check(path)[0])  # nothing of that size is asked for


def test_limits_are_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    for text, value in (("8GB", 8 * 10**9), ("2 GiB", 2**31), ("1.5e3", 1500), ("", DATA.default)):
        monkeypatch.setenv(DATA.variable, text)
        assert DATA.value() == value
    monkeypatch.setenv(DATA.variable, "much")
    with pytest.raises(InputError, match=r"COSIM_MAX_DATA=much: write a number, e.g. 2000000000"):
        DATA.value()


def test_a_long_description(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "cache_folder", lambda: tmp_path / "cache")
    path = pack(tmp_path / "long.fmu", fmi2(definitions=f"<!--{' ' * 2_000_000}-->"))
    monkeypatch.setenv("COSIM_MAX_TEXT", "1MB")
    refused(path)
    assert not list((tmp_path / "cache").rglob("modelDescription.xml"))  # nothing was unpacked
    monkeypatch.delenv("COSIM_MAX_TEXT")
    assert open_fmu(path).description.name == "m"
    # read with a larger limit, then refused with the smaller one
    monkeypatch.setenv("COSIM_MAX_TEXT", "1MB")
    text = refused(path)
    assert "MB are more than the limit of 1 MB; if the file is to be trusted" in text
    assert "raise it: COSIM_MAX_TEXT=200" in text


def calls(path: Path) -> int:
    """Calls of functions, those of C among them, that checking a file takes; all of it is wrong."""
    profile = cProfile.Profile()
    found = profile.runcall(check, path)
    assert "v0" in {finding.variable for finding in found}
    return sum(entry.callcount for entry in profile.getstats())


def test_a_description_that_is_wrong_everywhere_takes_no_longer(tmp_path: Path) -> None:
    taken = []
    for count in (1000, 8000):
        twice = "".join(
            f'<ScalarVariable name="v{i // 2}" valueReference="{i + 9}" causality="local">'
            "<Real/></ScalarVariable>"
            for i in range(count)
        )
        taken.append(calls(pack(tmp_path / f"{count}.fmu", fmi2(U + Y + twice))))
    # eight times as many: 8 if all is looked at once, 64 if all pairs are
    assert taken[1] < 8.1 * taken[0]


def test_many_elements(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COSIM_MAX_TEXT", "3200")
    with pytest.raises(markup.MarkupError, match=r"more than 100 elements; .*COSIM_MAX_TEXT=6400"):
        markup.parse(b"<a>" + b"<b/>" * 101 + b"</a>")


def test_an_array_larger_than_memory(tmp_path: Path) -> None:
    huge = (
        '<Float64 name="h" valueReference="3" start="0"><Dimension start="2000000000"/></Float64>'
    )
    path = pack(tmp_path / "dim.fmu", fmi3(variables=T3 + Y3 + huge))
    text = refused(path)
    assert "variable 'h': 2000000000 values are more than the limit of 1000000 values" in text
    assert "COSIM_MAX_VALUES=2000000000" in text
    many = "".join(
        f'<Float64 name="x{i}" valueReference="{i + 3}"><Dimension start="600000"/></Float64>'
        for i in range(2)
    )
    text = refused(pack(tmp_path / "many.fmu", fmi3(variables=T3 + Y3 + many)))
    assert "its variables together: 1200002 values are more than the limit" in text


def test_entities_are_not_expanded(tmp_path: Path) -> None:
    levels = "".join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 10}">' for i in range(9))
    bomb = f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY e0 "lol">{levels}]><x>&e9;</x>'
    for content in (bomb.encode(), bomb.encode("utf-16")):
        with pytest.raises(markup.MarkupError, match=r"line 1 has a document type .* remove it"):
            markup.parse(content)
    outside = fmi2().replace("<fmi", '<!DOCTYPE x SYSTEM "/etc/hostname"><fmi', 1)
    assert "has a document type" in refused(pack(tmp_path / "x.fmu", outside))


def test_deep_elements() -> None:
    with pytest.raises(markup.MarkupError, match="more than 200 deep"):
        markup.parse(b"<a>" * 100_000)
    assert markup.parse(b"<a>" * 200 + b"</a>" * 200).root.tag == "a"


def test_lines_and_names_of_elements() -> None:
    found = markup.parse(b'<a xmlns:n="uri"\n>\n<n:b n:c="1" d="2"/>t</a>')
    (inner,) = found.root
    assert (inner.tag, inner.attrib) == ("{uri}b", {"{uri}c": "1", "d": "2"})
    assert (found.lines[found.root], found.lines[inner], inner.tail) == (1, 3, "t")
    with pytest.raises(markup.MarkupError, match="encoding cannot be read"):
        markup.parse(b'<?xml version="1.0" encoding="klingon"?><a/>')


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("../../evil", "leads out of the archive"),
        ("resources/../../evil", "leads out of the archive"),
        ("..\\evil", "leads out of the archive"),
        ("/evil", "is an absolute path"),
        ("\\evil", "is an absolute path"),
        ("C:/evil", "is an absolute path"),
        ("x" * 300, "has a name of more than 255 bytes"),
    ],
)
def test_entries_that_lead_elsewhere(tmp_path: Path, name: str, message: str) -> None:
    text = refused(pack(tmp_path / "x.fmu", fmi2(), {name: b"!"}))
    assert f"its entry {name[:200]!r} {message}; pack it again" in text
    assert [item for item in tmp_path.rglob("*") if "evil" in item.name] == []


def test_symbolic_links(tmp_path: Path) -> None:
    path = pack(tmp_path / "x.fmu", fmi2())
    with zipfile.ZipFile(path, "a") as archive:
        info = zipfile.ZipInfo("resources/link")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(info, "/etc/passwd")
    assert "its entry 'resources/link' is a symbolic link" in refused(path)


def test_names_that_are_not_unique(tmp_path: Path) -> None:
    path = pack(tmp_path / "twice.fmu", fmi2())
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("modelDescription.xml", fmi2() + " ")
    assert "it has two entries 'modelDescription.xml'" in refused(path)
    both = pack(tmp_path / "both.fmu", fmi2(), {"resources": b"", "resources/a": b""})
    assert "its entry 'resources' is a file and a folder at once" in refused(both)


def test_a_folder_packed_twice(tmp_path: Path) -> None:
    # as a build of CMake does that lists it twice; both say the same, so either may count
    path = pack(tmp_path / "twice.fmu", fmi2(), {"extra/": b"", "extra/a.txt": b"x"})
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("extra/", b"")
        archive.writestr("extra/a.txt", b"x")
    assert open_fmu(path).description.name == "m"
    [finding] = [f for f in check(path) if "twice" in f.text]
    assert (finding.severity, "its entry 'extra/a.txt' is there twice" in str(finding)) == (
        "warning", True)  # fmt: skip


def test_too_many_entries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = pack(tmp_path / "x.fmu", fmi2(), {f"resources/{i}": b"" for i in range(20)})
    monkeypatch.setenv("COSIM_MAX_FILES", "21")
    assert "22 files are more than the limit of 21 files" in refused(path)
    monkeypatch.setenv("COSIM_MAX_FILES", "1")  # known from the size of the directory alone
    assert "its directory is too long" in refused(path)


def test_encrypted_entries(tmp_path: Path) -> None:
    path = pack(tmp_path / "x.fmu", fmi2())
    content = bytearray(path.read_bytes())
    for place in (content.index(b"PK\x03\x04") + 6, content.index(b"PK\x01\x02") + 8):
        content[place] |= 1
    path.write_bytes(content)
    text = refused(path)
    assert "its entry 'modelDescription.xml' is encrypted; unpack it with its password" in text


def test_a_folder_inside_the_archive(tmp_path: Path) -> None:
    path = tmp_path / "x.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("model/modelDescription.xml", fmi2())
    text = refused(path)
    assert "has no modelDescription.xml; the folder 'model' inside it has one: pack the" in text


def test_backslashes_are_read_as_slashes(tmp_path: Path) -> None:
    path = tmp_path / "x.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", fmi2())
        archive.writestr("binaries\\linux64\\m.so", "binary")
    opened = open_fmu(path)
    assert opened.platforms() == ("linux64",)
    assert (opened.folder / "binaries" / "linux64" / "m.so").read_text() == "binary"


def test_what_is_no_file(tmp_path: Path) -> None:
    assert "is not an FMU archive but a folder or device" in refused(tmp_path)
    with pytest.raises(FmuFileError, match=r"is no path"):
        open_fmu("a\0b.fmu")


def test_a_damaged_cache_heals(tmp_path: Path) -> None:
    path = pack(tmp_path / "x.fmu", fmi2(), {"resources/a": b"content"})
    folder = open_fmu(path).folder
    (folder / "resources" / "a").write_bytes(b"cont")
    (folder / "modelDescription.xml").unlink()
    again = open_fmu(path).folder
    assert again == folder
    assert (folder / "resources" / "a").read_bytes() == b"content"
    assert (folder / "modelDescription.xml").is_file()
    assert [item.name for item in folder.parent.iterdir() if item.name.startswith(".")] == []
    assert not (folder / ".damaged").exists()


def test_duplicate_variables_and_wide_references(tmp_path: Path) -> None:
    twice = fmi2().replace('name="y"', 'name="u"')
    assert "has two variables named 'u'" in refused(pack(tmp_path / "a.fmu", twice))
    wide = fmi2().replace('valueReference="1"', 'valueReference="4294967296"')
    text = refused(pack(tmp_path / "b.fmu", wide))
    assert "'y' has the value reference 4294967296, which is not a whole number of 32 bits" in text
    elsewhere = fmi2(interface='<CoSimulation modelIdentifier="../../m"/>')
    text = refused(pack(tmp_path / "c.fmu", elsewhere))
    assert "modelIdentifier '../../m' is not the name of a file" in text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"[", "cannot be read"),
        (b"[" * 100_000, "cannot be read"),
        (b"[]", "is a list, not an object"),
        (b'{"ports": [1]}', "port 1 is a number, not an object"),
        (b'{"ports": [{"name": "a"}]}', "port 1: effort is missing"),
        (b'{"variant": 1}', "variant is a number, not a text"),
        (b'{"ports": [{"name": "a", "effort": ["t"], "flow": [], "sign": 1, "causality": "m"}]}',
         "port 1 has 1 efforts and 0 flows"),
        (b'{"ports": [{"name": "a", "effort": [], "flow": [], "sign": 2, "causality": "m"}]}',
         "sign 2 is not 1 or -1"),
    ],
)  # fmt: skip
def test_component_json(tmp_path: Path, content: bytes, message: str) -> None:
    text = refused(pack(tmp_path / "x.fmu", fmi2(), {"extra/cosim/component.json": content}))
    assert "extra/cosim/component.json" in text and message in text
    assert "build the FMU again, or remove that file from it" in text


def test_ssp_packages_have_the_same_limits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = pack(tmp_path / "x.ssp", "<a/>", {"../b": b""})
    with pytest.raises(ScenarioError, match=r"x\.ssp: its entry '\.\./b' leads out of the archive"):
        ssp.read(path)
    monkeypatch.setenv(UNPACKED.variable, "1MB")
    path = pack(tmp_path / "y.ssp", "<a/>", {"b": bytes(2_000_000)})
    with pytest.raises(ScenarioError, match=r"y\.ssp: unpacked, 2 MB are more than .* of 1 MB"):
        ssp.read(path)


def test_names_of_entries() -> None:
    assert archives.fault("a/b.c") == "" and archives.fault("a..b/c") == ""
    assert archives.fault("a\0") == "has a zero byte in its name"


def test_the_page_gives_the_limits() -> None:
    page = (Path(__file__).parents[2] / "docs" / "foreign_files.md").read_text(encoding="utf-8")
    names = {2**30: "1 GiB", 100_000: "100 000", 2**24: "16 MiB", 10**6: "1 000 000"}
    for item in vars(limits).values():
        if isinstance(item, limits.Limit):
            row = next(line for line in page.splitlines() if f"`{item.variable}`" in line)
            assert row.endswith(f"| {names.get(item.default, '512 MiB')} |")
