"""What becomes of damaged logs: kinds of damage to good logs of a motor bench, and their outcomes.

    python -m benchmarks.damaged --out out/damaged
    python -m benchmarks.damaged --diagnose --out out/damaged

The first reads and checks (some seconds a kind), the second diagnoses what passes the checks, too.
The bench lacks nothing: a diagnosis must not end with the name of an effect, and no channel may
leave the fit unsaid. Each kind is a function of the tables of three runs. The outcome is `refused`
(with a sentence), `named` (a finding, by its kind), or the verdict of the diagnosis.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from benchmarks.motor_plant import draw, write_sets
from cosim.calibrate.checks.examine import examine
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose import diagnose
from cosim.errors import CosimError

Vector = NDArray[np.float64]
Runs = dict[str, pd.DataFrame]
SHEET = Path(__file__).parents[1] / "scenarios/motor_bench/data/motor_bench.toml"
NAMES = ("ST", "MS", "MX")
COLUMNS = ("speed", "current", "voltage", "angle")
SEED = 4


@dataclass(frozen=True)
class Outcome:
    """What a kind of damage ended with.

    Attributes:
        kind: of damage.
        outcome: `refused`, `named` or a verdict.
        by: kinds of the findings, of the error, or effects.
        text: the first sentence.
        lost: channels that are not compared and about which nothing is said.
    """

    kind: str
    outcome: str
    by: tuple[str, ...]
    text: str
    lost: tuple[str, ...]

    @property
    def right(self) -> bool:
        """Whether no effect is named and no channel is lost."""
        return self.outcome not in ("effect_found", "confounded") and not self.lost


def _each(function: Callable[[pd.DataFrame], pd.DataFrame]) -> Callable[[Runs], Runs]:
    """The same for all runs."""
    return lambda runs: {name: function(table.copy()) for name, table in runs.items()}


def _column(name: str, function: Callable[[Vector], object]) -> Callable[[Runs], Runs]:
    """The same for a column of all runs."""
    return _each(lambda t: t.assign(**{name: function(t[name].to_numpy(dtype=np.float64))}))


def _swap(first: str, second: str) -> Callable[[Runs], Runs]:
    return _each(lambda t: t.assign(**{first: t[second], second: t[first]}))


def _one(name: str, function: Callable[[pd.DataFrame], pd.DataFrame]) -> Callable[[Runs], Runs]:
    """One run only."""
    return lambda runs: {**runs, name: function(runs[name].copy())}


def _late(samples: int) -> Callable[[Vector], Vector]:
    return lambda x: np.concatenate([np.full(samples, x[0]), x[:-samples]])


def _spiked(x: Vector, share: float, size: float) -> Vector:
    random = np.random.default_rng(SEED)
    hit = random.random(x.size) < share
    return np.where(hit, x + size * random.choice([-1.0, 1.0], x.size), x)


def _dropped(t: pd.DataFrame, share: float) -> pd.DataFrame:
    random = np.random.default_rng(SEED)
    keep = random.random(len(t)) >= share
    keep[0] = True
    return t[keep].reset_index(drop=True)


def _low(t: pd.DataFrame, cutoff: float, names: tuple[str, ...] = COLUMNS) -> pd.DataFrame:
    filtered = {n: sosfiltfilt(butter(4, cutoff, fs=1e3, output="sos"), t[n]) for n in names}
    return t.assign(**filtered)


def _interpolated(t: pd.DataFrame, step: int, names: tuple[str, ...] = COLUMNS) -> pd.DataFrame:
    time = t["time"].to_numpy()
    return t.assign(**{n: np.interp(time, time[::step], t[n].to_numpy()[::step]) for n in names})


def _held(x: Vector, step: int) -> Vector:
    return np.repeat(x[::step], step)[: x.size]


def _frozen(x: Vector) -> Vector:
    return np.concatenate([x[:2000], np.full(2000, x[2000]), x[4000:]])


def _gap(t: pd.DataFrame) -> pd.DataFrame:
    return pd.concat([t[:2000], t[2800:]], ignore_index=True)


def _twice(t: pd.DataFrame) -> pd.DataFrame:
    return t.loc[np.sort(np.concatenate([np.arange(len(t)), np.arange(0, len(t), 100)]))]


def _jittered(t: pd.DataFrame) -> pd.DataFrame:
    random = np.random.default_rng(SEED)
    return t.assign(time=t["time"] + random.uniform(-4e-4, 4e-4, len(t)))


def _noisy(x: Vector, sigma: float) -> Vector:
    return np.asarray(x + np.random.default_rng(SEED).normal(size=x.size) * sigma)


def _text(x: Vector) -> object:
    return [f"{value:.7g}" for value in x]


def _words(x: Vector) -> object:
    return ["on" if value > 0.0 else "off" for value in x]


def _holes(x: Vector, share: float) -> Vector:
    return np.where(np.random.default_rng(SEED).random(x.size) < share, np.nan, x)


def _stretched(x: Vector, rate: float) -> Vector:
    at = np.arange(x.size, dtype=np.float64)
    return np.asarray(np.interp(at * rate, at, x))


KINDS: dict[str, Callable[[Runs], Runs]] = {
    "none": lambda runs: runs,
    "current and voltage swapped": _swap("current", "voltage"),
    "speed and angle swapped": _swap("speed", "angle"),
    "set speed and speed swapped": _swap("speed_set", "speed"),
    "sign of the current": _column("current", np.negative),
    "sign of the angle": _column("angle", np.negative),
    "sign of the current in one run": _one("MS", lambda t: t.assign(current=-t["current"])),
    "current late by 20 ms": _column("current", _late(20)),
    "speed late by 5 ms": _column("speed", _late(5)),
    "set speed late by 20 ms": _column("speed_set", _late(20)),
    "clock 1 % fast": _each(lambda t: t.assign(time=t["time"] * 1.01)),
    "clock 0.2 % slow": _each(lambda t: t.assign(time=t["time"] * 0.998)),
    "clock of the angle 1 % off": _column("angle", lambda x: _stretched(x, 0.99)),
    "speed in rpm": _column("speed", lambda x: x * 30.0 / np.pi),
    "angle in degrees": _column("angle", np.degrees),
    "current in mA": _column("current", lambda x: x * 1e3),
    "spikes in 1 % of the current": _column("current", lambda x: _spiked(x, 0.01, 20.0)),
    "one spike of the speed": _one("MS", lambda t: t.assign(
        speed=t["speed"].where(t.index != 1234, 1e9))),
    "speed 0 in 1 % of the samples": _column("speed", lambda x: np.where(
        np.random.default_rng(SEED).random(x.size) < 0.01, 0.0, x)),
    "speed frozen for 2 s": _column("speed", _frozen),
    "current held for 10 samples": _column("current", lambda x: _held(x, 10)),
    "all columns held for 5 samples": _each(
        lambda t: t.assign(**{n: _held(t[n].to_numpy(), 5) for n in COLUMNS})),
    "current low-passed at 20 Hz": _each(lambda t: _low(t, 20.0, ("current",))),
    "all columns low-passed at 20 Hz": _each(lambda t: _low(t, 20.0)),
    "all columns low-passed at 200 Hz": _each(lambda t: _low(t, 200.0)),
    "all columns interpolated from 100 Hz": _each(lambda t: _interpolated(t, 10)),
    "all columns averaged over 5 samples": _each(lambda t: t.assign(
        **{n: t[n].rolling(5, min_periods=1, center=True).mean() for n in COLUMNS})),
    "validation is a copy": lambda runs: {**runs, "MX": runs["ST"].copy()},
    "a run is there twice": lambda runs: {**runs, "MS": runs["ST"].copy()},
    "0.8 s of rows missing": _each(_gap),
    "2 % of the rows missing": _each(lambda t: _dropped(t, 0.02)),
    "rows there twice": _each(_twice),
    "time goes back": _one("MS", lambda t: t.assign(
        time=np.where(t.index > 2500, t["time"] - 0.5, t["time"]))),
    "sample times jitter": _each(_jittered),
    "noise of the current 5 times as large": _column("current", lambda x: _noisy(x, 0.25)),
    "current clipped at 4 A": _column("current", lambda x: np.clip(x, -4.0, 4.0)),
    "no samples": _each(lambda t: t[:0]),
    "30 samples": _each(lambda t: t[:30]),
    "current all gaps": _column("current", lambda x: np.full_like(x, np.nan)),
    "current with 30 % of gaps": _column("current", lambda x: _holes(x, 0.3)),
    "numbers as text": _column("current", _text),
    "a column of words": _column("current", _words),
    "a column missing": _each(lambda t: t.drop(columns="current")),
    "angle wraps": _column("angle", lambda x: np.mod(x, 2.0 * np.pi)),
    "angle begins elsewhere": _column("angle", lambda x: x + np.random.default_rng(
        int(abs(x[0]) * 1e6)).uniform(0.5, 2.0)),
    "current of another run": lambda runs: {
        **runs, "MS": runs["MS"].assign(current=runs["ST"]["current"].to_numpy())},
}  # fmt: skip
"""Name -> what it does to the runs; `none` leaves them as they are."""


def good(folder: Path, seconds: float = 6.0) -> Path:
    """A data set of a bench that lacks nothing."""
    bench = draw(np.random.default_rng(SEED))
    return write_sets(folder, [bench], SHEET, SEED, seconds, NAMES)[0]


def damaged(source: Path, kind: str, folder: Path) -> Path:
    """The data set with a kind of damage."""
    runs = {path.stem: pd.read_parquet(path) for path in sorted((source / "runs").glob("*"))}
    target = folder / kind.replace(" ", "_").replace("%", "percent")
    (target / "runs").mkdir(parents=True, exist_ok=True)
    for name, table in KINDS[kind](runs).items():
        table.to_parquet(target / "runs" / f"{name}.parquet", index=False)
    text = (source / "set.toml").read_text(encoding="utf-8").replace(source.name, target.name)
    (target / "set.toml").write_text(text, encoding="utf-8")
    return target


def outcome(kind: str, folder: Path, full: bool) -> Outcome:
    """What reading, checks and, if asked for, the diagnosis say."""
    try:
        problem = read_problem(folder)
        findings = examine(Simulator(problem))
    except CosimError as error:
        return Outcome(kind, "refused", (type(error).__name__,), str(error), ())
    said = {f.column for f in findings if f.kind in ("absent", "empty")}
    present = {
        c.name for i, c in enumerate(problem.channels)
        if any(np.isfinite(run.data[:, i]).any() for run in problem.runs)
    }  # fmt: skip
    lost = tuple(sorted(set(COLUMNS) - present - said))
    wrong = [f for f in findings if f.severity == "error"]
    if wrong:
        by = tuple(sorted({f.kind for f in wrong}))
        return Outcome(kind, "named", by, str(wrong[0]), lost)
    by = tuple(sorted({f.kind for f in findings}))
    if not full:
        text = str(findings[0]) if findings else ""
        return Outcome(kind, "passes" if not by else "warned", by, text, lost)
    try:
        result = diagnose(problem)
    except CosimError as error:
        return Outcome(kind, "refused", (type(error).__name__,), str(error), lost)
    effects = tuple(law.label for law in result.answer.laws)
    return Outcome(kind, result.verdict, effects or by, result.reason, lost)


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", nargs="*", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--diagnose", action="store_true", help="diagnose what passes the checks")
    parser.add_argument("--out", type=Path, help="folder for the table")
    arguments = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as name:
        source = good(Path(name))
        for kind in arguments.kinds:
            one = outcome(kind, damaged(source, kind, Path(name)), arguments.diagnose)
            found.append(one)
            mark = " " if one.right else "!"
            print(f"{mark} {kind:40s} {one.outcome:16s} {', '.join(one.by):24s} {one.text[:150]}")
            sys.stdout.flush()
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        rows = [vars(one) for one in found]
        text = json.dumps(rows, indent=2, default=list) + "\n"
        (arguments.out / "damaged.json").write_text(text, encoding="utf-8")
    if not all(one.right for one in found):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
