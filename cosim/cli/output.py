"""What the commands print: tables to standard output, notes to standard error."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON value to stdout.")]


def open_console(width: int | None = 160) -> Console:
    """Standard output, letter by letter: what is in brackets or between colons is no markup.

    Args:
        width: where nobody looks at it, so that names stay whole for other programs; rich's own
            if None.
    """
    from rich.console import Console

    width = None if sys.stdout.isatty() else width
    return Console(width=width, markup=False, emoji=False)


def new_table(first: str, *others: str) -> Table:
    """A table whose first column is not broken into lines."""
    from rich.table import Table

    table = Table()
    table.add_column(first, no_wrap=True)
    for name in others:
        table.add_column(name)
    return table


def say(text: str) -> None:
    """A line to standard error."""
    typer.echo(text, err=True)
