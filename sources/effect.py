"""What an effect is: an additive law with its own parameters and states, attached to a balance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from .quantity import Quantity

if TYPE_CHECKING:
    from .effect_model import EffectModel

SX = Any


@dataclass(frozen=True)
class Kind:
    """A kind of balance: what an effect adds to it and which signals it may read.

    Attributes:
        effort_unit: unit of what is added ("" where it depends on the balance).
        flow: signal whose product with the effort is power, "" if the balance carries none.
        signals: name -> meaning of the signals that every balance of this kind offers.
        optional: signals that some balances offer on top.
    """

    effort_unit: str
    flow: str
    signals: MappingProxyType[str, str]
    optional: MappingProxyType[str, str] = field(default_factory=lambda: MappingProxyType({}))


def _names(**entries: str) -> MappingProxyType[str, str]:
    return MappingProxyType(entries)


KINDS: dict[str, Kind] = {
    "rotation": Kind(
        "N.m",
        "velocity",
        _names(velocity="angular velocity of the shaft [rad/s]"),
        _names(
            angle="angle of the shaft [rad]",
            load="torque transmitted through the shaft [N.m]",
            reaction="torque of weight and process on the shaft [N.m]",
            normal="normal force that presses the friction partners together [N]",
            radius="radius of the wheel on the shaft [m]",
        ),
    ),
    "translation": Kind(
        "N",
        "velocity",
        _names(velocity="velocity [m/s]"),
        _names(position="position [m]", load="transmitted force [N]", normal="normal force [N]"),
    ),
    "winding": Kind(
        "V",
        "current",
        _names(current="winding current [A]"),
        _names(
            speed="rotor speed [rad/s]",
            voltage="terminal voltage [V]",
            resistance="winding resistance [ohm]",
            emf_constant="back-EMF constant [V.s/rad]",
        ),
    ),
    "compliance": Kind(
        "N.m",
        "rate",
        _names(
            deflection="twist [rad]", rate="twist rate [rad/s]", stiffness="stiffness [N.m/rad]"
        ),
        _names(damping="damping of the twist [N.m.s/rad]"),
    ),
    "signal": Kind(
        "",
        "",
        _names(value="the undisturbed signal"),
        _names(wheels="speeds of wheels that one controller commands [rad/s]"),
    ),
    "coefficient": Kind(
        "",
        "",
        _names(value="the coefficient, as the effects before this one leave it"),
        _names(
            x="floor position x [m]",
            y="floor position y [m]",
            angle="wheel angle [rad]",
            speed="speed that the coefficient may depend on",
            turning="speed of the shaft with whose angle the coefficient may repeat [rad/s]",
            current="current that the coefficient may depend on [A]",
            side="-1 right, +1 left of the vehicle",
            longitudinal="the same coefficient along the track or wheel",
            roller="load on each wheel that runs across on rollers [N]",
        ),
    ),
    "pivot": Kind(
        "N.m",
        "spin",
        _names(
            spin="rotation rate of the contact patch about the vertical [rad/s]",
            rolling="rolling speed of the wheel over the floor [m/s]",
            normal="normal force [N]",
        ),
    ),
    "across": Kind(
        "m/s",
        "",
        _names(
            value="the undisturbed speed across the base",
            along="speed along the base [m/s]",
            turning="yaw rate of the base [rad/s]",
        ),
    ),
    "body": Kind(
        "",
        "",
        _names(
            velocity="velocity of the reference point, body axes [m/s], 3",
            rate="angular velocity, body axes [rad/s], 3",
            gravity="gravity, body axes [m/s2], 3",
        ),
        _names(
            position="position of the reference point in the world [m], 3",
            rotation="rotation matrix body to world, 3x3",
            mass="mass without what effects add [kg]",
            first_moment="mass times position of the mass centre, without effects [kg.m], 3",
        ),
    ),
    "position": Kind("m", "", _names(value="the undisturbed position, body axes [m], 3")),
    "pose": Kind("", "", _names(value="the undisturbed planar pose x [m], y [m], yaw [rad], 3")),
    "point": Kind("m", "", _names(value="the undisturbed point in a fixed frame [m], 2 or 3")),
    "picture": Kind("m", "", _names(value="points in a picture [m]: x of all, then y of all")),
    "scale": Kind("1", "", _names(value="the undisturbed scale of a picture")),
    "bundle": Kind("", "", _names(value="signals of several units that travel together")),
    "gravity": Kind("m/s2", "", _names(value="gravity, in axes taken as level [m/s2], 3")),
}
"""Kinds of balances. A `pivot` is a torque balance about the vertical of a floor contact; `across`
is the speed across a base whose wheels roll; a `body` takes a wrench (force and moment at the
reference point, body axes) and additional mass. `pose`, `point` and `bundle` are signals with more
structure or less than `signal`, whose elements all have the unit of the balance."""


@dataclass(frozen=True)
class Effect:
    """An effect's declaration; the module also holds its `law(e)`.

    Attributes:
        name: the file's name.
        text: one sentence.
        kinds: kinds of balances that it can be attached to, in order of preference.
        strength: the quantity whose value 0 is the effect's exact absence.
        needs: signals beyond the obligatory ones of the kind that the law reads.
        unless: signals of balances at which it has no place (wheels that roll have no magnets).
        source: book or paper.
        unit: unit of what it adds, where the kind leaves it open: the effect fits only balances
            with this unit ("" fits any).
        probe: whether it stands for no law of physics and is no explanation.
        alone: whether it is looked for where its balance comes with a finer fidelity only, together
            with that (play in a gear that is declared as rigid).
        random: whether it draws random numbers: its values say nothing about a log.
        general: effect with the same law for any unit, which need not be tried where this one fits.
        contains: effects that its law becomes for some values of its parameters: a bristle that
            does not give way is Coulomb friction. Data that do not tell the two apart have it.
        first: whether it acts before the other effects of its balance, which see what it leaves.
        stiff: whether its state may be faster than a solver's fixed step: while it is present, the
            FMU steps by `rodas3_adaptive` in place of `rk4` and `rodas3`. A strength in seconds is
            taken for the state's time constant: while that is shorter than two steps.
    """

    name: str
    text: str
    kinds: tuple[str, ...]
    strength: Quantity
    needs: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()
    source: str = ""
    unit: str = ""
    general: str = ""
    probe: bool = False
    random: bool = False
    alone: bool = False
    contains: tuple[str, ...] = ()
    first: bool = False
    stiff: bool = False

    def __post_init__(self) -> None:
        for kind in self.kinds:
            if kind not in KINDS:
                raise ValueError(f"effect {self.name!r}: unknown kind of balance {kind!r}")
        if not self.strength.strength:
            raise ValueError(f"effect {self.name!r}: its strength quantity is not marked as such")


Law = Callable[["EffectModel"], None]
