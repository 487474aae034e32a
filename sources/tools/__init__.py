"""Calculations on numbers that need no simulation: identification, calibration, classification."""
