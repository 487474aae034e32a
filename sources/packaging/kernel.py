"""Compile the master's executor (`cosim/master/kernel/kernel.c`) as the FMUs are compiled."""

from __future__ import annotations

from pathlib import Path

from .cache import write_atomically
from .native import compile_c


def build_kernel(source: Path, target: Path, platform: str) -> Path:
    """Compile the executor for one platform unless `target` is there (its name holds its hash)."""
    if not target.exists():
        text = source.read_text(encoding="utf-8")
        library = compile_c({source.name: text}, source.name, target.stem, platform)
        write_atomically(target, library)
    return target
