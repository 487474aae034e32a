"""Inertia that nothing takes, and mass that a swapped fidelity is without, are said."""

from __future__ import annotations

import pytest

from cosim.errors import FmuFileError
from cosim.fmu.metadata import parse_metadata
from cosim.master.master import Master
from cosim.running.runner import run
from cosim.system.system import System


def geared(provider, gearbox: str, *, taken: bool) -> System:
    system = System("bench", provider)
    system.add("gearbox", gearbox, {"tau_a": 0.0})
    system.add("load", "inertia/disc")
    system.connect("gearbox.tau_b", "load.tau")
    system.connect("load.w", "gearbox.w_b")
    if taken:
        system.connect("gearbox.J_b", "load.J_added")
    return system


@pytest.mark.parametrize("isolate", [None, 30.0])
def test_a_rotor_that_no_load_carries_is_said(provider, isolate) -> None:
    system = geared(provider, "gearbox/ratio", taken=False)
    (note,) = Master(system, step=1e-3, isolate=isolate).run(0.01).notes
    assert note == (
        "gearbox.J_b = 0.0207 kg.m2 is taken by nothing (inertia that the load carries for the "
        "rotor, as seen at flange b): it is missing from the motion; connect it"
    )
    with_notes = Master(geared(provider, "gearbox/ratio", taken=True), step=1e-3).run(0.01)
    assert with_notes.notes == ()


def test_a_gearbox_that_carries_its_rotor_itself_has_nothing_to_pass_on(provider) -> None:
    system = geared(provider, "gearbox/elastic", taken=False)
    assert system.untaken() == ["gearbox.J_b"]
    assert Master(system, step=1e-3).run(0.01).notes == ()  # it is 0


def test_rotors_of_an_arm_are_told_together(provider) -> None:
    system = System("drive", provider)
    system.add("drive", "ur5_drive/servo")
    (note,) = Master(system, step=1e-3).run(0.01).notes
    assert note.startswith("drive.J_b = 1.02, 1.02, 1.02, 0.204, 0.204, 0.204 kg.m2 is taken by")


def test_a_swapped_arm_without_mass_is_said(provider) -> None:
    def notes(**variants: str) -> tuple[str, ...]:
        result = run("mobile_manipulator/IN1", provider=provider, variants=variants, duration=0.01)
        return next(iter(result.runs.values())).notes

    (note,) = notes(arm="kinematic")
    assert note == (
        "arm is without the mass of the links (17.7 kg): ur5_arm.ur5e/kinematic leaves it out, and "
        "nothing else carries it"
    )
    assert notes() == ()
    assert notes(arm="rigid_moving") == ()


@pytest.mark.parametrize(
    "text",
    [
        '{"passed_on": ["J_b"]}', '{"passed_on": {"J_b": 1}}', '{"left_out": {}}',
        '{"left_out": [{"what": "mass", "unit": "kg"}]}', '{"left_out": [1]}',
    ],
)  # fmt: skip
def test_metadata_of_another_form_is_refused(text) -> None:
    with pytest.raises(FmuFileError, match=r"component.json: (passed_on|left_out) is not"):
        parse_metadata(text.encode(), "x.fmu")
