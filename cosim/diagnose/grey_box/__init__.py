"""A law from data where the catalogue has none: smooth curves at a place, through the FMU."""
