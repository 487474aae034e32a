"""`python -m sources.distribution`: build what a wheel carries into `build/library`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from . import make

parser = argparse.ArgumentParser(description=make.__doc__)
parser.add_argument("--out", type=Path, default=Path("build/library"))
parser.add_argument("--platform", choices=("host", "all"), default="host")
parser.add_argument(
    "--diagnose", type=Path, nargs="*", metavar="MAPPING",
    help="serve the diagnoses of these mappings only",
)  # fmt: skip
given = parser.parse_args()
make.make(
    given.out, given.platform, lambda text: print(text, file=sys.stderr, flush=True),
    given.diagnose,
)  # fmt: skip
