"""A component in a finer fidelity of which the present one is a limit: a gear that yields."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..spec.hints import NO_HINTS, from_json
from .parts import Parameter, adjustable, free_parameter
from .problem import Problem

LIMIT = 1e-2
"""A compliance this many times smaller than a typical one is as good as none; a stiffer spring
would only ask for a finer exchange."""
_ELEMENT = re.compile(r"\[\d+\]$")


@dataclass(frozen=True)
class Refinement:
    """A step from a limit to the fidelity that holds it.

    Attributes:
        effect: what it is called among the effects.
        fidelity: short form of the variant, as of `cosim run --set`.
        parameter: that vanishes in the limit, or is infinite there.
        stiff: the parameter that is infinite in the limit, "" if none is.
        port: element that it stands for, "" for the whole component.
        others: further parameters of the element.
        held: parameters and their values without which the limit is another one.
        text: one line.
    """

    effect: str
    fidelity: str
    parameter: str
    stiff: str = ""
    port: str = ""
    others: tuple[str, ...] = ()
    held: tuple[tuple[str, float], ...] = ()
    text: str = ""

    def added_to(self, problem: Problem, instance: str) -> Problem:
        """The problem with a component in this fidelity.

        The strength begins at its limit; the fidelity's other parameters, of an element those that
        belong to it, become parameters of the problem, too.

        Args:
            problem: with the component in a fidelity that is the limit.
            instance: of the system.

        Raises:
            VariantError, UnknownNameError: it does not fit.
        """
        changed = problem.changed(model=problem.model.changed({instance: self.fidelity}))
        description = changed.system().members[instance].description
        variables, hints = description.variables, from_json(description.extra)
        before = problem.system().members[instance].description.variables
        constants = {f"{instance}.{name}": value for name, value in self.held}
        place = f"{instance}.{self.port}" if self.port else instance
        prefix = f"{place}.{self.effect}."
        added = []
        for name, variable in variables.items():
            full = f"{instance}.{name}"
            if name == self.stiff:
                span = 1.0 / float((variable.start or (1.0,))[0] or 1.0)
                own = name == self.parameter
                low = LIMIT * span
                added.append(
                    Parameter(
                        f"{prefix}1/{name}", f"1/({variable.symbol})", low if own else span,
                        low, span / LIMIT, ((full, 1.0),), "effect", strength=own, span=span,
                        text=f"inverse of: {variable.text}", inverse=True,
                    )
                )  # fmt: skip
            elif name == self.parameter:
                added.append(
                    free_parameter(
                        variable, prefix + _own(name), full, strength=True,
                        hints=hints.get(name, NO_HINTS).within(instance, name),
                    )
                )  # fmt: skip
            elif name in self.others or (
                not self.port
                and adjustable(variable)
                and name not in before
                and name not in dict(self.held)
            ):
                added.append(free_parameter(variable, prefix + _own(name), full, strength=False))
        return changed.changed(
            parameters=[*problem.parameters, *added], constants={**problem.constants, **constants}
        )


def _own(name: str) -> str:
    """Name of a parameter behind what already names its effect and its element."""
    return _ELEMENT.sub("", name).rpartition(".")[2]
