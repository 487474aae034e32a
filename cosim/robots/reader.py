"""Arms from files: URDF or MJCF, told apart by their root element."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError, within
from ..reading.markup import MarkupError, read
from . import mjcf, urdf
from .tree import Arm, Tree, serial


def read_tree(path: Path) -> Tree:
    """Links and joints of a URDF or MJCF file.

    Raises:
        InputError: it cannot be read, or is neither.
    """
    try:
        root = read(path).root
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except MarkupError as error:
        raise InputError(f"{path}: {error}") from error
    if root.tag == "robot":
        return urdf.tree(root, str(path))
    if root.tag == "mujoco":
        return mjcf.tree(root, str(path))
    raise InputError(
        f"{path}: its root element is <{root.tag}>; a URDF has <robot> and an MJCF <mujoco>"
    )


def read_arm(path: Path, base: str = "", tip: str = "") -> Arm:
    """The serial chain of a URDF or MJCF file, see `tree.serial`.

    Raises:
        InputError: see `read_tree` and `tree.serial`.
    """
    tree = read_tree(path)
    with within(str(path)):
        return serial(tree, base, tip)
