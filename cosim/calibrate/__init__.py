"""Calibration: estimate declared parameters of a system from measured runs."""

from .mapping import read_problem
from .parts import Channel, Parameter, Run, Sensitivity
from .problem import Problem

__all__ = ["Channel", "Parameter", "Problem", "Run", "Sensitivity", "read_problem"]
