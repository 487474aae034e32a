"""Runs scenarios: checks, comparisons, tables and plots of what came out."""
