"""FMUs that fail, crash, hang or lie: a clear error, the recording kept, nothing left over."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from cosim.control.linearize import linearize
from cosim.errors import FmuCallError, StepError
from cosim.master.master import Master
from cosim.system.system import System
from tests.coupling.faulty import MODES, build_faulty

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the test's FMU is for Linux")


@pytest.fixture(scope="session")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_faulty(tmp_path_factory.mktemp("faulty"))


def pair(faulty: Path, mode: str | None) -> System:
    """A good one in front of a bad one."""
    system = System("pair")
    system.add("good", str(faulty))
    system.add("bad", str(faulty), {"mode": MODES[mode], "fail_at": 0.35} if mode else {})
    system.connect("good.y", "bad.u")
    return system


@pytest.mark.parametrize("executor", ["python", "c"])
@pytest.mark.parametrize(
    ("mode", "text"),
    [
        ("error", "bad (faulty): a step of 0.1 s at t = 0.3 s failed with status 'error'"),
        ("discard", "bad (faulty): a step of 0.1 s at t = 0.3 s failed with status 'discard'"),
        ("fatal", "bad (faulty): a step of 0.1 s at t = 0.3 s failed with status 'fatal'"),
        ("nan", "bad.y became nan without an error of its FMU"),
    ],
)
def test_failing_steps_end_the_run_with_its_recording(
    faulty: Path, executor: str, mode: str, text: str
) -> None:
    with pytest.raises(StepError) as caught:
        Master(pair(faulty, mode), step=0.1, executor=executor).run(1.0)
    assert text in str(caught.value)
    recording = caught.value.recording
    assert recording is not None and recording.error == str(caught.value)
    # rows at 0, 0.1, 0.2, 0.3: the bad step is the one from 0.3 to 0.4
    np.testing.assert_allclose(recording.time, [0.0, 0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(recording["good.y"], recording.time, atol=1e-12)


@pytest.mark.parametrize("algorithm", ["iterated", "adaptive"])
@pytest.mark.parametrize("mode", ["error", "discard", "fatal"])
def test_steps_that_may_be_repeated_fail_alike_in_both_executors(
    algorithm: str, mode: str, tmp_path: Path
) -> None:
    faulty = build_faulty(tmp_path, keeps=True)
    texts, rows = [], []
    for executor in ("python", "c"):
        failed = rf"bad \(faulty\): a step of .* failed with status '{mode}'"
        with pytest.raises(StepError, match=failed) as caught:
            Master(pair(faulty, mode), algorithm, 0.1, executor=executor).run(1.0)
        assert caught.value.recording is not None
        texts.append(str(caught.value))
        rows.append(caught.value.recording.values.tobytes())
    assert texts[0] == texts[1] and rows[0] == rows[1]


def test_failing_in_threads_blocks_nobody(faulty: Path) -> None:
    outcomes: list[str] = []

    def work(mode: str | None) -> None:
        try:
            Master(pair(faulty, mode), step=0.1, executor="c").run(1.0)
            outcomes.append("ok")
        except StepError as error:
            outcomes.append("failed" if error.recording is not None else "no recording")

    threads = [threading.Thread(target=work, args=(m,)) for m in ("error", None, "fatal", None)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30.0)  # a run takes milliseconds
    assert sorted(outcomes) == ["failed", "failed", "ok", "ok"]


def test_claims_that_are_not_true_are_told(faulty: Path) -> None:
    for algorithm in ("iterated", "adaptive"):
        with pytest.raises(StepError, match="saving the state at t = 0 s failed with status"):
            Master(pair(faulty, None), algorithm, 0.1).run(1.0)
    with pytest.raises(FmuCallError, match=r"directional derivative.* failed with"):
        linearize(Master(pair(faulty, None), step=0.1))


def children() -> set[str]:
    listed = subprocess.run(
        ["ps", "-o", "pid=,args=", "--ppid", str(os.getpid())],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    return {line for line in listed.splitlines() if "ps -o" not in line}


HOW = {"fork": {"guard": True}, "isolated": {"isolate": 1.0}}


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["python", "c"])
@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize(
    ("mode", "text"),
    [
        ("crash", r"bad \(.*\), in a step, crashed \(signal SIGABRT\)"),
        # in a fork of a process with threads, destructors at exit() may abort
        ("exit", r"bad \(.*\), in a step, (ended the process with exit code 0|crashed .*SIGABRT)"),
        ("hang", r"bad \(.*\), in a step, did not return within 1 s and was ended"),
        ("error", r"bad \(faulty\): a step of 0.1 s at t = 0.3 s failed with status 'error'"),
        ("nan", r"bad.y became nan"),
    ],
)
def test_isolated_runs_survive_anything(
    faulty: Path, mode: str, text: str, how: str, executor: str
) -> None:
    if (mode, how) == ("hang", "fork"):
        pytest.skip("a guard has no time limit")
    before, begin = children(), time.monotonic()  # tests that came before may have workers left
    with pytest.raises(StepError, match=text) as caught:
        Master(pair(faulty, mode), step=0.1, executor=executor, **HOW[how]).run(1.0)
    assert time.monotonic() - begin < 30.0  # 1 s of waiting, the rest is the start of Python
    recording = caught.value.recording
    assert caught.value.time == pytest.approx(0.4 if mode == "nan" else 0.3)
    assert recording is not None
    np.testing.assert_allclose(recording["good.y"], [0.0, 0.1, 0.2, 0.3], atol=1e-12)
    assert children() <= before


def test_isolated_runs_give_the_same_bits(faulty: Path, provider) -> None:
    from tests.coupling.test_coupling_orders import INPUTS, drive

    system = drive(provider)
    plain = Master(system, step=1e-3).run(0.05, inputs=INPUTS)
    for how in ({"guard": True}, {"isolate": 20.0}):
        apart = Master(system, step=1e-3, **how).run(0.05, inputs=INPUTS)
        np.testing.assert_array_equal(plain.values, apart.values)
        assert plain.bond_energy == apart.bond_energy
        expected = {**plain.provenance, **({} if "guard" in how else {"isolated": True})}
        assert apart.provenance == expected
