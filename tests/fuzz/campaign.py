"""Runs many inputs in workers and keeps count; what must not be is written down with its seed."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from .readers import READERS, temporary

LONGEST = 10.0
"""[s] of processor time that an input may take."""
SILENT = 12 * LONGEST
"""[s] without an answer after which a worker is given up; a busy machine takes that long."""
GOOD = ("read", "refused")
_BATCH = 50
"""Inputs between looks at the clock."""
ROOT = Path(__file__).resolve().parents[2]


@dataclass
class Statistics:
    """Outcomes of one reader.

    Attributes:
        counts: by outcome; all others than `GOOD` must not be.
        examples: outcome -> the first inputs that had it.
        slowest: [s].
    """

    counts: Counter[str] = field(default_factory=Counter)
    examples: dict[str, list[int]] = field(default_factory=dict)
    slowest: float = 0.0

    def add(self, number: int, outcome: str, seconds: float) -> None:
        """Count an input."""
        if outcome in GOOD and seconds > LONGEST:
            outcome = f"took more than {LONGEST:g} s"
        self.counts[outcome] += 1
        self.slowest = max(self.slowest, seconds)
        if outcome not in GOOD and len(self.examples.setdefault(outcome, [])) < 3:
            self.examples[outcome].append(number)

    @property
    def bad(self) -> dict[str, int]:
        """Outcomes that must not be."""
        return {text: count for text, count in self.counts.items() if text not in GOOD}


class Worker:
    """A worker process in a temporary folder; replaced when it dies or hangs."""

    def __init__(self, seed: int, command: tuple[str, ...] = ("-m", "tests.fuzz.worker")) -> None:
        self.seed, self.command = seed, command
        self.folder = temporary()
        self.process: subprocess.Popen[bytes] | None = None
        self.rest = b""
        self.answered = False

    def _start(self) -> subprocess.Popen[bytes]:
        folder = Path(self.folder.name)
        (folder / "tmp").mkdir(exist_ok=True)
        environment = {
            **os.environ, "PYTHONPATH": str(ROOT), "COSIM_CACHE": str(folder / "cache"),
            "TMPDIR": str(folder / "tmp"), "HOME": str(folder), "PYTHONDONTWRITEBYTECODE": "1",
            "ARROW_DEFAULT_MEMORY_POOL": "system", "OMP_NUM_THREADS": "1",
            "PYTHONWARNINGS": "ignore",
        }  # fmt: skip
        return subprocess.Popen(
            [sys.executable, *self.command, self.folder.name, str(self.seed)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            cwd=self.folder.name, env=environment,
        )  # fmt: skip

    def run(self, reader: str, first: int, count: int, statistics: Statistics) -> None:
        """Run some inputs of a reader."""
        last = first + count
        while first < last:
            if self.process is None:
                self.process = self._start()
            process = self.process
            assert process.stdin is not None and process.stdout is not None
            try:
                process.stdin.write(f"{reader} {first} {last - first}\n".encode())
                process.stdin.flush()
            except BrokenPipeError:  # it ended after its last answer
                self.close()
                continue
            begun: int | None = None
            while first < last:
                line = self._line(SILENT)
                if not line:
                    number = first if begun is None else begun
                    first = self._lost(number, line is not None, statistics)
                    break
                answer = json.loads(line)
                self.answered = True
                if "begun" in answer:
                    begun = answer["begun"]
                    continue
                statistics.add(answer["number"], answer["outcome"], answer["s"])
                first = answer["number"] + 1

    def _line(self, longest: float) -> bytes | None:
        """The next line, b"" if the process has ended, None if it does not come in time."""
        assert self.process is not None and self.process.stdout is not None
        handle = self.process.stdout.fileno()
        while b"\n" not in self.rest:
            ready, _, _ = select.select([handle], [], [], longest)
            if not ready:
                return None
            more = os.read(handle, 65536)
            if not more:
                return b""
            self.rest += more
        line, _, self.rest = self.rest.partition(b"\n")
        return line

    def _lost(self, number: int, died: bool, statistics: Statistics) -> int:
        assert self.process is not None
        if not died:
            self.process.kill()
        code = self.process.wait()
        if not self.answered:
            raise RuntimeError(
                "the worker ends before its first answer, most likely as a reader refuses its good "
                "files; run it by hand: python -m tests.fuzz.worker FOLDER 1"
            )
        outcome = f"process ended with {code}" if died else f"no answer within {SILENT:g} s"
        statistics.add(number, outcome, LONGEST)
        self.close()
        return number + 1

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            for pipe in (self.process.stdin, self.process.stdout):
                if pipe is not None:
                    with contextlib.suppress(BrokenPipeError):  # a dead process takes no rest
                        pipe.close()
            self.process.wait()
        self.process, self.rest = None, b""


def campaign(
    readers: list[str],
    seed: int,
    *,
    inputs: int | None = None,
    seconds: float | None = None,
    first: int = 0,
    told: object = None,
) -> dict[str, Statistics]:
    """Run readers in turn, each for so many inputs, or all for so long.

    Args:
        readers: names.
        seed: of the inputs.
        inputs: of each reader.
        seconds: of all together.
        first: number of the first input.
        told: called with the statistics after each batch.
    """
    found = {name: Statistics() for name in readers}
    worker = Worker(seed)
    end = None if seconds is None else time.monotonic() + seconds
    done = 0
    try:
        while (inputs is None or done < inputs) and (end is None or time.monotonic() < end):
            batch = _BATCH if inputs is None else min(_BATCH, inputs - done)
            for name in readers:
                worker.run(name, first + done, batch, found[name])
            done += batch
            if callable(told):
                told(found)
    except KeyboardInterrupt:  # what was counted until then is given
        print("interrupted", file=sys.stderr)
    finally:
        worker.close()
        worker.folder.cleanup()
    return found


def keep(found: dict[str, Statistics], seed: int, folder: Path) -> list[Path]:
    """Write the inputs with outcomes that must not be: the file, and how it came about."""
    written = []
    for name, statistics in found.items():
        for outcome, numbers in statistics.examples.items():
            for number in numbers[:1]:
                place = folder / f"{name}-seed{seed}-{number}"
                READERS[name].place(place, READERS[name].content(seed, number))
                (place / "outcome.txt").write_text(
                    f"{outcome}\npython -m tests.fuzz --reader {name} --seed {seed} "
                    f"--first {number} --inputs 1\n",
                    encoding="utf-8",
                )
                written.append(place)
    return written
