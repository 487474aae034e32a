"""Where a parameter ends at a bound of the mapping, the model beyond it is a rival of all laws."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from tests.diagnose import disc

FEW = ("sweep", "steps", "check")
ROOM = {
    "J": ("nominal = 0.025\nmin = 0.005\nmax = 0.08", "nominal = 0.01\nmin = 0.005\nmax = 0.016"),
    "b": ("max = 0.3", "max = 0.035"),
}
"""What the mapping allows, and less: the disc has 0.02 kg.m2, and friction looks like more `b`."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "friction", "verdict"), [("J", 0.0, "unexplained"), ("b", 0.08, "effect_found")]
)
def test_a_bound_in_the_wrong_place_is_told_and_no_law_named_for_it(
    tmp_path: Path, name: str, friction: float, verdict: str
) -> None:
    """The twin: a bound that is reached since a law is missing hides no law."""
    folder = disc.write(tmp_path, lambda w, theta, t: friction * math.tanh(w / 0.02), names=FEW)
    mapping = folder / "dataset.toml"
    text = mapping.read_text(encoding="utf-8")
    assert text.count(ROOM[name][0]) == 1
    mapping.write_text(text.replace(*ROOM[name]), encoding="utf-8")
    told = CliRunner().invoke(app, ["diagnose", str(folder), "--out", str(tmp_path / "out")])
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["verdict"] == verdict, found["reason"]
    assert found["parameters"][name]["before"]["at_bound"]
    (warning,) = [w for w in found["warnings"] if w.startswith(f"{name} (max = ")]
    assert ") ended at its bound in the declared model" in warning
    assert warning in told.stdout
    assert list(found["bounds_opened"]) == ([] if friction else [name])
    if friction:
        assert [e["effect"] for e in found["effects"]] == ["coulomb"]
        low, high = found["parameters"]["b"]["after"]["ci95"]
        assert low <= disc.B <= high and not found["parameters"]["b"]["after"]["at_bound"]
        return
    low, high = found["bounds_opened"]["J"]["ci95"]
    assert low <= disc.J <= high
    assert "look at these bounds in the mapping first" in found["reason"]
    assert all("no worse with J beyond its bound" in hint["why"][0] for hint in found["hints"])
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Look at the bounds" in page


@pytest.mark.slow
def test_a_bound_is_opened_as_far_as_the_fmu_takes_it(tmp_path: Path) -> None:
    """An efficiency of 1 whose mapping ends at 0.9: ten times that is no efficiency."""
    folder = disc.write(tmp_path, lambda w, theta, t: 0.0, names=FEW)
    mapping = folder / "dataset.toml"
    text = mapping.read_text(encoding="utf-8").replace('"load.tau"', '"gear.tau_a"')
    fixed, _, drag = text.partition('[[parameter]]\nname = "J"')[2].partition("[[parameter]]")
    assert 'targets = "load.J"' in fixed
    mapping.write_text(
        text.partition("[columns]")[0]
        + f'[parameters]\n"load.J" = {disc.J}\n"gear.ratio" = 1.0\n"gear.J_a" = 0.0\n\n[columns]'
        + text.partition("[columns]")[2].partition("[[parameter]]")[0]
        + '[[parameter]]\nname = "eta"\nunit = "1"\nnominal = 0.8\nmin = 0.6\nmax = 0.9\n'
        + 'targets = "gear.eta"\n\n[[parameter]]'
        + drag,
        encoding="utf-8",
    )
    (folder / "system.toml").write_text(
        'description = "A disc behind a gear."\n'
        'connections = ["gear.tau_b -> load.tau", "load.w -> gear.w_b",\n'
        '  "gear.J_b -> load.J_added"]\n'
        '[instances]\nload = "inertia/disc"\ngear = "gearbox/ratio"\n',
        encoding="utf-8",
    )
    out = tmp_path / "out"
    told = CliRunner().invoke(app, ["diagnose", str(folder), "--out", str(out)])
    assert told.exit_code == 0, told.output
    found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["verdict"] == "unexplained", found["reason"]
    low, high = found["bounds_opened"]["eta"]["ci95"]
    assert low <= 1.0 and high == 1.0
