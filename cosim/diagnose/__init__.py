"""From logs to the name of the missing physics: calibrate, test, attribute, add, judge."""

from .diagnosis import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
