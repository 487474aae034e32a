"""Who made the FMUs, when, and under which licence: what archives and descriptions say."""

from __future__ import annotations

import importlib.metadata
from functools import lru_cache
from pathlib import Path

from cosim.spec import distribution

LICENSE = Path(__file__).parents[2] / "LICENSE"
"""The licence's text, beside `sources/` in a checkout and in an installed library."""
SPDX = "BSD-3-Clause"
"""Its name in the list of SPDX."""
_FOLDER = "documentation/licenses"


@lru_cache(maxsize=1)
def attributes() -> dict[str, str]:
    """Of `fmiModelDescription`, the same in FMI 2 and 3.

    No date: the same sources give the same bytes.
    """
    line = next(x for x in LICENSE.read_text(encoding="utf-8").splitlines() if "(c)" in x)
    version = distribution.version()
    found = {
        "author": line.split(", ", 1)[1],
        "version": version,
        "copyright": line,
        "license": SPDX,
        "generationTool": f"cosim {version}".rstrip(),
    }
    return {name: text for name, text in found.items() if text}


def files() -> dict[str, bytes]:
    """The licence, where FMI 3 looks for it."""
    return {f"{_FOLDER}/license.txt": LICENSE.read_bytes()}


def pythonfmu() -> dict[str, bytes]:
    """The licence of the libraries that python FMUs take over, where the package brings it."""
    package = importlib.metadata.distribution("pythonfmu")
    text = package.read_text("licenses/LICENSE") or package.read_text("LICENSE")
    return {f"{_FOLDER}/pythonfmu.txt": text.encode()} if text else {}
