"""Parameters of a law that undo its strength are held.

Where only a product of two shows in the data (a thermal resistance and a temperature coefficient),
both are open, and the interval of the strength holds absence though the law is there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from ..calibrate.parts import Parameter
from .models import GATE, Fitted


class Fits(Protocol):
    """Fits models (`Fitter`)."""

    def say(self, text: str, /) -> None:
        """Told what is done."""

    def held(self, fitted: Fitted, name: str, value: float) -> Fitted | None:
        """A model quickly fitted with one parameter held; None if it cannot be simulated."""

    def gain(self, fitted: Fitted, other: Fitted) -> float:
        """How much better the other one is [nats]."""


def without_redundant(search: Fits, fitted: Fitted, others: Sequence[Parameter]) -> Fitted:
    """A model with open parameters of its last effect at their usual values, if nothing is lost.

    Only where its strength is open: parameters that another law undoes (the place of a payload
    beside a shift of the load) say which of the two is one too many.

    Args:
        search: fits.
        fitted: the model.
        others: parameters of the effect beside its strength.
    """
    item = fitted.signature
    if item is None:
        return fitted
    usual = {p.name: item.fixed.get(p.name, p.nominal) for p in others}
    return at_usual(search, fitted, usual, lambda now: is_undetermined(now, item.strength.name))


def at_usual(
    search: Fits,
    fitted: Fitted,
    usual: Mapping[str, float],
    wanted: Callable[[Fitted], bool] = lambda now: True,
) -> Fitted:
    """A model with open parameters at their usual values, one after another, if nothing is lost.

    Args:
        search: fits.
        fitted: the model.
        usual: values of parameters, which may be free.
        wanted: whether to go on.
    """
    for name, value in usual.items():
        if not wanted(fitted):
            break
        if name not in fitted.estimate.values or not is_undetermined(fitted, name):
            continue
        less = search.held(fitted, name, value)
        if less is not None and search.gain(less, fitted) <= GATE:
            search.say(f"{name} = {value:g}: the data do not tell it from the others")
            less.effects, less.signature = fitted.effects, fitted.signature
            fitted = less
    return fitted


def is_undetermined(fitted: Fitted, name: str) -> bool:
    """Whether the data leave a parameter open."""
    return not fitted.estimate.identifiable[fitted.estimate.problem.index(name)]
