"""Results in a shell say in a line what they are; arrays are asked for."""

from __future__ import annotations

from dataclasses import replace

import cosim
from cosim.scenario.checks import met


def test_results_say_what_they_are_in_a_line() -> None:
    result = cosim.run("motor_bench/ST1")
    (run,) = result.runs.values()
    assert str(result) == "<Result of motor_bench/ST1: runs 1, 2 of 2 checks met>"
    assert str(run).startswith("<RunResult of motor_bench/ST1: 2 of 2 checks met, <Recording of ")
    assert met(replace(check, unfit="another step") for check in run.checks) == "no checks"
