"""FMUs that fail where the machine is, or ask to end before the log does: a fit says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from tests.tiny_fmus import V, tiny

GAIN = 2.3
MAPPING = """
system = "system.toml"
step = 0.01
[inputs]
"a.u" = "u"
[channels.y]
signal = "a.y"
sigma = 0.01
[[parameter]]
name = "k"
nominal = 2.0
min = 1.0
max = 4.0
targets = "a.k"
[[run]]
name = "r"
file = "r.csv"
purpose = "identification"
"""


def told(folder: Path, step: str) -> tuple[int, str]:
    """Of a calibration of y = k u by an FMU with this step."""
    variables = [
        V("u", "Float64", "input", "0"), V("y", "Float64", "output"),
        V("k", "Float64", "parameter", "2", more='variability="fixed"'),
    ]  # fmt: skip
    tiny(folder, variables, "v->r[1][0] = v->r[2][0] * v->r[0][0];", step, fmi=2)
    (folder / "system.toml").write_text('connections = []\n[instances]\na = "m.fmu"\n')
    (folder / "dataset.toml").write_text(MAPPING)
    random, t = np.random.default_rng(3), 0.01 * np.arange(101)
    u = np.sin(5.0 * t)
    before = np.concatenate([u[:1], u[:-1]])  # the input of a step gives the output at its end
    y = GAIN * before + 0.01 * random.standard_normal(t.size)
    np.savetxt(folder / "r.csv", np.column_stack([t, u, y]), delimiter=",",
               header="time,u,y", comments="")  # fmt: skip
    ran = CliRunner().invoke(app, ["calibrate", str(folder), "--out", str(folder / "out")])
    return ran.exit_code, " ".join(f"{ran.output} {ran.exception or ''}".split())


@pytest.mark.parametrize("limit", [2.1, 4.0])
def test_a_fit_says_what_it_could_not_simulate(tmp_path: Path, limit: float) -> None:
    """The twin fails far from the machine."""
    code, text = told(tmp_path, f"if (v->r[2][0] > {limit}) return 3;")
    assert code == 0
    said = "the fit ended beside values that cannot be simulated (k = 2.1" in text
    assert said == (limit < GAIN), text
    if said:
        assert "failed with status 'error'" in text


@pytest.mark.parametrize("end", [0.5, 5.0])
def test_an_end_before_that_of_the_log_is_an_error(tmp_path: Path, end: float) -> None:
    code, text = told(tmp_path, f"if (t + h >= {end}) {{ v->end = true; v->last = t + h; }}")
    assert (code == 0) == (end > 1.0), text
    if code:
        assert "an FMU asked to end the simulation at 0.5" in text
        assert "and the log goes on to 1 s" in text
