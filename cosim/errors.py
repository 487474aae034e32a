"""What can go wrong, and what to do about it.

    * CosimError                    exit code 1: the work failed
      x InputError                  exit code 2: wrong usage or input
        - FmuFileError              missing, corrupt or truncated .fmu, or not one we can run
        + PlatformError             the FMU has no binary for this machine
        - VariantError              unknown component, fidelity or effect; effect without a balance
          + UnbuiltError            its FMU is not there, and the compiler is not installed
        - GraphError                the graph is wrong
          + UnknownNameError        no such instance, variable, scenario, file, column
          + ConnectError           causality, type, size or double driver
          + UnitError               units that do not convert
        - ValueRangeError           a value outside its bounds, or not finite
        - ScenarioError             a scenario, system or data file that cannot be read
      x FmuCallError                an FMU refused a call; carries its own log messages
        + EndRequest                an FMU asked to end; a master ends the run without an error
        + StepError                 the run stopped; carries what was recorded until then
      x AlgebraicLoopError          connected values that do not settle
      x CheckError                  a scenario ran, but a check of it failed
      x StudyError                  a study ran, but runs of it failed

Every text names both ends, both values and the time where there are such, and the way out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any


class CosimError(Exception):
    """The work failed."""

    exit_code = 1


class InputError(CosimError):
    """Wrong usage or input."""

    exit_code = 2


class FmuFileError(InputError):
    """An .fmu that is missing, corrupt, truncated, or of a kind that cannot be run."""


class PlatformError(FmuFileError):
    """An FMU without a binary for this machine."""


class VariantError(InputError):
    """A variant that does not exist or cannot be built."""


class UnbuiltError(VariantError):
    """A variant whose FMU is not there and cannot be built here; the text says what is missing."""


class GraphError(InputError):
    """A wrong graph of instances and connections."""


class UnknownNameError(GraphError):
    """A name that does not exist; the text lists what does."""


class ConnectError(GraphError):
    """Two ends that do not fit."""


class UnitError(GraphError):
    """Units that are unknown or do not convert into each other."""


class ValueRangeError(InputError):
    """A value outside its bounds, or not finite."""


class ScenarioError(InputError):
    """A scenario, system or data file that cannot be read."""


class FmuCallError(CosimError):
    """An FMU refused a call.

    Attributes:
        messages: what the FMU itself logged.
    """

    def __init__(self, text: str, messages: Iterable[str] = ()) -> None:
        super().__init__(text)
        self.messages = tuple(messages)


class StepError(FmuCallError):
    """A run that stopped before its end.

    Attributes:
        time: the communication point from which the failing step started [s].
        recording: what was recorded until then, a `data.recording.Recording`; None if nothing was.
    """

    def __init__(
        self,
        text: str,
        messages: Iterable[str] = (),
        *,
        time: float,
        recording: Any = None,
    ) -> None:
        super().__init__(text, messages)
        self.time = time
        self.recording = recording


class EndRequest(FmuCallError):
    """An FMU asked to end the simulation: the master ends the run there, without an error.

    Attributes:
        time: up to which the FMU has gone [s].
        complete: whether all FMUs of the run have gone so far.
    """

    def __init__(self, text: str, messages: Iterable[str] = (), *, time: float) -> None:
        super().__init__(text, messages)
        self.time, self.complete = time, False


class AlgebraicLoopError(CosimError):
    """Connected values that depend on each other at the same instant and do not settle."""


class CheckError(CosimError):
    """A scenario ran, but a check of it failed."""


class StudyError(CosimError):
    """A study ran, but runs of it failed."""


@contextmanager
def within(where: str) -> Iterator[None]:
    """Errors about what a file says, with the file before them unless they name it themselves."""
    try:
        yield
    except InputError as error:
        if where in str(error):
            raise
        raise type(error)(f"{where}: {error}") from error


def listing(names: Iterable[str], wanted: str = "", limit: int = 12) -> str:
    """Name what exists, nearest to `wanted` first, for the end of an error text."""
    everything = list(dict.fromkeys(names))
    if not everything:
        return "there is none"
    # what differs in case only is near
    small = {name.lower(): name for name in reversed(everything)}
    found = get_close_matches(wanted.lower(), small, n=3, cutoff=0.6) if wanted else []
    near = [small[name] for name in found]
    shown = [*near, *[name for name in everything if name not in near]][:limit]
    rest = len(everything) - len(shown)
    text = ", ".join(shown) + (f" and {rest} more" if rest > 0 else "")
    if near:
        return f"did you mean {' or '.join(repr(name) for name in near)}? There is {text}"
    return f"there is {text}"
