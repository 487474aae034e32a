"""Bristles between wheel and floor: friction that truly sticks, and side slip while rolling.

    z' = s - a(|z|/z_max) |s| z/z_max - kappa |r w| z,   z_max = mu(|s|) f_n/k_t
    f = -k_t z - d_t max(0, 1 - |z|/z_max) s,   mu(v) = mu_d + (mu_s - mu_d) exp(-(v/v_s)^2)
    E = k_t |z|^2/2,  P_loss = k_t z.(s - z') + d_t max(0, 1 - |z|/z_max) |s|^2

z is the deflection along the wheel's plane and across, in metres; `a` rises smoothly from 0 at 0.7
to 1 at 1. Standing, a force below the limit deflects the bristles and moves nothing more. Rolling
carries deflected bristles out of the patch (kappa, about 1.2 over its length): a side force F then
needs the slip kappa |r w| F/k_t, the cornering stiffness is k_t/kappa.

Not modelled: distribution over the patch, self-aligning moment, dependence of k_t on load.

Source: Canudas de Wit et al., Vehicle System Dynamics 39(3), 2003 (average lumped LuGre tyre);
Velenis et al., Vehicle System Dynamics 43(1), 2005 (two directions); Dupont et al., IEEE Trans.
Automatic Control 47(5), 2002 (the elastic range below 0.7).
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..laws.bristle import STICK
from ..laws.contact import SMALL
from ..laws.floor import MU_D, MU_S
from ..model import SX, Model
from ..quantity import Quantity
from .wheel import Contact, wheel

FIDELITY = Fidelity(level=4, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))
V_S = Quantity(
    "v_s", "m/s", "slip velocity over which static friction falls", start=0.02, minimum=1e-6
)
K_T = Quantity(
    "k_t", "N/m", "tangential stiffness of tread and floor", start=2e5, minimum=1.0, nominal=1e5
)
D_T = Quantity("d_t", "N.s/m", "tangential damping while stuck", start=300.0, minimum=0.0)
KAPPA = Quantity(
    "kappa", "1/m", "share of the deflection lost per distance rolled", start=40.0, minimum=0.0
)
Z_X = Quantity("z_x", "m", "deflection of the bristles along the wheel", nominal=1e-4)
Z_Y = Quantity("z_y", "m", "deflection of the bristles across the wheel", nominal=1e-4)

LOAD_FLOOR = 1.0
"""Normal force [N] below which bristles slide as under this one: a lifted wheel lets go."""
FRICTION_FLOOR = 1e-4
"""Friction coefficient below which they slide as at this one, a hundredth of wet ice's: without a
largest deflection nothing would be a part of it."""


def equations(m: Model) -> None:
    """Collect the equations."""
    p = m.parameters(MU_S, MU_D, V_S, K_T, D_T, KAPPA)
    x = m.states(Z_X, Z_Y)

    def friction(c: Contact) -> tuple[SX, SX]:
        patch = m.balance("mu", "coefficient", unit="1", value=p.mu_s, x=c.x, y=c.y)
        square = c.s_x**2 + c.s_y**2
        mu = (p.mu_d + (p.mu_s - p.mu_d) * ca.exp(-square / p.v_s**2)) * (1 + patch.effort / p.mu_s)
        largest = ca.fmax(mu, FRICTION_FLOOR) * ca.fmax(c.f_n, LOAD_FLOOR) / p.k_t
        used = ca.sqrt(x.z_x**2 + x.z_y**2 + SMALL) / largest
        blend = ca.fmax(0, ca.fmin((used - STICK) / (1 - STICK), 1))
        sliding = blend**2 * (3 - 2 * blend) * ca.sqrt(square + SMALL) / largest
        decay = sliding + p.kappa * ca.sqrt(c.rolling**2 + SMALL)
        m.derivative(x.z_x, c.s_x - decay * x.z_x)
        m.derivative(x.z_y, c.s_y - decay * x.z_y)
        stuck = p.d_t * ca.fmax(0, 1 - used)
        deflection = x.z_x**2 + x.z_y**2
        m.stored_energy(p.k_t * deflection / 2)
        m.loss("slip", p.k_t * decay * deflection + stuck * square)
        return -p.k_t * x.z_x - stuck * c.s_x, -p.k_t * x.z_y - stuck * c.s_y

    wheel(m, friction, elastic=True)
