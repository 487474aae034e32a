"""What can be drawn: a graph of instances as a `system.System` is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol


class _Described(Protocol):
    @property
    def text(self) -> str:
        """What it is, for a pointer over its box."""


class _Box(Protocol):
    @property
    def reference(self) -> str:
        """What is in the box, below its name."""

    @property
    def description(self) -> _Described: ...


class _Connection(Protocol):
    @property
    def source(self) -> str: ...

    @property
    def target(self) -> str: ...

    @property
    def gain(self) -> float: ...

    @property
    def offset(self) -> float: ...


class _Bond(Protocol):
    @property
    def first(self) -> str: ...

    @property
    def terms(self) -> Sequence[tuple[str, str, int]]: ...


class Drawable(Protocol):
    """Boxes by name, and what connects them; full names are `box.port`."""

    @property
    def name(self) -> str:
        """Of the drawing."""

    @property
    def text(self) -> str:
        """A line below its name."""

    @property
    def members(self) -> Mapping[str, _Box]:
        """The boxes."""

    @property
    def connections(self) -> Sequence[_Connection]:
        """The wires."""

    def bonds(self) -> Sequence[_Bond]:
        """Pairs of wires that carry power: effort one way, flow the other."""

    def algebraic_loops(self) -> Sequence[Sequence[str]]:
        """Ports that depend on each other at one instant."""

    def open_inputs(self) -> Sequence[str]:
        """Inputs that nothing drives."""

    def unit(self, name: str) -> str:
        """Unit of a port."""
