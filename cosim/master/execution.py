"""One execution of a plan: creates the FMUs, initializes them together, makes the steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import Any

from ..data.recording import Recording
from ..errors import AlgebraicLoopError, EndRequest, FmuCallError, StepError, ValueRangeError
from ..fmu.surroundings import Surroundings
from . import kernel
from .initialization import initialize
from .interpreter import Interpreter
from .invented import invented
from .kernel.stepper import Compiled
from .kernel.updates import update
from .outline import Outline
from .plan import Stepper, decoded
from .startup import find_past

EXECUTORS = ("auto", "c", "python")
Maker = Callable[[Outline, ExitStack, int], Interpreter]
_usual: Maker = Interpreter


def usual(maker: Maker) -> None:
    """Have all further executions of this process made in another way (see `board`)."""
    global _usual
    _usual = maker


class Interpreted:
    """A `plan.Stepper` that does the operations of each step one by one."""

    looks_ahead = False

    def __init__(self, run: Interpreter) -> None:
        self.run, self.step = run, decoded(run.plan.step)

    def advance(self, last: int) -> None:
        """Go on up to a communication point."""
        while self.run.index < last:
            self.run.communication_step(self.step)

    def restart(self) -> None:
        """Nothing to forget."""

    def save(self) -> None:
        """Nothing is kept from step to step."""

    def restore(self, memory: None) -> None:
        """Nothing to return to."""

    def steps(self) -> int:
        """Steps that were made."""
        return self.run.index

    def report(self) -> Mapping[str, Any]:
        """Nothing to say."""
        return {}


class Execution:
    """One execution of a plan, which can be repeated.

    Args:
        outline: what is run.
        stack: ends the FMUs' instances.
        interpreter: what makes the instances and does the operations; see `usual`.

    Attributes:
        run: the instances and their values.
        stepper: what makes the communication steps, None until the first one.
        lost: what the system is without because nothing takes it.
        ended: the words of an FMU that asked to end the run, "" if none did.
        changed: what FMUs have left changed in this process.
    """

    def __init__(
        self,
        outline: Outline,
        stack: ExitStack,
        interpreter: Maker | None = None,
    ) -> None:
        if outline.executor not in EXECUTORS:
            raise ValueRangeError(
                f"executor {outline.executor!r}: must be {', '.join(EXECUTORS[:-1])} or "
                f"{EXECUTORS[-1]}"
            )
        self.outline = outline
        self.run = (interpreter or _usual)(outline, stack, update(outline.executor))
        self.stepper: Stepper | None = None
        self.ended = ""
        self.lost: list[str] = []
        self.changed: list[str] = []

    def execute(self, progress: Callable[[float], None] | None = None) -> Recording:
        """The whole run.

        Args:
            progress: told now and then which fraction is done.

        Raises:
            AlgebraicLoopError: initial values do not settle.
            StepError: an FMU failed; carries the recording up to then.
        """
        count = self.outline.count
        shown = max(count // 100, 1)
        initialize(self.run)
        self.find_lost()
        before = Surroundings.now()
        try:
            stepper = self.begin()
            try:
                while self.run.index < count:
                    stepper.advance(min(self.run.index + shown, count))
                    if progress is not None:
                        progress(self.run.index / count)
            except EndRequest as request:
                self.ended = str(request)
                self.finish(request)
            else:
                self.finish()
        except (FmuCallError, AlgebraicLoopError) as error:
            raise self.stopped(error, keep=True) from error
        finally:
            self.changed = before.restore()
        if progress is not None:
            progress(1.0)
        return self.recording()

    def begin(self) -> Stepper:
        """What makes the steps of an initialized run, with the past that it begins with."""
        find_past(self.run)
        return self.prepare()

    def prepare(self) -> Stepper:
        """What makes communication steps; made once."""
        if self.stepper is None:
            self.stepper = self._make()
        return self.stepper

    def _make(self) -> Stepper:
        wanted, plan = self.outline.executor, self.outline.plan
        objects = [
            name
            for name, carries in zip(plan.layout.names, plan.layout.objects.tolist(), strict=True)
            if carries
        ]
        if objects and wanted == "c":
            raise ValueRangeError(
                f"executor 'c': {objects[0]} is a string, a binary or an integer of 64 bits, which "
                "the executor in Python passes on; take executor auto, or do not record it"
            )
        if plan.stepper is not None and (wanted != "c" or kernel.find() is not None):
            return plan.stepper(self.run)
        if objects or wanted == "python" or (wanted == "auto" and kernel.find() is None):
            return Interpreted(self.run)
        try:
            return Compiled(self.run)
        except FileNotFoundError as error:
            raise ValueRangeError(
                f"executor 'c': this machine has no {error}; 'cosim fmus build' compiles it"
            ) from None

    def finish(self, request: EndRequest | None = None) -> None:
        """Operations at the end of the run, unless its present values are recorded already.

        Args:
            request: of an FMU that ended it. Where all FMUs stand at one time then, their values
                are recorded in any case; otherwise those of the last time at which they did.
        """
        run = self.run
        if request is not None and not request.complete:
            run.keep_last(present=False)
            return
        last = request is not None and request.complete
        if run.row > run.index // self.outline.every and not (
            last and run.index % self.outline.every
        ):
            return
        for op, a, b in decoded(self.outline.plan.final):
            run.do(op, a, b)
        if last:
            run.keep_last(present=True)

    def restart(self) -> None:
        """Return to the state before initialization, with the system's values set again."""
        self.run.restart()
        self.ended = ""
        if self.stepper is not None:
            self.stepper.restart()

    def stopped(self, error: FmuCallError | AlgebraicLoopError, keep: bool) -> StepError:
        """The error for a run that ended early; `keep`: with what was recorded."""
        time = float(self.outline.times[min(self.run.index, self.outline.count)])
        text = f"run stopped at t = {time:.9g} s: {error}"
        messages = error.messages if isinstance(error, FmuCallError) else ()
        text = "\n".join([text, *invented(*self.energies())])
        recording = self.recording(text) if keep else None
        return StepError(text, messages, time=time, recording=recording)

    def steps(self) -> int:
        """Steps of the whole system that were made, repeated ones too."""
        return self.stepper.steps() if self.stepper is not None else self.run.index

    def how(self) -> dict[str, Any]:
        """What provenance says of how it was run."""
        report = self.stepper.report() if self.stepper is not None else {}
        return {"fmu_steps": self.steps() * len(self.run.instances), **report}

    def recording(self, error: str = "") -> Recording:
        """What was recorded so far."""
        run, (energy, turnover) = self.run, self.energies()
        return self.outline.recording(
            run.rows[: run.row],
            energy,
            self.how(),
            error,
            objects=run.passing.kept,
            beside=run.beside,
            turnover=turnover,
            notes=self.notes(),
        )

    def energies(self) -> tuple[dict[str, float], dict[str, float]]:
        """Energy that each power bond invented, and that went over it [J]."""
        run = self.run
        names = [bond.name for bond in run.layout.bonds]
        return (
            dict(zip(names, run.bond_energy.tolist(), strict=True)),
            dict(zip(names, run.bond_turnover.tolist(), strict=True)),
        )

    def notes(self) -> list[str]:
        """What is to be known of the run besides what was recorded."""
        warnings = [text for instance in self.run.instances for text in instance.warnings()]
        changed = [
            f"an FMU changed {what} in a step ({', '.join(self.run.system.members)} made some), "
            "which was put back"
            for what in self.changed
        ]
        return [*self.lost, *filter(None, [self.ended]), *warnings, *changed]

    def find_lost(self) -> None:
        """Look which outputs are not 0, must be passed on, and are not."""
        found: dict[tuple[str, str], list[tuple[str, float]]] = {}
        system = self.outline.system
        instances = dict(zip(system.members, self.run.instances, strict=True))
        for full in system.untaken():
            owner, _, name = full.partition(".")
            whole = system.declaration(full)
            values = instances[owner].get(whole.name)
            value = float(values[whole.elements().index(name)])
            if value != 0.0:
                array = name.partition("[")[0]
                found.setdefault((owner, array), []).append((name, value))
        self.lost = [
            f"{owner}.{name} = {', '.join(f'{value:.3g}' for _, value in items)} "
            f"{system.unit(f'{owner}.{items[0][0]}')} is taken by nothing "
            f"({system.members[owner].description.extra['passed_on'][items[0][0]]}): it is missing "
            "from the motion; connect it"
            for (owner, name), items in found.items()
        ]
