"""Experiments as data: a system, inputs, an end, and what to compare and check."""
