"""`cosim scenarios`: everything that can be run, by kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from .output import AsJson, new_table, open_console
from .streams import print_json

KINDS = {
    "scenario": ("Scenarios", "cosim run NAME"),
    "logs": ("Example logs", "cosim diagnose NAME, or cosim calibrate NAME"),
    "study": ("Studies", "cosim study NAME"),
    "public logs": (
        "Mappings for logs that are not part of cosim",
        "cosim diagnose FOLDER --mapping NAME",
    ),
}
"""Kind -> heading, and the command that runs it."""
SHOWN = 4
"""Runs that are named; of more, their number."""


def scenarios_command(as_json: AsJson = False) -> None:
    """List what can be run: scenarios, example logs, studies, and mappings of public logs.

    Example: `cosim scenarios`
    """
    entries = [*_scenarios(), *_logs(), *_studies(), *_public()]
    if as_json:
        print_json(entries)
        return
    console = open_console()
    for kind, (heading, command) in KINDS.items():
        table = new_table("name", *({"public logs": ["logs from"]}.get(kind, ["runs"])), "what")
        for entry in entries:
            if entry["kind"] == kind:
                middle = entry["origin"] if kind == "public logs" else _few(entry["runs"])
                table.add_row(entry["name"], middle, entry["description"])
        console.print(f"{heading}: {command}", highlight=False)
        console.print(table)
    console.print(
        "Which files the public logs must have is in the README of each, "
        "scenarios/NAME/README.md: " + str(_root()),
        soft_wrap=True, highlight=False,
    )  # fmt: skip


def _few(runs: list[str]) -> str:
    return ", ".join(runs[:SHOWN]) + (f" … ({len(runs)})" if len(runs) > SHOWN else "")


def _root() -> Any:
    from ..installation import places

    return places.scenarios()


def _scenarios() -> Iterator[dict[str, Any]]:
    from ..scenario import scenario

    for file in scenario.scenario_files():
        yield {
            "kind": "scenario",
            "name": file.name,
            "system": str(file.table.get("system", "")),
            "runs": [name for name in file.runs if name],
            "description": file.text,
        }


def _logs() -> Iterator[dict[str, Any]]:
    from ..files import read_toml
    from ..installation.examples import example_sets, named_mappings, read_mapping

    mappings = [read_mapping(path) for path in named_mappings().values()]
    for name, folder in example_sets().items():
        table = read_toml(folder / "set.toml")
        own = [item for item in mappings if item.get("rig") == table.get("rig")]
        mapping = own[0] if own else {}
        yield {
            "kind": "logs",
            "name": name,
            "system": str(mapping.get("system", "")),
            "runs": [str(run["name"]) for run in table.get("run", [])],
            "description": f"{table['description']} {mapping.get('description', '')}".strip()
            if "description" in table
            else str(mapping.get("description", "")),
            "folder": str(folder),
        }


def _studies() -> Iterator[dict[str, Any]]:
    from ..files import read_toml

    for path in sorted((_root() / "studies").glob("*.toml")):
        table = read_toml(path)
        of = table.get("scenario", [])
        yield {
            "kind": "study",
            "name": path.stem,
            "runs": [of] if isinstance(of, str) else list(of),
            "description": str(table.get("description", "")),
        }


def _public() -> Iterator[dict[str, Any]]:
    from ..files import read_toml
    from ..installation.examples import example_sets, named_mappings, read_mapping

    sets = [read_toml(folder / "set.toml") for folder in example_sets().values()]
    shown = {table.get("rig") for table in sets}
    for name, path in named_mappings().items():
        table: Mapping[str, Any] = read_mapping(path)
        if table.get("origin") or table.get("rig") not in shown:
            yield {
                "kind": "public logs",
                "name": name,
                "system": str(table.get("system", "")),
                "runs": [str(run["name"]) for run in table.get("run", [])],
                "description": str(table.get("description", "")),
                "origin": str(table.get("origin") or f"rig {table['rig']}, with its sheet"),
                "readme": str(path.parent / "README.md"),
            }
