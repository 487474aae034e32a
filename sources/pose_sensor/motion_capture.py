"""Motion capture: frame, marker, noise, sampling, and samples in which the body is not seen.

    p     = [x; y] + R(phi) [x_marker; y_marker]
    [x_s; y_s] = R(phi_frame) p + [x_frame; y_frame] + sigma_xy n_1,2
    z_s   = z + z_frame + sigma_z n_3,   phi_s = phi + phi_frame + phi_marker + sigma_phi n_4

The noise n (independent standard normal numbers) is drawn anew every T. With `held` = 1 the pose is
read every T and kept in between, as someone sees it who polls the system; with 0 it follows the
body between the samples, so that a reader at the sample instants gets the pose of that instant, as
in a log. A sample is lost with probability p_lose, after a lost one with 1 - p_find; then `valid`
is 0 and the last good sample is repeated. The numbers depend on `seed` only.

Not modelled: jitter of the clock, correlation of the noise, confusion of markers.

Source: digital twin paper (OptiTrack, 0.5 mm; tool data missing outside the camera volume; Eq 2-5).
"""

from __future__ import annotations

import casadi as ca

from .. import pose_sensor as qs
from ..component import Fidelity
from ..laws.noise import RANDOM, Random, seed_quantity
from ..laws.planar_frame import rotated
from ..model import Model
from ..quantity import Quantity
from . import body_pose

FIDELITY = Fidelity(level=1)

T = Quantity("T", "s", "sample period", 0.01, minimum=1e-6, variability="fixed")
SIGMA_XY = Quantity("sigma_xy", "m", "standard deviation of x and y", minimum=0.0)
SIGMA_Z = Quantity("sigma_z", "m", "standard deviation of the height", minimum=0.0)
SIGMA_PHI = Quantity("sigma_phi", "rad", "standard deviation of the heading", minimum=0.0)
PHI_FRAME = Quantity("phi_frame", "rad", "heading of the world's x axis in the sensor's frame")
X_FRAME = Quantity("x_frame", "m", "position of the world's origin in the sensor's frame")
Y_FRAME = Quantity("y_frame", "m", "position of the world's origin in the sensor's frame")
Z_FRAME = Quantity("z_frame", "m", "height of the floor in the sensor's frame")
X_MARKER = Quantity("x_marker", "m", "marker ahead of the body's reference point")
Y_MARKER = Quantity("y_marker", "m", "marker to the left of the body's reference point")
PHI_MARKER = Quantity("phi_marker", "rad", "heading of the marker cluster on the body")
P_LOSE = Quantity("p_lose", "1", "probability that a sample is lost", minimum=0.0, maximum=1.0)
P_FIND = Quantity(
    "p_find", "1", "probability that the body is found after a loss", 0.2, minimum=0.0, maximum=1.0
)
HELD = Quantity("held", "1", "1: the value is held between samples", minimum=0.0, maximum=1.0)
DRAWN = Quantity("drawn", "1", "noise of the present sample", size=4)
SAMPLE = Quantity("sample", "1", "last good sample x, y, z [m], phi [rad]", size=4)
SEEN = Quantity("seen", "1", "1 if the body was seen at the last sample", 1.0)
STARTED = Quantity("started", "1", "1 once the first sample is taken")


def equations(m: Model) -> None:
    """Collect the equations."""
    pose, height = body_pose(m)
    p = m.parameters(
        PHI_FRAME,
        X_FRAME,
        Y_FRAME,
        Z_FRAME,
        X_MARKER,
        Y_MARKER,
        PHI_MARKER,
        SIGMA_XY,
        SIGMA_Z,
        SIGMA_PHI,
        seed_quantity("pose_sensor"),
        P_LOSE,
        P_FIND,
        T,
        HELD,
    )
    z = m.discretes(DRAWN, SAMPLE, SEEN, RANDOM, STARTED)
    x_offset, y_offset = rotated(pose[2], p.x_marker, p.y_marker)
    x, y = rotated(p.phi_frame, pose[0] + x_offset, pose[1] + y_offset)
    exact = ca.vertcat(
        x + p.x_frame, y + p.y_frame, height + p.z_frame, pose[2] + p.phi_frame + p.phi_marker
    )

    sigma = ca.vertcat(p.sigma_xy, p.sigma_xy, p.sigma_z, p.sigma_phi)
    random = Random(z.random, p.seed)
    normals, lot = random.normals(4), random.uniform()
    lost = ca.if_else(z.seen > 0.5, p.p_lose, 1.0 - p.p_find)
    sees = ca.logic_or(lot >= lost, z.started < 0.5)

    clock = m.clock("sample", p.T)
    m.update(clock, z.drawn, normals)
    m.update(clock, z.sample, ca.if_else(sees, exact + sigma * normals, z.sample))
    m.update(clock, z.seen, ca.if_else(sees, 1.0, 0.0))
    m.update(clock, z.random, random.state)
    m.update(clock, z.started, ca.SX(1.0))

    kept = ca.logic_and(z.started > 0.5, ca.logic_or(p.held > 0.5, z.seen < 0.5))
    measured = ca.if_else(kept, z.sample, exact + sigma * z.drawn)
    for index, quantity in enumerate((qs.X_MEAS, qs.Y_MEAS, qs.Z_MEAS, qs.PHI_MEAS)):
        m.output(quantity, measured[index])
    m.output(qs.VALID, z.seen)
