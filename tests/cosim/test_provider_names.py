"""A folder of FMUs finds what the builder wrote, however long the variant's name."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import FolderProvider
from cosim.errors import VariantError
from sources.packaging.ready import target_path
from sources.variant import parse_name


@pytest.mark.parametrize("effects", [1, 12, 40])  # 25, 190 and 610 characters
def test_names_of_any_length_are_found(tmp_path: Path, effects: int) -> None:
    variant = "gearbox/ratio" + "+coulomb@flange" * effects
    path = target_path(parse_name(variant), tmp_path, 2, "native")
    path.parent.mkdir()
    path.touch()
    assert FolderProvider(tmp_path).path(variant) == path
    with pytest.raises(VariantError, match="has no FMU of"):
        FolderProvider(tmp_path).path(variant + "+viscous")
