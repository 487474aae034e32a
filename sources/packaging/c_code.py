"""CasADi functions of a variant as C.

CasADi's own generator knows one function at a time. Here a result is computed once wherever it is
needed: what depends on parameters only is worked out when these are set, for all functions
together (`f_constants`), sine and cosine come together, those of states and inputs in one loop, and
laws of absent effects are left out (`guards`). Operations are CasADi's, and no bit depends on where
they are done.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import casadi as ca

from .guards import Chunk, chunks, guards, zeros

FORMS = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_POW: "pow({0}, {1})",
    ca.OP_CONSTPOW: "pow({0}, {1})",
    ca.OP_LT: "{0} < {1}",
    ca.OP_LE: "{0} <= {1}",
    ca.OP_EQ: "{0} == {1}",
    ca.OP_NE: "{0} != {1}",
    ca.OP_AND: "{0} && {1}",
    ca.OP_OR: "{0} || {1}",
    ca.OP_IF_ELSE_ZERO: "{0} ? {1} : 0.0",
    # one instruction, whose result for zeros of different sign is the same on every processor, and
    # which hides a NaN in the first place only
    ca.OP_FMIN: "{0} < {1} ? {0} : {1}",
    ca.OP_FMAX: "{0} > {1} ? {0} : {1}",
    ca.OP_ATAN2: "atan2({0}, {1})",
    ca.OP_COPYSIGN: "copysign({0}, {1})",
    ca.OP_FMOD: "fmod({0}, {1})",
    ca.OP_HYPOT: "hypot({0}, {1})",
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_TAN: "tan({0})",
    ca.OP_ASIN: "asin({0})",
    ca.OP_ACOS: "acos({0})",
    ca.OP_ATAN: "atan({0})",
    ca.OP_SINH: "sinh({0})",
    ca.OP_COSH: "cosh({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_ASINH: "asinh({0})",
    ca.OP_FABS: "fabs({0})",
    ca.OP_FLOOR: "floor({0})",
    ca.OP_CEIL: "ceil({0})",
    ca.OP_SIGN: "{0} < 0.0 ? -1.0 : {0} > 0.0 ? 1.0 : {0}",
    ca.OP_NOT: "!{0}",
    ca.OP_LOG1P: "log1p({0})",
    ca.OP_EXPM1: "expm1({0})",
}
_TRIGONOMETRIC = (ca.OP_SIN, ca.OP_COS)
BATCH, TOGETHER = 2, 2
"""So many angles are worth a loop, which takes a whole number of pairs."""


@dataclass(frozen=True)
class Value:
    """One operation on numbered values.

    Attributes:
        operation: CasADi's.
        of: the numbers of its arguments; of an input which argument and which element.
        constant: of a constant.
        parameters: whether it depends on parameters only, and takes computing.
        depth: how many sines or cosines lie one inside the other up to here.
        zero: the values that make it zero where one of them is zero.
    """

    operation: int
    of: tuple[int, ...]
    constant: float
    parameters: bool
    depth: int
    zero: frozenset[int]


@dataclass(frozen=True)
class Wanted:
    """A function to be written.

    Attributes:
        function: of CasADi.
        arguments: C names of its arguments.
        results: C name and, per element, the place in it (-1: nowhere); None: one after the other.
    """

    function: ca.Function
    arguments: tuple[str, ...]
    results: tuple[tuple[str, Sequence[int] | None], ...]


class Writer:
    """Writes C functions that share what depends on parameters only.

    Args:
        parameters: name of the argument that holds them.
        strengths: the elements of it whose 0 means that an effect is absent.
    """

    def __init__(self, parameters: str = "p", strengths: Collection[int] = ()) -> None:
        self._parameters = parameters
        self._strengths = frozenset(strengths)
        self._values: list[Value] = []
        self._numbers: dict[tuple[object, ...], int] = {}
        self._kept: dict[int, int] = {}

    @property
    def kept(self) -> int:
        """How many numbers depend on parameters only."""
        return len(self._kept)

    def write(self, wanted: Wanted, *, sharing: bool = True) -> str:
        """A function `static void name(const double *…, const double *k, double *…)`.

        Args:
            wanted: what it computes.
            sharing: what depends on parameters only stands in k; else it is worked out inside.

        Raises:
            ValueError: an operation that has no form in C.
        """
        function, body = wanted.function, _Body(self, wanted.arguments, not sharing)
        numbers, results = self._read(function, wanted.arguments)
        order = list(dict.fromkeys(numbers))
        if sharing:
            self._guarded(body, order, [number for *_, number in results])
        else:
            body.batch(self._angles(order))
            for number in order:
                body.need(number)
        # what results are that take no computing
        for *_, number in results:
            body.need(number)
        for result, element, number in results:
            name, places = wanted.results[result]
            place = element if places is None else places[element]
            if place >= 0:
                body.lines.append(f"{name}[{place}] = {body.name(number)};")
        head = [f"const double *restrict {name}" for name in (*wanted.arguments, "k")]
        head += [f"double *restrict {name}" for name, _ in wanted.results]
        lines = "".join(f"  {line}\n" for line in body.lines)
        return f"static void {function.name()}({', '.join(head)}) {{\n{lines}}}\n"

    def _guarded(self, body: _Body, order: Sequence[int], results: Sequence[int]) -> None:
        """Compute the results, each law while its effect is there."""
        computed = [n for n in order if not (self._values[n].parameters or self._leaf(n))]

        def of(number: int, among: Collection[int] = frozenset(computed)) -> list[int]:
            return [n for n in self._values[number].of if n in among]

        found = guards(computed, results, of, lambda n: self._values[n].zero)
        for number in found:  # a sine and its cosine are one call
            if self._values[number].operation == ca.OP_SIN:
                cosine = self.known(ca.OP_COS, self._values[number].of[0])
                if cosine in found:
                    both = found[number], found[cosine]
                    found[number] = found[cosine] = (
                        None if None in both else frozenset().union(*filter(None, both))
                    )
        body.batch(self._angles([n for n in computed if n in found and found[n] is None]))
        left = [n for n in computed if n in found and not body.has(n)]
        within = frozenset(left)
        for chunk in chunks(left, found.__getitem__, lambda n: of(n, within)):
            body.chunk(chunk)

    def _leaf(self, number: int) -> bool:
        return self._values[number].operation in (ca.OP_CONST, ca.OP_INPUT)

    def _angles(self, order: Sequence[int]) -> list[int]:
        """Angles of states and inputs whose sines or cosines are among these, in their order."""
        angles = dict.fromkeys(
            self._values[n].of[0]
            for n in order
            if self._values[n].operation in _TRIGONOMETRIC
            and self._values[n].depth == 1
            and not self._values[n].parameters
        )
        return list(angles) if len(angles) >= BATCH else []

    def constants(self) -> str:
        """`f_constants(p, k)`: what all functions written so far need of the parameters."""
        body = _Body(self, (self._parameters,), keeping=True)
        for number in sorted(self._kept):
            body.need(number)
        body.lines += [f"k[{k}] = {body.name(n)};" for n, k in self._kept.items()]
        lines = "".join(f"  {line}\n" for line in body.lines)
        return (
            f"static void f_constants(const double *restrict {self._parameters}, "
            f"double *restrict k) {{\n{lines}}}\n"
        )

    @property
    def parameter_name(self) -> str:
        """Name of the argument that holds the parameters."""
        return self._parameters

    def known(self, operation: int, angle: int) -> int | None:
        """The number of an operation on an angle, None if no function has it."""
        return self._numbers.get((operation, (angle,), (0.0).hex(), ""))

    def value(self, number: int) -> Value:
        """What stands behind a number."""
        return self._values[number]

    def keep(self, number: int) -> int:
        """The place in `k` of a value that depends on parameters only."""
        return self._kept.setdefault(number, len(self._kept))

    def _read(
        self, function: ca.Function, arguments: Sequence[str]
    ) -> tuple[list[int], list[tuple[int, int, int]]]:
        """The numbers of a function's values in order, and (result, element, number)."""
        registers: dict[int, int] = {}
        numbers: list[int] = []
        results: list[tuple[int, int, int]] = []
        for k in range(function.n_instructions()):
            operation = function.instruction_id(k)
            inputs, outputs = function.instruction_input(k), function.instruction_output(k)
            if operation == ca.OP_OUTPUT:
                results.append((outputs[0], outputs[1], registers[inputs[0]]))
                continue
            constant, name, of = 0.0, "", tuple(inputs)
            if operation == ca.OP_CONST:
                constant = function.instruction_constant(k)
            elif operation == ca.OP_INPUT:
                name = arguments[inputs[0]]
            elif operation in FORMS or operation in _TRIGONOMETRIC:
                of = tuple(registers[i] for i in inputs)
                if operation in FORMS and "{1}" not in FORMS[operation]:
                    of = of[:1]
            else:
                raise ValueError(f"{function.name()}: CasADi operation {operation} has no C form")
            number = self._number(operation, of, constant, name)
            registers[outputs[0]] = number
            numbers.append(number)
        return numbers, results

    def _number(self, operation: int, of: tuple[int, ...], constant: float, name: str) -> int:
        key = (operation, of, constant.hex(), name)  # two zeros differ
        if key not in self._numbers:
            leaf = operation in (ca.OP_CONST, ca.OP_INPUT)
            below = [] if leaf else [self._values[n] for n in of]
            fixed = not leaf and all(
                v.parameters
                or v.operation == ca.OP_CONST
                or (v.operation == ca.OP_INPUT and v.of[0] < 0)
                for v in below
            )
            depth = max((v.depth for v in below), default=0) + (operation in _TRIGONOMETRIC)
            zero = frozenset[int]()
            if operation == ca.OP_INPUT:  # of the parameters: -1
                of = (-1 if name == self._parameters else of[0], of[1])
                if of[0] < 0 and of[1] in self._strengths:
                    zero = frozenset([len(self._values)])
            elif not leaf:
                asked = of[0] if below[0].parameters else None
                zero = zeros(operation, [v.zero for v in below], asked)
            self._values.append(Value(operation, of, constant, fixed, depth, zero))
            self._numbers[key] = len(self._values) - 1
        return self._numbers[key]


