"""Reports of diagnoses and calibrations as web pages that need nothing else."""

from .page import write_page

__all__ = ["write_page"]
