"""What is wrong with an FMU, found without unpacking, loading or running anything of it."""

from .finding import Finding
from .whole import check

__all__ = ["Finding", "check"]
