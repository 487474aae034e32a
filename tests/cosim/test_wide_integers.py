"""Integers of 64 bits in what is done with them: comparisons, lines through them, checks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import cosim
from cosim import Master, System, Table
from tests.tiny_fmus import V, tiny

STAMP = 1_700_000_000_000_000_256
"""Nanoseconds since 1970; a double carries it."""


def scenario(folder: Path, variables: list[V], law: str, text: str) -> Any:
    """The only run of a scenario of one FMU `a`."""
    tiny(folder, variables, law)
    (folder / "s.toml").write_text('[instances]\na = "m.fmu"\n', encoding="utf-8")
    head = 'system = "s.toml"\nduration = 1.0\nstep = 0.1\n'
    (folder / "scenario.toml").write_text(head + text, encoding="utf-8")
    (run,) = cosim.run(str(folder / "scenario.toml")).runs.values()
    return run


def test_stamps_of_a_file_are_compared_and_connected_as_they_stand(tmp_path: Path) -> None:
    rows = "".join(f"{0.1 * i:.1f},{STAMP}\n" for i in range(11))
    (tmp_path / "log.csv").write_text("time,y\n" + rows, encoding="utf-8")
    run = scenario(
        tmp_path,
        [V("y", "Int64", "output"), V("u", "Float64", "input", "0"), V("z", "Float64", "output")],
        f"v->n[0][0] = {STAMP}LL; v->r[2][0] = v->r[1][0];",
        '[compare.y]\nsignal = "a.y"\nfile = "log.csv"\n'
        '[inputs."a.u"]\nfile = "log.csv"\ncolumn = "y"\ninterpolation = "linear"\n',
    )
    assert run.comparisons["y"].max == 0.0
    assert run.recording["a.z"][-1] == STAMP


@pytest.mark.parametrize(
    ("of", "more", "expected"),
    [
        ("rms", 'signal = "a.wide"', 4e9),  # its square is beyond 64 bits
        ("mean", 'signal = "a.three"\nminus = "a.five"', -2.0),  # unsigned, both
        ("mean", 'signal = "a.three"\nminus = "a.real"', 2.5),
        ("distance", 'signals = ["a.wide", "a.three"]', 0.0),
    ],
)
def test_checks_of_integers_neither_wrap_around_nor_overflow(
    of: str, more: str, expected: float, tmp_path: Path
) -> None:
    run = scenario(
        tmp_path,
        [V("wide", "Int64", "output"), V("three", "UInt64", "output"),
         V("five", "UInt64", "output"), V("real", "Float64", "output")],
        "v->n[0][0] = 4000000000LL; v->n[1][0] = 3; v->n[2][0] = 5; v->r[3][0] = 0.5;",
        f'[[checks]]\nname = "c"\nof = "{of}"\n{more}\nlimit = 1.0\n',
    )  # fmt: skip
    assert run.checks[0].measured == expected  # whole numbers: no rounding


def test_a_table_of_integers_and_numbers_keeps_the_integers(tmp_path: Path) -> None:
    fmu = tiny(tmp_path, [V("u", "Int64", "input", "0"), V("y", "Int64", "output")],
               "v->n[1][0] = v->n[0][0];")  # fmt: skip
    system = System("alone")
    system.add("a", str(fmu))
    table = Table([0.0, 0.1], [2**53 + 1, 1.0], extend=True)
    recording = Master(system, step=0.1).run(0.2, inputs={"a.u": table})
    assert recording["a.y"].tolist() == [2**53 + 1, 2**53 + 1, 1]  # outputs follow a step later
