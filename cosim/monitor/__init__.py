"""Many logs of one machine: what has changed, since when, and what it is."""

from .monitor import monitor
from .result import Monitored
from .series import Series, read_series

__all__ = ["Monitored", "Series", "monitor", "read_series"]
