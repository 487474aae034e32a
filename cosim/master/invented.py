"""Is a run the model's, or does the coupling move it? Judged by the energy that it invents.

At a power bond both ends take the same energy with opposite signs; what is left over was invented
by exchanging values at communication points only. A motion of angular frequency w that is passed on
late by half a step h invents about w h times what goes over the bond: at TOLERATED the exchange
resolves its fastest motion by 2 pi / TOLERATED = 60 steps per period. Beyond, a stable system rings
or keeps swinging, because what its losses take out is put in again.

Source: M. Benedikt, D. Watzenig, J. Zehetner, A. Hofer, NEPCE - a nearly energy-preserving coupling
element for weak-coupled problems and co-simulations, COUPLED PROBLEMS 2013.
"""

from __future__ import annotations

from collections.abc import Mapping

TOLERATED = 0.1
"""Energy invented at a bond, relative to what went over it."""
NEGLIGIBLE = 1e-3
"""Energy invented at a bond, relative to what went over all bonds, that moves nothing."""


def invented(energy: Mapping[str, float], turnover: Mapping[str, float]) -> list[str]:
    """A warning that names the bonds at which the coupling invents too much, none if all is well.

    Args:
        energy: invented, per power bond [J].
        turnover: that went over it [J].
    """
    whole = sum(turnover.values())
    found = [
        f"{energy[name]:.3g} J of {turnover[name]:.3g} J at {name}"
        for name in turnover
        if abs(energy[name]) > max(TOLERATED * turnover[name], NEGLIGIBLE * whole)
    ]
    if not found:
        return []
    return [
        f"the coupling invented {', '.join(found)}: more than {TOLERATED:.0%} of what went over "
        "the bond, so the motion may be that of the exchange and not of the model; take a smaller "
        "step, gauss_seidel, or extrapolation = 1 or 2, and compare"
    ]
