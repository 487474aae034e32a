"""Systems: what they refuse, and what they find out about themselves."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from cosim.errors import (
    ConnectError,
    GraphError,
    ScenarioError,
    UnitError,
    UnknownNameError,
    ValueRangeError,
    VariantError,
)
from cosim.system.feedthrough import components, loops
from cosim.system.provider import FolderProvider
from cosim.system.system import System
from cosim.system.toml import read_system
from tests.cosim.bench import bench
from tests.cosim_fmus import rewrite
from tests.fmus import fmu


def test_names(provider) -> None:
    system = bench(provider)
    with pytest.raises(UnknownNameError, match=r"no instance 'gearbax' .*did you mean 'gearbox'\?"):
        system.connect("motor.tau", "gearbax.tau_a")
    with pytest.raises(UnknownNameError, match=r"no variable 'taub'; did you mean 'tau_b'"):
        system.connect("gearbox.taub", "load.tau")
    with pytest.raises(
        GraphError, match=r"already is an instance 'load' \(inertia.lab_bench/disc\)"
    ):
        system.add("load", "inertia/disc")
    with pytest.raises(GraphError, match=r"'a b' cannot name an instance"):
        system.add("a b", "inertia/disc")


def test_causality_and_double_drivers(provider) -> None:
    system = bench(provider)
    with pytest.raises(
        ConnectError, match=r"load.tau is an input of inertia.lab_bench/disc, not an output"
    ):
        system.connect("load.tau", "motor.w_ref")
    with pytest.raises(ConnectError, match=r"gearbox.ratio is a parameter of .*, not an input"):
        system.connect("motor.tau", "gearbox.ratio")
    with pytest.raises(ConnectError, match=r"motor.w is already driven by gearbox.w_a"):
        system.connect("load.w", "motor.w")
    assert system.driver("motor.w") == "gearbox.w_a"


def test_units_on_connect(provider) -> None:
    system = bench(provider)
    with pytest.raises(
        UnitError, match=r"cannot connect motor.tau to motor.w_ref: unit 'N.m' .*rad/s"
    ):
        system.connect("motor.tau", "motor.w_ref")
    assert system.driver("motor.w_ref") is None


def test_units_are_converted(tmp_path: Path, provider) -> None:
    def in_rpm(text: str) -> str:
        unit = '<Unit name="rpm"><BaseUnit rad="1" s="-1" factor="0.10471975511965977"/></Unit>'
        assert "<UnitDefinitions>" in text
        text = text.replace("<UnitDefinitions>", "<UnitDefinitions>" + unit)
        head, mark, tail = text.partition('name="w_b"')
        return head + mark + tail.replace('unit="rad/s"', 'unit="rpm"', 1)

    path = rewrite(fmu("gearbox/ratio"), tmp_path / "rpm.fmu", xml=in_rpm)
    system = System(provider=provider)
    system.add("load", "inertia/disc")
    system.add("gearbox", str(path))
    system.connect("load.w", "gearbox.w_b")
    (wire,) = system.connections
    assert wire.gain == pytest.approx(30.0 / math.pi, rel=1e-15)  # one rounding
    assert "x 9.54929659" in str(system) and "[rpm]" in str(system)


def test_vectors(provider) -> None:
    system = System(provider=provider)
    system.add("path", "joint_trajectory/swing")
    system.add("drive", "ur5_drive/perfect")
    system.connect("path.q_set", "drive.q_set")
    assert [wire.target for wire in system.connections] == [
        f"drive.q_set[{k}]" for k in range(1, 7)
    ]
    with pytest.raises(ConnectError, match=r"path.q_set\[1\] has 1 elements, drive.q has 6"):
        system.connect("path.q_set[1]", "drive.q")
    assert not [wire for wire in system.connections if wire.target.startswith("drive.q[")]


def test_types(affine: Path) -> None:
    system = System()
    system.add("a", str(affine))
    system.add("b", str(affine))
    system.connect("a.next", "b.n")
    system.connect("a.next", "b.u")
    with pytest.raises(ConnectError, match=r"types Float64 and Boolean2 do not fit"):
        system.connect("a.y", "b.on")


def test_parameters_are_checked(provider) -> None:
    system = bench(provider)
    with pytest.raises(
        ValueRangeError, match=r"gearbox: ratio = 0 is outside its bounds \[0.001, 10000\]"
    ):
        system.set("gearbox.ratio", 0.0)
    with pytest.raises(ValueRangeError, match=r"ratio = nan is not finite"):
        system.set("gearbox.ratio", math.nan)
    with pytest.raises(GraphError, match=r"gearbox.tau_b is an output and cannot be given a value"):
        system.set("gearbox.tau_b", 1.0)
    assert system.members["gearbox"].parameters == {}


def test_variants(provider, tmp_path: Path) -> None:
    with pytest.raises(VariantError, match=r"there is no provider of variants"):
        System().add("gearbox", "gearbox/ratio")
    folder = FolderProvider(fmu("gearbox/ratio").parent.parent)
    assert folder.path("gearbox/ratio") == fmu("gearbox/ratio")
    with pytest.raises(
        VariantError, match=r"has no FMU of 'gearbox/ratia'; did you mean .*gearbox/ratio'"
    ):
        folder.path("gearbox/ratia")


def test_power_bonds(provider) -> None:
    bonds = bench(provider).bonds()
    assert [bond.name for bond in bonds] == [
        "motor.shaft -- gearbox.flange_a",
        "gearbox.flange_b -- load.flange",
    ]
    assert bonds[1].terms == (
        ("gearbox.tau_b", "gearbox.w_b", -1),
        ("load.w", "load.tau", 1),
    )


def test_bonds_are_looked_for_along_connections(provider, monkeypatch) -> None:
    """Each port with each other one would be 10^8 pairs for 12 000 FMUs."""
    system = System("many", provider)
    for k in range(20):
        system.add(f"gearbox{k}", "gearbox/ratio")
        system.add(f"load{k}", "inertia/disc")
        system.connect(f"gearbox{k}.tau_b", f"load{k}.tau")
        system.connect(f"load{k}.w", f"gearbox{k}.w_b")
    pairs: list[str] = []
    terms = System._bond_terms

    def counted(self, giver, *arguments):
        pairs.append(giver.name)
        return terms(self, giver, *arguments)

    monkeypatch.setattr(System, "_bond_terms", counted)
    assert [bond.name for bond in system.bonds()] == [
        f"gearbox{k}.flange_b -- load{k}.flange" for k in range(20)
    ]
    assert len(pairs) == 20


def test_a_half_connected_port_is_no_bond(provider) -> None:
    system = System(provider=provider)
    system.add("gearbox", "gearbox/ratio")
    system.add("load", "inertia/disc")
    system.connect("gearbox.tau_b", "load.tau")
    assert system.bonds() == []


def test_open_inputs_and_print(provider) -> None:
    system = bench(provider)
    assert system.open_inputs() == ["motor.w_ref"]
    text = str(system)
    for part in ("motor = dc_motor.lab_bench/electrical", "gearbox.tau_b -> load.tau [N.m]",
                 "motor.w_ref [rad/s]", "gearbox.flange_b -- load.flange"):  # fmt: skip
        assert part in text
    assert "algebraic loop" not in text


def test_algebraic_loops_are_found_and_explained(provider) -> None:
    system = System(provider=provider)
    for name in ("a", "b"):
        system.add(name, "gearbox/ratio")
    system.connect("a.tau_b", "b.tau_a")
    system.connect("b.tau_b", "a.tau_a")
    (loop,) = system.algebraic_loops()
    assert set(loop) == {"a.tau_a", "a.tau_b", "b.tau_a", "b.tau_b"}
    text = system.explain_loop(loop)
    assert "a.tau_a is direct feedthrough to a.tau_b" in text
    assert "a.tau_b is connected to b.tau_a" in text


def test_graph_order_and_loops() -> None:
    graph = {"a": ["b"], "b": ["c"], "c": ["a", "d"], "d": []}
    assert [sorted(item) for item in components("dcba", graph)] == [["a", "b", "c"], ["d"]]
    assert loops("abcd", graph) == [["a", "b", "c"]]
    assert loops("ab", {"a": ["a"]}) == [["a"]]
    order = [item for (item,) in components("xyz", {"z": ["x"]})]
    assert order.index("z") < order.index("x")


def test_order_follows_direct_feedthrough(provider) -> None:
    system = System(provider=provider)
    system.add("last", "gearbox/ratio")
    system.add("middle", "gearbox/ratio")
    system.add("first", "gearbox/ratio")
    system.connect("first.tau_b", "middle.tau_a")
    system.connect("middle.tau_b", "last.tau_a")
    assert system.order() == ["first", "middle", "last"]


FILE = """
description = "a bench"
connections = ["gearbox.tau_b -> load.tau"]
[instances]
gearbox = "gearbox/ratio"
load = "inertia/disc"
[parameters]
gearbox.ratio = 5.0
"load.J" = 0.2
"""


def test_read_from_toml(provider, tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(FILE)
    system = read_system(path).build(provider, {"gearbox.ratio": 6.0})
    assert system.name == "bench" and system.text == "a bench"
    assert system.members["gearbox"].parameters == {"ratio": 6.0}
    assert system.members["load"].parameters == {"J": 0.2}
    assert system.driver("load.tau") == "gearbox.tau_b"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[instances]", "[instances", "is not TOML"),
        ("description", "descriptio", "unknown key descriptio"),
        ("->", "=>", "is not a connection; write"),
        ('"inertia/disc"', "7", "instance 'load' must be a variant"),
    ],
)
def test_bad_toml(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(ScenarioError, match=message):
        read_system(path)
