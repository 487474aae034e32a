"""MJCF, MuJoCo's description of bodies and joints."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from ..errors import InputError
from .tree import Tree


def tree(root: ET.Element, shown: str) -> Tree:
    """Bodies and joints of a parsed MJCF."""
    raise InputError(f"{shown}: MJCF cannot be read yet")
