"""Hints for searches come out of an FMU as they went in."""

from __future__ import annotations

import json

import pytest

from cosim.spec.hints import SearchHints, from_json, to_json


def test_hints_of_parameters_survive_their_file() -> None:
    hints = {
        "psi": SearchHints(mix="turn"),
        "plain": SearchHints(),
        "n": SearchHints(tries=(1.0, 2.5), cycles="angle"),
        "t_th": SearchHints(decades=(0.5, 1000.0)),
        "t_d": SearchHints(lattice=1e-3, tries=(0.01,)),
        "x_p": SearchHints(visits="pose_x"),
        "position": SearchHints(times="mass"),
    }
    tables = to_json(hints)
    assert list(tables) == ["mixes", "tries", "decades", "cycles", "lattices", "visits", "products"]
    assert list(tables["tries"]) == ["n", "t_d"]
    found = from_json(json.loads(json.dumps({"slots": [], **tables})))
    assert found == {name: item for name, item in hints.items() if name != "plain"}


def test_kinds_of_hints_that_nobody_has_are_left_out() -> None:
    assert to_json({"a": SearchHints()}) == {}
    assert from_json({"variant": "gearbox/ratio"}) == {}


def test_in_a_system_the_variable_that_tells_a_value_has_its_instance() -> None:
    assert SearchHints(visits="pose_x").within("base", "p.patch.x_p").visits == "base.pose_x"
    order = SearchHints(cycles="angle").within("motor", "shaft.cogging.n")
    assert order.cycles == "motor.shaft.cogging.angle"
    assert SearchHints(mix="turn").within("base", "a") == SearchHints(mix="turn")


def test_a_way_of_mixing_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="mix = 'twist' is none of 'turn', 'shift'"):
        SearchHints(mix="twist")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="twist"):
        from_json({"mixes": {"psi": "twist"}})
