"""The base as a whole: loads, bounce, motion, agreement of the fidelities, interface to the arm."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sources.function import Oracle
from sources.variant import build_model
from tests.base.stiff import Stiff
from tests.support import oracle_of

pytestmark = pytest.mark.slow

PLANAR, SIX_DOF, SPRUNG = "mobile_base/planar", "mobile_base/six_dof", "mobile_base/sprung"
DYNAMIC = (PLANAR, SIX_DOF, SPRUNG)
G = 9.81
ROTOR = {"J_l": 0.0207, "J_r": 0.0207}  # behind the paper's gear
CASTERS = ("caster_fl", "caster_fr", "caster_rl", "caster_rr")
LOSSLESS = {"caster.b_w": 0.0, "caster.b_s": 0.0}


def cross_matrix(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def locked_arm(
    mass: float, centre: np.ndarray, up: np.ndarray, rate: np.ndarray
) -> dict[str, float]:
    """Inputs of a base that carries a point mass at `centre` from the mount, rigidly."""
    c = cross_matrix(centre)
    inertia = mass * np.block([[np.eye(3), -c], [c, -c @ c]])
    force = mass * (np.cross(rate, np.cross(rate, centre)) + G * up)
    bias = [*force, *np.cross(centre, force)]
    upper = inertia[np.triu_indices(6)]
    values = {f"arm_inertia[{k + 1}]": float(value) for k, value in enumerate(upper)}
    return values | {f"arm_bias[{k + 1}]": float(value) for k, value in enumerate(bias)}


def upright(mass: float, centre: np.ndarray) -> dict[str, float]:
    return locked_arm(mass, centre, np.array([0, 0, 1.0]), np.zeros(3))


def moving(variant: str, rng: np.random.Generator) -> dict[str, float]:
    """A random state of motion, wheels near rolling."""
    oracle = oracle_of(variant)
    spread = {"pose_z": 1e-4, "pitch": 0.003, "roll": 0.003, "vel_z": 0.01, "vel_y": 0.02}
    spread |= {"roll_rate": 0.02, "pitch_rate": 0.02, "travel_l": 1e-3, "travel_r": 1e-3}
    spread |= {"climb_l": 0.01, "climb_r": 0.01, "momentum": 0.005}
    values = {}
    for variable in oracle.model.of_role("state"):
        local = variable.name.rpartition(".")[2]
        values[variable.name] = variable.start + rng.normal() * spread.get(local, 0.5)
    for side in ("left", "right"):
        if f"{side}.speed" in values:
            values[f"{side}.speed"] = values["vel_x"] / 0.1 + rng.normal() * 0.1
    for name in ("tau_l", "tau_r"):
        values[name] = rng.normal() * 5
    return values


def up_axis(values: dict[str, float]) -> np.ndarray:
    pitch, roll = values.get("pitch", 0.0), values.get("roll", 0.0)
    return np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])


# -- loads and bounce --------------------------------------------------------------------------


TRAIL = 0.0382
ANGLES = {"caster_fl": 2.9, "caster_fr": 2.0, "caster_rl": -2.6, "caster_rr": 1.5}
FLANGE = 2.9  # of the arm's 20.6 kg, at the mount


def six_springs(
    mass: float, first: np.ndarray, angles: np.ndarray | None = None, trail: float = TRAIL
) -> np.ndarray:
    """Loads of six equal springs under weights with the given first moments [kg.m].

    Wheels of casters stand their trail behind the pivots.
    """
    psi = np.zeros(4) if angles is None else angles
    x = np.array([0, 0, *(np.array([0.25, 0.25, -0.25, -0.25]) - trail * np.cos(psi))])
    y = np.array(
        [0.205, -0.205, *(np.array([0.1875, -0.1875, 0.1875, -0.1875]) - trail * np.sin(psi))]
    )
    shape = np.array([np.ones(6), x, y])
    return shape.T @ np.linalg.solve(shape @ shape.T, G * np.array([mass, *first]))


def loads(y: dict[str, float]) -> list[float]:
    return [y[f"loads[{k}]"] for k in range(1, 7)]


def settle(values: dict[str, float]) -> list[float]:
    """Loads of the spatial base after a second at rest."""
    y = Stiff(SIX_DOF, values).run(1.0, h=1e-2)
    return loads({name: float(column[-1]) for name, column in y.items()})


@pytest.mark.parametrize(
    ("centre", "least", "most"),
    [
        ((0.0, -0.082, 0.512), 151, 234),  # upright
        ((0.344, 0.082, 0.147), 89, None),  # reaching forward
        ((0.079, -0.353, 0.167), 98, None),  # reaching to the right
    ],
)
def test_static_loads_with_an_arm_are_those_of_six_equal_springs(
    centre: tuple[float, float, float], least: float, most: float | None
) -> None:
    """Mass centres of a UR5e of 17.7 kg in three poses; least and largest load by hand."""
    mass, c = 17.7, np.array(centre)
    arm = upright(mass, c)
    arm["arm_bias[3]"] += FLANGE * G
    total, first = 98.0 + mass + FLANGE, mass * c[:2]
    at_pivots = six_springs(total, first, trail=0.0)
    y = oracle_of(PLANAR).outputs(arm)
    assert loads(y) == pytest.approx(list(at_pivots), rel=1e-4)  # body mass rounded to 0.01 kg

    settled = settle(arm)
    # the base leans by 2 mrad: the mass centre moves by 0.6 mm, 0.7 N.m, up to 0.8 N on a wheel
    assert settled == pytest.approx(list(six_springs(total, first)), abs=0.8)
    assert min(settled) == pytest.approx(least, abs=0.5 + 0.8)  # printed in whole newtons
    assert most is None or max(settled) == pytest.approx(most, abs=0.5 + 0.8)


def test_casters_stand_behind_their_pivots_wherever_these_point() -> None:
    angles = {f"{name}.swivel_angle": angle for name, angle in ANGLES.items()}
    expected = six_springs(98.0, np.zeros(2), np.array(list(ANGLES.values())))
    assert np.ptp(expected) > 5.0  # else the test would not see where they stand
    # stuck in their swivels, where the floor's reaction to settling would turn them a little
    settled = settle({**angles, "caster.b_s": 1e4})
    assert settled == pytest.approx(list(expected), abs=0.8)  # it leans by up to 2 mrad


def test_a_leaning_body_turns_a_fork_downhill() -> None:
    """Moment of the normal force about the swivel axis, roll positive lowers the right side."""
    values = {"roll": 0.02, "caster.mu_s": 1e-6, "caster.mu_d": 0.0, "caster.b_s": 0.0}
    base = oracle_of(SIX_DOF)
    rate, load = base.derivatives(values), base.outputs(values)["loads[4]"]
    # k = (0, sin roll, cos roll); wheel at (-trail, 0) from the pivot: z.(d x f k) = -trail f k_y
    expected = -TRAIL * load * np.sin(0.02)
    assert load > 0
    assert rate["caster_fr.momentum"] == pytest.approx(expected, rel=1e-5)  # mu of 1e-6


def test_sprung_drive_wheels_keep_their_load() -> None:
    """Laboratory base at rest on its casters: 250 N of preload on each drive wheel."""
    variant = "mobile_base.lab/sprung[wheel_contact=creep,caster=creep]"
    base = Stiff(variant, upright(17.0489, np.zeros(3)))
    y = base.run(0.5, h=1e-2)
    sinkage = 0.1 - y["z"][-1]
    assert 0 < sinkage < 5e-5  # the rig's bound on the deflection of its contacts
    on_body = [y[f"loads[{k}]"][-1] for k in range(1, 7)]
    # the contact of the drive wheel gives way by 0.06 mm, the spring by 15 kN/m of the difference
    assert on_body[:2] == pytest.approx([250, 250], abs=1.0)
    rest = (83.0 - 6.0 + 15.0 + 17.0489) * G - sum(on_body[:2])
    assert sum(on_body[2:]) == pytest.approx(rest, rel=1e-6)  # settled to this


def test_heave_swings_at_11_3_hz_with_damping_0_53() -> None:
    """118.6 kg on six springs of 1e5 N/m and 1500 N.s/m, all casters turned inwards.

    Springs that are not placed symmetrically would let it pitch as it bounces.
    """
    inwards = {"caster_rl.swivel_angle": np.pi, "caster_rr.swivel_angle": np.pi}
    payload = {"payload.mass": 20.6, "payload.position[3]": 0.6}
    base = Stiff(SIX_DOF + "+payload", payload | inwards)
    base.run(1.0, h=1e-2)
    eigenvalues = np.linalg.eigvals(base.jacobian())
    swinging = eigenvalues[eigenvalues.imag > 1]
    heave = swinging[np.argmin(np.abs(np.abs(swinging) - np.sqrt(6e5 / 118.6)))]
    assert abs(heave) / (2 * np.pi) == pytest.approx(11.3, rel=3e-3)  # three digits
    assert -heave.real / abs(heave) == pytest.approx(0.53, abs=0.005)  # two digits


# -- interface to the arm ----------------------------------------------------------------------


@pytest.mark.parametrize("variant", DYNAMIC)
def test_rigid_arm_through_the_interface_is_a_payload(variant: str) -> None:
    rng = np.random.default_rng(5)
    plain, loaded = oracle_of(variant), oracle_of(variant + "+payload")
    mass, centre = 17.0, np.array([0.3, -0.2, 0.25])
    mount = np.array([0.05, -0.02, 0.7])
    place = {f"mount_{axis}": float(value) for axis, value in zip("xyz", mount, strict=True)}
    position = mount + centre - [0, 0, 0.1]  # from O, at the height of the axle
    for _ in range(5):
        values = {**moving(variant, rng), **place}
        rate = np.array([values.get(n, 0.0) for n in ("roll_rate", "pitch_rate", "yaw_rate")])
        if variant == PLANAR:  # its loads know centrifugal forces of the arm only
            values["yaw_rate"] = rate[2] = 0.0
        arm = locked_arm(mass, centre, up_axis(values), rate)
        payload = {f"payload.position[{k + 1}]": float(p) for k, p in enumerate(position)}
        through_mount = plain.derivatives(values | arm)
        carried = loaded.derivatives(values | payload | {"payload.mass": mass})
        outputs = [
            plain.outputs(values | arm),
            loaded.outputs(values | payload | {"payload.mass": mass}),
        ]
        scale = max(abs(value) for value in carried.values())
        for name, value in carried.items():
            # rounding of two ways to sum the same masses, seen through stiff contacts
            assert through_mount[name] == pytest.approx(value, rel=1e-9, abs=1e-12 * scale), name
        for name in outputs[0]:
            if name.startswith(("mount_", "loads")):
                assert outputs[0][name] == pytest.approx(outputs[1][name], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("variant", ["mobile_base/kinematic", *DYNAMIC])
def test_motion_of_the_mount_is_the_derivative_of_its_position(variant: str) -> None:
    rng = np.random.default_rng(6)
    oracle = oracle_of(variant)
    values = moving(variant, rng) | {"mount_x": 0.05, "mount_y": 0.1}
    if variant == "mobile_base/kinematic":
        values |= {"speed_l": 4.0, "speed_r": 5.5}
    args = oracle.arguments(values)
    xdot = np.asarray(oracle.functions.derivatives(*args)).ravel()

    def at(shift: float) -> dict[str, np.ndarray]:
        moved = list(args)
        moved[1] = args[1] + shift * xdot
        y = np.asarray(oracle.functions.outputs(*moved)[1]).ravel()
        named = dict(zip(oracle.output_names, y.tolist(), strict=True))
        return {
            name: np.array([named[f"{name}[{k}]"] for k in range(1, size + 1)])
            for name, size in (
                ("mount_position", 3),
                ("mount_quaternion", 4),
                ("mount_velocity", 3),
                ("mount_rate", 3),
                ("mount_acceleration", 3),
                ("mount_angular_acceleration", 3),
            )
        }

    here, h = at(0.0), 1e-6
    w, x, y, z = here["mount_quaternion"]
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )

    def rate(name: str) -> np.ndarray:
        return (at(h)[name] - at(-h)[name]) / (2 * h)

    # central differences: h^2 of truncation and 1e-16/h of rounding, amplified by stiff contacts
    close = {"rel": 1e-6, "abs": 1e-7}
    assert rotation.T @ rate("mount_position") == pytest.approx(here["mount_velocity"], **close)
    turning = np.cross(here["mount_rate"], here["mount_velocity"])
    acceleration = rate("mount_velocity") + turning
    assert acceleration == pytest.approx(here["mount_acceleration"], **close)
    assert rate("mount_rate") == pytest.approx(here["mount_angular_acceleration"], **close)
    quaternion_rate = rate("mount_quaternion")
    product = 0.5 * np.array(
        [
            -x * here["mount_rate"][0] - y * here["mount_rate"][1] - z * here["mount_rate"][2],
            w * here["mount_rate"][0] + y * here["mount_rate"][2] - z * here["mount_rate"][1],
            w * here["mount_rate"][1] + z * here["mount_rate"][0] - x * here["mount_rate"][2],
            w * here["mount_rate"][2] + x * here["mount_rate"][1] - y * here["mount_rate"][0],
        ]
    )
    assert quaternion_rate == pytest.approx(product, **close)


# -- motion ------------------------------------------------------------------------------------


def trapezoid(t: float, speed: float = 0.6, slope: float = 0.5, end: float = 6.4) -> float:
    """Speed of a trapezoid of 3.12 m."""
    return max(0.0, min(slope * t, speed, slope * (end - t)))


def drive(base: Stiff, end: float, turning: float = 0.0, h: float = 5e-3) -> dict[str, np.ndarray]:
    """Follow the trapezoid with a proportional-integral speed control on each wheel."""
    integral = {"l": 0.0, "r": 0.0}

    def control(t: float, y: dict[str, float]) -> dict[str, float]:
        torques = {}
        for side, sign in (("l", -1), ("r", 1)):
            error = (trapezoid(t) * (1 + sign * turning * 0.205)) / 0.1 - y[f"w_{side}"]
            integral[side] += 100 * error * h
            torques[f"tau_{side}"] = 20 * error + integral[side]
        return torques

    return base.run(end, control, h=h)


@pytest.mark.parametrize("variant", DYNAMIC)
def test_equal_torques_drive_straight(variant: str) -> None:
    base = Stiff(variant, ROTOR)
    y = base.run(1.0, lambda t, _: {"tau_l": 3.0, "tau_r": 3.0}, h=1e-2)
    assert y["x"][-1] > 0.2
    assert np.abs(y["y"]).max() < 1e-13  # rounding
    assert np.abs(y["phi"]).max() < 1e-13


def test_acceleration_is_that_of_the_total_inertia() -> None:
    """m + 2 (J_w + J)/r^2 + 4 J_c/r_c^2, casters trailing, no losses."""
    base = Stiff(PLANAR, {**ROTOR, **LOSSLESS})
    y = base.run(1.0, lambda t, _: {"tau_l": 3.0, "tau_r": 3.0}, h=1e-2)
    mass = 98.0 + 2 * (0.00716 + 0.0207) / 0.1**2 + 4 * 0.00092 / 0.0625**2
    # creep of the contacts under traction takes 1e-4 m/s of 0.6 m/s
    assert y["v"][-1] == pytest.approx(60.0 / mass, rel=5e-4)


def test_trapezoid_of_speed_takes_the_base_3_12_m_ahead() -> None:
    base = Stiff(PLANAR, ROTOR)
    y = drive(base, 7.4, h=1e-2)
    assert y["x"][-1] == pytest.approx(3.12, abs=0.005)  # what the speed control leaves over
    assert np.abs(y["y"]).max() < 1e-9


def test_casters_turned_at_the_start_move_the_path_by_less_than_a_millimetre() -> None:
    """Viscous swivel damping alone does not explain a side deviation, dry friction does."""
    angles = dict(zip(CASTERS, (2.9, 2.0, -2.6, 1.5), strict=True))
    start = {f"{name}.swivel_angle": angle for name, angle in angles.items()}
    start |= {**ROTOR, "drive_wheel.v_c": 0.005, "caster.v_c": 0.005}
    free = drive(Stiff(PLANAR, start), 6.6, h=1e-2)
    assert abs(free["y"][-1]) < 1e-3
    stuck = Stiff(PLANAR + "+coulomb@caster.swivel", {**start, "caster.swivel.coulomb.tau_c": 0.5})
    dry = drive(stuck, 6.6, h=1e-2)
    assert abs(dry["y"][-1]) > 5 * abs(free["y"][-1])
    assert 2e-3 < abs(dry["y"][-1]) < 0.05


def test_rolling_wheels_make_the_planar_base_a_unicycle() -> None:
    stiff = {"drive_wheel.c_x": 1e-9, "drive_wheel.c_y": 1e-9}
    base = Stiff(PLANAR + "[wheel_contact=rolling]", {**ROTOR, **stiff})
    y = drive(base, 3.0, turning=0.8)
    x = np.zeros(3)
    for k in range(1, len(y["time"])):
        angles = [y[f"phi_{side}"][k] - y[f"phi_{side}"][k - 1] for side in ("l", "r")]
        way, turn = 0.1 * (angles[0] + angles[1]) / 2, 0.1 * (angles[1] - angles[0]) / 0.41
        middle = x[2] + turn / 2
        x += [way * np.cos(middle), way * np.sin(middle), turn]
    # creep under some 20 N over 3 s, and chords for arcs: (0.002 rad)^2/24 of the way
    assert [y["x"][-1], y["y"][-1], y["phi"][-1]] == pytest.approx(list(x), abs=1e-6)
    assert abs(y["phi"][-1]) > 0.5


@pytest.mark.parametrize("v_c", [0.02, 0.005])
def test_arc_drifts_outwards_as_the_formula_says(v_c: float) -> None:
    """Steady circle of 1 m at 0.5 m/s: the drive wheels hold m v^2/R and creep sideways."""
    heavy = {"J_l": 1e6, "J_r": 1e6}  # the wheels keep their speeds
    speeds = {"left.speed": 5 * (1 - 0.205), "right.speed": 5 * (1 + 0.205)}
    light = {"caster.m_f": 1e-6, "caster.m_w": 1e-6, "caster.J_t": 0.0, "caster.J_f": 1e-6}
    values = {**LOSSLESS, **heavy, **speeds, **light, "vel_x": 0.5, "yaw_rate": 0.5}
    base = Stiff(PLANAR, {**values, "drive_wheel.v_c": v_c, "caster.v_c": 2e-4})
    y = base.run(2.0, h=1e-2)
    drift = 0.25 * v_c / (1.5 * 0.7 * G / 3)  # two of six wheels hold, the casters follow freely
    drift *= 1 + (drift / v_c) ** 2 / 3  # mu(v) is not quite linear
    assert -y["v_y"][-1] == pytest.approx(drift, rel=1e-4)  # creep of the casters


@pytest.mark.parametrize("variant", [SIX_DOF, SPRUNG])
def test_spatial_bases_move_like_the_planar_one_when_slow(variant: str) -> None:
    pressed = {"preload": 0.0, "share": 1.0}
    if variant == SPRUNG:  # the springs carry a given share, the casters the rest
        pressed = {"preload": 150.0 + 4.933 * G, "share": 0.0}
    flat = drive(Stiff(PLANAR, {**ROTOR, **pressed}), 2.0, turning=0.8, h=1e-2)
    deep = drive(Stiff(variant, ROTOR), 2.0, turning=0.8, h=1e-2)
    for name in ("x", "y", "phi"):
        # pitch at 0.5 m/s2 moves O by less than 0.1 mm; load transfer changes creep by some 10 %
        assert deep[name][-1] == pytest.approx(flat[name][-1], abs=2e-4)
    assert flat["phi"][-1] > 0.3


# -- effects -----------------------------------------------------------------------------------


def test_a_slippery_patch_lies_under_the_wheels_that_it_is_given_to() -> None:
    """Casters and drive wheels know where they are; a patch has parameters for each kind."""
    base = Oracle(
        build_model(PLANAR + "+low_friction_patch@drive_wheel.mu+low_friction_patch@caster.mu")
    )
    sliding = {"vel_y": 0.5, "pose_x": 2.0, "pose_phi": np.pi / 2}
    dry = {f"{kind}.mu.low_friction_patch.reduction": 0.0 for kind in ("drive_wheel", "caster")}

    def force(wheels: str, x: float, y: float) -> float:
        patch = {
            f"{wheels}.mu.low_friction_patch.{name}": value
            for name, value in (
                ("reduction", 1.0),
                ("x_p", x),
                ("y_p", y),
                ("radius", 0.1),
                ("edge", 0.002),
            )
        }
        return base.derivatives({**sliding, **dry, **patch})["vel_y"]

    nowhere = force("caster", 9.0, 9.0)
    front_left = (2.0 - 0.1875, 0.25)  # the base looks along the world's y axis
    assert nowhere < 0
    # one of six wheels brakes no more: g mu_d/6 = 0.8 m/s2, less where a fork gives way
    assert force("caster", *front_left) > nowhere + 0.3
    assert force("drive_wheel", *front_left) == nowhere  # d = 0.25 m, exp(-150) rounds to nothing
    assert force("drive_wheel", 2.0 - 0.205, 0.0) > nowhere + 0.3


def test_effect_on_a_group_acts_on_all_its_members_with_one_set_of_parameters() -> None:
    model = build_model(PLANAR + "+coulomb@caster.swivel")
    assert [v.name for v in model.of_role("parameter") if v.of_effect] == [
        "caster.swivel.coulomb.tau_c",
        "caster.swivel.coulomb.w_0",
    ]
    losses = {v.name for v in model.of_role("output") if v.of_effect}
    assert losses == {f"{name}.swivel.coulomb.P_loss" for name in CASTERS}
    together = Oracle(model)
    one_by_one = Oracle(
        build_model(PLANAR + "".join(f"+coulomb@{name}.swivel" for name in CASTERS))
    )
    values = moving(PLANAR, np.random.default_rng(2))
    separate = {f"{name}.swivel.coulomb.tau_c": 0.7 for name in CASTERS}
    assert together.derivatives({**values, "caster.swivel.coulomb.tau_c": 0.7}) == (
        one_by_one.derivatives({**values, **separate})
    )


def test_slope_accelerates_a_free_base_by_g_sin_slope_over_its_inertia() -> None:
    values = {**LOSSLESS, "floor_slope.slope": 0.01, "floor_slope.heading": 0.0}
    y = Stiff(PLANAR + "+floor_slope", values).run(1.0, h=1e-2)
    inertia = 98.0 + 2 * 0.00716 / 0.1**2 + 4 * 0.00092 / 0.0625**2
    # the casters turn over backwards but hardly within 50 mm; creep of 1e-4 of the speed
    assert y["v"][-1] == pytest.approx(-98.0 * G * np.sin(0.01) / inertia, rel=2e-3)


@pytest.mark.parametrize("variant", DYNAMIC)
def test_what_a_base_carries_on_a_slope_feels_it(variant: str) -> None:
    """A load on the mount, a payload of the body and a heavier body are one."""
    base, rng = oracle_of(variant + "+floor_slope+payload"), np.random.default_rng(5)
    slope = {"floor_slope.slope": 0.03, "floor_slope.heading": 0.7}
    place = np.array([0.1, -0.05, 0.2])
    mount = [base.model.variables[f"mount_{axis}"].start for axis in "xyz"]
    at = np.array([*mount[:2], mount[2] - 0.1]) + place  # from O
    for _ in range(5):
        state = moving(variant, rng)
        if variant == PLANAR:  # its loads feel what an arm does as it turns, but not a payload
            state["yaw_rate"] = 0.0
        phi, pitch, roll = (state.get(name, 0.0) for name in ("pose_phi", "pitch", "roll"))
        turn = Rotation.from_euler("ZYX", [phi, pitch, roll]).as_matrix()
        rate = np.array([state.get(f"{name}_rate", 0.0) for name in ("roll", "pitch", "yaw")])
        arm = locked_arm(12.0, place, turn[2], rate)
        carried = base.outputs({**state, **slope, **arm, "payload.mass": 0.0})
        payload = {f"payload.position[{k + 1}]": x for k, x in enumerate(at)}
        loaded = base.outputs({**state, **slope, **payload, "payload.mass": 12.0})
        for k in (1, 2, 3):
            one = carried[f"mount_acceleration[{k}]"]
            # six forces of 1e6 N/m against each other; else rounding
            assert one == pytest.approx(loaded[f"mount_acceleration[{k}]"], rel=1e-9, abs=1e-9)


def test_an_arm_at_rest_on_a_slope_hangs_as_on_a_tilted_mount() -> None:
    """A base that is held on a slope tells the arm of it as an acceleration."""
    base, heading = oracle_of(PLANAR + "+floor_slope"), 0.7
    slope = {"floor_slope.slope": 0.02, "floor_slope.heading": heading}
    mount_x = base.model.variables["mount_x"].start
    leaning, rates = base.outputs(slope), base.derivatives(slope)
    # a base at rest glides off before its wheels resist: without what it does itself
    moves = (rates["vel_x"], rates["vel_y"] + mount_x * rates["yaw_rate"], 0.0)  # mount in front
    told = {
        f"mount_acceleration[{k + 1}]": leaning[f"mount_acceleration[{k + 1}]"] - own
        for k, own in enumerate(moves)
    }
    arm = oracle_of("ur5_arm/rigid_moving+base_tilt")
    q = {f"angle[{k + 1}]": x for k, x in enumerate((0.3, -1.0, 0.8, -0.4, 1.2, 0.1))}
    level = {"base_tilt.tilt": 0.0}
    on_slope = arm.derivatives({**q, **level, **told})
    tilted = arm.derivatives(
        {**q, "base_tilt.tilt": 0.02, "base_tilt.heading": heading - np.pi / 2}
    )
    flat = arm.derivatives({**q, **level})
    for k in range(1, 7):
        change = tilted[f"speed[{k}]"] - flat[f"speed[{k}]"]
        assert on_slope[f"speed[{k}]"] - flat[f"speed[{k}]"] == pytest.approx(change, rel=1e-9)


def test_bristles_hold_a_braked_base_across_a_slope() -> None:
    """Stick-slip creeps down the slope, bristles stay."""
    values = {"J_l": 1e6, "J_r": 1e6, "floor_slope.slope": 0.02, "floor_slope.heading": np.pi / 2}
    creeping = Stiff(PLANAR + "+floor_slope", values).run(4.0, h=2e-2)
    holding = Stiff(PLANAR + "[wheel_contact=brush]+floor_slope", values).run(4.0, h=2e-2)

    def late(y: dict[str, np.ndarray]) -> float:
        return float(abs(y["y"][-1] - y["y"][len(y["y"]) // 2]))

    assert late(holding) < 1e-3 * late(creeping)


def test_cable_pulls_sideways_towards_its_anchor() -> None:
    values = {"cable_force.tension": 20.0, "cable_force.heading": np.pi / 2}
    values |= {"cable_force.distance": 50.0, "cable_force.height": 0.1}
    base = oracle_of(PLANAR + "[wheel_contact=creep]+cable_force")
    free = {**values, "drive_wheel.mu": 0.0, "caster.mu_s": 1e-6, "caster.mu_d": 0.0}
    rates = base.derivatives(free)
    # 98 kg less what the forks swing aside, at 20 N
    assert rates["vel_y"] == pytest.approx(20.0 / 98.0, rel=0.02)


def test_larger_left_wheel_bends_the_path_to_the_right() -> None:
    heavy = {"J_l": 1e6, "J_r": 1e6, "left.speed": 5.0, "right.speed": 5.0, "vel_x": 0.5}
    base = Stiff(PLANAR + "+radius_offset@left.radius", {**heavy, **LOSSLESS})
    y = base.run(2.0, h=1e-2)
    rate = -5.0 * 3e-4 / 0.41
    assert (y["phi"][-1] - y["phi"][100]) / 1.0 == pytest.approx(rate, rel=1e-2)  # creep
