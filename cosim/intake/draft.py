"""A mapping to be: what is in it, and how it is written, with comments."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

WIDTH = 100
"""Of comments."""
COARSER = "A diagnosis may search more coarsely: what this adds, it takes from the data."


@dataclass(frozen=True)
class ColumnEntry:
    """An entry of `[columns]`; `keys` as they are written, `comment` above it."""

    name: str
    keys: Mapping[str, Any]
    comment: str = ""


@dataclass(frozen=True)
class Entry:
    """A channel, a parameter, a nuisance or a run: a table with a comment above it."""

    keys: Mapping[str, Any]
    comment: str = ""


@dataclass
class Draft:
    """A `dataset.toml` to be.

    Attributes:
        head: comment at the top.
        system, step, search_step, period, time: as of the mapping; 0 leaves one out.
        step_comment, time_comment: what is said about them.
        columns: entries of `[columns]`.
        inputs: full name of the input -> column.
        constants: full name of the variable -> value.
        channels, parameters, nuisances: tables.
        held: comments about parameters that are not estimated.
        runs: tables.
    """

    head: str
    system: str
    step: float
    time: str
    period: float = 0.0
    search_step: float = 0.0
    step_comment: str = ""
    time_comment: str = ""
    columns: list[ColumnEntry] = field(default_factory=list)
    inputs: dict[str, str] = field(default_factory=dict)
    constants: dict[str, float] = field(default_factory=dict)
    channels: dict[str, Entry] = field(default_factory=dict)
    parameters: list[Entry] = field(default_factory=list)
    nuisances: list[Entry] = field(default_factory=list)
    held: list[str] = field(default_factory=list)
    runs: list[Entry] = field(default_factory=list)

    def text(self) -> str:
        """The file."""
        lines = [*_comment(self.head), f"system = {_value(self.system)}"]
        lines += [*_comment(self.step_comment), f"step = {_value(self.step)}"]
        if self.search_step:
            lines += [*_comment(COARSER), f"search_step = {_value(self.search_step)}"]
        if self.period:
            lines.append(f"period = {_value(self.period)}")
        lines.append('algorithm = "gauss_seidel"')
        lines += [*_comment(self.time_comment), f"time = {_value(self.time)}"]
        lines += ["", *_comment("What is made of the columns of the logs: units, turns, clocks.")]
        lines.append("[columns]")
        for column in self.columns:
            lines += _comment(column.comment)
            lines.append(f"{_key(column.name)} = {_value(column.keys)}")
        if self.constants:
            lines += ["", "# Held at these values.", "[parameters]"]
            lines += [f"{_key(name)} = {_value(v)}" for name, v in self.constants.items()]
        lines += ["", "# What drives the system: input = column.", "[inputs]"]
        lines += [f"{_key(name)} = {_value(column)}" for name, column in self.inputs.items()]
        lines += ["", *_comment(
            "What was measured, and what it is in the model; sigma is the noise of the column. It "
            "weighs the channels, and says when nothing is missing: correct it if you know it."
        )]  # fmt: skip
        for name, entry in self.channels.items():
            lines += [*_comment(entry.comment), f"[channels.{_key(name)}]"]
            lines += [f"{key} = {_value(v)}" for key, v in entry.keys.items()] + [""]
        for title, kind, entries in (
            ("Values that nobody asks for, but that the logs must tell.", "nuisance",
             self.nuisances),
            ("What is estimated, between bounds.", "parameter", self.parameters),
        ):  # fmt: skip
            if entries or (kind == "parameter" and self.held):
                lines += [f"# -- {title}", ""]
            if kind == "parameter":
                for text in self.held:
                    lines += _comment(text)
            for entry in entries:
                lines += _table(kind, entry)
        for entry in self.runs:
            lines += _table("run", entry)
        return "\n".join(lines).rstrip() + "\n"


def _table(kind: str, entry: Entry) -> Iterable[str]:
    return [*_comment(entry.comment), f"[[{kind}]]",
            *(f"{key} = {_value(v)}" for key, v in entry.keys.items()), ""]  # fmt: skip


def _comment(text: str) -> list[str]:
    return [
        f"# {line}" for part in text.splitlines() for line in textwrap.wrap(part, WIDTH - 2)
    ]  # fmt: skip


def _key(name: str) -> str:
    plain = name.replace("_", "").replace("-", "")
    return name if plain.isalnum() and plain.isascii() else _value(name)


def _value(value: Any) -> str:
    """A value as TOML; JSON writes texts, numbers and truth alike."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, float) and not isinstance(value, bool):
        text = f"{value:.12g}"
        return text if any(mark in text for mark in ".en") else f"{text}.0"
    return json.dumps(value, ensure_ascii=False)
