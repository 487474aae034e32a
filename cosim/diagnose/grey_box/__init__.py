"""A law from data where the catalogue has none: smooth curves at a place, through the FMU."""

from .bench import Site, site
from .chain import unnamed
from .result import LawFromData
from .single import Begun, single

__all__ = ["Begun", "LawFromData", "Site", "single", "site", "unnamed"]
