"""Every fidelity of the crawler with every effect: energy, absence at strength 0, rest."""

from __future__ import annotations

import pytest

from tests.attachments import attachable, check_absence, check_energy, check_presence, check_rest

pytestmark = pytest.mark.slow

PLAIN = [
    "crawler/two_wheeled",
    "crawler/slip_law",
    "crawler/skid",
    "crawler.lab/track_contact",
]
CASES = [name for plain in PLAIN for name in attachable(plain)]


def test_the_asked_effects_attach() -> None:
    contact = "crawler.lab/track_contact+"
    for wanted in (
        "gain@speed_left",
        "gain@speed_right",
        "friction_asymmetry@mu",
        "friction_anisotropy@mu_lateral",
        "low_friction_patch@mu",
        "load_shift@load",
        "payload@body",
        "floor_slope@body",
        "cable_force@body",
        "turning_friction@body",
        "pivot_torque@pivot",
        "coulomb@sprocket_left",
    ):
        assert contact + wanted in CASES
    for plain in PLAIN:
        assert f"{plain}+gain@speed_left" in CASES


@pytest.mark.parametrize("name", PLAIN)
def test_plain(name: str) -> None:
    check_energy(name)
    check_rest(name)


def test_energy_with_every_parameter_off_its_zero() -> None:
    check_energy("crawler.lab/track_contact", x_G=0.03, y_G=-0.01, f_r=0.05)


@pytest.mark.parametrize("name", CASES)
def test_effect(name: str) -> None:
    check_energy(name)
    check_absence(name)
    check_rest(name)
    # a curve over a toe is one over what is 0
    if "track_contact" in name and "fitted_law@toe" not in name:
        check_presence(name)
