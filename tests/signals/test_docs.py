"""The committed pages say what the declarations say."""

from __future__ import annotations

import re

import pytest

from cosim.spec.units import parse
from sources import tables
from sources.effect import KINDS
from sources.variant import build_model, components, effects, fidelities

COMPONENTS = sorted(components())


@pytest.mark.parametrize("name", COMPONENTS)
def test_component_page_is_up_to_date(name: str) -> None:
    path = tables.DOCS / "components" / f"{name}.md"
    message = f"docs/components/{name}.md is out of date; run {tables.COMMAND}"
    assert path.exists(), message
    assert path.read_text(encoding="utf-8") == tables.component_page(name), message


@pytest.mark.parametrize("page", ["effects.md", "components/index.md"])
def test_page_over_all_is_up_to_date(page: str) -> None:
    text = tables.effects_page() if page == "effects.md" else tables.index_page()
    path = tables.DOCS / page
    message = f"docs/{page} is out of date; run {tables.COMMAND}"
    assert path.exists() and path.read_text(encoding="utf-8") == text, message


def test_no_page_is_left_of_a_component_that_is_gone() -> None:
    assert not tables.orphans(), f"run {tables.COMMAND}"


def test_pages_name_every_variable_balance_and_device_value() -> None:
    page = tables.component_page("encoder")
    model = build_model("encoder/counts")
    for variable in model.variables.values():
        name = variable.name.partition("[")[0]
        assert f"| `{name}`" in page or f"| `{name}[" in page
    assert "| `speed` | signal | rad/s | value |" in page and "`noise`" in page
    assert "| `n` | 41644 | 1 |" in page  # a device value, six digits
    assert "assumed" in tables.component_page("trajectory")


def test_effects_page_has_every_effect_and_kind() -> None:
    page = tables.effects_page()
    for name in effects():
        assert f"## `{name}`" in page
    for kind in KINDS:
        assert f"| `{kind}` |" in page


@pytest.mark.slow
def test_names_have_the_units_of_the_conventions() -> None:
    text = (tables.DOCS / "conventions.md").read_text(encoding="utf-8")
    section = text.split("## Names")[1].split("| suffix")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \|", section, flags=re.MULTILINE)
    allowed = {
        name: {parse(unit).exponents for unit in units.strip().split(", ")} for name, units in rows
    }
    assert len(allowed) > 30
    used = set()
    for component in COMPONENTS:
        for fidelity in fidelities(component):
            for variable in build_model(f"{component}/{fidelity}").variables.values():
                name = variable.quantity.name
                if name in allowed and component != "adapter":  # its u is what it passes on
                    used.add(name)
                    assert parse(variable.quantity.unit).exponents in allowed[name], (
                        f"{component}/{fidelity}: {name} is in {variable.quantity.unit}"
                    )
    assert len(used) > 25
