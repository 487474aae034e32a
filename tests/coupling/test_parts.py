"""The base in parts, coupled by the master, against the packed base; a foreign wheel in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.master.master import Master
from cosim.system.toml import read_system
from cosim.system.variants import apply
from tests.cosim_fmus import slave

SYSTEMS = Path(__file__).parents[2] / "scenarios" / "systems"
DURATION = 0.4
"""From rest, at 0.4 m/s2 into an arc, in which the casters swivel [s]."""
RASTER = 2e-3
ALLOWED = np.array([3e-5, 3e-5, 5e-5, 6e-3, 6e-3])
"""One tenth of the sensors' noise, as in docs/coupling.md [m, m, rad, A, A]."""

TYRE = '''
from math import atan, exp, hypot, sin

from pythonfmu import Fmi2Causality as C, Fmi2Slave, Real


class {name}(Fmi2Slave):
    """A driven wheel; `shape` 0: friction as wheel_contact/stick_slip, else a magic formula."""

    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.f_x = self.f_y = self.m_z = self.w = self.phi = 0.0
        for item in ("tau", "J_added", "v_x", "v_y", "w_z", "f_n", "x_w", "y_w"):
            setattr(self, item, 0.0)
            self.register_variable(Real(item, causality=C.input))
        for item in ("f_x", "f_y", "m_z", "w", "phi"):
            self.register_variable(Real(item, causality=C.output))
        self.shape, self.mu_s, self.mu_d, self.v_c, self.r = 0.0, 0.7, 0.5, 0.002, 0.1
        for item in ("shape", "mu_s", "mu_d", "v_c", "r"):
            self.register_variable(Real(item, causality=C.parameter, variability="tunable"))

    def force(self, w):
        s_x, s_y = self.v_x - self.r * w, self.v_y
        s = hypot(s_x, s_y) + 1e-12
        q = s / self.v_c
        if self.shape:
            mu = self.mu_s * sin(self.shape * atan(q))
        elif q <= 1.0:
            mu = self.mu_s * q * (3.0 - q * q) / 2.0
        else:
            mu = self.mu_d + (self.mu_s - self.mu_d) * exp(-(((q - 1.0) / 2.0) ** 2))
        return -mu * self.f_n * s_x / s, -mu * self.f_n * s_y / s

    def do_step(self, time, size):
        inertia, begin = 0.00716 + self.J_added, self.w
        for _ in range(5):
            rest = inertia * (self.w - begin) - size * (self.tau - self.r * self.force(self.w)[0])
            more = self.force(self.w + 1e-7)[0] - self.force(self.w)[0]
            self.w -= rest / (inertia + size * self.r * more / 1e-7)
        self.phi += 0.5 * size * (begin + self.w)
        self.f_x, self.f_y = self.force(self.w)
        return True
'''


def signals(body: str) -> list[str]:
    return [*(f"{body}.{n}" for n in ("x", "y", "phi")), "motor_left.i", "motor_right.i"]


def go(provider, name: str, step: float, changes: dict[str, str], values: dict[str, Any],
       algorithm: str = "gauss_seidel", **options: Any) -> Recording:  # fmt: skip
    """The start of an arc, every 2 ms; solvers inside the FMUs are sharp unless `values` say."""
    document = read_system(SYSTEMS / f"{name}.toml")
    changes = {"path": "trajectory.cn1/world", **changes}
    system = replace(document, instances=apply(document.instances, changes, provider)).build(
        provider
    )
    for instance, member in system.members.items():
        if "solver.tolerance" in member.description.variables:
            system.set(f"{instance}.solver.tolerance", 1e-8)
    for key, value in {"path.t_0": 0.0, "path.a": 0.4, **values}.items():
        system.set(key, value)
    body = "base" if name == "mir250" else "body"
    master = Master(system, algorithm, step, options=options)
    return master.run(DURATION, record=signals(body), every=round(RASTER / step))


def packed(provider, changes: str = "", **values: Any) -> Recording:
    values = {f"base.{key}": value for key, value in values.items()}
    base = {"base": f"planar{changes}"}
    return go(provider, "mir250", 1e-4, base, values, extrapolation=2)


def parts(provider, step: float, changes: dict[str, str] | None = None,
          values: dict[str, Any] | None = None, **options: Any) -> Recording:  # fmt: skip
    return go(provider, "mir250_parts", step, changes or {}, values or {}, **options)


