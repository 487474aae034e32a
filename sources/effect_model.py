"""What the law of an effect sees of the model that it is built into."""

from __future__ import annotations

import casadi as ca

from cosim.errors import listing

from .declarations import SX, Attachment, Balance, Clock, ModelError, Symbols
from .model import Model, total
from .quantity import Quantity

EFFECT_LOSS = Quantity("P_loss", "W", "power that the effect takes out as heat")


class EffectModel:
    """What an effect's law sees: the balance it acts on and its own quantities.

    Names are prefixed with the effect's name (`coulomb.tau_c`), or with balance and effect where
    the variant names the balance (`flange_b.coulomb.tau_c`). An effect on a group of balances has
    one set of parameters (`caster.swivel.coulomb.tau_c`) and the rest once per balance.
    """

    def __init__(
        self, model: Model, attachment: Attachment, balance: Balance, *, grouped: bool = False
    ) -> None:
        self._root = model._root
        self._balance = balance
        self._grouped = grouped
        name = attachment.effect.name
        own = f"{attachment.balance}.{name}" if attachment.balance else name
        self._prefix = f"{balance.name}.{name}" if grouped else own
        self._strength = f"{own}.{attachment.effect.strength.name}"
        if attachment.effect.stiff:
            self._root.stiff.add(self._strength)
        self._model = self._declaring(model, self._prefix)
        self._parameters = self._declaring(model, own)
        self.kind = balance.kind
        self.unit = balance.unit or "1"
        self.size = int(balance.effort.numel())

    def _declaring(self, model: Model, prefix: str) -> Model:
        return Model(
            model.component,
            model.fidelity,
            prefix=prefix,
            parent=self._root,
            of_effect=self._strength,
        )

    @property
    def t(self) -> SX:
        """Simulation time [s]."""
        return self._root.time

    def signal(self, name: str) -> SX:
        """A signal of the balance, see `effect.KINDS`.

        Raises:
            ModelError: it offers none of that name.
        """
        if name not in self._balance.signals:
            raise ModelError(
                f"the law of {self._prefix!r} reads the signal {name!r} of {self._balance.name!r}; "
                f"{listing(self._balance.signals, name)}"
            )
        return self._balance.signals[name]

    def signals(self, *names: str, **symbols: str) -> Symbols:
        """Signals of the balance by their names, or by the symbols of a formula.

        `s = e.signals("load", v="velocity")` gives `s.load` and `s.v`.
        """
        named = {name: name for name in names} | symbols
        return Symbols({symbol: self.signal(name) for symbol, name in named.items()})

    def offers(self, name: str) -> bool:
        """Whether the balance has this optional signal."""
        return name in self._balance.signals

    def parameter(self, quantity: Quantity) -> SX:
        """Declare a parameter of the effect."""
        known = self._root._vectors.get(self._parameters._full(quantity.name))
        if self._grouped and known is not None:
            return known
        return self._parameters.parameter(quantity)

    def parameters(self, *quantities: Quantity, **symbols: Quantity) -> Symbols:
        """Declare parameters, in this order, under their names or the symbols of a formula.

        `p = e.parameters(K, f_c=TAU_C)` gives `p.k` and `p.f_c`.
        """
        named = {item.name: item for item in quantities} | symbols
        return Symbols({symbol: self.parameter(item) for symbol, item in named.items()})

    def input(self, quantity: Quantity) -> SX:
        """Declare an input of the FMU that the effect reads."""
        return self._model.input(quantity)

    def state(self, quantity: Quantity) -> SX:
        """Declare a continuous state of the effect."""
        return self._model.state(quantity)

    def derivative(self, state: SX, expression: SX) -> None:
        """Set the derivative of a state."""
        self._model.derivative(state, expression)

    def discrete(self, quantity: Quantity) -> SX:
        """Declare a sampled value of the effect."""
        return self._model.discrete(quantity)

    def clock(self, name: str, period: SX | float) -> Clock:
        """Declare a sample clock."""
        return self._model.clock(name, period)

    def update(self, clock: Clock, discrete: SX, expression: SX) -> None:
        """At each tick, replace the discrete variable."""
        self._model.update(clock, discrete, expression)

    def output(self, quantity: Quantity, expression: SX) -> SX:
        """Declare an output of the effect."""
        return self._model.output(quantity, expression)

    def add(self, effort: SX) -> None:
        """Add an effort to the balance (6 elements, force and moment, for kind `body`).

        One element counts for every shaft, winding or signal of a balance of several.
        """
        effort = ca.SX(effort)
        if effort.numel() == 1 and self.kind != "body":
            effort = ca.repmat(effort, self.size, 1)
        if effort.numel() != self.size:
            raise ModelError(
                f"effect {self._prefix!r} adds {effort.numel()} elements to balance "
                f"{self._balance.name!r}, which has {self.size}"
            )
        share, signals = self._balance.share, self._balance.signals
        self._balance.effort = self._balance.effort + (effort if share is None else share * effort)
        if self.kind == "coefficient":  # the next law acts on what this one has left of it
            signals["value"] = signals["value"] + effort

    def pass_on(self, share: SX, **signals: SX) -> None:
        """Let effects that act after this one see these signals, and add this share of theirs."""
        self._balance.signals |= signals
        self._balance.share = share

    def lean(self, change: SX) -> None:
        """Add to gravity (3), body axes [m/s2]: it acts on all mass of the body, and is supplied.

        The balance must offer `mass` and `first_moment`.
        """
        self._balance.lean = self._balance.lean + change

    def add_mass(self, mass: SX, position: SX, inertia: SX) -> None:
        """Add a rigid mass [kg] at a position (3) [m], with its inertia about its centre (3x3)."""
        position = ca.SX(position)
        self._balance.mass = self._balance.mass + mass
        self._balance.first_moment = self._balance.first_moment + mass * position
        steiner = mass * (ca.dot(position, position) * ca.SX.eye(3) - position @ position.T)
        self._balance.inertia = self._balance.inertia + inertia + steiner

    def loss(self, power: SX) -> None:
        """Report loss power [W]: output `P_loss` of the effect and part of the component's.

        The elements of a vector (a balance of several shafts) are added up.
        """
        power = total(power)
        self._model.output(EFFECT_LOSS, power)
        self._model.loss("P_loss", power)

    def stored_energy(self, energy: SX) -> None:
        """Add energy [J] that the effect stores."""
        self._root.stored.append(total(energy))

    def supply(self, power: SX) -> None:
        """Add power [W] that the effect brings in from outside."""
        self._root.inflows.append(total(power))
