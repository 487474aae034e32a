"""What a component looks like: nodes with a pose and shapes, written in the names of its variables.

An FMU carries its scene in `extra/cosim/component.json` under `scene`, a list of nodes:

    {"name": "fork", "parent": "body", "trail": false,
     "pose": [{"move": ["0.25", 0.19, 0]}, {"turn": "z", "by": "psi[1]"}],
     "shapes": [{"cylinder": ["caster.r", 0.03], "axis": "y", "at": [-0.04, 0, 0]}]}

A pose is a sequence of motions from the parent (the world without one), each in the axes that the
ones before have made: `move` [m], `turn` about x, y or z [rad], `quaternion` (w x y z). Shapes are
`box` (three edges), `cylinder` (radius, length), `sphere` (radius), `rod` (two ends, with a
`radius`), `arrow` (a vector from `at`), `frame` (length of three axes). Numbers may be formulas of
numbers, names of the FMU's variables in its units, + - * / and sin, cos, sqrt. A motion or shape
that names a variable which this FMU does not have is left out, so that one scene serves all
fidelities.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

Number = float | str
NODE = {"name": str, "parent": str, "pose": list, "shapes": list, "trail": bool}
MOTIONS = {"move": 3, "turn": 0, "quaternion": 4}
SHAPES = {"box": 3, "cylinder": 2, "sphere": 0, "rod": 2, "arrow": 3, "frame": 0}
"""Kinds and how many numbers they take; 0: one number alone, and for `turn` a letter."""
WORDS = {"at", "colour", "opacity", "axis", "radius", "by"}
_COLOUR = re.compile("#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")
_FUNCTIONS: dict[str, Callable[[Any], Any]] = {"sin": np.sin, "cos": np.cos, "sqrt": np.sqrt}
_OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
}  # fmt: skip
LONGEST = 200
"""Characters of a formula: deeper nesting than any needs would end the interpreter."""


@lru_cache(maxsize=4096)
def _parsed(formula: str) -> ast.expr:
    if len(formula) > LONGEST:
        raise ValueError(f"formula {formula[:20]!r}... is longer than {LONGEST} characters")
    try:
        return ast.parse(formula, mode="eval").body
    except SyntaxError:
        raise ValueError(f"{formula!r} is no formula") from None


def _variable(node: ast.expr) -> str | None:
    """The variable's name that this is: `q[1]`, `caster.r`."""
    if isinstance(node, (ast.Name, ast.Attribute, ast.Subscript)):
        return ast.unparse(node).replace(" ", "")
    return None


def evaluate(formula: Number, value: Callable[[str], Any]) -> Any:
    """The value of a formula; `value` gives those of variables.

    Raises:
        ValueError: it is no formula.
    """
    if not isinstance(formula, str):
        return float(formula)

    def of(node: ast.expr) -> Any:
        name = _variable(node)
        if name is not None:
            return value(name)
        match node:
            case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
                return float(number)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -of(operand)
            case ast.BinOp(op=op, left=left, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](of(left), of(right))
            case ast.Call(func=ast.Name(id=function), args=[one], keywords=[]) if (
                function in _FUNCTIONS
            ):
                return _FUNCTIONS[function](of(one))
        raise ValueError(f"{formula!r} is no formula of numbers, names, + - * / sin cos sqrt")

    return of(_parsed(formula))


def names(formula: Number) -> list[str]:
    """The variables in a formula."""
    found: list[str] = []

    def note(name: str) -> float:
        found.append(name)
        return 1.0

    with np.errstate(all="ignore"):
        evaluate(formula, note)
    return found


def formulas(item: Any) -> Iterator[Number]:
    """The formulas in a motion or shape, or part of one."""
    if isinstance(item, Mapping):
        for key, part in item.items():
            if key not in ("turn", "axis", "colour", "name", "parent", "trail"):
                yield from formulas(part)
    elif isinstance(item, (list, tuple)):
        for part in item:
            yield from formulas(part)
    else:
        yield item


