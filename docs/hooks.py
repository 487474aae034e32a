"""What the site has beyond the pages of docs/: references from the code, and linked files.

MkDocs calls the functions `on_…`. Links from docs/ to files elsewhere in the project work on the
site, too: such files are taken along below `project/`.
"""

from __future__ import annotations

import posixpath
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, get_args, get_type_hints

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
TAKEN = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "sources/README.md")
"""Files that are taken along though no page of docs/ links to them."""
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
CODE = re.compile(r"(^```.*?^```|`[^`\n]*`)", re.M | re.S)
PYTHON = {
    "Running": ["cosim.run", "cosim.Result", "cosim.RunResult", "cosim.Recording",
                "cosim.read_recording", "cosim.data.comparison.Comparison"],
    "Systems": ["cosim.System", "cosim.read_system", "cosim.Master", "cosim.Instance",
                "cosim.FolderProvider", "cosim.Constant", "cosim.Function", "cosim.Table"],
    "Calibration": ["cosim.calibrate.mapping.read_problem", "cosim.calibrate.problem.Problem",
                    "cosim.calibrate.simulator.Simulator", "cosim.calibrate.fit.fit",
                    "cosim.calibrate.estimate.Estimate"],
    "Diagnosis": ["cosim.diagnose.diagnose", "cosim.diagnose.Diagnosis"],
    "Monitoring": ["cosim.monitor.monitor.monitor", "cosim.monitor.result.Monitored",
                   "cosim.monitor.series.read_series"],
    "Errors": ["cosim.errors"],
}  # fmt: skip
"""Objects of the reference, by section."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Leave out of the navigation what is not there."""
    made = {f"reference/{name}.md" for name in ("command_line", "mapping_keys", "python")}

    def kept(item: Any) -> Any:
        if isinstance(item, str):
            there = item in made or item.startswith("project/") or (DOCS / item).is_file()
            return item if there else None
        ((title, inner),) = item.items()
        if isinstance(inner, list):
            found = [one for one in map(kept, inner) if one is not None]
            return {title: found} if found else None
        return {title: inner} if kept(inner) is not None else None

    config.nav = [one for one in map(kept, config.nav or []) if one is not None]
    for item in config.nav:
        if "Components" in item:
            pages = sorted((DOCS / "components").glob("*.md"))
            item["Components"] += [f"components/{p.name}" for p in pages if p.name != "index.md"]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the references and what pages link to outside of docs/."""
    pages: dict[str, Callable[[], str]] = {
        "reference/command_line.md": command_line,
        "reference/mapping_keys.md": mapping_keys,
        "reference/python.md": python,
    }
    for uri, write in pages.items():
        files.append(File.generated(config, uri, content=write()))
    waiting = [*DOCS.rglob("*.md"), *(ROOT / name for name in TAKEN)]
    seen: set[Path] = set()
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        if not path.is_relative_to(DOCS):
            files.append(File.generated(config, uri_of(path), abs_src_path=str(path)))
        if path.suffix == ".md":
            waiting += [target for target, _ in linked(path) if target.is_file()]
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead where their targets are on the site."""
    source = page.file.abs_src_path
    if source is None or page.file.src_uri.startswith("reference/"):
        return markdown
    path, here = Path(source), posixpath.dirname(page.file.src_uri)

    def moved(match: re.Match[str]) -> str:
        place, mark, heading = match[2].partition("#")
        if not place or "://" in place or place.startswith("mailto:"):
            return match[0]
        target = (path.parent / place).resolve()
        if target.is_dir():  # a site has no lists of files
            target = target / "README.md"
        if not target.is_file():
            return match[0]
        return f"{match[1]}{posixpath.relpath(uri_of(target), here)}{mark}{heading}{match[3]}"

    parts = CODE.split(markdown)
    return "".join(part if part[:1] == "`" else LINK.sub(moved, part) for part in parts)


def uri_of(path: Path) -> str:
    """Where a file is on the site."""
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS).as_posix()
    return f"project/{path.relative_to(ROOT).as_posix()}"


def linked(path: Path) -> Iterator[tuple[Path, str]]:
    """Files that a page links to, with the heading."""
    for part in CODE.split(path.read_text(encoding="utf-8")):
        if part[:1] == "`":
            continue
        for _, link, _ in LINK.findall(part):
            place, _, heading = link.partition("#")
            if place and "://" not in place and not place.startswith("mailto:"):
                target = (path.parent / place).resolve()
                yield (target / "README.md" if target.is_dir() else target), heading


# -- references ------------------------------------------------------------------------------------


