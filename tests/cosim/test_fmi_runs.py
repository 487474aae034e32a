"""How runs of FMUs end, what they warn of, and that time is counted as FMUs count it."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cosim
from cosim import Master, Recording, System, Table, read_recording
from cosim.cli import app as cli
from cosim.errors import CosimError, StepError
from cosim.master.session import Session
from tests import tiny_fmus
from tests.cosim_fmus import slave
from tests.fmus import fmu
from tests.tiny_fmus import V, tiny

ISOLATED = pytest.param("isolated", marks=pytest.mark.slow)
CLOCK = [V("y", "Float64", "output"), V("u", "Float64", "input", "0")]
TIME = "v->r[0][0] = v->t;"
"""Its output is the time that it has reached."""
END = 'if (t + h >= 0.5) { say(m, 0, "all done"); v->end = true; v->last = t + h; }'
"""It asks to end with the step that reaches 0.5 s, which it makes."""
EARLY = "if (t + h >= 0.45) { v->end = true; v->last = t + 0.5 * h; return END_STATUS; }"
"""It asks to end in the middle of a step."""


def alone(path: Path, count: int = 1) -> System:
    system = System("alone")
    for name in "abc"[:count]:
        system.add(name, str(path))
    return system


def run(system: System, duration: float = 1.0, **settings: Any) -> Recording:
    names = ("executor", "algorithm", "isolate", "step")
    options = {"step": 0.1, **{k: settings.pop(k) for k in names if k in settings}}
    return Master(system, **options).run(duration, **settings)


@dataclass(frozen=True)
class Outcome:
    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Outcome]:
    def call(*words: str) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["cosim", *words])
        monkeypatch.chdir(tmp_path)
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = int(end.code or 0)
        said = capsys.readouterr()
        return Outcome(code, said.out, said.err)

    return call


Command = Callable[..., Outcome]


def scenario(folder: Path, path: Path, text: str = "") -> Path:
    (folder / "s.toml").write_text(f'connections = []\n[instances]\na = "{path.name}"\n')
    file = folder / "run.toml"
    file.write_text('system = "s.toml"\nduration = 1.0\nstep = 0.1\n' + text)
    return file


# -- ends ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("executor", ["python", "auto", ISOLATED])
@pytest.mark.parametrize("every", [1, 3])
def test_an_end_that_an_fmu_asks_for_is_one(
    every: int, executor: str, fmi: int, tmp_path: Path
) -> None:
    path = tiny(tmp_path, CLOCK, TIME, END, fmi=fmi)
    system = alone(path, 2)
    how = {"isolate": 30.0} if executor == "isolated" else {"executor": executor}
    recording = run(system, every=every, **how)
    expected = [*np.arange(0, 6, every), *([5] if 5 % every else [])]
    assert recording.time == pytest.approx(0.1 * np.array(expected), rel=1e-15)
    assert recording["a.y"] == pytest.approx(recording.time, rel=1e-15)
    assert recording["b.y"].tolist() == recording["a.y"].tolist()  # both went there
    assert not recording.error
    assert any("a (m): asked to end the simulation at t = 0.5 s" in n for n in recording.notes)
    assert "all done" in str(recording.notes)
    read = read_recording(recording.write_parquet(tmp_path / "r.parquet"))
    assert read.notes == recording.notes and read.time.tolist() == recording.time.tolist()


def test_a_check_whose_window_an_end_does_not_reach_is_not_judged(tmp_path: Path) -> None:
    path = tiny(tmp_path, CLOCK, TIME, END)
    text = "".join(
        f'[[checks]]\nname = "{name}"\nof = "maximum"\nsignal = "a.y"\nafter = {after}\n'
        'expected = 0.5\nlimit = 0.01\nsource = "its law"\n'
        for name, after in (("whole", 0.0), ("late", 0.7))
    )
    result = next(iter(cosim.run(scenario(tmp_path, path, text)).runs.values()))
    whole, late = result.checks
    assert whole.ok and not whole.unfit
    assert late.unfit == "the run ended at 0.5 s, before its window begins at 0.7 s"
    assert math.isnan(late.value) and len(result.recording) == 6
    going = tiny(tmp_path, CLOCK, TIME, name="going")
    text = text.replace("after = 0.7", "after = 3.0")
    with pytest.raises(CosimError, match=r"check 'late': nothing was recorded between 3 s"):
        cosim.run(scenario(tmp_path, going, text))


@pytest.mark.parametrize("every", [1, 3])
def test_a_session_ends_where_the_fmu_asks(every: int, tmp_path: Path) -> None:
    path = tiny(tmp_path, CLOCK, TIME, END)
    with Session(Master(alone(path), step=0.1), 1.0, record=["a.y"], every=every) as session:
        for _ in range(2):  # a repetition is the same
            times, rows = session.run()
            assert times[-1] == 0.5 and rows[-1, 0] == 0.5 and len(times) == len(rows)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("executor", ["python", "auto", ISOLATED])
@pytest.mark.parametrize(("every", "times"), [(1, [0, 1, 2, 3, 4]), (2, [0, 2, 4]), (3, [0, 3, 4])])
def test_an_end_inside_a_step_keeps_the_last_values_of_all(
    every: int, times: list[int], executor: str, fmi: int, tmp_path: Path
) -> None:
    status = 2 if fmi == 2 else 0
    path = tiny(tmp_path, CLOCK, TIME, EARLY.replace("END_STATUS", str(status)), fmi=fmi)
    how = {"isolate": 30.0} if executor == "isolated" else {"executor": executor}
    recording = run(alone(path, 2), every=every, **how)
    assert recording.time == pytest.approx(0.1 * np.array(times), rel=1e-15)
    for name in ("a.y", "b.y"):  # one of the two has gone on
        assert recording[name] == pytest.approx(recording.time, rel=1e-15)
    assert "asked to end the simulation at t = 0.45 s" in recording.notes[0]


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("executor", ["python", "auto"])
def test_an_end_is_one_at_every_point_however_times_round(
    executor: str, fmi: int, tmp_path: Path
) -> None:
    count = V("k", "Int32", "parameter", "1")
    law = "if (++v->n[3][0] == v->n[2][0]) { v->end = true; v->last = t + h; }"
    path = tiny(tmp_path, [*CLOCK, count], TIME, law, fmi=fmi, name="clock")
    for start, step in ((0.0, 0.1), (3.0, 1e-3), (1.7e9, 1e-3)):
        assert any(start + k * step + step < start + (k + 1) * step for k in range(1, 13))
        for k in range(2, 14):
            system = alone(path, 2)
            system.set("a.k", k)
            master = Master(system, step=step, executor=executor)
            recording = master.run(20 * step, record=["a.y", "b.y"], start=start)
            assert len(recording) == k + 1 and not recording.error
            # both count t + h; where t is the point before, rounding is that of one sum
            assert recording["a.y"][-1] == pytest.approx(recording.time[-1], rel=1e-15)
            assert recording["b.y"].tolist() == recording["a.y"].tolist()


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "iterated", "adaptive"])
def test_no_step_goes_beyond_the_stop_time_by_rounding(algorithm: str, tmp_path: Path) -> None:
    law = "if (t + h > v->stop) return 3; v->r[9][0] += h * (1 - v->r[1][0]);"
    path = tiny(tmp_path, CLOCK, "v->r[0][0] = v->r[9][0];", law)
    for k in range(1, 31):
        system = alone(path, 2)
        system.connect("a.y", "b.u")
        system.connect("b.y", "a.u")
        recording = Master(system, algorithm, step=0.1).run(round(0.1 * k, 1))
        assert len(recording) == k + 1 and not recording.error


def test_a_discarded_step_that_asks_for_no_end_is_an_error(tmp_path: Path) -> None:
    path = tiny(tmp_path, CLOCK, TIME, "if (t > 0.25) return 2;", fmi=2)
    with pytest.raises(StepError, match=r"t = 0\.3 s failed with status 'discard'") as caught:
        run(alone(path))
    assert caught.value.recording is not None and len(caught.value.recording) == 4


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_command_line_takes_a_requested_end_as_an_end(
    fmi: int, tmp_path: Path, command: Command
) -> None:
    path = tiny(tmp_path, CLOCK, TIME, END, fmi=fmi)
    done = command("run", str(scenario(tmp_path, path)), "--out", "o", "--json")
    assert done.returncode == 0
    assert "asked to end the simulation at t = 0.5 s" in done.stderr
    assert "asked to end the simulation at t = 0.5 s" in json.loads(done.stdout)["notes"][0]
    assert read_recording(tmp_path / "o" / "recording.parquet").time[-1] == 0.5


# -- statuses ------------------------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("executor", ["python", "auto", ISOLATED])
@pytest.mark.parametrize("status", [0, 1])
def test_warnings_are_notes(status: int, executor: str, fmi: int, tmp_path: Path) -> None:
    step = f'if (t > 0.15) {{ say(m, 1, "hot"); v->t = t + h; return {status}; }}'
    system = alone(tiny(tmp_path, CLOCK, TIME, step, fmi=fmi))
    how = {"isolate": 30.0} if executor == "isolated" else {"executor": executor}
    recording = run(system, **how)
    assert recording["a.y"][-1] == 1.0 and not recording.error
    assert "a (m): warning: hot" in recording.notes
    said = any("a step returned status 'warning'" in note for note in recording.notes)
    assert said == bool(status)
    quiet = run(alone(tiny(tmp_path, CLOCK, TIME, fmi=fmi, name="quiet")), **how)
    assert quiet.notes == ()


def test_warnings_are_on_stderr_and_in_the_result(tmp_path: Path, command: Command) -> None:
    path = tiny(tmp_path, CLOCK, TIME, 'say(m, 1, "hot");', fmi=2)
    done = command("run", str(scenario(tmp_path, path)), "--out", "o")
    assert done.returncode == 0 and "note: a (m): warning: hot" in done.stderr
    assert "a (m): warning: hot" in json.loads((tmp_path / "o/result.json").read_text())["notes"]


@pytest.mark.parametrize("executor", ["python", "auto"])
@pytest.mark.parametrize(
    ("status", "name"),
    [(2, "discard"), (3, "error"), (4, "fatal"), (5, "pending"), (9, "9"), (-1, "-1")],
)
def test_every_status_is_named(status: int, name: str, executor: str, tmp_path: Path) -> None:
    path = tiny(tmp_path, CLOCK, TIME, f"if (t > 0.25) return {status};", fmi=2)
    with pytest.raises(StepError, match=f"at t = 0.3 s failed with status '?{name}") as caught:
        run(alone(path), executor=executor)
    assert caught.value.recording is not None
    assert caught.value.recording["a.y"] == pytest.approx([0.0, 0.1, 0.2, 0.3])


# -- steps ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("algorithm", ["iterated", "adaptive"])
def test_steps_that_may_be_taken_back_are_not_said_to_be_final(
    algorithm: str, fmi: int, tmp_path: Path
) -> None:
    ring = [V("y", "Float64", "output", "1", more='initial="exact"'), V("u", "Float64", "input")]
    law = "v->r[0][0] += h * (v->r[1][0] - v->r[0][0]);"
    begin = "v->r[0][0] = 1;"
    system = alone(tiny(tmp_path, ring, "", law, fmi=fmi, begin=begin), 2)
    system.set("b.y", 0.0)
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    recording = run(system, algorithm=algorithm)  # the FMU fails if a final step is taken back
    # y_a - y_b = exp(-2 t); Euler's method with h = 0.1 misses it by less than h
    assert recording["a.y"] - recording["b.y"] == pytest.approx(
        np.exp(-2.0 * recording.time), abs=0.1
    )
    assert run(system)["a.y"][-1] == pytest.approx(0.57, abs=0.1)


def test_plain_steps_are_said_to_be_final(tmp_path: Path) -> None:
    path = tiny(tmp_path, CLOCK, "v->r[0][0] = v->final;")
    assert run(alone(path))["a.y"].tolist() == [0.0] + [1.0] * 10


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("executor", ["python", "auto"])
@pytest.mark.parametrize("step", [0.1, 0.01, 0.001])
def test_the_last_step_ends_at_the_stop_time(
    step: float, executor: str, fmi: int, tmp_path: Path
) -> None:
    # not beyond it by rounding, nor before it
    strict = 'if (t + h > v->stop) { say(m, 3, "beyond the stop time"); return 3; }'
    system = alone(tiny(tmp_path, CLOCK, TIME, strict, fmi=fmi))
    counts = [1, 3, 7, 13, 130] if step < 0.1 else [*range(1, 40), 190, 200]
    for count in counts:
        duration = round(count * step, 6)
        recording = run(system, duration, step=step, executor=executor, every=count)
        assert recording["a.y"][-1] == duration == recording.time[-1]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["native", "python"])
@pytest.mark.parametrize(("start", "part"), [(1e3, 1e-7), (86400.0, 1e-6), (1e6, 1e-5)])
def test_sampled_drives_run_late_as_they_run_early(start: float, part: float, kind: Any) -> None:
    # times round to eps * start, against sample intervals of 0.1 ms and more
    system = System("late")
    for name, variant in (
        ("motor", "dc_motor.lab_bench/sampled"),
        ("gearbox", "gearbox.lab_bench/ratio"),
        ("load", "inertia.lab_bench/disc"),
    ):
        system.add(name, str(fmu(variant, kind, 2)))
    for source, target in (
        ("motor.tau", "gearbox.tau_a"), ("gearbox.w_a", "motor.w"), ("gearbox.tau_b", "load.tau"),
        ("gearbox.J_b", "load.J_added"), ("load.w", "gearbox.w_b"),
    ):  # fmt: skip
        system.connect(source, target)
    early, late = (
        run(system, 0.1, step=1e-3, start=begin, inputs={"motor.w_ref": 20.0})
        for begin in (0.0, start)
    )
    for name in ("load.w", "motor.i"):
        assert np.ptp(early[name]) > 0.1
        assert late[name] == pytest.approx(early[name], abs=part * np.abs(early[name]).max())


# -- the command line ----------------------------------------------------------------------------

TALKATIVE = """
from pythonfmu import Fmi2Causality as C, Fmi2Slave, Real


