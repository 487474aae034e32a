"""Base that slips outwards in bends.

    u = -k v w_z (v^2 + v_0^2)^((n - 1)/2),   v_0 = 1e-3 m/s

v is the speed along the base, w_z its yaw rate and v w_z the acceleration to the side, which the
wheels must transmit. n = 1: the slip speed grows with that force, as where wheels scrub all the
time; n = 2: the slip angle does, as of a tyre.

Not modelled: the force itself (the base has no mass), slip along the base, tyres that let go.

Source: Rajamani, Vehicle Dynamics and Control, 2nd ed. 2012, ch. 2 (slip angle over force).
"""

from __future__ import annotations

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

K = Quantity(
    "k", "s", "slip speed over acceleration to the side at 1 m/s, 0 = absent", start=0.02,
    strength=True,
)  # fmt: skip
N = Quantity(
    "n", "1", "power of the speed with which it grows", start=1.0, minimum=1.0, maximum=3.0,
    hints=SearchHints(tries=(2.0,)),
)  # fmt: skip
V_0 = 1e-3
"""[m/s] Below it a power of the speed has no slope; no wheel's speed is known that well."""

EFFECT = Effect(
    "side_slip",
    "Slip to the outside of a bend.",
    ("across",),
    K,
    source="Rajamani 2012",
)


def law(e: EffectModel) -> None:
    """Add the slip speed."""
    p, s = e.parameters(k=K, n=N), e.signals(v="along", w_z="turning")
    e.add(-p.k * s.v * s.w_z * (s.v**2 + V_0**2) ** ((p.n - 1) / 2))
