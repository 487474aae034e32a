"""Simulators of calibration problems that share their sessions among the tests."""

from __future__ import annotations

from cosim.calibrate.pool import SessionPool
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator

SESSIONS = SessionPool()


def simulator(problem: Problem, workers: int | None = None) -> Simulator:
    """Without limits on work; as many threads as this worker of the tests has processors."""
    return Simulator(problem, workers=workers, pool=SESSIONS)
