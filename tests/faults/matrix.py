"""Faults of FMUs, and what runs say of them: `python -m tests.faults.matrix` writes docs/faults.md.

Each is a run of two instances of one small FMU (`faulty.c`), of which the second fails as its name
says; faults of the archive are made here.
"""

from __future__ import annotations

import re
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from cosim.errors import CosimError, StepError
from cosim.fmu.archive import platform_folders
from cosim.master.master import Master
from cosim.system.system import System
from sources.packaging.native import compile_c
from sources.packaging.platforms import host_platform
from tests.coupling.faulty import XML
from tests.faults import others

PAGE = Path(__file__).resolve().parents[2] / "docs" / "faults.md"
LIMIT = 1.0
"""Time that a call may take here with isolation [s]; the fault that hangs never returns."""
STRING = (
    '<ScalarVariable name="s" valueReference="5" causality="output" variability="discrete"'
    ' initial="calculated"><String/></ScalarVariable></ModelVariables>'
)


@dataclass(frozen=True)
class Fault:
    """One way to fail.

    Attributes:
        phase: call in which it does; "archive" for faults of the file.
        kind: as in `faulty.c`, or of the file.
        says: what the error says (or the note, if the run goes on), as a regular expression.
        text: what it does, for the page.
        fails: whether the run must fail.
        maker: "" for the FMU in C of FMI 2; `third` or `python` for those of `others`.
    """

    phase: str
    kind: str
    says: str
    text: str
    fails: bool = True
    maker: str = ""

    @property
    def name(self) -> str:
        return "_".join(filter(None, (self.phase, self.kind, self.maker)))

    @property
    def place(self) -> str:
        """First cell of its row."""
        return {"third": "FMI 3: ", "python": "pythonfmu: "}.get(self.maker, "") + self.phase

    @property
    def hangs(self) -> bool:
        return self.kind in ("hang", "spin")


def _of(
    kind: str, says: str, text: str, *phases: str, fails: bool = True, maker: str = ""
) -> list[Fault]:
    return [Fault(phase, kind, says, text, fails, maker) for phase in phases]


