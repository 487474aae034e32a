"""Folders of robots of one's own, written."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError
from ..files import make_folder, read_toml, write_text
from ..installation import places
from ..system.provider import Provider
from . import examples, templates
from .templates import Template


def new_folder(name: str, folder: Path) -> Path:
    """Make the folder of a robot.

    Raises:
        InputError: there is one with files of ours, or a scenario of that name.
    """
    if (places.scenarios() / name).is_dir():
        raise InputError(f"{name!r} is the name of a scenario that comes with cosim; take another")
    present = [file for file in templates.FILES if (folder / file).exists()]
    if present:
        raise InputError(
            f"{folder} has {', '.join(present)} already; give another name, or --out, or move them"
        )
    return make_folder(folder)


def from_template(
    name: str, folder: Path, template: Template, provider: Provider, *, logs: bool = True
) -> list[Path]:
    """Write system, scenario, mapping and example logs; returns the files.

    Raises:
        InputError: see `new_folder`.
    """
    made = []
    new_folder(name, folder)
    for file, text in templates.texts(template, name, folder).items():
        write_text(folder / file, text)
        made.append(folder / file)
    if logs:
        source = places.scenarios() / "templates" / template.table["files"] / "log.toml"
        columns = {
            column: (entry["signal"], entry["noise"])
            for column, entry in read_toml(source)["columns"].items()
        }
        inputs = {purpose: template.input_values(purpose) for purpose in templates.PURPOSES}
        made += examples.write_logs(folder, columns, inputs, template.differing(), provider)
    return made
