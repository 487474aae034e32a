"""Pages show the results that are committed, and their links lead somewhere."""

from __future__ import annotations

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


def test_a_link_to_nothing_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Here\n[a](page.md#here) [b](#there) [c](gone.md) `[d](code.md)`\n")
    assert list(broken(page)) == ["#there", "gone.md"]
