"""Pages show the results that are committed, and their links lead somewhere."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks import tables

ROOT = Path(__file__).parents[2]
FOLDERS = ("docs", "benchmarks", "scenarios", "sources", "cosim", "fmus")
PAGES = [*ROOT.glob("*.md"), *(p for f in FOLDERS for p in (ROOT / f).rglob("*.md"))]


def headings(path: Path) -> set[str]:
    """Anchors as a Markdown viewer makes them of a page's headings."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    found = re.findall(r"^#+ +(.+)$", text, flags=re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in found}


def broken(path: Path) -> Iterator[str]:
    """Links of a page to files or headings that there are not."""
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", path.read_text(encoding="utf-8"), flags=re.M | re.S)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        place, _, heading = link.partition("#")
        if "://" in link or link.startswith("mailto:"):
            continue
        target = path.parent / place if place else path
        if not target.exists() or (heading and heading not in headings(target)):
            yield link


@pytest.mark.parametrize("name", ["benchmarks/results.md", "docs/real_logs.md"])
def test_pages_of_results_are_up_to_date(name: str) -> None:
    wanted = tables.pages()[ROOT / name]
    message = f"{name} is out of date; run {tables.COMMAND}"
    assert (ROOT / name).read_text(encoding="utf-8") == wanted, message


FIGURE = re.compile(r"(\d[\d.]*) (N\.m|kg|%|mm|mrad|ms)")
PARTS = {"%": ("", 1e-2), "mm": ("m", 1e-3), "mrad": ("rad", 1e-3), "ms": ("s", 1e-3)}


def is_rounded(figure: str, unit: str, effect: str) -> bool:
    """Whether a figure is a rounded one of the estimates `name value [interval] unit`."""
    base, factor = PARTS.get(unit, (unit, 1.0))
    digits = len(figure.partition(".")[2])
    estimates = re.findall(r"(-?\d[\d.e-]*) \[[^]]*\] ?([\w./]*)", effect)
    return any(
        of == base and f"{abs(float(value)) / factor:.{digits}f}" == figure
        for value, of in estimates
    )


def found_in_readme(text: str) -> list[list[str]]:
    """Rows (logs, before, what was found, after) of the README's table."""
    section = text.split("## From logs to the missing effect")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line[:1] == "|"]
    return rows[2:]


def disagreements(text: str) -> Iterator[str]:
    """Cells of the README's table that are not what `results/data_sets.toml` says."""
    (table,) = (t for t in tables.results()["data_sets"]["table"] if t["name"] == "sets")
    known = {row[1]: row for row in table["rows"]}
    for logs, before, sentence, after in found_in_readme(text):
        _, _, _, effect, *wanted = known[logs.split()[-1]]
        if [before, after] != wanted:
            yield f"{logs}: {before} and {after} instead of {wanted}"
        for figure, unit in FIGURE.findall(sentence):
            if not is_rounded(figure, unit, effect):
                yield f"{logs}: {figure} {unit} is not in {effect}"


def test_the_readme_says_what_the_results_say() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(found_in_readme(text)) > 5
    assert all(FIGURE.search(sentence) for _, _, sentence, _ in found_in_readme(text))
    assert not list(disagreements(text))
    assert len(list(disagreements(text.replace("1.51 kg", "1.52 kg")))) == 1
    assert len(list(disagreements(text.replace("0.97–2.9", "0.97–2.8")))) == 1


def test_a_page_that_quotes_other_figures_is_noticed() -> None:
    table = "\n".join(
        ["<!-- results: data_sets/time -->", "| set | s |", "<!-- end of results -->", "rest"]
    )
    text = tables.quoted(table)
    assert "| set | s | goal |" in text and text.endswith("<!-- end of results -->\nrest")
    assert tables.quoted(text) == text  # writing twice changes nothing
    with pytest.raises(ValueError, match="no table data_sets/nothing"):
        tables.quoted(table.replace("time", "nothing"))


def test_a_ragged_row_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "one.toml").write_text(
        'title = "One"\n[[table]]\nname = "t"\ntitle = "T"\ncolumns = ["a", "b"]\nrows = [["1"]]\n'
    )
    monkeypatch.setattr(tables, "RESULTS", tmp_path)
    tables.results.cache_clear()
    try:
        with pytest.raises(ValueError, match=r"one\.toml, table 't': \['1'\]"):
            tables.results()
    finally:
        tables.results.cache_clear()


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(path: Path) -> None:
    assert not list(broken(path))


def imports(text: str) -> Iterator[tuple[str, str]]:
    """Modules and names of ours that a page imports in its examples."""
    for module, names in re.findall(r"from (cosim[\w.]*) import ([\w, ]+)", text):
        yield from ((module, name) for name in names.split(", "))


def test_what_pages_import_is_there() -> None:
    wanted = {item for path in PAGES for item in imports(path.read_text(encoding="utf-8"))}
    assert ("cosim.diagnose", "diagnose") in wanted and len(wanted) > 5
    gone = [item for item in wanted if not importable(*item)]
    assert not gone
    assert not importable("cosim", "nothing_of_the_kind")


def importable(module: str, name: str) -> bool:
    """Whether `from module import name` works: the name is there, or a module of its own."""
    if hasattr(importlib.import_module(module), name):
        return True
    return importlib.util.find_spec(f"{module}.{name}") is not None


def test_a_link_to_nothing_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Here\n[a](page.md#here) [b](#there) [c](gone.md) `[d](code.md)`\n")
    assert list(broken(page)) == ["#there", "gone.md"]