def apart(found: Recording, exact: Recording) -> np.ndarray:
    """Largest differences, in units of what coupling may add."""
    return np.max(np.abs(found.values - exact.values), axis=0) / ALLOWED


@pytest.fixture(scope="module")
def whole() -> Recording:
    from tests.coupling.conftest import Built

    return packed(Built())


def test_the_base_in_parts_comes_nearer_to_the_packed_one_with_the_step(provider, whole) -> None:
    steps = np.array([5e-4, 2.5e-4, 1.25e-4])
    runs = [parts(provider, h, extrapolation=1) for h in steps]
    errors = np.array([np.max(apart(found, whole)) for found in runs])
    assert errors[0] < 1.0  # twice the scenario's step, and still a tenth of the noise
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    # 2 where all is smooth; the path starts with a jump of acceleration, which costs up to one
    assert 1.0 < order < 2.3
    invented = [abs(sum(found.bond_energy.values())) for found in runs]
    # two ends that differ by h^2 of a power that does not
    assert np.polyfit(np.log(steps), np.log(invented), 1)[0] == pytest.approx(2.0, abs=0.2)


def test_plain_exchange_does_not_carry_the_contacts(provider, whole) -> None:
    found = parts(provider, 2.5e-4)
    assert np.max(apart(found, whole)) > 10.0


def test_iteration_carries_the_contacts_at_eight_times_the_step(provider, whole) -> None:
    options = {"interpolation": 1, "tolerance": 1e-5}
    found = parts(provider, 2e-3, algorithm="iterated", **options)
    assert np.max(apart(found, whole)) < 1.0
    explicit = parts(provider, 2e-3, extrapolation=1)
    assert np.max(apart(explicit, whole)) > 10.0
    # settled to 1e-5: what both ends of a bond say differs by so much of what went over
    turnover = sum(found.bond_turnover.values())
    assert abs(sum(found.bond_energy.values())) < 1e-5 * turnover


def test_dry_friction_in_the_swivels_turns_the_base_in_parts_as_the_packed_one(
    provider, whole
) -> None:
    angles = {"fl": 2.9, "fr": 2.0, "rl": -2.6, "rr": 1.5}
    start = {f"caster_{c}.swivel_angle": angle for c, angle in angles.items()}
    friction = {"tau_c": 0.5, "w_0": 0.02}
    exact = packed(
        provider,
        "+coulomb@caster.swivel",
        **start,
        **{f"caster.swivel.coulomb.{k}": v for k, v in friction.items()},
    )
    each = {f"caster_{c}.swivel.coulomb.{k}": v for c in angles for k, v in friction.items()}
    found = parts(
        provider, 2.5e-4, {"caster": "+coulomb@swivel"}, {**start, **each}, extrapolation=1
    )
    assert np.max(apart(found, exact)) < 1.0
    assert np.max(apart(exact, packed(provider, **start))) > 10.0  # it does something


@pytest.fixture(scope="module")
def tyre(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return slave(tmp_path_factory.mktemp("tyre"), "Tyre", TYRE, "pythonfmu")


def test_a_foreign_wheel_with_the_law_of_ours_drives_as_ours(provider, whole, tyre) -> None:
    found = parts(provider, 2.5e-4, {"wheel_contact": str(tyre)}, extrapolation=1)
    # its spin is by implicit Euler: first order, half a step of 2 A in the ramp of 0.1 s
    assert np.max(apart(found, whole)) < 2.0


def test_a_foreign_wheel_with_another_law_drives_otherwise(provider, whole, tyre) -> None:
    weak = {f"wheel_{side}.{k}": v for side in ("left", "right")
            for k, v in {"shape": 1.3, "mu_s": 0.01}.items()}  # fmt: skip
    found = parts(provider, 2.5e-4, {"wheel_contact": str(tyre)}, weak, extrapolation=1)
    # 98 kg on six like springs, a third of it on the drive wheels: at most this acceleration, and
    # at full slip 0.89 of it (sin(1.3 pi/2)); the first slip takes some hundredths of a second
    most = 0.01 * 9.81 / 3.0 * DURATION**2 / 2.0
    assert 0.8 * most < found["body.x"][-1] < most < 0.1 * whole["base.x"][-1]
