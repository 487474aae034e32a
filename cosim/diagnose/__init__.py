"""From logs to the name of the missing physics: calibrate, test, attribute, add, judge."""

from .diagnosis import diagnose
from .result import Diagnosis

__all__ = ["Diagnosis", "diagnose"]
