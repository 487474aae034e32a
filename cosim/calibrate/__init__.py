"""Calibration: estimate declared parameters of a system from measured runs."""

from .mapping import read_problem
from .problem import Channel, Parameter, Problem, Run, Sensitivity

__all__ = ["Channel", "Parameter", "Problem", "Run", "Sensitivity", "read_problem"]