def mapped(item: Any, change: Callable[[Number], Any]) -> Any:
    """A motion or shape with each formula changed."""
    if isinstance(item, Mapping):
        kept = ("turn", "axis", "colour", "name", "parent", "trail")
        return {k: part if k in kept else mapped(part, change) for k, part in item.items()}
    if isinstance(item, (list, tuple)):
        return [mapped(part, change) for part in item]
    return change(item)


def fitted(
    scene: list[dict[str, Any]], has: Callable[[str], bool], numbers: Mapping[str, float]
) -> list[dict[str, Any]]:
    """A scene for what has these variables; those in `numbers` are put in as numbers.

    What names others is left out, as are nodes without anything to show below them.
    """

    def fits(item: Any) -> bool:
        return all(has(n) or n in numbers for f in formulas(item) for n in names(f))

    def put(formula: Number) -> Number:
        known = names(formula)
        if not all(name in numbers for name in known):
            return formula
        return float(evaluate(formula, numbers.__getitem__))

    found = []
    for node in scene:
        kept: dict[str, Any] = {k: node[k] for k in ("name", "parent", "trail") if k in node}
        for key in ("pose", "shapes"):
            kept[key] = [mapped(item, put) for item in node.get(key, []) if fits(item)]
        found.append(kept)
    while True:  # nodes that nobody needs
        parents = {node.get("parent") for node in found}
        rest = [n for n in found if n["shapes"] or n.get("trail") or n["name"] in parents]
        if len(rest) == len(found):
            return found
        found = rest


def problem(scene: Any) -> str:
    """What is wrong with a scene, "" if nothing is."""
    if not isinstance(scene, list):
        return "scene is not a list of nodes"
    known: set[str] = set()
    for number, node in enumerate(scene, 1):
        if not isinstance(node, dict) or not isinstance(node.get("name"), str):
            return f"scene: node {number} is not an object with a name"
        where = f"scene: node {node['name']!r}"
        for key, part in node.items():
            if not isinstance(part, NODE.get(key, ())):
                return f"{where}: {key} is wrong; a node has {', '.join(NODE)}"
        if "parent" in node and node["parent"] not in known:
            return f"{where}: its parent {node['parent']!r} is no node before it"
        if node["name"] in known:
            return f"{where} is there twice"
        known.add(node["name"])
        for kinds, items in ((MOTIONS, node.get("pose", [])), (SHAPES, node.get("shapes", []))):
            for item in items:
                if wrong := _wrong(item, kinds):
                    return f"{where}: {wrong}"
    return ""


def _wrong(item: Any, kinds: Mapping[str, int]) -> str:
    """What is wrong with a motion or shape."""
    found = [kind for kind in kinds if isinstance(item, dict) and kind in item]
    if len(found) != 1 or not set(item) <= {*found, *WORDS}:
        return f"{item!r} is not one of {', '.join(kinds)}"
    kind, content = found[0], item[found[0]]
    if kind == "turn":
        if content not in ("x", "y", "z") or "by" not in item:
            return f"{item!r} must turn about x, y or z, `by` an angle"
        content = item["by"]
    count = kinds[kind]
    if count and (not isinstance(content, (list, tuple)) or len(content) != count):
        return f"{kind} takes {count} numbers, not {content!r}"
    if kind == "rod" and ("radius" not in item or not all(_vector(end) for end in content)):
        return "rod takes two ends of three numbers each, and a radius"
    if not _vector(item.get("at", [0, 0, 0])):
        return f"at takes 3 numbers, not {item['at']!r}"
    if item.get("axis", "z") not in ("x", "y", "z"):
        return f"axis {item['axis']!r} is not x, y or z"
    if not _COLOUR.fullmatch(str(item.get("colour", "#888"))):
        return f"colour {item['colour']!r} is not like #8ac or #88aacc"
    try:
        for formula in formulas({k: v for k, v in item.items() if k != "turn"}):
            if isinstance(formula, bool) or not isinstance(formula, (int, float, str)):
                return f"{formula!r} is neither a number nor a formula"
            names(formula)
    except (ValueError, RecursionError, MemoryError) as error:
        return str(error)
    return ""


def _vector(item: Any) -> bool:
    return isinstance(item, (list, tuple)) and len(item) == 3
