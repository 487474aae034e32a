"""Tables of results, written from `benchmarks/results/*.toml`: `python -m benchmarks.tables`.

Writes `benchmarks/results.md`, and in every page of `docs/` what stands between

    <!-- results: FILE/TABLE -->
    <!-- end of results -->

With `--check` it writes nothing and fails if a page is out of date. The result depends on the data
alone: files by their names, tables and rows in their order. Cells are text, since the digits that
were printed say how well a figure is known.

A file has `title`, `note` and its tables `[[table]]`: `name`, `title`, `note`, `columns` and `rows`
(a list of cells each). Notes are Markdown and may be left out; links are as seen from a folder
beside `docs/`.
"""

from __future__ import annotations

import re
import sys
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "benchmarks" / "results.md"
COMMAND = "python -m benchmarks.tables"
_NOTE = f"<!-- Written by `{COMMAND}` from benchmarks/results/; edit those. -->\n"
_KEYS = {"name", "title", "note", "columns", "rows"}
_QUOTED = re.compile(
    r"(<!-- results: (?P<file>\w+)/(?P<table>\w+) -->\n)(?P<text>.*?)(<!-- end of results -->)",
    flags=re.DOTALL,
)


@lru_cache(maxsize=1)
def results() -> dict[str, dict[str, Any]]:
    """The files of results by name, checked.

    Raises:
        ValueError: a file has no title, or a table a wrong key, a name twice or a ragged row.
    """
    found = {}
    for path in sorted(RESULTS.glob("*.toml")):
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        if set(content) - {"note"} != {"title", "table"}:
            raise ValueError(f"{path.name}: title, note and tables are wanted, not {[*content]}")
        names = set()
        for table in content["table"]:
            place = f"{path.name}, table {table.get('name')!r}"
            if set(table) | {"note"} != _KEYS or table["name"] in names:
                raise ValueError(f"{place}: wrong keys, or a name that was there before")
            names.add(table["name"])
            for row in table["rows"]:
                if len(row) != len(table["columns"]) or not all(isinstance(c, str) for c in row):
                    raise ValueError(f"{place}: {row} has not one text for each column")
        found[path.stem] = content
    return found


def _cell(text: str) -> str:
    return text.replace("|", "\\|") + " " * bool(text)


def _table(table: dict[str, Any]) -> str:
    lines = [table["columns"], *table["rows"]]
    text = ["|" + "".join(f" {_cell(cell)}|" for cell in line) for line in lines]
    text.insert(1, "|" + "---|" * len(table["columns"]))
    return "\n".join(text) + "\n"


def _note(content: dict[str, Any]) -> list[str]:
    return [content["note"].strip() + "\n"] if "note" in content else []


def page() -> str:
    """The text of `benchmarks/results.md`."""
    parts = ["# Results\n", _NOTE]
    parts.append(
        "What was measured, and how each figure came about: [notebook](notebook.md). Figures of\n"
        "coupling errors are in [coupling tables](../docs/coupling_tables.md).\n"
    )
    for content in results().values():
        parts += [f"## {content['title']}\n", *_note(content)]
        for table in content["table"]:
            parts += [f"### {table['title']}\n", *_note(table), _table(table)]
    return "\n".join(parts)


def quoted(text: str) -> str:
    """A page with the tables that it quotes as they are now.

    Raises:
        ValueError: there is no such table.
    """

    def fill(match: re.Match[str]) -> str:
        tables = results().get(match["file"], {"table": []})["table"]
        chosen = [table for table in tables if table["name"] == match["table"]]
        if not chosen:
            raise ValueError(f"there is no table {match['file']}/{match['table']}")
        return f"{match[1]}\n{_table(chosen[0])}\n{match[5]}"

    return _QUOTED.sub(fill, text)


def pages() -> dict[Path, str]:
    """What every page that shows results should say."""
    wanted = {PAGE: page()}
    for path in sorted((ROOT / "docs").glob("*.md")):
        text = path.read_text(encoding="utf-8")
        if "<!-- results:" in text:
            wanted[path] = quoted(text)
    return wanted


def main(arguments: list[str]) -> int:
    """Write the pages, or check them; 1 if one is out of date."""
    late = [
        path
        for path, text in pages().items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]
    for path in late:
        name = path.relative_to(ROOT).as_posix()
        if "--check" in arguments:
            print(f"{name} is out of date; run {COMMAND}")
        else:
            path.write_text(pages()[path], encoding="utf-8", newline="\n")
            print(f"{name} written")
    return int(bool(late) and "--check" in arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
