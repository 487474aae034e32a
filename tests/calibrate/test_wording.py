"""What is wrong in a mapping is said with the names that are in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cosim.calibrate import Problem
from cosim.calibrate.checks.examine import check_model
from cosim.calibrate.checks.finding import Source, quantity
from cosim.calibrate.mapping import _outputs, find_system
from cosim.errors import ScenarioError, UnknownNameError
from tests.problems import simulator


def test_a_system_beside_the_mapping_is_offered(tmp_path: Path) -> None:
    mapping = tmp_path / "dataset.toml"
    for name in ("dataset.toml", "system.toml", "other.toml"):
        (tmp_path / name).write_text('description = "x"\n[instances]\nload = "inertia/disc"\n')
    with pytest.raises(UnknownNameError, match=r"did you mean 'system.toml'") as error:
        find_system(mapping, "sistem.toml")
    assert "dataset.toml," not in str(error.value).partition("there is no system")[2]
    assert find_system(mapping, "system.toml").path == tmp_path / "system.toml"
    # what comes with cosim is offered by its name, and where there is no file
    with pytest.raises(UnknownNameError, match="motor_bench"):
        find_system(mapping, "motor_bensh")
    empty = tmp_path / "empty" / "dataset.toml"
    empty.parent.mkdir()
    with pytest.raises(UnknownNameError, match="crawler"):
        find_system(empty, "sistem.toml")


def targeting(problem: Problem, target: str, nominal: float) -> Problem:
    """The problem with a further parameter."""
    more = replace(
        problem.parameters[0], name="more", unit="m", nominal=nominal, targets=((target, 1.0),)
    )
    return problem.changed(
        parameters=[*problem.parameters, more], source=Source(path=Path("b/dataset.toml"))
    )


@pytest.mark.parametrize(
    ("target", "nominal", "said"),
    [
        ("motor.radius", 0.05, "has no variable 'radius'"),
        ("motor.R_a", -3.0, "motor.R_a"),
    ],
)
def test_a_model_that_does_not_run_names_the_parameter(
    noisy, target: str, nominal: float, said: str
) -> None:
    problem = noisy(0)
    free = [p for p in problem.parameters if target not in dict(p.targets)]
    [found] = check_model(simulator(targeting(problem.with_parameters(free), target, nominal)))
    assert found.kind == "simulation" and said in found.text
    path = Path("b/dataset.toml")
    assert f"does not run with parameter more ({nominal:g} m) of {path}: " in found.text


def test_a_channel_of_an_open_input_is_refused(noisy) -> None:
    problem = noisy(0)
    _outputs(problem)
    first, *rest = problem.channels
    with pytest.raises(ScenarioError, match=r"signal motor\.w_ref is an input of the system"):
        _outputs(problem.changed(channels=[replace(first, signal="motor.w_ref"), *rest]))


def test_a_number_without_a_unit_ends_with_itself() -> None:
    assert (quantity(0.011, ""), quantity(0.011, "m")) == ("0.011", "0.011 m")
