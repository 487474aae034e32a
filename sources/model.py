"""Collects the equations of one variant: declared quantities, balances, effects, energy.

A fidelity file defines `equations(m: Model)`; an effect file defines `law(e: EffectModel)`. Both
write CasADi SX expressions and nothing else; the C code, the XML and the tables are made from what
is collected here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca

from .component import Component, Port, Solver
from .declarations import (
    SX,
    Attachment,
    Balance,
    Clock,
    Declared,
    ModelError,
    Role,
    Symbols,
    misfit,
)
from .effect import KINDS
from .quantity import Quantity

__all__ = [
    "SX",
    "Attachment",
    "Balance",
    "Clock",
    "Model",
    "ModelError",
    "Role",
    "Declared",
    "misfit",
]


class Model:
    """Collector of the equations of a variant.

    Every method that declares returns the CasADi symbol (scalar, or column vector for a quantity
    with a size).
    """

    def __init__(
        self,
        component: Component,
        fidelity: str,
        *,
        values: Mapping[str, Any] | None = None,
        attachments: tuple[Attachment, ...] = (),
        slots: Mapping[str, str] | None = None,
        device: str = "",
        prefix: str = "",
        parent: Model | None = None,
        of_effect: str = "",
    ) -> None:
        self.component = component
        self.fidelity = fidelity
        self._of_effect = of_effect
        self.prefix = prefix
        self.values = dict(values or {})
        self.slots = dict(slots or {})
        self.device = device
        self.solver = Solver()
        self._root: Model = parent._root if parent else self
        if parent is None:
            self.time = ca.SX.sym("time")
            self.variables: dict[str, Declared] = {}
            self.derivatives: dict[str, SX] = {}
            self.clocks: list[Clock] = []
            self.balances: dict[str, Balance] = {}
            self.left_out: list[tuple[str, float, str]] = []
            self.attachments = attachments
            self.ports: list[tuple[Port, str]] = []
            self.stored: list[SX] = []
            self.losses: list[tuple[str, SX]] = []
            self.inflows: list[SX] = []
            self.baked: set[str] = set()
            self.asked: set[str] = set()  # values of the device that were asked for by name
            self.stiff: set[str] = set()  # strengths of the effects whose states are stiff
            self._attached: dict[str, str] = {}  # spelling of an attachment -> balance or group
            self._vectors: dict[str, SX] = {}
            self.input_rates: dict[str, SX] = {}

    @property
    def t(self) -> SX:
        """Simulation time [s]."""
        return self._root.time

    # -- quantities ------------------------------------------------------------------------------

    def _full(self, name: str) -> str:
        return f"{self.prefix}.{name}" if self.prefix else name

    def _declare(self, quantity: Quantity, role: Role, symbol: SX | None = None) -> SX:
        root = self._root
        full = self._full(quantity.name)
        if role != "output":
            for values, name in ((self.values, quantity.name), (root.values, full)):
                if name in values:
                    quantity = quantity.with_start(values[name])
        if full in root._vectors:
            raise ModelError(f"{root.component.name}/{root.fidelity}: {full!r} is declared twice")
        names = [self._full(name) for name in quantity.names()]
        if full == "time":
            raise ModelError(
                f"{root.component.name}/{root.fidelity}: every FMU has its own {full!r}; give the "
                "quantity another name, and read the time by m.t"
            )
        if symbol is None:
            symbol = ca.vertcat(*[ca.SX.sym(name) for name in names])
        else:
            symbol = ca.SX(symbol)
            if symbol.numel() != len(names):
                raise ModelError(
                    f"{root.component.name}/{root.fidelity}: {full!r} has {len(names)} elements "
                    f"but its expression has {symbol.numel()}"
                )
        elements = zip(names, quantity.elements(), quantity.starts(), strict=True)
        for index, (name, element, start) in enumerate(elements):
            root.variables[name] = Declared(
                name, element, role, start, symbol[index], self._of_effect
            )
        root._vectors[full] = symbol
        return symbol

    def parameter(self, quantity: Quantity, *, shared: str = "") -> SX:
        """Declare a parameter; its start value is the device's, else the declaration's.

        With `shared`, declare one of parts to come that share it under this prefix (see `part`), or
        return it if that has been done.
        """
        if shared and f"{self._full(shared)}.{quantity.name}" in self._root._vectors:
            return self._root._vectors[f"{self._full(shared)}.{quantity.name}"]
        prefix, self.prefix = self.prefix, self._full(shared) if shared else self.prefix
        try:
            return self._declare(quantity, "parameter")
        finally:
            self.prefix = prefix

    def constant(self, name: str) -> Any:
        """A number (or list) of the device file that is baked into the code.

        Constants keep structural zeros; make a quantity a parameter if users should change it.
        """
        if name not in self.values:
            raise ModelError(
                f"{self.component.name}/{self.fidelity}: the device file has no value {name!r}"
            )
        self._root.baked.add(name)
        return self.given(name)

    def given(self, name: str, default: Any = None) -> Any:
        """A value of the device file as it stands there, `default` without one."""
        self._root.asked.add(name)
        return self.values.get(name, default)

    def input(self, quantity: Quantity) -> SX:
        """Declare an input, held by the master over a communication step."""
        return self._declare(quantity, "input")

    def parameters(self, *quantities: Quantity) -> Symbols:
        """Declare parameters, in this order; `p = m.parameters(K, D)` gives `p.k` and `p.d`."""
        return Symbols({item.name: self.parameter(item) for item in quantities})

    def inputs(self, *quantities: Quantity) -> Symbols:
        """Declare inputs, in this order; `u = m.inputs(TAU_A)` gives `u.tau_a`."""
        return Symbols({item.name: self.input(item) for item in quantities})

    def states(self, *quantities: Quantity) -> Symbols:
        """Declare states, in this order; `x = m.states(TWIST)` gives `x.twist`."""
        return Symbols({item.name: self.state(item) for item in quantities})

    def discretes(self, *quantities: Quantity) -> Symbols:
        """Declare sampled values, in this order; `z = m.discretes(HELD)` gives `z.held`."""
        return Symbols({item.name: self.discrete(item) for item in quantities})

    def input_rate(self, symbol: SX, rate: SX) -> None:
        """Say how an input moves that others of the inputs determine, e.g. an angle by its speed.

        Only the energy test reads it: there inputs count as held unless they have a rate.
        """
        rate = ca.SX(rate)
        for index in range(symbol.numel()):
            self._root.input_rates[symbol[index].name()] = rate[index]

    def state(self, quantity: Quantity, *, part: str = "") -> SX:
        """Declare a continuous state; give its `derivative`.

        The implicit solver eliminates states in the order of their declaration: declare what is
        local (a wheel) before what couples everything (the body). With `part`, declare one of a
        part to come whose inputs depend on it (see `part`).
        """
        prefix, self.prefix = self.prefix, self._full(part) if part else self.prefix
        try:
            return self._declare(quantity, "state")
        finally:
            self.prefix = prefix

    def eliminate_last(self, *states: SX) -> None:
        """Move states behind all others declared so far, e.g. a body's behind its wheels'."""
        for state in states:
            for index in range(state.numel()):
                name = state[index].name()
                self._root.variables[name] = self._root.variables.pop(name)

    def discrete(self, quantity: Quantity) -> SX:
        """Declare a value that only an `update` of a clock changes."""
        return self._declare(quantity, "discrete")

    def output(self, quantity: Quantity, expression: SX) -> SX:
        """Declare an output by its expression; returns the expression."""
        return self._declare(quantity, "output", expression)

    def derivative(self, state: SX, expression: SX) -> None:
        """Set the time derivative of a state that `state()` returned (element by element)."""
        expression = ca.SX(expression)
        if expression.numel() != state.numel():
            raise ModelError(
                f"{self.component.name}/{self.fidelity}: derivative of {state} has "
                f"{expression.numel()} elements instead of {state.numel()}"
            )
        for index in range(state.numel()):
            name = state[index].name()
            if name in self._root.derivatives:
                raise ModelError(f"{name!r} has two derivatives")
            self._root.derivatives[name] = expression[index]

    # -- sampling --------------------------------------------------------------------------------

    def clock(self, name: str, period: SX | float) -> Clock:
        """Declare a sample clock with a period [s] (a number or an expression of parameters)."""
        clock = Clock(self._full(name), ca.SX(period))
        self._root.clocks.append(clock)
        return clock

    def update(self, clock: Clock, discrete: SX, expression: SX) -> None:
        """At each tick of `clock`, replace the discrete variable by the expression."""
        expression = ca.SX(expression)
        if expression.numel() != discrete.numel():
            raise ModelError(
                f"{self.component.name}/{self.fidelity}: update of {discrete} has "
                f"{expression.numel()} elements instead of {discrete.numel()}"
            )
        for index in range(discrete.numel()):
            name = discrete[index].name()
            if name in clock.updates:
                raise ModelError(f"{name!r} has two updates at clock {clock.name!r}")
            clock.updates[name] = expression[index]

    # -- energy ----------------------------------------------------------------------------------

    def port(self, port: Port, effort: SX, flow: SX) -> None:
        """Bind a port's two variables; their product is power that enters the component.

        In a part the port is internal to the whole and only its bookkeeping is dropped.
        """
        if self._root is self:
            self.ports.append((port, port.name))
            self.inflows.append(port.sign * ca.dot(ca.SX(effort), ca.SX(flow)))

    def supply(self, power: SX) -> None:
        """Add power [W] that enters other than through a port, e.g. from an ideal source."""
        self._root.inflows.append(ca.SX(power))

    def stored_energy(self, energy: SX) -> None:
        """Add stored energy [J]."""
        self._root.stored.append(ca.SX(energy))

    def leaves_out(self, what: str, amount: float, unit: str) -> None:
        """Say which part of the real thing, that other fidelities have, this one is without."""
        self._root.left_out.append((what, float(amount), unit))

    def loss(self, name: str, power: SX) -> None:
        """Add a loss [W], positive when it takes energy out of the component."""
        self._root.losses.append((self._full(name), ca.SX(power)))

    # -- effects ---------------------------------------------------------------------------------

    def balance(
        self, name: str, kind: str, *, unit: str = "", sensor: Quantity | None = None, **signals: SX
    ) -> Balance:
        """Open a balance to effects and return what the variant's effects add to it.

        Args:
            name: e.g. `shaft`; effects find it as `effect@shaft`.
            kind: one of `effect.KINDS`.
            unit: unit of the added effort where the kind leaves it open.
            sensor: output that is a sensor's reading, where a signal is one; columns of a log that
                show something else may have a gain and a bias of their own.
            signals: what the effects may read; the kind says which names are obligatory.
        """
        root = self._root
        full = self._full(name)
        declared = KINDS[kind]
        missing = set(declared.signals) - set(signals)
        unknown = set(signals) - set(declared.signals) - set(declared.optional)
        if missing or unknown:
            raise ModelError(
                f"balance {full!r} of kind {kind!r}: missing signals {sorted(missing)}, "
                f"unknown signals {sorted(unknown)}"
            )
        if full in root.balances:
            raise ModelError(f"balance {full!r} is declared twice")
        expressions = {key: ca.SX(value) for key, value in signals.items()}
        if kind == "body":
            effort: SX = ca.SX.zeros(6)
        elif declared.flow:
            effort = ca.SX.zeros(expressions[declared.flow].numel())
        else:
            effort = ca.SX.zeros(expressions["value"].numel())
        balance = Balance(
            full, kind, unit or declared.effort_unit, expressions, effort, self._group(name),
            sensor.name if sensor else "",
        )  # fmt: skip
        balance.lean = ca.SX.zeros(3)
        balance.first_moment = ca.SX.zeros(3)
        balance.inertia = ca.SX.zeros(3, 3)
        root.balances[full] = balance
        for attachment in sorted(root.attachments, key=lambda each: not each.effect.first):
            place = root._attached.get(attachment.spelling, "")
            if not place and self._fits(attachment, balance):
                place = full if attachment.balance == full else balance.group
                root._attached[attachment.spelling] = place
            if place in (full, balance.group):
                from .effect_model import EffectModel  # it builds on this module

                attachment.law(EffectModel(self, attachment, balance, grouped=place != full))
        if not balance.lean.is_zero():
            self._lean(balance)
        return balance

    def _lean(self, balance: Balance) -> None:
        """Let the change of gravity act on a body and on what effects add to it."""
        s = balance.signals
        force = (s["mass"] + balance.mass) * balance.lean
        moment = ca.cross(s["first_moment"] + balance.first_moment, balance.lean)
        balance.effort = balance.effort + ca.vertcat(force, moment)
        self._root.inflows.append(ca.dot(force, s["velocity"]) + ca.dot(moment, s["rate"]))

    def _group(self, name: str) -> str:
        return self._full(name)

    def _fits(self, attachment: Attachment, balance: Balance) -> bool:
        named = attachment.balance
        if named and named not in (balance.name, balance.group):
            return False
        reason = misfit(attachment.effect, balance)
        if reason and named:
            raise ModelError(reason)
        return not reason

    # -- composition -----------------------------------------------------------------------------

    def part(
        self,
        name: str,
        component: Component,
        fidelity: str,
        equations: Any,
        *,
        inputs: Mapping[str, SX],
        parameters: Mapping[str, SX] | None = None,
        values: Mapping[str, Any] | None = None,
        shared: str = "",
    ) -> dict[str, SX]:
        """Build another component's fidelity into this model and return its outputs.

        Its states, balances and losses appear as `name.…`; its energy counts as the whole's.

        Args:
            name: prefix of its states, balances and outputs.
            component, fidelity, equations: what to build in (see `variant.fidelity`).
            inputs: an expression for each of its inputs.
            parameters: expressions for some of its parameters; the others become parameters
                `name.…` of the whole.
            values: start values that replace the declared ones.
            shared: prefix of its parameters, the same for parts that share them (`drive_wheel`
                for a left and a right one).
        """
        part = _Part(
            self, name, component, fidelity, inputs, parameters or {}, values or {}, shared
        )
        equations(part)
        unused = (set(inputs) - part.seen_inputs) | (set(parameters or {}) - part.seen_parameters)
        if unused:
            raise ModelError(
                f"part {name!r} ({component.name}/{fidelity}) has no {', '.join(sorted(unused))}"
            )
        return part.results

    # -- result ----------------------------------------------------------------------------------

    def finish(self) -> Model:
        """Check completeness and add the energy outputs `E_stored`, `P_in` and `P_loss`."""
        where = f"{self.component.name}/{self.fidelity}"
        for attachment in self.attachments:
            if attachment.spelling not in self._attached:
                offers = {
                    place: b.kind for b in self.balances.values() for place in (b.group, b.name)
                }
                offered = ", ".join(f"{b} ({kind})" for b, kind in offers.items()) or "none"
                raise ModelError(
                    f"effect {attachment.spelling!r} fits no balance of {where}: it acts on "
                    f"{', '.join(attachment.effect.kinds)}"
                    + "".join(f" with {need}" for need in attachment.effect.needs)
                    + f"; {where} offers {offered}"
                )
        for name, variable in self.variables.items():
            if variable.role == "state" and name not in self.derivatives:
                raise ModelError(f"{where}: state {name!r} has no derivative")
        if self.component.energy:
            self.output(E_STORED, sum(self.stored, ca.SX(0)))
            self.output(P_IN, sum(self.inflows, ca.SX(0)))
            self.output(P_LOSS, sum((power for _, power in self.losses), ca.SX(0)))
        return self

    def of_role(self, role: Role) -> list[Declared]:
        """The scalar variables of a role, in order of declaration, those of effects last.

        Effects last keeps the elimination order of the implicit solver, and with it every rounding,
        the same as without them.
        """
        chosen = [variable for variable in self.variables.values() if variable.role == role]
        return sorted(chosen, key=lambda variable: bool(variable.of_effect))


E_STORED = Quantity("E_stored", "J", "energy stored in the component")
P_IN = Quantity("P_in", "W", "power that enters through ports and sources")
P_LOSS = Quantity("P_loss", "W", "power that leaves as heat")


class _Part(Model):
    """A component inside another: inputs and some parameters are given, outputs are returned."""

    def __init__(
        self,
        parent: Model,
        name: str,
        component: Component,
        fidelity: str,
        inputs: Mapping[str, SX],
        parameters: Mapping[str, SX],
        values: Mapping[str, Any],
        shared: str,
    ) -> None:
        prefix = parent._full(name)
        super().__init__(
            component, fidelity, values=values, device=parent.device, prefix=prefix, parent=parent
        )
        self._inputs = {key: ca.SX(value) for key, value in inputs.items()}
        self._parameters = {key: ca.SX(value) for key, value in parameters.items()}
        self._shared = parent._full(shared) if shared else prefix
        self.slots = parent.slots
        self.results: dict[str, SX] = {}
        self.seen_inputs: set[str] = set()
        self.seen_parameters: set[str] = set()

    def input(self, quantity: Quantity) -> SX:
        self.seen_inputs.add(quantity.name)
        if quantity.name not in self._inputs:
            raise ModelError(f"part {self.prefix!r}: nothing feeds its input {quantity.name!r}")
        return self._inputs[quantity.name]

    def _group(self, name: str) -> str:
        return f"{self._shared}.{name}"

    def input_rate(self, symbol: SX, rate: SX) -> None:
        """Nothing: the whole determines how the part's inputs move."""

    def parameter(self, quantity: Quantity, *, shared: str = "") -> SX:
        if quantity.name in self._parameters:
            self.seen_parameters.add(quantity.name)
            return self._parameters[quantity.name]
        full = ".".join(filter(None, (self._shared, shared, quantity.name)))
        if full in self._root._vectors:
            return self._root._vectors[full]
        prefix, self.prefix = self.prefix, self._shared
        try:
            return super().parameter(quantity, shared=shared)
        finally:
            self.prefix = prefix

    def state(self, quantity: Quantity, *, part: str = "") -> SX:
        declared = self._root._vectors.get(self._full(quantity.name))
        return super().state(quantity, part=part) if part or declared is None else declared

    def output(self, quantity: Quantity, expression: SX) -> SX:
        self.results[quantity.name] = ca.SX(expression)
        return self.results[quantity.name]


def total(power: SX) -> SX:
    return ca.sum1(ca.vec(ca.SX(power)))
