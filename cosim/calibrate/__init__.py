"""Calibration: estimate declared parameters of a system from measured runs."""

from .mapping import read_problem
from .parts import Channel, MeasuredRun, Parameter, Sensitivity
from .problem import Problem
from .simulator import Simulator

__all__ = [
    "Channel",
    "MeasuredRun",
    "Parameter",
    "Problem",
    "Sensitivity",
    "Simulator",
    "read_problem",
]
