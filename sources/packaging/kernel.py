"""Compile the master's executor (`cosim/master/kernel`) as the FMUs are compiled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cosim.spec.cache import sealed

from .cache import keep
from .native import compile_c


def build_kernel(sources: Sequence[Path], target: Path, platform: str) -> Path:
    """Compile the executor for one platform unless `target`, named by its sources, is there whole.

    Args:
        sources: the first is compiled and includes the others.
        target: the library.
        platform: key of `PLATFORMS`.
    """
    if not (target.exists() and sealed(target, target.read_bytes())):
        files = {path.name: path.read_text(encoding="utf-8") for path in sources}
        library = compile_c(files, sources[0].name, target.stem, platform)
        keep(target, library)
    return target
