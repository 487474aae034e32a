"""Runs inputs one after another, within limits of memory, and says what became of each.

`python -m tests.fuzz.worker FOLDER SEED` takes lines `READER FIRST COUNT` and answers one JSON line
per input. A reader that does not come back, or ends the process, is the parent's business.
"""

from __future__ import annotations

import json
import os
import re
import resource
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from cosim.errors import InputError

MEMORY = 10**9
"""[bytes] That an input may take beyond what the process had before."""
_HARMLESS = ("/dev/null",)
outside: list[str] = []
"""What the present input wrote outside the folder, loaded or started."""


def _watch(folder: str) -> None:
    """Note every write outside the folder, every program and library."""
    allowed = (os.path.realpath(folder) + os.sep,)

    def inside(path: Any) -> bool:
        if isinstance(path, int) or path is None:
            return True
        text = os.fsdecode(path)
        if "\0" in text or text in _HARMLESS:
            return True  # no file can have that name
        return (os.path.realpath(text) + os.sep).startswith(allowed)

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, mode, flags = arguments
            writes = (flags or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
            if (writes or any(letter in (mode or "") for letter in "wax+")) and not inside(path):
                outside.append(f"{event} {path!r}")
        elif event in ("os.mkdir", "os.remove", "os.rmdir", "os.truncate", "os.chmod"):
            if not inside(arguments[0]):
                outside.append(f"{event} {arguments[0]!r}")
        elif event in ("os.rename", "os.link", "os.symlink"):
            if not (inside(arguments[0]) and inside(arguments[1])):
                outside.append(f"{event} {arguments[:2]!r}")
        elif event in ("subprocess.Popen", "os.system", "os.exec", "os.fork", "socket.connect"):
            outside.append(event)
        elif event == "ctypes.dlopen" and inside(arguments[0]) and arguments[0] is not None:
            outside.append(f"loaded {arguments[0]!r}")

    sys.addaudithook(hook)


def _names_it(text: str, path: Path) -> bool:
    """Whether an error names the file or one of its folder."""
    return any(part in text for part in (path.name, str(path), str(path.parent)))


def outcome(read: Any, path: Path) -> str:
    """What became of one input: `read`, `refused`, or what must not be."""
    outside.clear()
    try:
        read(path)
        found = "read"
    except InputError as error:
        text = str(error)
        if not _names_it(text, path):
            alike = re.sub(r"'[^']*'|\"[^\"]*\"|\S*/\S*|\d+", "*", text)  # one kind of outcome
            found = f"unnamed file: {type(error).__name__}: {alike[:100]}"
        elif len(text) > 5000:
            found = f"text of {len(text)} characters"
        else:
            found = "refused"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)
        ours = [item for item in place if f"{os.sep}cosim{os.sep}" in item.filename]
        where = ours[-1] if ours else place[-1]
        found = (
            f"{type(error).__name__} at {Path(where.filename).name}:{where.lineno}: "
            + re.sub(r"'[^']*'|\S*/\S*|\d+", "*", str(error))[:100]
        )
    return f"outside: {outside[0]}" if outside else found


def _virtual() -> int:
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


def main() -> None:
    """Serve the parent until it closes the pipe."""
    folder, seed = Path(sys.argv[1]), int(sys.argv[2])
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # readers that print do not disturb
    from .readers import READERS

    for reader in READERS.values():  # imports and caches are not the inputs' cost
        (folder / reader.name).mkdir(exist_ok=True)
        for content in reader.seeds():
            reader.read(reader.place(folder / reader.name, content))
    _watch(str(folder))
    if sys.platform == "linux":
        limit = _virtual() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for line in sys.stdin:
        name, first, count = line.split()
        reader = READERS[name]
        for number in range(int(first), int(first) + int(count)):
            path = reader.place(folder / name, reader.content(seed, number))
            answers.write(json.dumps({"begun": number}) + "\n")
            answers.flush()
            begin = time.process_time()
            found = outcome(reader.read, path)
            answer = {"number": number, "outcome": found, "s": time.process_time() - begin}
            answers.write(json.dumps(answer) + "\n")
            answers.flush()


if __name__ == "__main__":
    main()
