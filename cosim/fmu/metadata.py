"""extra/cosim/component.json: what our own FMUs say beyond FMI."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import FmuFileError
from ..reading.limits import TEXT
from ..spec import scene

ENTRY = "extra/cosim/component.json"
_TEXTS = ("component", "variant", "fidelity")
_PORT = {"name": str, "effort": list, "flow": list, "sign": int, "causality": str}


def read_metadata(path: Path, where: str) -> Mapping[str, Any]:
    """The content of component.json, empty where there is none.

    Args:
        path: of the file.
        where: the FMU, for error texts.

    Raises:
        FmuFileError: it is not what we write.
    """
    if not path.is_file():
        return {}
    if excess := TEXT.excess(path.stat().st_size):
        raise FmuFileError(f"{where}: {ENTRY}: {excess}")
    return parse_metadata(path.read_bytes(), where)


def parse_metadata(content: bytes, where: str) -> dict[str, Any]:
    """Parse component.json.

    Raises:
        FmuFileError: not JSON, or not what we write.
    """
    try:
        table = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise FmuFileError(f"{where}: {ENTRY} cannot be read ({error}); {_WAY_OUT}") from error
    if problem := _problem(table):
        raise FmuFileError(f"{where}: {ENTRY}: {problem}; {_WAY_OUT}")
    assert isinstance(table, dict)  # else there is a problem
    return table


_WAY_OUT = "build the FMU again, or remove that file from it"


def _problem(table: Any) -> str:
    if not isinstance(table, dict):
        return f"is {_kind(table)}, not an object"
    for key in _TEXTS:
        if not isinstance(table.get(key, ""), str):
            return f"{key} is {_kind(table[key])}, not a text"
    for key in ("effects", "strengths"):
        if not _texts(table.get(key, [])):
            return f"{key} is not a list of texts"
    balances = table.get("balances", [])
    if not isinstance(balances, list) or not all(
        isinstance(item, dict) and _texts([item.get(key) for key in ("name", "kind", "unit")])
        for item in balances
    ):
        return "balances is not a list of objects with name, kind and unit"
    for key in ("slots", "mixes", "tries", "lattices", "visits"):
        if not isinstance(table.get(key, {}), dict):
            return f"{key} is {_kind(table[key])}, not an object"
    passed_on = table.get("passed_on", {})
    if not isinstance(passed_on, dict) or not _texts(list(passed_on.values())):
        return "passed_on is not an object of texts"
    left_out = table.get("left_out", [])
    if not isinstance(left_out, list) or not all(
        isinstance(item, dict)
        and _texts([item.get("what"), item.get("unit")])
        and _kind(item.get("amount")) == "a number"
        for item in left_out
    ):
        return "left_out is not a list of objects with what, amount and unit"
    ports = table.get("ports", [])
    if not isinstance(ports, list):
        return f"ports is {_kind(ports)}, not a list"
    for number, port in enumerate(ports, 1):
        if not isinstance(port, dict):
            return f"port {number} is {_kind(port)}, not an object"
        for key, type_ in _PORT.items():
            if not isinstance(port.get(key), type_) or isinstance(port[key], bool):
                return f"port {number}: {key} is {_kind(port.get(key))}"
        if not _texts(port["effort"]) or not _texts(port["flow"]):
            return f"port {number}: effort and flow are not lists of names"
        if len(port["effort"]) != len(port["flow"]):
            return f"port {number} has {len(port['effort'])} efforts and {len(port['flow'])} flows"
        if port["sign"] not in (-1, 1):
            return f"port {number}: sign {port['sign']} is not 1 or -1"
    return scene.problem(table.get("scene", []))


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, str) for item in value)


def _kind(value: Any) -> str:
    names = {dict: "an object", list: "a list", str: "a text", bool: "true or false",
             int: "a number", float: "a number", type(None): "missing"}  # fmt: skip
    return names.get(type(value), type(value).__name__)