EVERY = ("create", "init", "set", "get", "step", "terminate", "free")
EXIT = (
    r"(ended the process with exit code {}, which an FMU must not"
    r"|crashed \(signal SIG(ABRT|SEGV)\))"
)
"""In a fork of a process with threads, exit() may end in abort(): destructors wait for threads."""
CRASH = r"crashed \(signal {}"
FAULTS: tuple[Fault, ...] = (
    *_of("error", "failed with status 'error'", "returns error",
         "setup", "init", "exitinit", "set", "get", "step"),
    *_of("fatal", "failed with status 'fatal'", "returns fatal", "init", "set", "get", "step"),
    *_of("discard", "failed with status 'discard'", "returns discard", "get", "step"),
    *_of("pending", "failed with status 'pending'", "returns pending", "step"),
    *_of("status6", "failed with status 6, which FMI does not know", "returns 6", "get", "step"),
    *_of("status9", "failed with status 9, which FMI does not know", "returns 9", "step"),
    *_of("negative", "failed with status -1, which FMI does not know", "returns -1",
         "init", "set", "get", "step"),
    *_of("warning", "returned status 'warning'", "returns warning", "step", fails=False),
    *_of("exit0", EXIT.format(0), "calls `exit(0)`", *EVERY),
    *_of("exit3", EXIT.format(3), "calls `exit(3)`", "step"),
    *_of("_exit0", EXIT.format(0), "calls `_exit(0)`", "step"),
    *_of("segv", CRASH.format("SIGSEGV"), "writes to a wild address", *EVERY),
    *_of("abort", CRASH.format("SIGABRT"), "calls `abort()`", "create", "step", "free"),
    *_of("fpe", CRASH.format("SIGFPE"), "arithmetic signal", "step"),
    *_of("illegal", CRASH.format("SIG(ILL|TRAP)"), "illegal instruction", "step"),
    *_of("bus", CRASH.format("SIGBUS"), "bus error", "step"),
    *_of("kill", CRASH.format("SIGKILL"), "is killed (memory runs out)", "step"),
    *_of("term", CRASH.format("SIGTERM"), "ends its process by SIGTERM", "step"),
    *_of("stack", CRASH.format("SIGSEGV"), "overflows the stack", "step"),
    *_of("heap", CRASH.format("SIG"), "writes around its memory", "step"),
    *_of("twice", CRASH.format("SIGABRT"), "frees twice", "step", "free"),
    *_of("threadsegv", CRASH.format("SIGSEGV"), "a thread of its own crashes", "step"),
    *_of("hang", "did not return within 1 s", "does not return",
         "create", "init", "get", "step", "terminate", "free"),
    *_of("spin", "did not return within 1 s", "does not return, busily", "step"),
    *_of("nan", r"bad_step_nan\.y became nan", "gives nan", "step"),
    *_of("inf", r"bad_step_inf\.y became inf", "gives infinity", "step"),
    *_of("refused", "no licence for", "refuses to be created", "create"),
    *_of("guid", "could not be created: error: GUID .* is not mine", "finds a wrong GUID",
         "create"),
    *_of("chdir", "changed the working directory to /", "changes the working directory",
         "create", "init", "step", fails=False),
    *_of("umask", "changed the file mode mask to 777", "changes the file mode mask",
         "create", "step", fails=False),
    *_of("round", "changed the rounding", "rounds upwards", "create", "step", fails=False),
    *_of("ftz", "changed the rounding", "flushes tiny numbers to zero", "step", fails=False),
    *_of("locale", "changed the locale of numbers to C.UTF-8", "changes the locale",
         "create", fails=False),
    *_of("signal", "changed what happens at SIGTERM", "ignores SIGTERM", "create", fails=False),
    *_of("prints", "", "prints", "step", fails=False),
    *_of("logs", "error: line 19999", "logs 20 000 lines a step", "step", fails=False),
    *_of("long", "error: aaa", "logs 100 000 characters", "step", fails=False),
    *_of("format", "error: ", "logs a bad format", "step", fails=False),
    *_of("null", "error: ", "logs null strings", "step", fails=False),
    *_of("bytes", "status 'error': error: ", "logs what is no text", "step"),
    *_of("thread", "", "leaves a thread running", "step", fails=False),
    *_of("child", "", "leaves a process running", "step", fails=False),
    *_of("resources", "", "overwrites its unpacked files", "create", fails=False),
    *_of("string", "gave no string for s", "gives a null string", "get", fails=False),
    *_of("missing", "its binary lacks a function of FMI 2.0", "lacks a function", "archive"),
    *_of("version", "its binary lacks a function of FMI 2.0", "binary of another FMI version",
         "archive"),
    *_of("dependency", "its binary cannot be loaded", "needs a library that is not there",
         "archive"),
    *_of("garbage", "its binary cannot be loaded", "binary that is none", "archive"),
    *_of("cut", "is cut short", "binary cut short", "archive"),
    *_of("platform", "has no binary for this machine", "binary for another platform", "archive"),
    *_of("once", "can be instantiated only once per process", "is allowed once only", "archive"),
    *_of("error", "failed with status 'error'", "returns error", "step", maker="third"),
    *_of("fatal", "failed with status 'fatal'", "returns fatal", "step", maker="third"),
    *_of("discard", "failed with status 'discard'", "returns discard", "step", maker="third"),
    *_of("status7", "failed with status 7, which FMI does not know", "returns 7", "step",
         maker="third"),
    *_of("warning", "returned status 'warning'", "returns warning", "step", fails=False,
         maker="third"),
    *_of("exit0", EXIT.format(0), "calls `exit(0)`", "create", "get", "step", maker="third"),
    *_of("segv", CRASH.format("SIGSEGV"), "writes to a wild address", "create", "get", "step",
         maker="third"),
    *_of("abort", CRASH.format("SIGABRT"), "calls `abort()`", "step", maker="third"),
    *_of("hang", "did not return within 1 s", "does not return, busily", "step", maker="third"),
    *_of("nan", r"bad_step_nan_third\.y became nan", "gives nan", "step", maker="third"),
    *_of("raises", "belt came off", "raises an exception", "create", "init", "get", "step",
         maker="python"),
    *_of("false", "asked to end the simulation at t = 0.2 s", "returns False", "step", fails=False,
         maker="python"),
    *_of("leaves", "failed with status 'fatal'", "calls `sys.exit(0)`", "step", maker="python"),
    *_of("exit0", EXIT.format(0), "calls `os._exit(0)`", "step", maker="python"),
    *_of("abort", CRASH.format("SIGABRT"), "calls `os.abort()`", "step", maker="python"),
    *_of("hang", "did not return within 1 s", "does not return, busily", "step", maker="python"),
    *_of("nan", r"bad_step_nan_python\.y became nan", "gives nan", "step", maker="python"),
    *_of("prints", "", "prints", "step", fails=False, maker="python"),
)  # fmt: skip


