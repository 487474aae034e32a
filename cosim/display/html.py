"""Pieces of HTML: what is not marked as HTML is text and gets escaped."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

UNITLESS = ("", "-", "1")
VOID = ("img",)
"""Elements that have no end."""


class Html(str):
    """Text that is HTML."""

    __slots__ = ()


def text(item: object) -> Html:
    """Anything as HTML; only text that is not HTML yet is escaped."""
    return item if isinstance(item, Html) else Html(escape(str(item)))


def join(*items: object) -> Html:
    """Pieces one after the other."""
    return Html("".join(map(text, items)))


def tag(name: str, *items: object, **attributes: object) -> Html:
    """An element. `class_` is `class`, `data_x` is `data-x`; None and "" leave an attribute out."""
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None and value != ""
    )
    return Html(f"<{name}{given}>" + ("" if name in VOID else f"{join(*items)}</{name}>"))


def number(value: float | None) -> str:
    """Four digits; a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}"


def unit(name: str) -> str:
    """A unit as it is printed, "" for pure numbers."""
    return "" if name in UNITLESS else name.replace(".", "·")


def quantity(value: float | None, of: str) -> str:
    """A number with its unit."""
    return f"{number(value)} {unit(of)}".rstrip()


def words(names: Sequence[object], last: str = "and") -> Html:
    """A list in words: `a, b and c`."""
    if len(names) < 2:
        return join(*names)
    middle = [piece for name in names[:-1] for piece in (", ", name)][1:]
    return join(*middle, f" {last} ", names[-1])


def explained(name: object, meaning: str) -> Html:
    """A word with its explanation, for pointer, keyboard and touch."""
    return tag("abbr", name, title=meaning) if meaning else text(name)


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Attributes:
        shown: what is in it.
        sort: number that it is sorted by; its text if None.
        kind: classes.
        fact: name of the fact that it shows.
    """

    shown: object
    sort: float | None = None
    kind: str = ""
    fact: str = ""

    @property
    def html(self) -> Html:
        """As an element."""
        sort = None if self.sort is None or not math.isfinite(self.sort) else repr(self.sort)
        return tag("td", self.shown, class_=self.kind, data_sort=sort, data_fact=self.fact)


def cell(item: object) -> Cell:
    """Anything as a cell: numbers are printed with four digits and sorted as they are."""
    if isinstance(item, Cell):
        return item
    if item is None or (isinstance(item, (int, float)) and not isinstance(item, bool)):
        return Cell(number(item), item)
    return Cell(item)


def table(head: Sequence[object], rows: Iterable[Sequence[object]], caption: str = "") -> Html:
    """A table that sorts by any column and scrolls where the page is narrow; "" without rows.

    Args:
        head: of the columns; a pair is a name with its explanation.
        rows: their cells, see `cell`.
        caption: what the table is, for those who do not see it.
    """
    found = [list(map(cell, row)) for row in rows]
    if not found:
        return Html("")
    whole = [
        all(row[column].sort is None for row in found if column < len(row))
        for column in range(len(head))
    ]
    cells = []
    for column, title in enumerate(head):
        name, meaning = title if isinstance(title, tuple) else (title, "")
        cells.append(
            tag("th", tag("button", name, type="button", title=meaning), scope="col",
                class_="text" if whole[column] else "")
        )  # fmt: skip
    body = join(*(tag("tr", *(item.html for item in row)) for row in found))
    return tag(
        "div",
        tag(
            "table",
            tag("thead", tag("tr", *cells)),
            tag("tbody", body),
            class_="sortable" if len(found) > 1 else "",
            aria_label=caption,
        ),
        class_="wide",
        tabindex="0" if len(head) > 4 else None,
    )


def command(line: str) -> Html:
    """A command that can be copied."""
    return tag(
        "div", tag("code", line), tag("button", "copy", type="button", class_="copy"),
        class_="command",
    )  # fmt: skip
