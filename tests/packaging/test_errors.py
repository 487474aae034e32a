"""What building and checking say when they cannot do what is asked, and what they leave behind."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from cosim.errors import listing
from cosim.fmu.check import check
from sources.effect import Effect
from sources.model import ModelError
from sources.packaging import native
from sources.packaging.build import build
from sources.packaging.cache import cache_folder
from sources.variant import UnknownVariantError, components, effects
from tests.cosim_fmus import rewrite
from tests.fmus import fmu

COMPONENTS = ", ".join(components())
EFFECTS = ", ".join(effects())


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (
            "gearbox ratio",
            "'gearbox ratio' is not a variant name; write component/fidelity, then +effect or "
            "+effect@balance as often as wanted, e.g. gearbox/elastic+backlash",
        ),
        (
            "gearbx/ratio",
            f"there is no component 'gearbx'; {listing(COMPONENTS.split(', '), 'gearbx')}",
        ),
        (
            "gearbox/rato",
            "there is no fidelity of 'gearbox' called 'rato'; did you mean 'ratio'? There is "
            "ratio, lossy, elastic",
        ),
        (
            "gearbox.mir/ratio",
            "component 'gearbox' has no device 'mir'; did you mean 'mir250'? There is mir250, "
            "lab_base, lab_bench",
        ),
        (
            "gearbox/ratio+coulom",
            f"there is no effect 'coulom'; {listing(EFFECTS.split(', '), 'coulom')}",
        ),
        (
            "gearbox/ratio[mesh=ratio]",
            "there is no slot of gearbox/ratio called 'mesh'; there is none",
        ),
        ("gearbox/ratio+coulomb+coulomb", None),
    ],
)
def test_unknown_names_are_told_what_there_is(
    name: str, message: str | None, tmp_path: Path
) -> None:
    with pytest.raises(UnknownVariantError) as caught:
        build(name, out=tmp_path)
    if message is None:
        message = f"variant {name}: an effect is named twice"
    assert str(caught.value) == message
    assert list(tmp_path.iterdir()) == []


def test_an_effect_without_its_balance_is_told_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(ModelError) as caught:
        build("inertia/disc+backlash", out=tmp_path)
    backlash: Effect = effects()["backlash"].EFFECT
    assert str(caught.value).startswith(
        f"effect 'backlash' fits no balance of inertia/disc: it acts on {', '.join(backlash.kinds)}"
    )
    assert "inertia/disc offers flange (rotation)" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_balance_is_told_which_there_are(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"'coulomb@shaft' fits no balance of inertia/disc: .*"):
        build("inertia/disc+coulomb@shaft", out=tmp_path)


def test_a_signal_that_a_balance_has_not_is_told_which_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(effects()["coulomb"], "law", lambda e: e.signal("speed"))
    with pytest.raises(
        ModelError,
        match=r"the law of 'coulomb' reads the signal 'speed' of 'flange'; .*there is velocity",
    ):
        build("inertia/disc+coulomb", out=tmp_path)


def test_python_fmus_are_fmi_2(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^python FMUs are FMI 2\.0 \(pythonfmu writes no other"):
        build("inertia/disc", out=tmp_path, fmi=3, kind="python")


def test_a_failing_compiler_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "zig").symlink_to(cache_folder("zig"), target_is_directory=True)
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "cache"))
    good = native.with_token
    monkeypatch.setattr(native, "with_token", lambda *a: good(*a) + "int broken(void) { return }\n")
    with pytest.raises(native.CompilerError) as caught:
        build("inertia/disc", out=tmp_path / "out")
    assert str(caught.value).startswith("compiling inertia_disc for ")
    assert "model.c" in str(caught.value) and "expected expression" in str(caught.value)
    assert not (tmp_path / "out").exists()
    left = [path.name for path in (tmp_path / "cache").iterdir() if path.name != "zig"]
    for folder in left:
        assert list((tmp_path / "cache" / folder).iterdir()) == [], folder


def test_a_failing_compiler_leaves_the_old_fmu(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = build("inertia/disc", out=tmp_path)
    old = path.read_bytes()
    monkeypatch.setattr("sources.packaging.ready.sources_key", lambda: "sources have changed")
    good = native.with_token
    monkeypatch.setattr(native, "with_token", lambda *a: good(*a) + "#error changed\n")
    with pytest.raises(native.CompilerError, match="changed"):
        build("inertia/disc", out=tmp_path)
    assert path.read_bytes() == old
    assert [item.name for item in path.parent.iterdir()] == [path.name]


# -- check ----------------------------------------------------------------------------------------


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    path = tmp_path / "sample.fmu"
    path.write_bytes(fmu("inertia/disc").read_bytes())
    assert check(path) == []
    return path


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('unit="N.m" ', "", "variable 'tau' has no unit"),
        ('canGetAndSetFMUstate="true" ', "", "canGetAndSetFMUstate is not declared"),
        ('name="tau"', 'name="torque"', "port 'flange' names the unknown variable 'tau'"),
        ('start="0.0"', "", "start"),
    ],
)
def test_a_description_that_breaks_our_promises_is_a_problem(
    archive: Path, old: str, new: str, expected: str
) -> None:
    with zipfile.ZipFile(archive) as opened:
        text = opened.read("modelDescription.xml").decode()
    assert old in text
    rewrite(archive, archive.with_name("other.fmu"), lambda text: text.replace(old, new))
    assert any(expected in str(finding) for finding in check(archive.with_name("other.fmu")))