class _Body:
    """The statements of a function, each value before it is used."""

    def __init__(self, writer: Writer, arguments: Sequence[str], keeping: bool = False) -> None:
        self.lines: list[str] = []
        self._writer, self._arguments, self._keeping = writer, arguments, keeping
        self._names: dict[int, str] = {}
        self._inside: list[str] | None = None

    def name(self, number: int) -> str:
        """How a value is referred to."""
        return self._names[number]

    def need(self, number: int) -> None:
        """Compute a value and what it hangs on, unless it is there."""
        stack = [number]
        while stack:
            top = stack[-1]
            value = self._writer.value(top)
            leaf = value.operation in (ca.OP_CONST, ca.OP_INPUT)
            if top in self._names:
                stack.pop()
            elif value.parameters and not self._keeping:
                self._names[top] = f"k[{self._writer.keep(top)}]"
            elif not leaf and (missing := [n for n in value.of if n not in self._names]):
                stack += reversed(missing)
            else:
                self._state(top, value)

    def has(self, number: int) -> bool:
        """Whether a value has been computed."""
        return number in self._names

    def chunk(self, chunk: Chunk) -> None:
        """Compute values, or leave them at zero, as their guard says."""
        if chunk.guard is None:
            for number in chunk.numbers:
                self.need(number)
            return
        for gate in sorted(chunk.guard):
            self.need(gate)
        asked = " || ".join(f"{self._names[gate]} != 0.0" for gate in sorted(chunk.guard))
        before, self.lines = self.lines, []
        self._inside = []
        for number in chunk.numbers:
            self.need(number)
        declared = [f"double {name} = 0.0;" for name in self._inside]
        inside, self._inside = self.lines, None
        self.lines = [*before, *declared, f"if ({asked}) {{", *inside, "}"]

    def batch(self, angles: Sequence[int]) -> None:
        """Sines and cosines of several angles, by one loop."""
        if not angles:
            return
        for number in angles:
            self.need(number)
        names = [self._names[number] for number in angles]
        names += ["0.0"] * (-len(names) % TOGETHER)
        n = len(names)
        self.lines.append(f"const double angles[] = {{{', '.join(names)}}};")
        self.lines.append(f"double sines[{n}], cosines[{n}];")
        self.lines.append(f"sines_cosines({n}, angles, sines, cosines);")
        for place, number in enumerate(angles):
            self._turned(number, f"sines[{place}]", f"cosines[{place}]")

    def _turned(self, angle: int, sine: str, cosine: str) -> None:
        for operation, name in zip(_TRIGONOMETRIC, (sine, cosine), strict=True):
            known = self._writer.known(operation, angle)
            if known is not None:
                self._names[known] = name

    def _state(self, number: int, value: Value) -> None:
        if value.operation == ca.OP_CONST:
            self._names[number] = _literal(value.constant)
            return
        if value.operation == ca.OP_INPUT:
            which, element = value.of
            name = self._writer.parameter_name if which < 0 else self._arguments[which]
            self._names[number] = f"{name}[{element}]"
            return
        arguments = [self._names[n] for n in value.of]
        if value.operation in _TRIGONOMETRIC:
            if self._inside is None:
                self.lines.append(f"double s{number}, c{number};")
            else:
                self._inside += [f"s{number}", f"c{number}"]
            self.lines.append(f"sine_cosine({arguments[0]}, &s{number}, &c{number});")
            self._turned(value.of[0], f"s{number}", f"c{number}")
            return
        text = FORMS[value.operation].format(*arguments)
        if self._inside is None:
            self.lines.append(f"const double a{number} = {text};")
        else:
            self._inside.append(f"a{number}")
            self.lines.append(f"a{number} = {text};")
        self._names[number] = f"a{number}"


def _literal(value: float) -> str:
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    return repr(value) if value >= 0 and math.copysign(1.0, value) > 0 else f"({value!r})"
