"""Result files of a study: one per run, written whole or not at all, checked when read.

`runs/KEY.json` holds `{"format", "sha256", "result"}`; the hash is that of the result as canonical
JSON. Where signals are kept, `runs/KEY.parquet` holds them (`runs/KEY.npz` where pyarrow is not
installed), and the result its hash.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..data.recording import Recording, read_recording
from ..errors import InputError
from ..files import write_text

NAME = "cosim study result"
LEFT_OVER = 60.0
"""Age from which on a temporary file is one that a killed process left behind [s]."""


class Store:
    """The folder of a study's result files.

    Args:
        folder: where results are; made when the first is written.
        warn: told about files that cannot be used.
    """

    def __init__(self, folder: Path, warn: Callable[[str], None]) -> None:
        self.folder, self.warn = folder, warn
        self.corrupt: list[Path] = []

    def path(self, key: str) -> Path:
        """The result file of a run."""
        return self.folder / f"{key}.json"

    def channels(self, key: str) -> Path:
        """The recording of a run."""
        other = self.folder / f"{key}.npz"
        return other if other.is_file() else self.folder / f"{key}.parquet"

    def write(self, result: dict[str, Any], recording: Recording | None) -> None:
        """Write a run's result, and its recording before that."""
        key = result["key"]
        if recording is not None:
            path = recording.keep(self.folder / key)
            result["channels"] = {"signals": list(recording.names), "sha256": _file_hash(path)}
        text = _canonical(result)
        digest = hashlib.sha256(text.encode()).hexdigest()
        content = f'{{"format": "{NAME}", "sha256": "{digest}",\n"result": {text}}}\n'
        write_text(self.path(key), content)

    def read(self, key: str) -> dict[str, Any] | None:
        """A run's result; None if there is none that can be used.

        A file that is cut off, changed, or not of this run is set aside as *.corrupt, with a
        warning.
        """
        path = self.path(key)
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from error
        problem, result = _check(key, content)
        if not problem and result.get("channels") is not None:
            recording = self.channels(key)
            if not recording.is_file():
                problem = f"its recording {recording.name} is missing"
            elif _file_hash(recording) != result["channels"]["sha256"]:
                problem = f"its recording {recording.name} was changed or cut off"
        if not problem:
            return result
        self._set_aside(key, problem)
        return None

    def recording(self, key: str) -> Recording:
        """The kept signals of a run."""
        return read_recording(self.channels(key))

    def _set_aside(self, key: str, problem: str) -> None:
        for path in (self.path(key), self.channels(key)):
            if not path.exists():
                continue
            aside, number = path.with_name(path.name + ".corrupt"), 1
            while aside.exists():
                number += 1
                aside = path.with_name(f"{path.name}.{number}.corrupt")
            path.rename(aside)
            self.corrupt.append(aside)
        names = " and ".join(path.name for path in self.corrupt if path.name.startswith(key))
        self.warn(
            f"{self.path(key)}: cannot be used ({problem}); it is kept as {names}, and the run is "
            "made again"
        )

    def tidy(self) -> None:
        """Remove temporary files that a killed process left behind."""
        for path in self.folder.glob(".*-*"):
            if path.is_file() and time.time() - path.stat().st_mtime > LEFT_OVER:
                path.unlink(missing_ok=True)


def _check(key: str, content: bytes) -> tuple[str, dict[str, Any]]:
    """What is wrong with a result file ("" for nothing), and the result."""
    try:
        whole = json.loads(content)
    except (ValueError, RecursionError):
        return f"not JSON, or cut off after {len(content)} bytes", {}
    if not isinstance(whole, dict) or whole.get("format") != NAME:
        return "not a result of a study", {}
    result = whole.get("result")
    digest = hashlib.sha256(_canonical(result).encode()).hexdigest()
    if not isinstance(result, dict) or digest != whole.get("sha256"):
        return "its content does not fit its checksum", {}
    if result.get("key") != key:
        return f"it is the result of run {result.get('key')}", {}
    kept = result.get("channels")
    if kept is not None and not (isinstance(kept, dict) and isinstance(kept.get("sha256"), str)):
        return "what it says about its recording is no checksum", {}
    return "", result


def _canonical(result: Any) -> str:
    return json.dumps(result, sort_keys=True)


def _file_hash(path: Path) -> str:
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()