def binary() -> bytes:
    """The library of the FMU."""
    source = Path(__file__).with_name("faulty.c").read_text(encoding="utf-8")
    return compile_c({"faulty.c": source}, "faulty.c", "faulty", host_platform())


def build(folder: Path, kind: str = "") -> Path:
    """The FMU, with a fault of the archive if one is named."""
    content, text, place = binary(), XML, platform_folders(2)[0]
    match kind:
        case "missing":
            content = content.replace(b"fmi2DoStep\0", b"fmi2NoStep\0")
        case "version":
            content = content.replace(b"\0fmi2", b"\0fmi3")
        case "dependency":
            content = content.replace(b"libc.so.6\0", b"libq.so.6\0")
        case "garbage":
            content = b"no library at all" * 100
        case "cut":
            content = content[: len(content) // 2]
        case "platform":
            place = "win64"
        case "once":
            claim = '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true" '
            text = text.replace("<CoSimulation ", claim)
        case "string":
            text = text.replace("</ModelVariables>", STRING).replace(
                "</Outputs>", '<Unknown index="5"/></Outputs>'
            )
    path = folder / f"faulty{kind}.fmu"
    if not path.exists():
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", text)
            archive.writestr(f"binaries/{place}/faulty.so", content)
    return path


@dataclass(frozen=True)
class Outcome:
    """What a run said: its exit code, its text, and how many rows its recording has."""

    code: int
    text: str
    rows: int


def faulty(folder: Path, fault: Fault) -> Path:
    """The FMU that fails."""
    if fault.maker == "third":
        return others.third(folder, fault.phase, fault.kind)
    if fault.maker == "python":
        return others.python(folder)
    return build(folder, fault.kind if fault.phase == "archive" or fault.kind == "string" else "")


def outcome(folder: Path, fault: Fault, isolated: bool) -> Outcome:
    """Run with a fault as `cosim run` does, with or without `--isolate`."""
    once = "once" if fault.kind == "once" else ""
    system = System("pair")
    bad = f"bad_{fault.name}"
    try:
        system.add("good", str(build(folder, once)))
        system.add(bad, str(faulty(folder, fault)))
        system.connect("good.y", f"{bad}.u")
        how = {"isolate": LIMIT} if isolated else {"guard": True}
        recording = Master(system, step=0.1, **how).run(1.0)
    except StepError as error:
        rows = len(error.recording.time) if error.recording is not None else 0
        return Outcome(error.exit_code, str(error), rows)
    except CosimError as error:
        return Outcome(error.exit_code, str(error), 0)
    return Outcome(0, "\n".join(recording.notes), len(recording.time))


def table() -> str:
    """The page's table."""
    lines = [
        "| call | the FMU | `cosim run` says | exit code | rows kept | with `--isolate` |",
        "|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for fault in FAULTS:
            apart = outcome(folder, fault, True)
            same = apart if fault.hangs else outcome(folder, fault, False)
            plain = "waits until it is interrupted" if fault.hangs else _short(same.text, folder)
            other = (
                "the same"
                if not fault.hangs and (same.code, same.rows) == (apart.code, apart.rows)
                else f"{_short(apart.text, folder)} ({apart.code}, {apart.rows} rows)"
            )
            code, rows = ("130", "–") if fault.hangs else (str(same.code), str(same.rows))
            lines.append(
                f"| {fault.place} | {fault.text} | {plain or 'nothing: the run is right'} | {code} "
                f"| {rows} | {other} |"
            )
    return "\n".join(lines)


def _short(text: str, folder: Path) -> str:
    text = text.replace(f"{folder}/", "").partition("; take other values")[0]
    text = re.sub(r"\[Errno.*|/\S*/(?=\w+\.so)", "", text).replace("|", "\\|")
    text = " ".join(text.split())
    return text if len(text) < 160 else text[:150] + " …"


def main() -> None:
    """Write the table into the page."""
    head = PAGE.read_text(encoding="utf-8").partition("<!-- table -->")[0]
    PAGE.write_text(f"{head}<!-- table -->\n\n{table()}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
