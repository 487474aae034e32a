"""A law from data where the catalogue has none: smooth curves at a place, through the FMU."""

from .bench import Site, site
from .chain import unnamed
from .result import LawFromData
from .single import Single, single

__all__ = ["LawFromData", "Single", "Site", "single", "site", "unnamed"]
