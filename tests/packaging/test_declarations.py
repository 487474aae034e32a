"""A component or effect whose declaration is wrong is refused with a text, not passed over."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sources import variant
from sources.component import Fidelity
from sources.model import Model, ModelError
from sources.quantity import Quantity

READERS = (variant.components, variant.fidelities, variant.effects)
LEVEL_0 = "from sources.component import Fidelity\nFIDELITY = Fidelity(level=0)\n"
STRENGTH = "Quantity('c', '1', 'strength', strength=True)"
EFFECT = (
    "from sources.effect import Effect\nfrom sources.quantity import Quantity\n"
    f"EFFECT = Effect({{name!r}}, 'text', ('signal',), {STRENGTH})\n"
)
Write = Callable[[str, str, str], None]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Write]:
    """Writes `file` as if it lay in the folder of `package`."""
    before = set(sys.modules)

    def add(package: str, file: str, text: str) -> None:
        folder = tmp_path / package
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8")
        module: Any = importlib.import_module(package)
        monkeypatch.setattr(module, "__path__", [*module.__path__, str(folder)])
        for reader in READERS:
            reader.cache_clear()

    yield add
    for name in set(sys.modules) - before:
        # modules written here end with the test; their parents hold them as attributes, too
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]
    for reader in READERS:
        reader.cache_clear()


@pytest.mark.parametrize(
    ("package", "file", "text", "message"),
    [
        (
            "sources.gearbox", "planetary.py", "def equations(m): ...",
            "sources.gearbox.planetary needs `FIDELITY = Fidelity(...)`; it has no FIDELITY",
        ),
        (
            "sources.gearbox", "planetary.py", "FIDELITY = 3\ndef equations(m): ...",
            "sources.gearbox.planetary needs `FIDELITY = Fidelity(...)`; it has FIDELITY = 3",
        ),
        (
            "sources.gearbox", "planetary.py", LEVEL_0 + "def equation(m): ...",
            "sources.gearbox.planetary declares a FIDELITY but has no `equations(m)`",
        ),
        (
            "sources.effects", "dust.py", "def law(e): ...",
            "sources.effects.dust needs `EFFECT = Effect(...)`; it has no EFFECT",
        ),
        (
            "sources.effects", "dust.py", EFFECT.format(name="dirt") + "def law(e): ...",
            "sources.effects.dust: EFFECT is named 'dirt' instead of 'dust'",
        ),
        (
            "sources.effects", "dust.py", EFFECT.format(name="dust"),
            "sources.effects.dust declares an EFFECT but has no `law(e)`",
        ),
        (
            "sources", "spring/__init__.py", "COMPONENTS = ()",
            "sources.spring needs `COMPONENT = Component(...)`; it has no COMPONENT",
        ),
    ],
)  # fmt: skip
def test_a_missing_declaration_is_named(
    write: Write, package: str, file: str, text: str, message: str
) -> None:
    write(package, file, text)
    with pytest.raises(ModelError) as caught:
        variant.components(), variant.effects(), variant.fidelities("gearbox")
    assert str(caught.value) == message


def test_a_helper_without_equations_is_no_fidelity(write: Write) -> None:
    write("sources.gearbox", "teeth.py", "COUNT = 3")
    assert list(variant.fidelities("gearbox")) == ["ratio", "lossy", "elastic"]


def test_a_limit_that_is_no_fidelity_is_refused(write: Write) -> None:
    declared = "Fidelity(level=3, stiff=Quantity('k', '1', 'stiffness'), limits={'rato': {}})"
    text = (
        "from sources.component import Fidelity\nfrom sources.quantity import Quantity\n"
        f"FIDELITY = {declared}\ndef equations(m): ..."
    )
    write("sources.gearbox", "planetary.py", text)
    with pytest.raises(variant.UnknownVariantError) as caught:
        variant.fidelities("gearbox")
    assert str(caught.value) == (
        "there is no fidelity, named as a limit by sources.gearbox.planetary, called 'rato'; "
        "did you mean 'ratio'? There is ratio, lossy, elastic, planetary"
    )


def test_a_misspelt_field_is_refused() -> None:
    fields: dict[str, Any] = {"limit": {}}
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'limit'$"):
        Fidelity(level=0, **fields)


K = Quantity("k", "N.m/rad", "stiffness")
C = Quantity("c", "rad/(N.m)", "compliances", size=2)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"limits": {"ratio": {}}},
            "a fidelity with limits (ratio) needs exactly one of stiff and soft, one without "
            "limits neither; it has 0",
        ),
        (
            {"limits": {"ratio": {}}, "stiff": K, "soft": (C,), "called": "x"},
            "a fidelity with limits (ratio) needs exactly one of stiff and soft, one without "
            "limits neither; it has 2",
        ),
        (
            {"stiff": K},
            "a fidelity with limits (none) needs exactly one of stiff and soft, one without "
            "limits neither; it has 1",
        ),
        (
            {"limits": {"ratio": {}}, "soft": (C,), "called": "x", "places": ("one",)},
            "soft quantities of 2 elements need `called` and as many places; called is 'x' and "
            "places are one",
        ),
        (
            {"limits": {"ratio": {}}, "soft": (C,), "places": ("one", "two")},
            "soft quantities of 2 elements need `called` and as many places; called is '' and "
            "places are one, two",
        ),
    ],
)
def test_limits_need_what_makes_them(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        Fidelity(level=1, **fields)
    assert str(caught.value) == message


def test_a_misspelt_symbol_is_told_which_there_are() -> None:
    p = Model(variant.components()["gearbox"], "ratio").parameters(K, C)
    assert p.c.numel() == 2
    with pytest.raises(AttributeError, match=r"^no symbol 'kk'; declared are k, c$"):
        p.kk  # noqa: B018 - the access is what fails


def test_sampled_values_are_declared_in_their_order() -> None:
    m = Model(variant.components()["gearbox"], "ratio")
    z = m.discretes(C, K)
    assert [v.name for v in m.of_role("discrete")] == ["c[1]", "c[2]", "k"]
    tick = m.clock("tick", 0.1)
    m.update(tick, z.k, z.c[0])
    assert set(tick.updates) == {"k"}


@pytest.fixture
def bare() -> Model:
    return Model(variant.components()["command_link"], "test")


def test_an_update_has_as_many_elements_as_its_value_and_one_expression(bare: Model) -> None:
    tick, held = bare.clock("tick", 1.0), bare.discrete(Quantity("z", "1", "two", size=2))
    with pytest.raises(ModelError, match="has 4 elements instead of 2"):
        bare.update(tick, held, np.ones(4))
    bare.update(tick, held, np.ones(2))
    with pytest.raises(ModelError, match=r"'z\[1\]' has two updates at clock 'tick'"):
        bare.update(tick, held, np.zeros(2))
    bare.update(bare.clock("other", 2.0), held, np.zeros(2))  # each clock has its own


def test_a_quantity_is_not_called_as_the_time_of_every_fmu(bare: Model) -> None:
    with pytest.raises(ModelError, match="give the quantity another name"):
        bare.input(Quantity("time", "s", "time of another clock"))
