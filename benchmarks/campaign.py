"""Four hundred generated sets, each made and diagnosed once on one state of the program.

    python -m benchmarks.campaign --out out/campaign
    python -m benchmarks.campaign --out out/campaign --rig motor --workers 1

The series of `SERIES` one after the other, as `benchmarks.selftest` runs them; a series of one rig
is short, so a campaign that ends early holds a bit of everything. A set that is there is not
diagnosed again, so the same command goes on, and one command for each rig and kind may run beside
others; with another state of the program or of the rig's plant (the files of `STATE`) a series is
refused, since figures of two states are figures of none.
Prints, and writes as `campaign.md`, a table of outcomes for each rig and kind of series:

    one      one effect or none
    several  two effects or three
    withheld one effect that the catalogue lacks: another name is wrong if it leaves more than noise
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks import selftest
from cosim.files import atomic


class Series(NamedTuple):
    """Sets of one rig with one seed."""

    rig: str
    kind: str
    seed: int
    sizes: str
    """Options of `benchmarks.selftest`."""


ONE = "--clean {} --repeats 1"
SOME = "--clean 0 --repeats 0 --pairs {} --triples {}"
WITHHELD = "--clean 0 --repeats 1 --withheld"
SERIES = (
    *(Series("motor", "one", 140008 + i, ONE.format(7)) for i in range(5)),
    *(Series("motor", "several", 140105 + i, SOME.format(10, 5)) for i in range(4)),
    *(Series("motor", "withheld", 140203 + i, WITHHELD) for i in range(2)),
    *(Series("crawler", "one", 141002 + i, ONE.format(6)) for i in range(2)),
    *(Series("crawler", "several", 141102 + i, SOME.format(10, 4)) for i in range(2)),
    Series("crawler", "withheld", 141202, WITHHELD),
    Series("omni", "one", 142003, ONE.format(6)),
    Series("omni", "several", 142101, SOME.format(8, 2)),
    Series("arm", "one", 143001, ONE.format(6)),
    Series("arm", "several", 143101, SOME.format(8, 0)),
)
"""Four hundred sets, half of them of the rig that is quickest."""


def turns(chosen: list[Series]) -> list[Series]:
    """Series in the order in which they run: the first of each kind, the second, and so on."""
    met: dict[tuple[str, str], int] = {}
    order = []
    for place, series in enumerate(chosen):
        turn = met[series.rig, series.kind] = met.get((series.rig, series.kind), 0) + 1
        order.append((turn, place, series))
    return [series for _, _, series in sorted(order)]


STATE = (
    "cosim/**/*.py", "cosim/**/*.toml", "sources/**/*.py", "sources/**/*.c",
    "benchmarks/bench.py", "benchmarks/own_plant.py", "benchmarks/selftest.py",
    "benchmarks/{rig}_plant.py",
)  # fmt: skip
"""Files that the rows of a rig come from."""


def state(rig: str, top: Path = Path(__file__).parents[1]) -> str:
    """What tells the present state of all that a rig's rows come from: a digest of the files."""
    digest = hashlib.sha256()
    patterns = [pattern.format(rig=rig) for pattern in STATE]
    for path in sorted({path for pattern in patterns for path in top.glob(pattern)}):
        digest.update(f"{path.relative_to(top).as_posix()}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def claim(folder: Path, rig: str) -> None:
    """Mark the folder of a series as one of this state.

    Raises:
        SystemExit: its rows are of another.
    """
    mark, mine = folder / "state.txt", state(rig)
    if mark.exists() and (theirs := mark.read_text(encoding="utf-8").strip()) != mine:
        raise SystemExit(
            f"{folder}: its sets were diagnosed by state {theirs} of the program, which is {mine} "
            "now; go on with the commit that made it, or give another --out"
        )
    folder.mkdir(parents=True, exist_ok=True)
    with atomic(mark) as place:
        place.write_text(mine + "\n", encoding="utf-8")


def main() -> None:
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rig", choices=sorted({s.rig for s in SERIES}), help="of one rig alone")
    parser.add_argument("--kind", choices=sorted({s.kind for s in SERIES}), help="of this alone")
    parser.add_argument("--workers", default="2")
    parser.add_argument("--out", type=Path, default=Path("out/campaign"))
    arguments = parser.parse_args()
    chosen = [
        s for s in SERIES
        if arguments.rig in (None, s.rig) and arguments.kind in (None, s.kind)
    ]  # fmt: skip
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for series in turns(chosen):
        words = ["--rig", series.rig, "--wide", "--seed", str(series.seed), *series.sizes.split()]
        folder = arguments.out / f"{series.rig}_{series.kind}_{series.seed}"
        claim(folder, series.rig)
        words += ["--workers", arguments.workers, "--out", str(folder)]
        rows.setdefault((series.rig, series.kind), []).extend(selftest.main(words))
    text = "\n".join(
        f"## {rig}, {kind}\n\n{selftest.summary(found)}" for (rig, kind), found in rows.items()
    )
    name = "_".join(filter(None, ("campaign", arguments.rig, arguments.kind))) + ".md"
    with atomic(arguments.out / name) as place:
        place.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
