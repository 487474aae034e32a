"""What a report shows, read back from its HTML."""

from __future__ import annotations

from html.parser import HTMLParser
from typing import Any


class Marked(HTMLParser):
    """Texts by the fact that they show, and all visible text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.facts: dict[str, list[str]] = {}
        self.text = ""
        self._open: list[str] = []
        self._hidden = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        fact = dict(attrs).get("data-fact")
        if tag in ("script", "style"):
            self._hidden = tag
        if fact:
            assert tag == "span"  # facts are spans without others inside
            self._open.append(fact)
            self.facts.setdefault(fact, []).append("")

    def handle_endtag(self, tag: str) -> None:
        if tag == self._hidden:
            self._hidden = ""
        if tag == "span" and self._open:
            self._open.pop()

    def handle_data(self, data: str) -> None:
        if self._hidden:
            return
        self.text += data
        if self._open:
            self.facts[self._open[-1]][-1] += data


def expected(content: dict[str, Any], fact: str) -> str:
    """How a fact must be printed, from the JSON alone."""
    kind, _, path = fact.partition(": ")
    keys: list[Any] = [int(k) if k.isdigit() else k for k in path.split(" > ")]
    value: Any = content
    for key in keys:
        value = value[key]
    if kind == "ratio":
        return f"{value / content['channels'][keys[1]]['noise_rms']:.2f}×"
    if kind == "interval":
        open_ = "" if value["identifiable"] else ", open"
        return f"{value['ci95'][0]:.4g} to {value['ci95'][1]:.4g}{open_}"
    if kind == "smallest":
        size = value["smallest_detectable"]
        return (f"{size:.4g} " if size is not None else "– ") + value["unit"].replace(".", "·")
    of = value.get("unit", "").replace(".", "·") if isinstance(value, dict) else ""
    plain = {"number": lambda: f"{value:.4g}", "percent": lambda: f"{100 * value:.1f} %",
             "value": lambda: f"{value['value']:.4g} {of}"}  # fmt: skip
    return plain[kind]()
