"""The omnidirectional base once more, from vectors and Lagrange's equations alone.

Independent of `sources/omni_base/rigid_body.py`: velocities of mass centres and contact points are
differentiated symbolically, nothing is simplified by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

L, E, R, D = 0.35, 0.08, 0.1, 0.06
M_P, M_W, I_P, I_S, I_PHI = 220.0, 10.0, 17.6, 0.05, 0.03
X_G = 0.02
AXES = [(L * np.cos(a), L * np.sin(a)) for a in (np.pi / 3, np.pi, 5 * np.pi / 3)]


@dataclass(frozen=True)
class Equations:
    """Functions of X = (x, y, theta, beta, phi) and X' (9 each)."""

    inertia: ca.Function  # T
    christoffel: ca.Function  # C with h = C X'
    slip: ca.Function  # (across, along) of the three contact points, 6
    constraint: ca.Function  # A, 6 x 9
    constraint_rate: ca.Function  # A'
    energy: ca.Function


def equations() -> Equations:
    q, v = ca.SX.sym("q", 9), ca.SX.sym("v", 9)

    def rate(expression: ca.SX) -> ca.SX:
        return ca.jtimes(expression, q, v)

    def world(x: float | ca.SX, y: float | ca.SX) -> ca.SX:
        c, s = ca.cos(q[2]), ca.sin(q[2])
        return ca.vertcat(q[0] + c * x - s * y, q[1] + s * x + c * y)

    energy = M_P * ca.sumsqr(rate(world(X_G, 0.0))) / 2 + I_P * v[2] ** 2 / 2
    across, along = [], []
    for k, (x, y) in enumerate(AXES):
        c, s = ca.cos(q[3 + k]), ca.sin(q[3 + k])
        centre = rate(world(x - D * c, y - D * s))
        energy += M_W * ca.sumsqr(centre) / 2 + I_S * (v[2] + v[3 + k]) ** 2 / 2
        energy += I_PHI * v[6 + k] ** 2 / 2
        heading = q[2] + q[3 + k]
        contact = rate(world(x - E * c, y - E * s))
        across.append(ca.sin(heading) * contact[0] - ca.cos(heading) * contact[1])
        along.append(ca.cos(heading) * contact[0] + ca.sin(heading) * contact[1] + R * v[6 + k])
    slip = ca.vertcat(*across, *along)

    inertia = ca.hessian(energy, v)[0]
    christoffel = ca.SX(9, 9)
    slopes = [ca.reshape(ca.jacobian(ca.vec(inertia), q[k]), 9, 9) for k in range(9)]
    for i in range(9):
        for j in range(9):
            for k in range(9):
                symbol = slopes[k][i, j] + slopes[j][i, k] - slopes[i][j, k]
                christoffel[i, j] += symbol * v[k] / 2
    constraint = ca.jacobian(slip, v)
    constraint_rate = ca.reshape(ca.jtimes(ca.vec(constraint), q, v), 6, 9)

    def function(name: str, expression: ca.SX) -> ca.Function:
        return ca.Function(name, [q, v], [ca.densify(expression)])

    return Equations(
        function("T", inertia),
        function("C", christoffel),
        function("slip", slip),
        function("A", constraint),
        function("A_rate", constraint_rate),
        function("energy", energy),
    )
