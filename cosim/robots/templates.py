"""Systems from templates: a folder with system, scenario and mapping of logs, with comments.

A template is a TOML file in `scenarios/templates`: what can be chosen (`[parameters.NAME]`), the
open inputs with what drives them in two runs (`[[input]]`), and the folder of its files. Those have
places `@name@`, which are filled; `@expression@` of parameters is calculated.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError, UnknownNameError, listing
from ..files import read_toml
from ..installation import places
from ..scenario.run_table import evaluate

FILES = ("system.toml", "scenario.toml", "dataset.toml")
TIMES = (0.0, 2.5, 5.0, 7.5)
"""When the inputs of a template's runs take their values [s]."""
PURPOSES = ("identification", "validation")
_PLACE = re.compile(r"@([^@\n]+)@")


@dataclass(frozen=True)
class Template:
    """A kind of robot.

    Attributes:
        name: of the file, without suffix.
        table: its content.
        values: parameter -> its value, as chosen.
    """

    name: str
    table: Mapping[str, Any]
    values: Mapping[str, Any]

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """What can be chosen."""
        return dict(self.table.get("parameters", {}))

    @property
    def inputs(self) -> list[dict[str, Any]]:
        """Open inputs of the system."""
        return list(self.table.get("input", ()))

    def input_values(self, purpose: str) -> dict[str, list[float]]:
        """Column of each input -> its values at `TIMES` in a run."""
        return {
            item["column"]: [
                evaluate(f"template {self.name}", str(text), self._numbers())
                for text in item[purpose]
            ]
            for item in self.inputs
        }

    def _numbers(self) -> dict[str, float]:
        return {key: float(v) for key, v in self.values.items() if isinstance(v, (int, float))}

    def differing(self) -> dict[str, float]:
        """Variable -> value with which the example logs are simulated."""
        return {
            entry["variable"]: self.values[name] * entry["example"]
            for name, entry in self.parameters.items()
            if "example" in entry
        }


def names() -> list[str]:
    """Templates that there are."""
    return sorted(path.stem for path in (places.scenarios() / "templates").glob("*.toml"))


def read(name: str, given: Mapping[str, Any]) -> Template:
    """A template with parameters as chosen.

    Raises:
        UnknownNameError: no such template or parameter.
        InputError: a value of another kind than the template's.
    """
    if name not in names():
        raise UnknownNameError(f"there is no template {name!r}; {listing(names(), name)}")
    table = read_toml(places.scenarios() / "templates" / f"{name}.toml")
    values = {key: entry["value"] for key, entry in table.get("parameters", {}).items()}
    for key, value in given.items():
        if key not in values:
            raise UnknownNameError(
                f"template {name!r} has no parameter {key!r}; {listing(values, key)}"
            )
        values[key] = _like(key, value, values[key])
    return Template(name, table, values)


def _like(key: str, value: Any, default: Any) -> Any:
    """A value of the same kind as the template's."""
    if isinstance(default, list):
        right = (
            isinstance(value, list)
            and len(value) == len(default)
            and all(isinstance(item, (int, float)) for item in value)
        )
        wanted = f"a list of {len(default)} numbers, as [{', '.join(map(str, default))}]"
    else:
        right = isinstance(value, (int, float)) and not isinstance(value, bool)
        wanted = "a number"
    if not right:
        raise InputError(f"--param {key}={value}: must be {wanted}")
    return value


def texts(
    template: Template,
    name: str,
    folder: Path,
    blocks: Mapping[str, str] | None = None,
    files: Iterable[str] = FILES,
) -> dict[str, str]:
    """Name of each file -> its text.

    Args:
        template: with its values.
        name: of the robot.
        folder: where the files will be.
        blocks: further places and what comes there.
        files: of the robot; each has a `.template`.
    """
    source = places.scenarios() / "templates" / template.table["files"]
    blocks = {**_blocks(template), **(blocks or {}), "name": name, "folder": folder.as_posix()}
    found = {}
    for file in files:
        path = source / file.replace(".toml", ".template")
        raw = path.read_text(encoding="utf-8")

        def put(match: re.Match[str], path: Path = path) -> str:
            place = match[1]
            if place in blocks:
                return blocks[place]
            if place in template.table and isinstance(template.table[place], str):
                return str(template.table[place])
            return f"{evaluate(str(path), place, template._numbers()):.12g}"

        found[file] = _PLACE.sub(put, raw)
    return found


def _blocks(template: Template) -> dict[str, str]:
    """The places that consist of one entry per parameter or input."""
    inputs = template.inputs
    shown = [
        (entry["variable"], template.values[key], entry)
        for key, entry in template.parameters.items()
        if "variable" in entry
    ]
    estimated = [
        parameter(key, entry["unit"], template.values[key], entry["range"], entry["variable"],
                  entry["text"])
        for key, entry in template.parameters.items()
        if "range" in entry
    ]  # fmt: skip
    differs = ", ".join(
        f"{entry['variable']} {100 * (entry['example'] - 1):+.0f} %"
        for entry in template.parameters.values()
        if "example" in entry
    )
    return {
        "parameters": "\n".join(
            f"{variable} = {value}   # [{entry['unit']}] {entry['text']}"
            for variable, value, entry in shown
        ),
        "input_comments": "\n".join(
            f"#   {item['variable']} [{item['unit']}]: {item['text']}" for item in inputs
        ),
        "columns": "\n".join(
            f'{item["column"]} = {{ source = "{item["column"]}", unit = "{item["unit"]}" }}'
            for item in inputs
        ),
        "input_columns": "\n".join(
            f'"{item["variable"]}" = {{ column = "{item["column"]}", interpolation = "hold" }}'
            for item in inputs
        ),
        "estimated": "\n\n".join(estimated),
        "differs": differs,
        **{purpose: _runs(template, purpose) for purpose in PURPOSES},
    }


def _runs(template: Template, purpose: str) -> str:
    values = template.input_values(purpose)
    times = ", ".join(f"{time:g}" for time in TIMES)
    return "\n".join(
        f'"{item["variable"]}" = {{ times = [{times}], '
        f"values = [{', '.join(f'{value:.12g}' for value in values[item['column']])}], "
        f'unit = "{item["unit"]}" }}'
        for item in template.inputs
    )


def parameter(
    name: str, unit: str, nominal: float, factors: Any, target: str, text: str
) -> str:  # fmt: skip
    """A `[[parameter]]` of a mapping; the bounds are factors of the nominal value."""
    low, high = sorted(factor * nominal for factor in factors)
    return (
        f'[[parameter]]\nname = "{name}"\nunit = "{unit}"\nnominal = {nominal:.10g}\n'
        f'min = {low:.10g}\nmax = {high:.10g}\ntargets = "{target}"\ndescription = "{text}"'
    )
