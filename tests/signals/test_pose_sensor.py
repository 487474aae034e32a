"""Pose sensors: frames and their calibration, sampling, lost samples, markers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.support import Stepper

# Calibration poses of the rig mobile_manipulator: x, y, phi in the robot's and the sensor's frame.
ROBOT = np.array(
    [[1.20073, -0.40172, 0.35209], [5.09824, 0.60053, -0.79901], [2.99964, 3.20033, 2.09987]]
)
MOCAP = np.array(
    [[3.59828, -1.89932, 0.99668], [6.10847, 1.24844, -0.15323], [2.86589, 2.0586, 2.74668]]
)
QUIET = {"sigma_xy": 0.0, "sigma_z": 0.0, "sigma_phi": 0.0}


def triad(points: np.ndarray) -> np.ndarray:
    """Homogeneous matrix of the triad of three points, digital twin paper, Eq 2-4."""
    a, b, c = (np.append(point[:2], 0.0) for point in points)
    ex = (b - a) / np.linalg.norm(b - a)
    ez = np.cross(b - a, c - a)
    ez /= np.linalg.norm(ez)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([ex, np.cross(ez, ex), ez, a])
    return matrix


def measured(
    robot_pose: np.ndarray, values: dict[str, float], device: str = "mir250"
) -> np.ndarray:
    stepper = Stepper(f"pose_sensor.{device}/motion_capture", {**QUIET, **values})
    out = stepper.step(dict(zip(("x", "y", "phi"), robot_pose.tolist(), strict=True)), 0.01)
    return np.array([out["x_meas"], out["y_meas"], out["phi_meas"]])


def test_frame_of_three_points_maps_the_robot_into_the_sensor_frame() -> None:
    frame = triad(MOCAP) @ np.linalg.inv(triad(ROBOT))  # Eq 5
    values = {
        "phi_frame": math.atan2(frame[1, 0], frame[0, 0]),
        "x_frame": frame[0, 3],
        "y_frame": frame[1, 3],
    }
    errors = np.array([measured(r, values) - o for r, o in zip(ROBOT, MOCAP, strict=True)])
    # A is hit exactly: it is the origin of both triads, B lies on their x axes.
    assert np.abs(errors[0, :2]).max() < 1e-12
    # Robot side accurate to 1 mm: 1.4 mm in a difference, over AB = 4.0 m 0.35 mrad; three sigma,
    # and the lever of C adds as much again.
    assert np.abs(errors[1:, :2]).max() < 6e-3
    assert np.abs(errors[:, 2]).max() < 3 * math.hypot(1e-3, 0.35e-3)


def test_device_frame_fits_all_three_poses() -> None:
    errors = np.array(
        [measured(r, {}, "mobile_manipulator") - o for r, o in zip(ROBOT, MOCAP, strict=True)]
    )
    assert np.abs(errors[:, :2]).max() < 3e-3  # three sigma of 1 mm
    assert np.abs(errors[:, 2]).max() < 3e-3  # three sigma of 1 mrad
    assert np.abs(errors[:, :2].mean(axis=0)).max() < 2e-4  # least squares: no mean error; rounding


def test_marker_and_frame_are_applied_in_the_right_order() -> None:
    values = {"x_marker": 0.2, "y_marker": 0.1, "phi_marker": 0.05}
    values |= {"phi_frame": math.pi / 2, "x_frame": 10.0, "y_frame": 20.0}
    read = measured(np.array([1.0, 2.0, math.pi]), values)
    # Heading pi: the marker sits at (-0.2, -0.1) from the body; the frame turns (x, y) to (-y, x).
    assert read == pytest.approx([10 - 1.9, 20 + 0.8, 1.5 * math.pi + 0.05], abs=1e-14)  # rounding


def test_log_at_sample_instants_shows_the_pose_of_that_instant_and_held_the_one_before() -> None:
    for held in (0.0, 1.0):
        stepper = Stepper("pose_sensor/motion_capture", {**QUIET, "held": held})
        for k in range(1, 30):
            stepper.step({"x": 0.1 * (k - 1)}, 0.01)
            stepper.set({"x": 0.1 * k})
            read = stepper.outputs()["x_meas"]
            assert read == pytest.approx(0.1 * (k - held), abs=1e-15)


def test_held_samples_follow_the_rate() -> None:
    stepper = Stepper("pose_sensor/motion_capture", {**QUIET, "held": 1.0, "T": 0.02})
    read = [stepper.step({"x": float(k)}, 0.005)["x_meas"] for k in range(12)]
    assert read == [0.0] * 4 + [4.0] * 4 + [8.0] * 4


@pytest.mark.slow
def test_lost_samples_repeat_the_last_good_one() -> None:
    lose, find = 0.05, 0.2
    values = {**QUIET, "p_lose": lose, "p_find": find}
    stepper = Stepper("pose_sensor/motion_capture", values)
    valid, kept = [], 0.0
    for k in range(8000):
        out = stepper.step({"x": float(k)}, 0.01)
        valid.append(out["valid"])
        if out["valid"]:
            kept = float(k)
        assert out["x_meas"] == kept
    seen = np.array(valid) > 0
    gaps = np.count_nonzero(seen[:-1] & ~seen[1:])
    lost = np.count_nonzero(~seen)
    # Two-state chain: four standard deviations of binomial and geometric counts.
    assert gaps / seen.sum() == pytest.approx(lose, abs=4 * math.sqrt(lose / seen.sum()))
    assert lost / gaps == pytest.approx(1 / find, rel=4 / math.sqrt(gaps))


@pytest.mark.slow
def test_noise_has_the_declared_standard_deviations() -> None:
    stepper = Stepper("pose_sensor.mobile_manipulator/motion_capture")
    run = stepper.run(0.01, 3000)
    for name, sigma in (("x_meas", 3e-4), ("y_meas", 3e-4), ("phi_meas", 5e-4)):
        # Four standard deviations of an estimated standard deviation.
        assert run[name][1:].std() == pytest.approx(sigma, rel=4 / math.sqrt(2 * 3000))
    assert np.abs(np.corrcoef([run[n][1:] for n in ("x_meas", "y_meas")])[0, 1]) < 0.08


@pytest.mark.parametrize("fidelity", ["ideal", "camera"])
def test_markers_keep_their_distances_and_show_the_pose(fidelity: str) -> None:
    stepper = Stepper(f"marker_sensor/{fidelity}", {"sigma": 0.0} if fidelity == "camera" else {})
    pose = np.array([0.3, -0.2, 2.0])
    out = stepper.step(dict(zip(("x", "y", "phi"), pose.tolist(), strict=True)), 0.02)
    seen = np.array([[out[f"x_m[{k}]"], out[f"y_m[{k}]"]] for k in range(1, 6)])
    body = np.array([[0, 0], [0.19, 0.13], [0.19, -0.13], [-0.19, 0.13], [-0.19, -0.13]])  # sheet
    assert np.linalg.norm(seen[1] - seen[4]) == pytest.approx(math.hypot(0.38, 0.26), rel=1e-14)
    # Least-squares pose of the five markers: exact without noise.
    assert seen.mean(axis=0) == pytest.approx(pose[:2], abs=1e-15)
    cross = body[:, 0] * (seen - pose[:2])[:, 1] - body[:, 1] * (seen - pose[:2])[:, 0]
    heading = math.atan2(cross.sum(), (body * (seen - pose[:2])).sum())
    assert heading == pytest.approx(pose[2], abs=1e-14)


def test_camera_noise_is_that_of_the_rig() -> None:
    run = Stepper("marker_sensor/camera").run(0.02, 1000)
    noise = np.array([run[f"{axis}_m[{k}]"][1:] for axis in "xy" for k in range(1, 6)])
    assert noise.std(axis=1) == pytest.approx(np.full(10, 1e-4), rel=4 / math.sqrt(2000))
    assert np.abs(np.corrcoef(noise) - np.eye(10)).max() < 4.5 / math.sqrt(1000)  # 45 pairs
