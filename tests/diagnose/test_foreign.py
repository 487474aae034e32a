"""FMUs of others in the loop: adapters change nothing, and say whether something lies inside."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose import diagnose
from cosim.diagnose.answer import Verdict
from cosim.diagnose.candidates import candidates
from cosim.diagnose.facts import Law, Value
from cosim.diagnose.foreign import Adapter, attached
from cosim.diagnose.foreign_file import leave_system
from cosim.diagnose.foreign_words import placed, said
from cosim.diagnose.story.facts import Facts
from cosim.errors import UnitError
from cosim.intake.fan_example import FAN_SOURCE, NOISE, Hidden, bench, write
from cosim.system.toml import read_system
from sources.distribution import contents
from tests.cosim_fmus import slave
from tests.problems import simulator
from tests.tiny_fmus import V, tiny

ADAPTERS = (
    Adapter("fan_tau", "torque", "fan", "fan.tau", "output", "N.m"),
    Adapter("fan_w", "signal", "fan", "fan.w", "input", "rad/s"),
    Adapter("fan_tau_sensor", "signal", "fan", "fan.tau", "sensor", "N.m"),
)
ASKED = ("viscous", "coulomb", "gain", "winding_heating")
"""Effects that the short diagnoses try: true ones, and rivals on the other side."""


@pytest.fixture(scope="module")
def fan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return slave(tmp_path_factory.mktemp("fan"), "Fan", FAN_SOURCE, "pythonfmu")


def data(fan: Path, folder: Path, hidden: Hidden, **options: Any) -> Problem:
    """A short data set of the bench."""
    write(folder, hidden, duration=3.0, purposes=("identification", "validation"), **options)
    (folder / "Fan.fmu").write_bytes(fan.read_bytes())
    return read_problem(folder)


@pytest.fixture(scope="module")
def clean(fan: Path, tmp_path_factory: pytest.TempPathFactory) -> Problem:
    return data(fan, tmp_path_factory.mktemp("clean"), Hidden())


def test_the_bench_has_the_speed_at_which_its_torques_balance() -> None:
    # at rest u = R i + K w and K i = k w^2; noise over 100 samples: 4 sigma of their mean
    rows = bench(1, duration=1.0)
    held = rows[80:100]
    u = float(held[0, 1])
    w = np.roots([4e-6 * 1.2 / 0.05 * np.sign(u), 0.05, -u])
    expected = float(w[np.argmin(np.abs(w - held[-1, 2]))].real)
    # five mechanical time constants J R / K^2 = 0.14 s after the step: 0.6 % of a speed of 240
    assert held[-1, 2] == pytest.approx(expected, abs=4 * NOISE[0] + 1.5)


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_a_system_with_adapters_gives_the_same_numbers(clean: Problem, algorithm: str) -> None:
    problem = clean.changed(algorithm=algorithm)
    changed, adapters = attached(problem)
    assert {(a.at, a.role) for a in adapters} == {
        ("fan.tau", "output"), ("fan.w", "input"), ("fan.tau", "sensor"), ("rotor.w", "sensor"),
    }  # fmt: skip
    for (name, plain), (other, through) in zip(
        simulator(problem, 2).residuals(problem.nominal, None),  # in processes of its own
        simulator(changed).residuals(problem.nominal, None),
        strict=True,
    ):
        assert name == other
        np.testing.assert_array_equal(plain, through)


def test_effects_find_a_place_at_an_fmu_without_sources(clean: Problem) -> None:
    before = {c.label for c in candidates(clean)}
    changed, _ = attached(clean)
    found = {c.label for c in candidates(changed)}
    assert not any("fan" in label for label in before)
    assert {"viscous at fan_tau.inside", "delay at fan_w.value",
            "gain at fan_tau_sensor.value"} <= found - before  # fmt: skip
    assert attached(changed)[1] == (), "adapters get no adapters"


def test_effects_on_a_signal_have_its_unit(clean: Problem) -> None:
    changed = attached(clean)[0].with_effects({"fan_w": "+bias@value+gain@value"})
    units = {p.name: p.unit for p in changed.parameters}
    assert units["fan_w.value.bias.bias"] == "rad/s"
    assert units["fan_w.value.gain.error"] == "1"


def test_a_system_of_our_own_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(
        'connections = ["motor.tau -> load.tau", "load.w -> motor.w"]\n'
        '[instances]\nmotor = "bare_motor/winding"\nload = "inertia/disc"\n'
    )
    problem = _problem(tmp_path, "load.w")
    changed, adapters = attached(problem)
    assert changed is problem and adapters == ()


def test_friction_in_an_fmu_that_gives_motion_brakes_it(tmp_path: Path) -> None:
    variables = [
        V("torque", "Float64", "input", "0"), V("omega", "Float64", "output"),
    ]  # fmt: skip
    step = "v->r[1][0] += h * v->r[0][0] / 3e-4;"
    tiny(tmp_path, variables, step=step, name="flywheel")
    (tmp_path / "bench.toml").write_text(
        'connections = ["motor.tau -> load.torque", "load.omega -> motor.w"]\n'
        '[instances]\nmotor = "bare_motor/winding"\nload = "flywheel.fmu"\n'
    )
    problem = _problem(tmp_path, "load.omega")
    changed, adapters = attached(problem)
    assert [(a.at, a.fidelity, a.inside) for a in adapters[:2]] == [
        ("load.torque", "torque", True), ("load.omega", "signal", True),
    ]  # fmt: skip
    brake = changed.with_effects({"load_torque": "+viscous@inside"})
    (b,) = (p for p in brake.parameters if p.strength)
    free, braked = (simulator(brake).simulate(np.array([v]), "run")[-1, 0] for v in (0.0, 5e-4))
    assert b.name == "load_torque.inside.viscous.b"
    # K^2 / R is 5e-4 N.m.s/rad of the bare motor: as much friction halves the speed
    assert 0.0 < braked < 0.9 * free


UNITS = (
    '<UnitDefinitions><Unit name="N.mm"><BaseUnit kg="1" m="2" s="-2" factor="0.001"/></Unit>'
    '<Unit name="rpm"><BaseUnit rad="1" s="-1" factor="0.10471975511965977"/></Unit>'
    "</UnitDefinitions>"
)


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_units_of_an_fmu_without_sources_are_converted_once(tmp_path: Path, algorithm: str) -> None:
    variables = [
        V("torque", "Float64", "input", "0", inner='unit="N.mm"'),
        V("omega", "Float64", "output", inner='unit="rpm"'),
    ]
    step = "v->r[1][0] += h * v->r[0][0] * 1e-3 / 3e-4 * 30 / 3.141592653589793;"
    tiny(tmp_path, variables, step=step, name="flywheel", definitions=UNITS)
    (tmp_path / "bench.toml").write_text(
        'connections = ["motor.tau -> load.torque", "load.omega -> motor.w"]\n'
        '[instances]\nmotor = "bare_motor/winding"\nload = "flywheel.fmu"\n'
    )
    problem = _problem(tmp_path, "load.omega").changed(algorithm=algorithm)
    changed, adapters = attached(problem)
    assert [a.unit for a in adapters] == ["N.m", "rpm", "rpm"]
    plain, through = (simulator(p).simulate(p.nominal, "run") for p in (problem, changed))
    assert plain[-1, 0] > 500.0, "it is given in rpm"
    # 1000 steps of some rounding errors each
    np.testing.assert_allclose(through, plain, rtol=1e-12)


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_a_log_drives_an_fmu_without_sources_through_its_adapter(
    tmp_path: Path, algorithm: str
) -> None:
    variables = [V("cmd", "Float64", "input", "0"), V("y", "Float64", "output")]
    tiny(tmp_path, variables, step="v->r[1][0] += h * v->r[0][0];", name="valve")
    (tmp_path / "bench.toml").write_text('[instances]\nvalve = "valve.fmu"\n')
    problem = _problem(tmp_path, "valve.y", "valve.cmd").changed(algorithm=algorithm)
    changed, adapters = attached(problem)
    assert [(a.at, a.role, a.unit) for a in adapters] == [
        ("valve.cmd", "input", ""), ("valve.y", "sensor", ""),
    ]  # fmt: skip
    plain, through = (simulator(p).simulate(p.nominal, "run") for p in (problem, changed))
    assert plain[-1, 0] == pytest.approx(6.0 * 0.99, rel=1e-9)  # rounding of 990 steps
    np.testing.assert_array_equal(through, plain)


def test_vectors_take_an_adapter_for_each_element(tmp_path: Path) -> None:
    def vector(name: str, causality: str) -> V:
        return V(name, "Float64", causality, "0 0" if causality == "input" else None, (2,))

    tiny(tmp_path, [V("u", "Float64", "input", "0"), vector("q", "output")], fmi=3, name="giver",
         step="v->r[1][0] += h * v->r[0][0]; v->r[1][1] -= 2 * h * v->r[0][0];")  # fmt: skip
    tiny(tmp_path, [vector("q", "input"), V("y", "Float64", "output")], fmi=3, name="taker",
         step="v->r[1][0] += v->r[0][0] + 10 * v->r[0][1];")  # fmt: skip
    (tmp_path / "bench.toml").write_text(
        'connections = ["giver.q -> taker.q"]\n'
        '[instances]\ngiver = "giver.fmu"\ntaker = "taker.fmu"\n'
    )
    problem = _problem(tmp_path, "taker.y", "giver.u")
    changed, adapters = attached(problem)
    assert [a.at for a in adapters if a.role == "output"] == ["giver.q[1]", "giver.q[2]"]
    plain, through = (simulator(p).simulate(p.nominal, "run") for p in (problem, changed))
    assert plain[-1, 0] < -100.0
    np.testing.assert_array_equal(through, plain)


def _problem(folder: Path, signal: str, driven: str = "motor.u_set") -> Problem:
    """A problem on a system file, whose log says nothing."""
    (folder / "run.csv").write_text(
        "t,u,w\n" + "".join(f"{0.01 * k:.2f},6.0,{k}\n" for k in range(100))
    )
    (folder / "dataset.toml").write_text(
        'system = "bench.toml"\nstep = 0.001\ntime = "t"\n'
        '[columns]\nu = { unit = "V" }\n'
        f'[inputs]\n"{driven}" = "u"\n'
        f'[channels.w]\nsignal = "{signal}"\nsigma = 1.0\n'
        '[[run]]\nname = "run"\nfile = "run.csv"\npurpose = "identification"\n'
    )
    return read_problem(folder)


def test_a_wheel_carries_what_the_example_asks_for(clean: Problem) -> None:
    asked = set(contents.of_diagnosis(attached(clean)[0]))
    assert "adapter/torque+viscous@inside" in asked
    assert asked <= set(contents.of_diagnosis(contents.beside_foreign(clean.provider)))


# -- words -----------------------------------------------------------------------------------------


def named(place: str, *others: str, kind: str = "effect_found", rivals: Any = ()) -> Verdict:
    """A verdict that names friction at a place, and what does as well."""
    instance, port = place.split(".")
    size = Value("b", "N.m.s/rad", 1e-4, 9e-5, 1.1e-4, 0.0, 1.0, True)
    law = Law("viscous", instance, port, "b", (size,))
    return Verdict(kind, 1, (law,), places={law.label: others} if others else {}, others=rivals)


@pytest.mark.parametrize(
    ("verdict", "text"),
    [
        (
            named("fan_tau.inside"),
            "It lies inside fan, whose FMU has no sources: it shows at fan.tau.",
        ),
        (named("rotor.flange_a"), "It lies outside fan: nothing inside does the same."),
        (named("fan_w.value"), "It acts on the way of fan.w into fan, and not inside the FMU."),
        (named("fan_tau_sensor.value"), "It acts in what is measured of fan.tau, and not inside"),
        (
            named("rotor.flange_a", "fan_tau.inside"),
            "Whether viscous lies inside fan or outside, these runs do not tell (rotor.flange_a or "
            "fan.tau): measure what passes between.",
        ),
        (
            named("fan_tau.inside", kind="confounded", rivals=(("gain at fan_tau.value",),)),
            "It lies inside fan,",
        ),
        (
            named("fan_tau.inside", kind="confounded", rivals=(("coulomb at rotor.flange_a",),)),
            "Whether viscous lies inside fan or outside",
        ),
        (Verdict("nothing_missing"), ""),
    ],
)  # fmt: skip
def test_a_verdict_says_whether_it_lies_inside(verdict: Verdict, text: str) -> None:
    found = said(verdict, [], ADAPTERS)
    assert found.startswith(text) if text else found == ""
    assert said(verdict, [], ()) == "", "systems of our own have no inside"


def test_the_headline_names_both_sides_where_the_runs_do_not_tell() -> None:
    adapters = {a.name: {"where": a.where} for a in ADAPTERS}
    effect = {"effect": "viscous", "place": "fan_tau.inside", "text": "Viscous friction."}
    one = Facts({"adapters": adapters})
    both = {**effect, "other_places": ["viscous at rotor.flange_a", "rotor.flange_a"]}
    assert one.places_in_words(effect) == "inside fan, at fan.tau"
    assert one.places_in_words(both) == "inside fan, at fan.tau or at the flange a of the rotor"
    plain = Facts({})
    assert plain.places_in_words({**both, "place": "load.flange"}) == "at the flange of the load"


def test_a_free_force_says_whether_it_lies_inside() -> None:
    def place(label: str, evidence: float, explained: float = 0.9) -> Any:
        curves = [SimpleNamespace(explained=explained)]
        return SimpleNamespace(
            label=label, instance=label.partition(".")[0], evidence=evidence, curves=curves
        )

    fan, rotor, verdict = place("fan_tau.inside", 900.0), place("rotor.flange_a", 500.0), Verdict(
        "unexplained"
    )  # fmt: skip
    assert said(verdict, [fan, rotor], ADAPTERS).startswith("It lies most likely inside fan")
    near = place("rotor.flange_a", 899.0)
    open_ = (
        "Whether it lies inside fan or outside, these runs do not tell (fan.tau or rotor.flange_a"
    )
    assert said(verdict, [fan, near], ADAPTERS).startswith(open_)
    assert said(verdict, [place("rotor.flange_a", 2e3), fan], ADAPTERS) == ""
    assert said(verdict, [place("fan_tau.inside", 900.0, 0.3)], ADAPTERS) == ""


def test_a_law_is_made_at_a_variable_of_an_fmu_without_sources() -> None:
    assert placed("fan.tau", ADAPTERS) == "fan_tau.inside"
    assert placed("fan.w", ADAPTERS) == "fan_w.value"
    assert placed("rotor.flange_a", ADAPTERS) == "rotor.flange_a"


# -- the system with what was found ----------------------------------------------------------------


def test_the_system_with_its_adapter_can_be_run(clean: Problem, tmp_path: Path) -> None:
    problem, adapters = attached(clean)
    made = {
        "variants": {"fan_tau": "adapter/torque+viscous@inside"},
        "values": {"fan.k": 4e-6, "fan_tau.inside.viscous.b": 1e-4},
    }
    warnings: list[str] = []
    (path,) = leave_system(problem, adapters, made, tmp_path, warnings)
    file = read_system(path)
    assert warnings == [] and set(file.instances) == {"motor", "rotor", "fan", "fan_tau"}
    system = file.build(clean.provider)
    assert system.members["fan_tau"].parameters["inside.viscous.b"] == 1e-4
    assert system.driver("rotor.tau_b") == "fan_tau.y" and system.driver("fan.w") == "rotor.w"
    assert leave_system(problem, adapters, {**made, "variants": {}}, tmp_path, warnings) == []


def test_a_factor_that_units_do_not_say_is_named(clean: Problem, tmp_path: Path) -> None:
    problem, adapters = attached(clean)
    file = problem.file
    wires = [w._replace(factor=2.0) if w.target == "rotor.tau_b" else w for w in file.connections]
    model = replace(problem.model, file=replace(file, connections=tuple(wires)))
    made = {"variants": {"fan_tau": "adapter/torque+viscous@inside"}, "values": {}}
    warnings: list[str] = []
    assert leave_system(problem.changed(model=model), adapters, made, tmp_path, warnings) == []
    assert warnings[0].startswith("system.toml is not written: fan_tau.y -> rotor.tau_b has the ")


def test_an_adapter_takes_a_signal_of_any_unit_and_others_do_not(clean: Problem) -> None:
    system = clean.model.system({})
    system.add("way", "adapter/signal")
    system.add("push", "adapter/torque")
    system.connect("motor.i", "way.u")
    with pytest.raises(UnitError, match=r"connect motor.i to push.w: unit 'A' .* into 'rad/s'"):
        system.connect("motor.i", "push.w")


# -- diagnoses ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "place", "words"),
    [
        (Hidden(fan_viscous=2e-4), "fan_tau.inside", "It lies inside fan"),
        (Hidden(motor_coulomb=0.006), "rotor.flange_a", "It lies outside fan"),
        (Hidden(), "", ""),
    ],
    ids=["in the fan", "in the motor", "nowhere"],
)
def test_what_is_missing_is_placed(
    fan: Path, tmp_path: Path, hidden: Hidden, place: str, words: str
) -> None:
    problem = data(fan, tmp_path, hidden)
    known = {c.effect for c in candidates(attached(problem)[0])}
    result = diagnose(problem, without=known - set(ASKED))
    assert result.verdict == ("effect_found" if place else "nothing_missing")
    assert [law.place for law in result.answer.laws] == ([place] if place else [])
    assert words in result.reason
    if place:  # five standard deviations, of a 95 % interval of four
        size = result.answer.laws[0].size
        true = hidden.fan_viscous or hidden.motor_coulomb
        assert abs(size.value - true) < 5.0 / 4.0 * (size.high - size.low)
