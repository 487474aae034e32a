"""XML that cannot harm: limits on size, number and depth of elements, no entities; line numbers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from .limits import TEXT

DEPTH = 200
"""Elements within elements. FMI needs 6, an SSP of systems within systems two more per system."""
_LEAST = 32
"""Bytes of the text of an average element in FMI and SSP; a file with more of them than the limit
on its size allows is made to fill the memory."""


class MarkupError(Exception):
    """XML that cannot be read; the text says why, where, and the way out."""


@dataclass(frozen=True)
class Markup:
    """A parsed file.

    Attributes:
        root: its root element; names in a namespace are `{namespace}name`.
        lines: line of each element's begin.
    """

    root: ET.Element
    lines: Mapping[ET.Element, int]


def read(path: Path) -> Markup:
    """Parse an XML file.

    Raises:
        MarkupError: see `parse`.
        OSError: it cannot be read.
    """
    if excess := TEXT.excess(path.stat().st_size):
        raise MarkupError(excess)
    return parse(path.read_bytes())


def parse(content: bytes) -> Markup:
    """Parse XML.

    Raises:
        MarkupError: too large, not well-formed, or with a document type (which FMI and SSP do not
            use, and through which entities multiply or read other files).
    """
    if excess := TEXT.excess(len(content)):
        raise MarkupError(excess)
    parser = expat.ParserCreate(namespace_separator="}")
    parser.buffer_text = True
    builder = ET.TreeBuilder()
    lines: dict[ET.Element, int] = {}
    most, depth = TEXT.value() // _LEAST, 0

    def name(text: str) -> str:
        return "{" + text if "}" in text else text

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEPTH:
            raise MarkupError(f"elements lie within each other more than {DEPTH} deep")
        if len(lines) >= most:
            raise MarkupError(
                f"has more than {most} elements; if the file is to be trusted, raise the limit: "
                f"{TEXT.variable}={2 * TEXT.value()}"
            )
        if any("}" in key for key in attributes):
            attributes = {name(key): value for key, value in attributes.items()}
        lines[builder.start(name(tag), attributes)] = parser.CurrentLineNumber

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(name(tag))

    def doctype(*_: object) -> None:
        raise MarkupError(
            f"line {parser.CurrentLineNumber} has a document type (<!DOCTYPE), which is not read, "
            "since entities can multiply without end; remove it"
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(content, True)
        return Markup(builder.close(), lines)
    except expat.ExpatError as error:
        raise MarkupError(str(error)) from error
    except (LookupError, ValueError) as error:  # an encoding that is not known
        raise MarkupError(f"its encoding cannot be read ({error}); save it as UTF-8") from error
