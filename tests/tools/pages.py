"""Runs the code of a page: blocks that a comment above them marks.

<!-- run -->            the next block runs (`sh` or `python`; one Python per page)
<!-- run: fails -->     it must end with an error
<!-- file: a/b.py -->   the next block is written there
<!-- output -->         each line of the next block is in what the last one printed
<!-- checkout -->       the page works on a copy of the project's sources
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
MARK = re.compile(
    r"^<!-- (run|run: fails|file: \S+|output|checkout) -->\n+(?:```(\w+)\n(.*?)^```$)?", re.M | re.S
)
COPIED = ("cosim", "sources", "LICENSE", "pyproject.toml")
LIMIT = 120.0
"""Longest time of one block [s]: tutorials are for fast ones."""
PROMPT = """
import io, sys, traceback
space = {"__name__": "__main__"}
for mark in iter(sys.stdin.readline, ""):
    size = int(mark)
    code = sys.stdin.read(size)
    try:
        exec(compile(code, "<page>", "exec"), space)
    except BaseException:
        traceback.print_exc(file=sys.stdout)
        print("FAILED")
    print("END", flush=True)
"""
"""Reads blocks from its input, runs them in one namespace, says when each has ended."""


@dataclass
class Page:
    """A page whose blocks run in a folder of their own.

    Attributes:
        folder: where they run.
        printed: by the last block.
        ran: number of blocks that ran.
    """

    folder: Path
    printed: str = ""
    ran: int = 0
    home: Path = ROOT
    _python: subprocess.Popen[str] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        (self.folder / "scenarios").symlink_to(ROOT / "scenarios")
        tools = self.folder / ".bin"
        tools.mkdir()
        command = tools / "cosim"
        command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m cosim "$@"\n')
        command.chmod(0o755)

    @property
    def environment(self) -> dict[str, str]:
        """With `cosim` as a command, of the project or of the page's copy."""
        return {
            **os.environ, "PATH": f"{self.folder / '.bin'}:{os.environ['PATH']}",
            "PYTHONPATH": str(self.home), "MPLBACKEND": "agg", "COLUMNS": "160",
        }  # fmt: skip

    def run(self, text: str) -> None:
        """Run a page's blocks, one after the other.

        Raises:
            AssertionError: one does not do what the page says.
        """
        try:
            for mark, language, code in MARK.findall(text):
                self._block(mark, language, code)
        finally:
            if self._python is not None:
                self._python.communicate()

    def _block(self, mark: str, language: str, code: str) -> None:
        if mark == "checkout":
            for name in COPIED:
                source = ROOT / name
                copy = shutil.copytree if source.is_dir() else shutil.copy
                copy(source, self.folder / name)
            self.home = self.folder
            return
        assert code, f"no block of code follows {mark!r}"
        if mark.startswith("file: "):
            path = self.folder / mark.removeprefix("file: ")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(code, encoding="utf-8")
        elif mark == "output":
            for line in filter(None, map(str.strip, code.splitlines())):
                assert line in self.printed, f"{line!r} is not in:\n{self.printed}"
        else:
            self.ran += 1
            failed = self._shell(code) if language == "sh" else self._exec(language, code)
            assert failed == (mark == "run: fails"), f"{code}\n{self.printed}"

    def _shell(self, code: str) -> bool:
        done = subprocess.run(
            ["bash", "-e", "-c", code], cwd=self.folder, env=self.environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LIMIT, check=False,
        )  # fmt: skip
        self.printed = done.stdout
        return done.returncode != 0

    def _exec(self, language: str, code: str) -> bool:
        assert language == "python", f"blocks of {language!r} cannot run"
        if self._python is None:
            self._python = subprocess.Popen(
                [sys.executable, "-c", PROMPT], cwd=self.folder, env=self.environment, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )  # fmt: skip
        assert self._python.stdin is not None and self._python.stdout is not None
        self._python.stdin.write(f"{len(code)}\n{code}")
        self._python.stdin.flush()
        lines = list(iter(self._python.stdout.readline, "END\n"))
        assert "" not in lines, "".join(lines)
        self.printed = "".join(lines)
        return "FAILED\n" in lines
