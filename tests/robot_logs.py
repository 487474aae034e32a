"""Parts of mappings for the logs of a robot with two wheels (`cosim.intake.example`)."""

from __future__ import annotations

from pathlib import Path

from cosim.intake.example import RADIUS, TRACK

COLUMNS = """
[columns]
left = { source = "cmd.left_rpm", hold = true, from = "rpm", unit = "rad/s" }
right = { source = "cmd.right_rpm", hold = true, from = "rpm", unit = "rad/s" }
x = { source = "pose.px_mm", from = "mm", unit = "m" }
y = { source = "pose.py_mm", from = "mm", unit = "m" }
yaw = { source = "pose.heading_deg", from = "deg", unit = "rad", unwrap = true }
"""
ROBOT = f"""
system = "robot.toml"
step = 0.01
period = 0.01
algorithm = "gauss_seidel"
time = "pose.stamp_ns"
{COLUMNS}[inputs]
"base.w_l" = "left"
"base.w_r" = "right"
[channels]
x = {{ signal = "base.x", sigma = 0.002 }}
y = {{ signal = "base.y", sigma = 0.002 }}
yaw = {{ signal = "base.phi", sigma = 0.004 }}
"""
CLOCK = """
[[nuisance]]
name = "clock"
unit = "s"
nominal = 0.0
min = -0.5
max = 0.5
targets = ["clock:x", "clock:y", "clock:yaw"]
"""
"""The camera's."""
YAW_GAIN = """
[[nuisance]]
name = "error"
unit = "1"
nominal = 0.0
min = -0.5
max = 0.5
targets = "column:gain:yaw"
"""
START = "".join(
    f"""
[[nuisance]]
name = "start of {name}"
unit = "{unit}"
per_run = true
nominal = "first:{name}"
span = 0.3
targets = "base.pose_{state}"
"""
    for name, unit, state in (("x", "m", "x"), ("y", "m", "y"), ("yaw", "rad", "phi"))
)


def write_system(folder: Path) -> None:
    """Write robot.toml: the robot with its true measures."""
    (folder / "robot.toml").write_text(
        '[instances]\nbase = "diff_drive/rolling"\n[parameters]\n'
        f'"base.r" = {RADIUS}\n"base.track" = {TRACK}\n'
    )
