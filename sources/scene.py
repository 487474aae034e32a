"""Words for the scenes of components; `cosim/spec/scene.py` says what they mean."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Sequence
from typing import Any

from cosim.spec import scene

from .model import Model, ModelError

Number = float | str
STEEL, DARK, BODY, ACCENT, TYRE = "#9aa3ad", "#3a3f45", "#dfe3e8", "#2f6fb3", "#2b2b2b"


def move(x: Number = 0, y: Number = 0, z: Number = 0) -> dict[str, Any]:
    """A displacement [m]."""
    return {"move": [x, y, z]}


def turn(axis: str, by: Number) -> dict[str, Any]:
    """A rotation about x, y or z [rad]."""
    return {"turn": axis, "by": by}


def box(x: Number, y: Number, z: Number, at: Sequence[Number] = (0, 0, 0), colour: str = BODY,
        opacity: float = 1.0) -> dict[str, Any]:  # fmt: skip
    """A box by its edges and its middle [m]."""
    return {"box": [x, y, z], "at": list(at), "colour": colour, "opacity": opacity}


def cylinder(radius: Number, length: Number, axis: str = "z", at: Sequence[Number] = (0, 0, 0),
             colour: str = STEEL) -> dict[str, Any]:  # fmt: skip
    """A cylinder about an axis through its middle [m]."""
    return {"cylinder": [radius, length], "axis": axis, "at": list(at), "colour": colour}


def wheel(radius: Number, width: Number) -> list[dict[str, Any]]:
    """A wheel about y, with a spoke that shows how it turns [m]."""
    spoke = [f"1.2*({radius})", f"({width})*1.04", f"0.16*({radius})"]
    return [
        cylinder(radius, width, "y", colour=TYRE),
        cylinder(f"0.62*({radius})", f"({width})*1.02", "y", colour=STEEL),
        {"box": spoke, "at": [0, 0, 0], "colour": ACCENT},
    ]


def node(name: str, pose: Sequence[dict[str, Any]] = (), shapes: Sequence[dict[str, Any]] = (),
         parent: str = "", trail: bool = False) -> dict[str, Any]:  # fmt: skip
    """A node; its parent comes before it, the world without one."""
    found: dict[str, Any] = {"name": name, "pose": list(pose), "shapes": list(shapes)}
    return found | ({"parent": parent} if parent else {}) | ({"trail": True} if trail else {})


def component_scene(component: str) -> list[dict[str, Any]]:
    """What `sources/<component>/scene.py` says, nothing without that file.

    Raises:
        ModelError: it is no scene.
    """
    name = f"{__package__}.{component}.scene"
    if importlib.util.find_spec(name) is None:
        return []
    found: list[dict[str, Any]] = importlib.import_module(name).SCENE
    if problem := scene.problem(found):
        raise ModelError(f"{name}: {problem}")
    return found


def model_scene(model: Model, variables: set[str]) -> list[dict[str, Any]]:
    """The scene of a model: its own variables stay, constants of the device are put in.

    Args:
        model: of one fidelity and device.
        variables: scalar names of the FMU.
    """
    numbers: dict[str, float] = {}
    for name, value in model.values.items():
        several = isinstance(value, (list, tuple))
        for index, item in enumerate(value if several else [value], 1):
            full = f"{name}[{index}]" if several else name
            if full not in variables and isinstance(item, (int, float)):
                numbers[full] = float(item)
    return scene.fitted(component_scene(model.component.name), variables.__contains__, numbers)
