"""Which law of e2, e3 over the track speeds do the measured turns of the crawler paper support?

    python -m benchmarks.slip_law [--picture FILE]

Printed for SET2 to SET5 (inner track turning) and for all sets: the laws of
`sources/tools/slip_laws.py` by their error on the set that was left out, the scatter between runs
of a set, and what choosing a law is worth. Then the same question to the chain that calibrates all
other data: the FMU `crawler/slip_law` is fitted to the paths of S, set by set left out.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cosim.calibrate.estimate import Estimate
from cosim.calibrate.fit import Effort, fit
from cosim.calibrate.model import Model
from cosim.calibrate.parts import Channel, Coarse, MeasuredRun, Parameter
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.data.signals import Constant
from cosim.installation.builder import default_provider
from cosim.system.toml import read_system
from sources.tools.crawler_identification import Constants, Turns
from sources.tools.slip_laws import (
    CANDIDATES,
    LawScore,
    SlipLaw,
    left_out,
    nested,
    other_runs,
    ranked,
    simplest,
)

Vector = NDArray[np.float64]
FOLDER = Path(__file__).parents[1] / "scenarios" / "crawler_paper"
PAPER = Constants()
SIGMA = 2e-3
"""Scatter of the path between runs of a set after a quarter turn, the order of it [m]."""
STEP = 0.02
SHOWN = 8


def table() -> tuple[Turns, Vector, Vector]:
    """Table 2: turns, e2, e3."""
    with (FOLDER / "data" / "table2.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))

    def column(name: str) -> Vector:
        return np.array([float(row[name]) for row in rows])

    turns = Turns(
        column("w2_rpm") * np.pi / 30,
        column("w3_rpm") * np.pi / 30,
        column("yaw_rate_rad_s"),
        column("R_S_m"),
        column("set").astype(int),
    )
    return turns, column("e2_m"), column("e3_m")


def line(name: str, score: LawScore, size: int | str) -> str:
    """A row of the table."""

    def rms(values: Vector) -> float:
        return float(np.sqrt(np.mean(values**2)))

    return (f"  {name:44} {size:>2}  {1e3 * rms(score.e2):5.1f} {1e3 * rms(score.e3):5.1f}  "
            f"{100 * rms(score.radius):6.2f} {100 * rms(score.w_z):6.2f}  "
            f"{100 * score.error:6.2f} ± {100 * score.deviation:.2f}")  # fmt: skip


HEAD = f"  {'law':44} {'p':>2}  {'e2':>5} {'e3':>5}  {'R_S':>6} {'w_z':>6}  quarter turn"


def compared(title: str, turns: Turns, e2: Vector, e3: Vector) -> SlipLaw:
    """Print the laws of one choice of sets; the simplest good one."""
    print(f"\n{title}: rms on the set left out [mm, mm, %, %], criterion after a quarter turn [%]")
    print(HEAD)
    print(line("mean of the set's other runs", other_runs(turns, e2, e3, PAPER), ""))
    found = ranked(turns, e2, e3, PAPER)
    shown = {str(law) for law, _ in found[:SHOWN]}
    constant = [law for law in CANDIDATES if str(law) in ("e2 = a, e3 = 0", "e2 = a, e3 = c")]
    skid = CANDIDATES[-1]
    for law, score in found[:SHOWN]:
        print(line(str(law), score, law.size))
    for law in (*constant, skid):
        if str(law) not in shown:
            print(line(str(law), left_out(law, turns, e2, e3, PAPER), law.size))
    best = simplest(found)
    print(f"  fewest parameters within one standard error of the best: {best}")
    score, chosen = nested(turns, e2, e3, PAPER)
    print(line("law chosen anew without the set left out", score, ""))
    print("  " + "; ".join(f"SET{group}: {law}" for group, law in chosen.items()))
    return best


def parameter(name: str, unit: str, start: float, span: float, *targets: str) -> Parameter:
    """A parameter of the FMU."""
    return Parameter(name, unit, start, start - span, start + span,
                     tuple((f"crawler.{target}", 1.0) for target in targets))  # fmt: skip


A = parameter("a", "m", 0.04, 0.06, "slip_a")
INNER = parameter("e3", "m", 0.0, 0.03, "e_inner")
BY_DIFFERENCE = parameter("b (w2 - w3)", "m.s/rad", 0.0, 0.03, "slip_b")
BY_INNER = parameter("b w3", "m.s/rad", 0.0, 0.03, "slip_c")
BY_OUTER = parameter("b w2", "m.s/rad", 0.0, 0.03, "slip_b", "slip_c")


@dataclass(frozen=True)
class Chained:
    """A law that the FMU can take: its parameters, and the values that are held."""

    name: str
    parameters: tuple[Parameter, ...]
    exchange: float = 0.0


CHAINED = (
    Chained("e2 = a, e3 = 0", (A,)),
    Chained("e2 = a, e3 = c", (A, INNER)),
    Chained("e2 = a + b (w2 - w3), e3 = 0", (A, BY_DIFFERENCE)),
    Chained("e2 = a + b w3, e3 = 0", (A, BY_INNER)),
    Chained("e2 = a + b w2, e3 = 0", (A, BY_OUTER)),
    Chained("e2 = a + b (w2 - w3), e2 + e3 = s", (A, BY_DIFFERENCE, INNER), 1.0),
    Chained("e2 = a + b w2, e2 + e3 = s", (A, BY_OUTER, INNER), 1.0),
)


def problem_of(turns: Turns, law: Chained) -> Problem:
    """The measured turns as runs of a quarter turn, the law's parameters to be fitted."""
    runs = []
    for k in range(turns.w2.size):
        duration = np.pi / 2 / turns.w_z[k]
        times = np.arange(0.0, duration, 5 * STEP)
        middle = np.sqrt(turns.R_S[k] ** 2 - PAPER.l_Sx**2) - PAPER.l_Sy
        sine, cosine = np.sin(turns.w_z[k] * times), np.cos(turns.w_z[k] * times)
        path = np.column_stack(
            [middle * sine - PAPER.l_Sx * cosine, middle * (1 - cosine) - PAPER.l_Sx * sine]
        )
        speeds = {"crawler.w2": Constant(float(turns.w2[k]), "rad/s"),
                  "crawler.w3": Constant(float(turns.w3[k]), "rad/s")}  # fmt: skip
        name = f"SET{turns.group[k]}_{int(np.sum(turns.group[:k] == turns.group[k])) + 1}"
        runs.append(MeasuredRun(name, "identification", times, path, speeds))
    return Problem(
        "crawler_paper",
        Model.of(read_system(FOLDER / "slip_law_system.toml"), default_provider()),
        law.parameters,
        [Channel("x_S", "m", SIGMA, "crawler.x_S"), Channel("y_S", "m", SIGMA, "crawler.y_S")],
        runs,
        STEP,
        Coarse(STEP),
        constants={"crawler.slip_b": 0.0, "crawler.slip_c": 0.0, "crawler.e_inner": 0.0,
                   "crawler.exchange": law.exchange},
        period=5 * STEP,
    )  # fmt: skip


