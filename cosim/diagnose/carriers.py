"""The FMUs that carry what was found."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from ..calibrate.problem import Problem
from ..errors import CosimError
from ..files import atomic
from ..system.provider import locate
from .candidates import Candidate


def leave_fmus(
    problem: Problem, effects: Sequence[Candidate], out: Path, warnings: list[str]
) -> list[Path]:
    """Copy the FMUs that carry effects into a folder; what cannot be is added to the warnings."""
    model = problem.model
    for item in effects:
        model = model.changed(item.change)
    files = []
    for name in dict.fromkeys(n for item in effects for n in item.change):
        try:
            source = locate(model.instances[name], problem.provider)
        except CosimError as error:
            warnings.append(str(error))
            continue
        target = out / "fmus" / source.name
        with atomic(target) as temporary:
            shutil.copyfile(source, temporary)
        files.append(target)
    return files
