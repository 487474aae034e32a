"""Compile the master's executor (`cosim/master/kernel`) as the FMUs are compiled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .cache import write_atomically
from .native import compile_c


def build_kernel(sources: Sequence[Path], target: Path, platform: str) -> Path:
    """Compile the executor for one platform unless `target` is there (its name holds its hash).

    Args:
        sources: the first is compiled and includes the others.
        target: the library.
        platform: key of `native.PLATFORMS`.
    """
    if not target.exists():
        files = {path.name: path.read_text(encoding="utf-8") for path in sources}
        library = compile_c(files, sources[0].name, target.stem, platform)
        write_atomically(target, library)
    return target