class {name}(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.y = 0.0
        self.register_variable(Real("y", causality=C.output))

    def do_step(self, time, size):
        print("python says", time)
        return True
"""


def process(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "cosim", *words],
        capture_output=True, text=True, cwd=folder, check=False,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("isolate", [(), ("--isolate",)])
def test_json_is_alone_on_stdout_whatever_fmus_print(
    isolate: tuple[str, ...], tmp_path: Path
) -> None:
    loud = 'printf("C says %g\\n", t);'
    talking = tiny(tmp_path, CLOCK, TIME, loud, name="talking")
    script = slave(tmp_path, "Talk", TALKATIVE, "pythonfmu")
    file = scenario(tmp_path, talking)
    (tmp_path / "s.toml").write_text(
        f'connections = []\n[instances]\na = "{talking.name}"\nb = "{script.name}"\n'
    )
    done = process(tmp_path, "run", str(file), "--out", "o", "--json", *isolate)
    assert done.returncode == 0
    assert json.loads(done.stdout)["fmu_steps"] == 20
    assert isolate or ("C says 0.9" in done.stderr and "python says 0.9" in done.stderr)


COLUMNS = {
    "Boolean": (["true", "false"], "b", [1.0, 0.0]),
    "Int64": ([str(2**63 - 1), str(2**53 + 1)], "n", [2**63 - 1, 2**53 + 1]),
    "UInt64": ([str(2**64 - 1), "0"], "u", [2**64 - 1, 0]),
    "String": (["left", "to the right"], "s", ["left", "to the right"]),
    "Enumeration": (["off", "on"], "e", [0.0, 4.0]),
}
MODES = (
    '<TypeDefinitions><EnumerationType name="Mode"><Item name="off" value="0"/>'
    '<Item name="on" value="4"/></EnumerationType></TypeDefinitions>'
)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@pytest.mark.parametrize("type_", list(COLUMNS))
def test_columns_of_files_drive_inputs_of_their_type(
    type_: str, suffix: str, tmp_path: Path, command: Command
) -> None:
    cells, name, expected = COLUMNS[type_]
    zero = {"String": "", "Boolean": "false"}.get(type_, "0")
    inner = 'declaredType="Mode"' if type_ == "Enumeration" else ""
    path = tiny(
        tmp_path,
        [V("x", type_, "input", zero, inner=inner), V("y", type_, "output", inner=inner)],
        "memcpy(v->s[1], v->s[0], TEXT); v->n[1][0] = v->n[0][0];",
        definitions=MODES,
    )
    file = tmp_path / "log.csv"
    rows = [f"{0.3 * i},{cell}\n" for i, cell in enumerate([*cells, cells[-1], cells[-1]])]
    file.write_text(f"time,{name}\n" + "".join(rows))
    text = f'[inputs]\n"a.x" = {{ file = "log.{suffix}", column = "{name}" }}\n'
    if suffix == "parquet":
        import pandas as pd

        pd.read_csv(file).to_parquet(tmp_path / "log.parquet")
    done = command("run", str(scenario(tmp_path, path, text)), "--out", "o")
    assert done.returncode == 0, done.stderr
    recording = read_recording(tmp_path / "o" / "recording.parquet")
    assert list(dict.fromkeys(recording["a.y"].tolist())) == expected


def test_a_recording_drives_the_next_run_exactly(tmp_path: Path, command: Command) -> None:
    law = "v->n[1][0] = v->n[0][0];"
    path = tiny(tmp_path, [V("x", "Int64", "input", "0"), V("y", "Int64", "output")], law)
    given = Table([0.0, 0.5], [2**63 - 1, -(2**63)], extend=True)
    run(alone(path), inputs={"a.x": given}).write_csv(tmp_path / "log.csv")
    text = '[inputs]\n"a.x" = { file = "log.csv", column = "a.y" }\n'
    done = command("run", str(scenario(tmp_path, path, text)), "--out", "o")
    assert done.returncode == 0, done.stderr
    column = read_recording(tmp_path / "o" / "recording.parquet")["a.y"]
    assert list(dict.fromkeys(column.tolist())) == [2**63 - 1, -(2**63)]


def test_a_column_of_texts_drives_no_number(tmp_path: Path, command: Command) -> None:
    path = tiny(tmp_path, CLOCK, TIME)
    (tmp_path / "log.csv").write_text("time,word\n0,left\n1,right\n")
    text = '[inputs]\n"a.u" = { file = "log.csv", column = "word" }\n'
    done = command("run", str(scenario(tmp_path, path, text)), "--out", "o")
    assert done.returncode == 2
    assert "input a.u from log.csv:word: u = 'left' is not a number" in " ".join(
        done.stderr.split()
    )


@pytest.mark.parametrize("executor", ["python", "auto"])
def test_the_error_of_a_fatal_step_is_told_and_no_state_is_released(
    executor: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = "EXPORT int STATE(Free)(Model *m, Values **state) {\n"
    assert free in tiny_fmus.SHELL
    refusing = tiny_fmus.SHELL.replace(free, f"{free}  if (m->v.length[0] == 7) return 3;\n")
    monkeypatch.setattr(tiny_fmus, "SHELL", refusing)
    law = "if (t > 0.25) { v->length[0] = 7; return 4; } v->r[9][0] += h * (1 - v->r[1][0]);"
    system = alone(tiny(tmp_path, CLOCK, "v->r[0][0] = v->r[9][0];", law), 2)
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    with pytest.raises(StepError, match="status 'fatal'"):
        Master(system, "iterated", step=0.1, executor=executor).run(1.0)


def test_repeated_recordings_count_their_own_steps(tmp_path: Path) -> None:
    law = "v->r[9][0] += h * (1 - v->r[1][0]);"
    system = alone(tiny(tmp_path, CLOCK, "v->r[0][0] = v->r[9][0];", law), 2)
    system.connect("a.y", "b.u")
    system.connect("b.y", "a.u")
    with Session(Master(system, "iterated", step=0.1), 1.0, record=["a.y"]) as session:
        counts = {session.record().provenance["fmu_steps"] for _ in range(3)}
    assert len(counts) == 1 and counts.pop() > 20  # two FMUs of ten steps, some of them again
