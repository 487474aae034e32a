"""Variants under test and their descriptions, made once for all tests of packaging."""

from __future__ import annotations

from functools import lru_cache

from sources.packaging.build import Variant, collect
from sources.packaging.description import describe_fmi2, describe_fmi3


@lru_cache(maxsize=None)
def described(name: str) -> tuple[Variant, dict[str, bytes]]:
    """A variant and its `modelDescription.xml` for FMI 2, for the Python twin and for FMI 3."""
    variant = collect(name)
    arguments = (variant.model, variant.functions, variant.entries)
    common = {"identifier": variant.name.identifier, "name": name, "token": "{0}"}
    return variant, {
        "fmi2": describe_fmi2(*arguments, **common, kind="native"),
        "python": describe_fmi2(*arguments, **common, kind="python"),
        "fmi3": describe_fmi3(*arguments, **common),
    }