def command_line() -> str:
    """Every command with its options, as `--help` says them."""
    import typer

    from cosim.cli.app import app

    root: Any = typer.main.get_command(app)
    parts = ["# Command line", root.help, "Every command has `--help`; exit code 0 is done, 1 the "
             "work failed, 2 wrong usage or input."]  # fmt: skip
    for name, command in commands(root, "cosim"):
        parts += [f"## `{name}`", command.help or "", *_parameters(command)]
    return "\n\n".join(parts) + "\n"


def commands(group: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Commands of a group and of those in it, by full name."""
    for key, command in sorted(group.commands.items()):
        if hasattr(command, "commands"):
            yield from commands(command, f"{name} {key}")
        else:
            yield f"{name} {key}", command


def _parameters(command: Any) -> Iterator[str]:
    """A table of a command's arguments and options."""
    rows = []
    kinds = {float: "NUMBER", int: "NUMBER", Path: "PATH", str: "TEXT"}
    hints = get_type_hints(command.callback)
    for parameter in command.params:
        if parameter.name == "help":
            continue
        if parameter.param_type_name == "argument":
            name = f"`{parameter.metavar or parameter.name}`"
        else:
            name = ", ".join(f"`{text}`" for text in parameter.opts)
            asked = get_args(hints[parameter.name]) or (hints[parameter.name],)
            shown = parameter.metavar or kinds.get(asked[0], "")
            name += f" `{shown}`" if shown else ""
        help_ = getattr(parameter, "help", None) or ""
        default = parameter.default
        if default not in (None, False, ()) and not callable(default):
            help_ += f" Default: `{default}`."
        rows.append(f"| {name} | {_cell(help_)} |")
    if rows:
        yield "\n".join(["| argument or option | meaning |", "|---|---|", *rows])


def _cell(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|").strip()


def mapping_keys() -> str:
    """Keys of a `dataset.toml` and the kinds of their values, as they are checked."""
    from cosim.calibrate import schema

    tables: list[tuple[str, Mapping[str, Any]]] = [
        ("At the top", schema.MAPPING),
        ("`[channels.NAME]`", schema.CHANNEL), ("`[inputs]`", schema.INPUT),
        ("`[columns]`", schema.COLUMN), ("`[parameter]`", schema.PARAMETER),
        ("`[[run]]`", schema.RUN), ("`[search]`", schema.SEARCH), ("`[checks]`", schema.CHECKS),
    ]  # fmt: skip
    parts = [
        "# Keys of a mapping",
        "Every key of a `dataset.toml`, with the kind of its value; another key or kind is an "
        "error with near names. How they work together: [Data sets](../datasets.md).",
    ]
    for title, keys in tables:
        told = max(_meanings(), key=lambda known: len(set(known) & set(keys)))
        if 2 * len(set(told) & set(keys)) < len(keys):  # a table of other things
            told = {}
        said = {k: re.sub(r"\]\((?=[\w.]+\.md)", "](../", text) for k, text in told.items()}
        rows = [f"| `{k}` | {_kind(check)} | {said.get(k, '')} |" for k, check in keys.items()]
        parts += [f"## {title}", "\n".join(["| key | value | meaning |", "|---|---|---|", *rows])]
    return "\n\n".join(parts) + "\n"


def _meanings() -> list[dict[str, str]]:
    """Tables of keys and meanings in the page of data sets."""
    found: list[dict[str, str]] = []
    before = ""
    for line in (DOCS / "datasets.md").read_text(encoding="utf-8").splitlines():
        if line[:1] == "|" and before[:1] != "|":
            found.append({})
        cells = line.strip("| ").split(" | ", 1)
        if line[:1] == "|" and len(cells) == 2:
            keys = re.findall(r"`\[*([\w.]+?)(?:\.NAME)?\]*(?: = \w+)?`", cells[0])
            found[-1] |= dict.fromkeys(keys, cells[1].strip())
        before = line
    return found


def _kind(check: Any) -> str:
    """What a check asks for, as it says where it refuses a value."""
    from cosim.errors import ScenarioError

    try:
        check(None, "value")
    except ScenarioError as error:
        said = re.search(r"must be (.*), not |is not known; (.*)$", str(error))
        return _cell(said[1] or said[2]) if said else _cell(str(error))
    return "anything"


def python() -> str:
    """The Python interface; mkdocstrings writes it from the docstrings."""
    parts = ["# Python", "What is meant to be used from Python."]
    for title, names in PYTHON.items():
        parts.append(f"## {title}")
        for name in names:
            home = location(name)
            parts.append(f"::: {home}\n    options:\n      heading_level: 3")
    return "\n\n".join(parts) + "\n"


def location(name: str) -> str:
    """Where an object is defined: static readers do not follow names that are loaded when used."""
    import importlib

    if name == "cosim.errors":
        return name
    module, _, item = name.rpartition(".")
    found = getattr(importlib.import_module(module), item)
    return f"{found.__module__}.{found.__qualname__}"


if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))
