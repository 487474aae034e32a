"""Of parameters that undo a law's strength, those are held that the data do not miss."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.diagnose.redundant import without_redundant

OTHERS: Any = [SimpleNamespace(name="alpha", unit="1/K", nominal=4e-3),
               SimpleNamespace(name="t_th", unit="s", nominal=60.0)]  # fmt: skip


def model(known: dict[str, bool], nats: float = 0.0) -> Any:
    """A fit whose parameters are identifiable or not, so far above the minimum."""
    names = list(known)
    estimate = SimpleNamespace(
        values=dict.fromkeys(names, 1.0), identifiable=np.array(list(known.values())),
        problem=SimpleNamespace(index=names.index),
    )  # fmt: skip
    signature = SimpleNamespace(strength=SimpleNamespace(name="r_th"), fixed={"alpha": 5e-3})
    return SimpleNamespace(estimate=estimate, signature=signature, effects=("heating",), nats=nats)


class Product:
    """Fits of a law in whose data a product of two parameters shows."""

    def __init__(self, lost: float) -> None:
        self.lost, self.asked, self.said = lost, {}, []

    def say(self, text: str) -> None:
        self.said.append(text)

    def held(self, fitted: Any, name: str, value: float) -> Any:
        self.asked[name] = value
        left = [n for n in fitted.estimate.values if n != name]
        return model(dict.fromkeys(left, True), fitted.nats + self.lost)

    def gain(self, fitted: Any, other: Any) -> float:
        return fitted.nats - other.nats


def test_a_parameter_that_undoes_the_strength_keeps_its_usual_value() -> None:
    search = Product(lost=0.1)
    found = without_redundant(search, model({"r_th": False, "alpha": False, "t_th": True}), OTHERS)
    assert search.asked == {"alpha": 5e-3}  # as the effect was tried with, not the nominal value
    assert set(found.estimate.values) == {"r_th", "t_th"} and found.effects == ("heating",)
    assert search.said == ["alpha = 0.005: the data do not tell it from the others"]


@pytest.mark.parametrize(
    ("known", "lost"),
    [
        (
            {"r_th": True, "alpha": False, "t_th": False},
            0.1,
        ),  # of another law, which is one too many
        ({"r_th": False, "alpha": False, "t_th": True}, 100.0),  # the data miss it
        (
            {"r_th": False, "alpha": True, "t_th": True},
            0.1,
        ),  # declared parameters undo the strength
    ],
    ids=["strength known", "missed", "others known"],
)
def test_others_stay_free(known: dict[str, bool], lost: float) -> None:
    before = model(known)
    assert without_redundant(Product(lost), before, OTHERS) is before