def chained(turns: Turns, law: Chained) -> tuple[Vector, Vector, Estimate]:
    """Criterion on sets left out and on the sets themselves, by turn [1], and the fit to all."""
    whole = problem_of(turns, law)
    simulator, near = Simulator(whole), Effort("near")

    def criterion(theta: Vector, names: list[str]) -> list[float]:
        return [
            float(np.max(np.hypot(*(SIGMA * residual.T)))) / turns.R_S[index[name]]
            for name, residual in simulator.residuals(theta, names)
        ]

    names = [run.name for run in whole.runs]
    index = {name: k for k, name in enumerate(names)}
    found = np.empty(len(names))
    for group in np.unique(turns.group):
        held = [name for name in names if turns.group[index[name]] == group]
        rest = [name for name in names if name not in held]
        theta = fit(simulator, whole.nominal, rest, effort=near).theta
        found[[index[name] for name in held]] = criterion(theta, held)
    estimate = fit(simulator, whole.nominal, names, effort=near)
    own = np.array(criterion(estimate.theta, names))
    simulator.close()
    return found, own, estimate


def chain(turns: Turns) -> None:
    """Print what the chain finds."""
    print(
        "\nFMU crawler/slip_law fitted to the paths, SET2 to SET5: criterion after a quarter turn"
    )
    for law in CHAINED:
        outside, inside, estimate = chained(turns, law)
        values = ", ".join(
            f"{p.name}: {1e3 * value:.4g} m{p.unit}"
            for p, value in zip(law.parameters, estimate.theta, strict=True)
        )
        print(f"  {law.name:34} {100 * outside.mean():.2f} % on the set left out, "
              f"{100 * inside.mean():.2f} % fitted; {values}")  # fmt: skip


def draw(path: Path, turns: Turns, e2: Vector, e3: Vector) -> None:
    """Shifts over the outer speed, with the two best laws fitted to SET2 to SET5."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axes = figure.subplots(1, 2)
    moving = turns.group > 1
    part = turns.where(moving)
    found = ranked(part, e2[moving], e3[moving], PAPER)
    laws = (found[0][0], simplest(found))
    shades = ("tab:blue", "tab:orange")
    for side, (values, name) in enumerate(((e2, "e2"), (e3, "e3"))):
        axis = axes[side]
        groups = np.unique(turns.group)
        for group in groups:
            rows = turns.group == group
            axis.plot(group + np.array([-0.1, 0.0, 0.1]), 1e3 * values[rows],
                      "o" if group > 1 else "x", color="0.25", markersize=5)  # fmt: skip
        for law, shade, shift in zip(laws, shades, (-0.1, 0.1), strict=True):
            model = law.fitted(part, e2[moving], e3[moving])
            for group in np.unique(part.group):
                rows = part.group == group
                rest = law.fitted(part.where(~rows), e2[moving][~rows], e3[moving][~rows])
                first = group == part.group[0]
                other = "   fitted without the set"
                for found_by, style, label in ((model, "-", str(law)), (rest, ":", other)):
                    level = 1e3 * float(found_by(part.where(rows))[side].mean())
                    axis.plot([group + shift - 0.2, group + shift + 0.2], [level, level], style,
                              color=shade, lw=1.8, label=label if first else None)  # fmt: skip
        names = [f"SET{g}\n{turns.w2[turns.group == g].mean():.2f}, "
                 f"{turns.w3[turns.group == g].mean():.2f}" for g in groups]  # fmt: skip
        axis.set_xticks(groups, names)
        axis.set(xlabel="w2, w3 [rad/s]", ylabel=f"{name} [mm]")
        axis.margins(y=0.15)
    axes[0].legend(fontsize=7, frameon=False)
    axes[1].axhline(0.0, color="0.8", lw=0.8, zorder=0)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", type=Path, help="file to draw the shifts and laws to")
    args = parser.parse_args()
    turns, e2, e3 = table()
    moving = turns.group > 1
    compared("SET2 to SET5", turns.where(moving), e2[moving], e3[moving])
    compared("all sets", turns, e2, e3)
    chain(turns.where(moving))
    if args.picture:
        draw(args.picture, turns, e2, e3)


if __name__ == "__main__":
    main()
