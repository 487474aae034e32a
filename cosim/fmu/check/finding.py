"""What a check found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

DESCRIPTION = "modelDescription.xml"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, or that others may stumble over.

    Attributes:
        severity: `error` breaks a rule of the standard, or keeps masters from running the FMU;
            `warning` is allowed but not what others expect.
        text: what is wrong, with the values.
        way_out: what to do about it.
        entry: file of the archive, "" for the archive itself.
        line: in that file, None where it has none.
        variable: that it is about, "" if none.
    """

    severity: Literal["error", "warning"]
    text: str
    way_out: str
    entry: str = ""
    line: int | None = None
    variable: str = ""

    def __str__(self) -> str:
        place = self.entry + (f", line {self.line}" if self.line is not None else "")
        about = f"variable {self.variable!r} " if self.variable else ""
        return f"{self.severity}: {place}{': ' if place else ''}{about}{self.text}; {self.way_out}"

    def to_dict(self) -> dict[str, Any]:
        """As in `cosim fmus check --json`."""
        return {
            "severity": self.severity,
            "file": self.entry,
            "line": self.line,
            "variable": self.variable,
            "problem": self.text,
            "way_out": self.way_out,
        }


@dataclass
class Findings:
    """Findings about one file of an archive, in the order in which they were made."""

    entry: str
    found: list[Finding] = field(default_factory=list)

    def error(self, text: str, way_out: str, line: int | None = None, variable: str = "") -> None:
        """Add an error."""
        self.found.append(Finding("error", text, way_out, self.entry, line, variable))

    def warning(self, text: str, way_out: str, line: int | None = None, variable: str = "") -> None:
        """Add a warning."""
        self.found.append(Finding("warning", text, way_out, self.entry, line, variable))
