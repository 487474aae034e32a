"""Run systems of FMUs, compare them with measurements, and ask what is missing."""
