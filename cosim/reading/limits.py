"""How large files may be: asked before anything is unpacked or allocated.

A file of some hundred bytes can ask for gigabytes: an array of 2e9 values, zeros packed by a factor
of a thousand, XML entities that contain each other. Each limit can be raised by an environment
variable, which the error names.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass

from ..errors import InputError

_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12,
          "ki": 2**10, "mi": 2**20, "gi": 2**30, "ti": 2**40}  # fmt: skip
_NUMBER = re.compile(r"(\d+(?:\.\d*)?(?:e\d+)?)\s*(|[kmgt]i?)b?", flags=re.IGNORECASE)


@dataclass(frozen=True)
class Limit:
    """A largest size.

    Attributes:
        variable: environment variable that replaces it, e.g. `COSIM_MAX_UNPACKED=8GB`.
        default: without that.
        unit: what is counted.
    """

    variable: str
    default: int
    unit: str = "bytes"

    def value(self) -> int:
        """The limit in force.

        Raises:
            InputError: the variable is no number.
        """
        text = os.environ.get(self.variable, "").strip()
        if not text:
            return self.default
        match = _NUMBER.fullmatch(text)
        if match is None:
            raise InputError(f"{self.variable}={text}: write a number, e.g. 2000000000 or 2GB")
        return int(float(match[1]) * _UNITS[match[2].lower()])

    def excess(self, amount: int) -> str:
        """What is wrong with an amount, and the way out; "" where it is within the limit."""
        limit = self.value()
        if amount <= limit:
            return ""
        return (
            f"{shown(amount, self.unit)} are more than the limit of {shown(limit, self.unit)}; if "
            f"the file is to be trusted, raise it: {self.variable}={amount}"
        )


def shown(amount: int, unit: str = "bytes") -> str:
    """An amount for people: `4.3 GB`, `2000000000 values`."""
    if unit != "bytes":
        return f"{amount} {unit}"
    for factor, name in ((10**9, "GB"), (10**6, "MB"), (10**3, "kB")):
        if amount >= factor:
            return f"{amount / factor:.4g} {name}"
    return f"{amount} bytes"


UNPACKED = Limit("COSIM_MAX_UNPACKED", 2**30)
"""All files of an FMU or SSP archive together; the largest FMUs known to us take a tenth."""
FILES = Limit("COSIM_MAX_FILES", 100_000, "files")
"""In an archive; an FMU that carries a Python environment has 30 000."""
TEXT = Limit("COSIM_MAX_TEXT", 32 * 2**20)
"""One XML, JSON or TOML file. Read, 32 MiB take up to 1 GB; 100 000 variables take 25 MB."""
VALUES = Limit("COSIM_MAX_VALUES", 1_000_000, "values")
"""Of all variables of an FMU, elements of arrays counted one by one."""
DATA = Limit("COSIM_MAX_DATA", 2**29)
"""Columns of one log or recording in memory: 18 of them, for an hour at 1 kHz. Reading takes twice
that for a moment."""
