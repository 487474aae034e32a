"""What a component promises to its neighbours, whatever its fidelity: ports and shared names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
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
        like: component with the same balances; effects are catalogued of that one only.
        devices_of: component whose shipped parameter files are this one's too.
        relay: whether it passes values on within an instant: masters that hold values over a step
            fetch its outputs anew, so that a signal through it is no later than one without it.
    """

    name: str
    text: str
    ports: tuple[Port, ...] = ()
    device: str = ""
    source: str = ""
    energy: bool = True
    like: str = ""
    devices_of: str = ""
    relay: bool = False


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


@dataclass(frozen=True)
class Fidelity:
    """One set of equations of a component: what its module declares besides `equations(m)`.

    A finer fidelity contains another one as a limit (`limits`) by a quantity that is infinite there
    (`stiff`) or by quantities that vanish there (`soft`); a search tries it like an effect.

    Attributes:
        level: order among the component's fidelities, 0 is the simplest.
        solver: the solver inside the FMU.
        slots: part that a variant may exchange -> its fidelity unless the variant names another.
        limits: fidelity that is the limit -> values without which the limit is another one.
        stiff: quantity that is infinite in the limit.
        soft: quantities of an element (a joint); the first vanishes in the limit, where the others
            mean nothing. Their elements count one by one.
        called: what a search calls an element with `soft` quantities.
        places: balances of these elements, one each.

    Raises:
        ValueError: limits without what makes them, or what makes them without limits.
    """

    level: int
    solver: Solver = Solver()
    slots: Mapping[str, str] = field(default_factory=dict)
    limits: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    stiff: Quantity | None = None
    soft: tuple[Quantity, ...] = ()
    called: str = ""
    places: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        makers = (self.stiff is not None) + bool(self.soft)
        if makers != bool(self.limits):
            raise ValueError(
                f"a fidelity with limits ({', '.join(self.limits) or 'none'}) needs exactly one of "
                f"stiff and soft, one without limits neither; it has {makers}"
            )
        elements = self.soft[0].size if self.soft else 0
        if bool(self.called) != bool(self.soft) or len(self.places) != elements:
            raise ValueError(
                f"soft quantities of {elements} elements need `called` and as many places; "
                f"called is {self.called!r} and places are {', '.join(self.places) or 'none'}"
            )
