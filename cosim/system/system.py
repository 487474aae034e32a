"""A system: instances of FMUs and the connections between them.

    system = System("bench", provider=FolderProvider("fmus"))
    system.add("motor", "dc_motor/ideal")
    system.add("gearbox", "gearbox/ratio", {"ratio": 10.0})
    system.connect("motor.tau", "gearbox.tau_a")
    system.connect("gearbox.w_a", "motor.w")
    print(system)

Everything is checked when it is said: names, causality, units, bounds, double drivers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import ConnectError, GraphError, UnitError, UnknownNameError, listing
from ..fmu.archive import Fmu, open_fmu
from ..fmu.description import Description, PowerPort
from ..fmu.values import TYPES, boolean, check_values, plain
from ..fmu.variables import Variable
from ..spec.units import conversion
from . import feedthrough
from .provider import Provider, locate
from .roles import need_end, need_settable


@dataclass(frozen=True)
class Member:
    """An instance of a system.

    Attributes:
        name: e.g. `gearbox`.
        reference: the variant or path that was asked for.
        fmu: what it resolved to.
        parameters: start values and parameters that differ from the FMU's.
    """

    name: str
    reference: str
    fmu: Fmu
    parameters: dict[str, Any]

    @property
    def description(self) -> Description:
        """What the FMU says about itself."""
        return self.fmu.description


@dataclass(frozen=True)
class Connection:
    """A scalar connection: `target = gain * source + offset`.

    Attributes:
        source, target: full names, `instance.variable`; an element of an FMI 3 array is `x[2]`.
    """

    source: str
    target: str
    gain: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Bond:
    """Two connected power ports.

    Attributes:
        first, second: `instance.port`.
        terms: what the power into the two consists of: (effort or flow that the component gives,
            its own input that multiplies it, sign) with full names; those of `first` come first.
    """

    first: str
    second: str
    terms: tuple[tuple[str, str, int], ...]

    @property
    def name(self) -> str:
        """Both ends."""
        return f"{self.first} -- {self.second}"


@dataclass
class System:
    """Instances and connections.

    Args:
        name: for prints and recordings.
        provider: where variants come from; not needed if instances are given by path.
        text: one line on what it is.
    """

    name: str = "system"
    provider: Provider | None = None
    text: str = ""
    members: dict[str, Member] = field(default_factory=dict)
    connections: list[Connection] = field(default_factory=list)
    _drivers: dict[str, str] = field(default_factory=dict)
    _influences: feedthrough.Influences = field(
        default_factory=feedthrough.Influences, init=False, repr=False, compare=False
    )

    # -- building --------------------------------------------------------------------------------

    def add(
        self,
        name: str,
        reference: str,
        parameters: Mapping[str, Any] | None = None,
        *,
        base: Path | None = None,
    ) -> Member:
        """Add an instance.

        Args:
            name: a plain identifier.
            reference: a variant such as `gearbox/ratio`, or the path of an .fmu.
            parameters: values of parameters, start values of states and inputs.
            base: folder against which a relative path is taken.

        Raises:
            GraphError: the name is taken or no identifier.
            VariantError, FmuFileError: no such FMU, or it cannot be read.
        """
        if not name.isidentifier():
            raise GraphError(f"{self.name}: {name!r} cannot name an instance; use letters and _")
        if name in self.members:
            raise GraphError(
                f"{self.name}: there already is an instance {name!r} "
                f"({self.members[name].reference}); choose another name"
            )
        fmu = open_fmu(locate(reference, self.provider, base))
        member = Member(name, reference, fmu, {})
        self.members[name] = member
        for key, value in (parameters or {}).items():
            self.set(f"{name}.{key}", value)
        return member

    def set(self, name: str, value: Any) -> None:
        """Give a parameter or a start value, e.g. `set("gearbox.ratio", 10.0)`.

        Raises:
            UnknownNameError: no such instance or variable.
            ValueRangeError: outside the declared bounds, or not finite.
        """
        member, variables = self.variables(name)
        if variables[0].alias:
            name = self.first_name(name)
            member, variables = self.variables(name)
        first = variables[0]
        need_settable(self.name, member.name, variables)
        where = f"{self.name}: {member.name}"
        found = check_values(where, variables, value)
        if first.index is None:
            for variable in variables if len(variables) > 1 else ():  # said of one of them before
                member.parameters.pop(variable.name, None)
            plain = isinstance(value, (bool, int, float)) and not variables[0].items
            member.parameters[name.partition(".")[2]] = value if plain else _given(value, found)
            return
        whole = member.description.whole(first.name)
        given = member.parameters.get(whole.name)  # as it was written: rows, one for all
        items = list(whole.start) if given is None else check_values(where, [whole], given)
        if len(items) != whole.size:
            raise GraphError(f"{where}.{whole.name} has no start values; set it as a whole")
        items[first.index] = found[0]
        member.parameters[whole.name] = items

    def connect(
        self,
        source: str,
        target: str,
        *,
        factor: float = 1.0,
        offset: float = 0.0,
        convert: bool = True,
    ) -> None:
        """Connect an output to an input; `q` connects all of `q[1]` ... `q[n]`.

        Args:
            source, target: `instance.variable`.
            factor, offset: target = factor * (source in the target's unit) + offset.
            convert: False passes the number on without looking at units.

        Raises:
            UnknownNameError: no such instance or variable.
            ConnectError: wrong causality, type or size, or the input is driven already.
            UnitError: the units do not convert.
        """
        what = f"{self.name}: cannot connect {source} to {target}"
        giver, givers = self.variables(source)
        taker, takers = self.variables(target)
        need_end(what, (giver.name, giver.reference), givers, "output")
        need_end(what, (taker.name, taker.reference), takers, "input")
        outputs = [(v, name) for v in givers for name in v.elements()]
        inputs = [(v, name) for v in takers for name in v.elements()]
        if len(outputs) != len(inputs):
            raise ConnectError(
                f"{what}: {source} has {len(outputs)} elements, {target} has {len(inputs)}"
            )
        found = [
            self._wire(
                what,
                (out, self.first_name(f"{giver.name}.{out_name}")),
                (into, self.first_name(f"{taker.name}.{into_name}")),
                (factor, offset),
                convert,
            )
            for (out, out_name), (into, into_name) in zip(outputs, inputs, strict=True)
        ]
        self.connections += found
        self._drivers.update({wire.target: wire.source for wire in found})

    def _wire(
        self,
        what: str,
        source: tuple[Variable, str],
        target: tuple[Variable, str],
        transformation: tuple[float, float],
        convert: bool,
    ) -> Connection:
        if target[1] in self._drivers:
            raise ConnectError(
                f"{what}: {target[1]} is already driven by {self._drivers[target[1]]}; an input "
                "takes one source"
            )
        for variable, name in (source, target):
            if variable.type not in TYPES:
                raise ConnectError(
                    f"{what}: {name} is of type {variable.type}; values of this type cannot be "
                    "connected"
                )
        out, into = source[0], target[0]
        if _family(out) != _family(into) and not _counts(out, into):
            raise ConnectError(
                f"{what}: types {out.type} and {into.type} do not fit{_way(out, into)}"
            )
        factor, offset = transformation
        if (factor, offset) != (1.0, 0.0) and _family(out) in ("String", "Binary"):
            raise ConnectError(
                f"{what}: a value of type {out.type} takes no factor {factor:g} or offset "
                f"{offset:g}"
            )
        if not (math.isfinite(factor) and math.isfinite(offset)):
            raise ConnectError(f"{what}: factor {factor} and offset {offset} must be finite")
        if convert and out.unit is not None and into.unit is not None:
            try:
                gain, shift = conversion(out.unit, into.unit)
            except UnitError as error:
                raise UnitError(f"{what}: unit {error}") from error
            if out.relative or into.relative:  # a difference of temperatures has no offset
                shift = 0.0
            factor, offset = factor * gain, factor * shift + offset
        return Connection(source[1], target[1], factor, offset)

    # -- looking up ------------------------------------------------------------------------------

    def variables(self, name: str) -> tuple[Member, list[Variable]]:
        """The instance and the variable (or all elements of the vector) that `name` means.

        Raises:
            UnknownNameError: with the nearest names.
        """
        instance, dot, variable = name.partition(".")
        if instance not in self.members:
            raise UnknownNameError(
                f"{self.name}: there is no instance {instance!r} (in {name!r}); "
                f"{listing(self.members, instance)}"
            )
        member = self.members[instance]
        if not dot:
            known = [f"{name}.{item}" for item in member.description.variables]
            raise UnknownNameError(
                f"{self.name}: {name!r} is an instance, not one of its variables; "
                f"{listing(known, f'{name}.')}"
            )
        try:
            return member, member.description.expand(variable)
        except UnknownNameError as error:
            raise UnknownNameError(f"{self.name}: {name!r}: {error}") from None

    def elements(self, name: str) -> list[str]:
        """Full scalar names that `name` means."""
        member, variables = self.variables(name)
        return [f"{member.name}.{element}" for v in variables for element in v.elements()]

    def signals(self) -> list[str]:
        """Full scalar names of all outputs (but clocks), in order."""
        return [
            f"{member.name}.{element}"
            for member in self.members.values()
            for variable in member.description.of("output")
            if variable.type in TYPES
            for element in variable.elements()
        ]

    def first_name(self, name: str) -> str:
        """The first name of a variable that a full name, perhaps an alias, means."""
        instance, _, variable = name.partition(".")
        whole = self.declaration(name)
        return f"{instance}.{whole.alias}{variable[len(whole.name) :]}" if whole.alias else name

    def unit(self, name: str) -> str:
        """Unit of a variable, "" where the FMU declares none."""
        return self.declaration(name).symbol

    def declaration(self, name: str) -> Variable:
        """The FMU's variable that is, or holds, the one of a full scalar name."""
        instance, _, variable = name.partition(".")
        return self.members[instance].description.whole(variable)

    def open_inputs(self) -> list[str]:
        """Full scalar names of the inputs that nothing drives, with their FMU's start value."""
        return [
            f"{member.name}.{element}"
            for member in self.members.values()
            for variable in member.description.of("input")
            for element in variable.elements()
            if f"{member.name}.{element}" not in self._drivers
        ]

    def driver(self, target: str) -> str | None:
        """The output that drives an input, None if nothing does."""
        return self._drivers.get(target)

    def untaken(self) -> list[str]:
        """Full scalar names of outputs that must be passed on, and that no input takes."""
        taken = {connection.source for connection in self.connections}
        return [
            f"{member.name}.{element}"
            for member in self.members.values()
            for name in member.description.extra.get("passed_on", {})
            if name in member.description.variables
            for element in member.description.variables[name].elements()
            if f"{member.name}.{element}" not in taken
        ]

    # -- structure -------------------------------------------------------------------------------

    def dependencies(self) -> Mapping[str, Sequence[str]]:
        """Variable -> variables that it influences at the same instant, through FMUs and wires."""
        return self._influences.of(
            {member.name: member.description for member in self.members.values()},
            self.connections,
        )

    def order(self) -> list[str]:
        """Instances, those first whose outputs others pass on at the same instant."""
        edges: dict[str, list[str]] = {name: [] for name in self.members}
        influences = self.dependencies()
        for connection in self.connections:
            giver, taker = connection.source.partition(".")[0], connection.target.partition(".")[0]
            if influences.get(connection.target) and taker not in edges[giver]:
                edges[giver].append(taker)
        position = {name: index for index, name in enumerate(self.members)}
        return [
            name
            for component in feedthrough.components(self.members, edges)
            for name in sorted(component, key=position.__getitem__)
        ]

    def algebraic_loops(self) -> list[list[str]]:
        """Cycles of variables that depend on each other at the same instant."""
        influences = self.dependencies()
        nodes = list(dict.fromkeys([*influences, *(c.target for c in self.connections)]))
        return feedthrough.loops(nodes, influences)

    def explain_loop(self, loop: list[str]) -> str:
        """A loop, port by port."""
        lines = []
        for name, following in zip(loop, [*loop[1:], loop[0]], strict=True):
            wired = self._drivers.get(following) == name
            lines.append(
                f"  {name} is {'connected to' if wired else 'direct feedthrough to'} {following}"
            )
        return "\n".join(lines)

    def bonds(self) -> list[Bond]:
        """Pairs of power ports whose efforts and flows are connected to each other."""
        takers: dict[str, list[str]] = {}  # who takes the first effort may take all of them
        for connection in self.connections:
            takers.setdefault(connection.source, []).append(connection.target.partition(".")[0])
        place = {name: index for index, name in enumerate(self.members)}
        found = []
        for giver in self.members.values():
            for port in giver.description.ports:
                if port.causality != "gives_effort":
                    continue
                near = takers.get(f"{giver.name}.{port.effort[0]}", ()) if port.effort else place
                for taker in map(self.members.__getitem__, sorted({*near}, key=place.__getitem__)):
                    for other in taker.description.ports:
                        if terms := self._bond_terms(giver, port, taker, other):
                            ends = f"{giver.name}.{port.name}", f"{taker.name}.{other.name}"
                            found.append(Bond(*ends, terms))
        return found

    def _bond_terms(
        self, giver: Member, port: PowerPort, taker: Member, other: PowerPort
    ) -> tuple[tuple[str, str, int], ...]:
        if other.causality != "gives_motion" or len(other.effort) != len(port.effort):
            return ()
        efforts = [(f"{giver.name}.{a}", f"{taker.name}.{b}")
                   for a, b in zip(port.effort, other.effort, strict=True)]  # fmt: skip
        flows = [(f"{taker.name}.{b}", f"{giver.name}.{a}")
                 for a, b in zip(port.flow, other.flow, strict=True)]  # fmt: skip
        if any(self._drivers.get(target) != source for source, target in efforts + flows):
            return ()
        first = [(effort, flow, port.sign)
                 for (effort, _), (_, flow) in zip(efforts, flows, strict=True)]  # fmt: skip
        second = [(flow, effort, other.sign)
                  for (_, effort), (flow, _) in zip(efforts, flows, strict=True)]  # fmt: skip
        return tuple(first + second)

    # -- printing --------------------------------------------------------------------------------

    # -- pictures --------------------------------------------------------------------------------

    def svg(self, marks: Mapping[str, Sequence[str]] | None = None) -> str:
        """The system as a drawing (SVG); instances with marks (short texts) stand out."""
        from ..drawing import svg as drawing

        return drawing.svg(self, marks)

    def _repr_svg_(self) -> str:
        return self.svg()

    def to_svg(self, path: Path | str) -> Path:
        """Write the drawing to a file."""
        from ..drawing import svg as drawing

        return drawing.to_svg(self, path)

    def __str__(self) -> str:
        lines = [f"System {self.name!r}" + (f": {self.text}" if self.text else "")]
        lines.append("instances")
        for member in self.members.values():
            values = ", ".join(f"{key} = {value}" for key, value in member.parameters.items())
            lines.append(
                f"  {member.name} = {member.reference}" + (f" ({values})" if values else "")
            )
        lines.append("connections")
        for connection in self.connections:
            unit = self.unit(connection.target)
            scale = "" if connection.gain == 1.0 else f" x {connection.gain:.9g}"
            shift = f" + {connection.offset:.9g}" if connection.offset else ""
            lines.append(
                f"  {connection.source} -> {connection.target}{scale}{shift}"
                + (f" [{unit}]" if unit else " (no unit declared, not checked)")
            )
        lines.append("open inputs")
        lines += [f"  {name} [{self.unit(name)}]" for name in self.open_inputs()] or ["  none"]
        lines.append("power bonds")
        lines += [f"  {bond.name}" for bond in self.bonds()] or ["  none"]
        for loop in self.algebraic_loops():
            lines += ["algebraic loop", self.explain_loop(loop)]
        return "\n".join(lines)


def _family(variable: Variable) -> str:
    """What may be connected to each other."""
    if variable.type in ("String", "Binary"):
        return variable.type
    return "truth" if boolean(variable.type) else "number"


def _counts(out: Variable, into: Variable) -> bool:
    """Whether a truth value goes into a number as 1 or 0: that loses nothing, but has no unit."""
    plain = into.unit is None or into.unit.symbol in ("", "1")
    return (_family(out), _family(into)) == ("truth", "number") and plain


def _way(out: Variable, into: Variable) -> str:
    match _family(out), _family(into):
        case "truth", "number":
            return f": true is 1, and not 1 {into.symbol}; convert it in one of the two FMUs"
        case "number", "truth":
            return ": a number is neither true nor false; compare it in one of the two FMUs"
    return ""


def _given(value: Any, found: list[Any]) -> Any:
    """A checked value as it is kept: one for all elements as one, lists as they were given."""
    return found[0] if len(found) == 1 and not isinstance(value, (list, tuple)) else plain(value)
