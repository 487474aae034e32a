"""What a component promises to its neighbours, whatever its fidelity: ports and shared names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .quantity import Quantity

Causality = Literal["gives_motion", "gives_effort"]


@dataclass(frozen=True)
class Port:
    """Two variables whose product is power.

    Inertias take effort and give motion (`gives_motion`); compliances, contacts and drives take
    motion and give effort (`gives_effort`).

    Attributes:
        name: e.g. `flange_b`.
        effort, flow: quantities (scalar or vector of equal size), one an input, one an output.
        causality: which of the two the component gives.
        sign: power INTO the component = sign * sum(effort * flow).
        text: where the port sits.
    """

    name: str
    effort: Quantity
    flow: Quantity
    causality: Causality
    sign: Literal[1, -1]
    text: str


@dataclass(frozen=True)
class Component:
    """A physical block: one folder below `sources/`, one file per fidelity.

    Attributes:
        name: the folder's name.
        text: one sentence.
        ports: what all its fidelities offer.
        device: name of the default parameter file, `parameters/<device>.toml`; "" if it has none.
        source: paper and section, or book.
        energy: False for blocks that only carry signals (they have no energy balance).
    """

    name: str
    text: str
    ports: tuple[Port, ...] = ()
    device: str = ""
    source: str = ""
    energy: bool = True


@dataclass(frozen=True)
class Solver:
    """The solver inside the FMU, chosen for the stiffness of one fidelity.

    Attributes:
        method: `rk4` (explicit, order 4), `rodas3` (linearly implicit, L-stable, order 3),
            `dopri5`, `rodas3_adaptive` or, with a Jacobian that is kept for several steps,
            `rosw3_adaptive` (error-controlled).
        step: internal step (largest step of the error-controlled ones) [s].
        tolerance: relative local error of the error-controlled ones.
    """

    method: Literal["rk4", "rodas3", "dopri5", "rodas3_adaptive", "rosw3_adaptive"] = "rk4"
    step: float = 1e-3
    tolerance: float = 1e-6
