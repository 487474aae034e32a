"""The fuzzers for seconds: nothing unnamed, slow, large or outside; and that they would find it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from cosim.errors import InputError, ScenarioError
from tests.fuzz import worker
from tests.fuzz.campaign import GOOD, ROOT, Statistics, Worker, campaign, keep
from tests.fuzz.readers import READERS

SEED = 20_261_125
INPUTS = 40
"""Of each reader: together they take some seconds."""


@pytest.fixture(scope="module")
def found() -> dict[str, Statistics]:
    return campaign(list(READERS), SEED, inputs=INPUTS)


@pytest.mark.parametrize("reader", READERS)
def test_every_outcome_is_named(found: dict[str, Statistics], reader: str) -> None:
    assert found[reader].bad == {}
    assert found[reader].counts.total() == INPUTS
    assert found[reader].counts["read"] > 0  # else the good files would not be good
    assert set(found[reader].counts) <= set(GOOD)


def test_the_same_seed_gives_the_same_input() -> None:
    for reader in READERS.values():
        first = len(reader.seeds())
        assert reader.content(3, first + 5) == reader.content(3, first + 5)
        assert len({reader.content(3, first + number) for number in range(20)}) > 10
        assert reader.content(3, 0) == reader.seeds()[0]


# -- that the harness sees what it is for ----------------------------------------------------------


def _raise(error: Exception) -> object:
    def read(path: Path) -> None:
        raise error

    return read


def test_outcomes(tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    assert worker.outcome(lambda path: None, path) == "read"
    assert worker.outcome(_raise(ScenarioError(f"{path}: is bad")), path) == "refused"
    nameless = worker.outcome(_raise(InputError("is bad")), path)
    assert nameless == "unnamed file: InputError: is bad"
    assert worker.outcome(_raise(TypeError("x")), path).startswith("TypeError at test_fuzz.py:")
    long = worker.outcome(_raise(ScenarioError(f"{path}: {'x' * 6000}")), path)
    assert long.startswith("text of 6")


def _script(tmp_path: Path, program: str) -> Path:
    """A worker whose only reader runs a program for all inputs but the first."""
    script = tmp_path / "serve.py"
    script.write_text(
        f"import os, sys, time\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from tests.fuzz import readers, worker\n"
        f"def read(path):\n    if path.read_bytes() == b'good': return\n    {program}\n"
        "readers.READERS.clear()\n"
        "readers.READERS['x'] = readers.Reader('x', 'x', lambda: [b'good'], lambda c, b: b'bad', "
        "read)\nworker.main()\n"
    )
    return script


def _serve(tmp_path: Path, program: str) -> str:
    """What such a worker answers to one input."""
    statistics = Statistics()
    one = Worker(1, (str(_script(tmp_path, program)),))
    try:
        one.run("x", 1, 1, statistics)
    finally:
        one.close()
        one.folder.cleanup()
    (outcome,) = statistics.counts
    return outcome


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are those of Linux")
def test_too_much_memory_is_seen(tmp_path: Path) -> None:
    assert _serve(tmp_path, "bytearray(2 * 10**9)").startswith("MemoryError")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("open({outside!r}, 'w')", "outside: open"),
        ("import os; os.mkdir({outside!r})", "outside: os.mkdir"),
        ("import os; os.rename(path, {outside!r})", "outside: os.rename"),
        ("import subprocess; subprocess.run(['true'])", "outside: subprocess.Popen"),
        ("print('loud'); path.with_name('inside').write_text('')", "read"),
        ("import os; os._exit(3)", "process ended with 3"),
    ],
)
def test_writes_and_programs_are_seen(tmp_path: Path, program: str, message: str) -> None:
    outside = tmp_path / "elsewhere"
    assert _serve(tmp_path, program.format(outside=str(outside))).startswith(message)


@pytest.mark.slow
def test_a_worker_that_hangs_or_dies_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for program, message in (
        ("time.sleep(200)", "no answer within 10 s"),
        ("os._exit(3)", "with 3"),
    ):
        statistics = Statistics()
        one = Worker(SEED, (str(_script(tmp_path, program)),))
        try:
            with monkeypatch.context() as patience:
                if "sleep" in program:  # long enough for a worker to begin on a busy machine
                    patience.setattr("tests.fuzz.campaign.SILENT", 10.0)
                one.run("x", 0, 2, statistics)
            one.run("x", 0, 1, statistics)  # a new one
        finally:
            one.close()
            one.folder.cleanup()
        (bad,) = statistics.bad
        assert message in bad
        assert statistics.counts["read"] == 2


def test_counterexamples_are_kept_with_their_seed(tmp_path: Path) -> None:
    statistics = Statistics()
    statistics.add(7, "TypeError at x.py:1: no", 0.1)
    statistics.add(8, "read", 11.0)
    assert statistics.bad == {"TypeError at x.py:1: no": 1, "took more than 10 s": 1}
    first, _ = keep({"study": statistics}, 5, tmp_path)
    assert (first / "study.toml").read_bytes() == READERS["study"].content(5, 7)
    assert "--reader study --seed 5 --first 7 --inputs 1" in (first / "outcome.txt").read_text()


@pytest.mark.slow
def test_the_command(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "--reader", "system", "--inputs", "5", "--seed", "4",
         "--out", str(tmp_path), "--json", str(tmp_path / "counts.json")],
        cwd=ROOT, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "5 inputs, 0 of them bad" in done.stdout
    assert sum(json.loads((tmp_path / "counts.json").read_text())["system"].values()) == 5
