"""Does the diagnosis name undeclared effects, and stay quiet without? Data of an independent plant.

    python -m benchmarks.selftest --repeats 3 --out out/selftest
    python -m benchmarks.selftest --wide --repeats 4 --out out/wide
    python -m benchmarks.selftest --pairs 20 --repeats 0 --clean 0 --out out/pairs
    python -m benchmarks.selftest --wide --withheld --clean 0 --out out/withheld
    python -m benchmarks.selftest --rig crawler --repeats 1 --clean 4 --out out/crawler
    python -m benchmarks.selftest --example DATASET --out out/mirror

Every effect is put into rigs with other parameters and sizes; some of the data sets have none.
Prints the confusion matrix, false alarms and the coverage of the 95 % intervals, and writes them as
a table. An effect is hidden if what calibration cannot absorb of it stays below the least size that
the diagnosis names; being quiet about it is right. With `--example` the data come from our own
FMUs, for any rig that has a mapping. Of several effects in one bench, all that the data show must
be named, and nothing else. With `--withheld`, and for a law that no catalogue has, another name is
wrong unless it leaves the noise in runs that were not used (it counts as confounded then);
`unexplained` is right.

Each set's row is kept in `--out` as soon as it is there; the same command goes on after them.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import arm_plant, crawler_plant, motor_plant, omni_plant
from benchmarks.bench import Bench, Law
from benchmarks.own_plant import Made, catalogue, example, made
from cosim.calibrate.differences import jacobian
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose import diagnose
from cosim.diagnose.candidates import Candidate, candidates
from cosim.diagnose.diagnosis import Diagnosis
from cosim.diagnose.linear import MATERIAL, Absorber, SampleStack
from cosim.files import atomic

Vector = NDArray[np.float64]
Change = dict[str, dict[str, Vector]]
PLANTS: dict[str, Any] = {
    "motor": motor_plant, "crawler": crawler_plant, "omni": omni_plant, "arm": arm_plant
}  # fmt: skip
"""Rigs that are played by code of their own, written from their sheets."""
SHEET, SECONDS = motor_plant.SHEET, motor_plant.SECONDS
SEVERAL = {2: "two effects", 3: "three effects"}
QUIET = 1.1
"""RMS over the noise up to which another law does what one does that the catalogue lacks."""
EXTREME = 300.0
"""RMS over the noise from which an effect is made smaller: a machine that oscillates is no test."""


def benches(
    repeats: int,
    clean: int,
    seed: int,
    pairs: int = 0,
    *,
    triples: int = 0,
    wide: bool = False,
    plant: Any = motor_plant,
) -> list[Bench]:
    """Effects at 0.5, 1 and 2 times their size, clean ones, and some with several effects.

    Args:
        repeats: benches of each effect.
        clean: benches without any.
        seed: of all that is drawn.
        pairs: benches with two effects.
        triples: benches with three.
        wide: shapes are drawn over their whole range (`SHAPES`), and ripples are among the effects.
        plant: the module that plays the rig.
    """
    random = np.random.default_rng(seed)
    found = [plant.draw(random) for _ in range(clean)]
    kinds = [name for name in plant.EFFECTS if name != "none" and (wide or name not in plant.WHOLE)]
    for name in kinds:
        for index in range(repeats):
            found.append(plant.draw(random, name, (1.0, 2.0, 0.5)[index % 3], wide=wide))
    known = [name for name in kinds if plant.EFFECTS[name][1]]
    for count in [2] * pairs + [3] * triples:
        names = random.choice(known, count, replace=False).tolist()
        sizes = random.choice([0.5, 1.0, 2.0], count)
        bench = plant.draw(random, names[0], float(sizes[0]))
        others = []
        for name, size in zip(names[1:], sizes[1:], strict=True):
            turned = plant.SHAPES.get(name, (0.0,))[0] < 0.0  # a direction has no usual value
            shape = plant.draw(random, name).shape if turned else 0.0
            others.append(Law(name, float(size) * plant.EFFECTS[name][0], shape))
        found.append(replace(bench, others=tuple(others)))
    return found


def over_noise(problem: Problem, change: Change, stack: SampleStack) -> Vector:
    """Changes of the channels of the stack's runs, over the noise, as one vector."""
    rows = [
        np.column_stack([change[name][c.name] / c.sigma for c in problem.channels])
        for name in stack.names
    ]
    return stack.vector(rows)


def shown(problem: Problem, truth: dict[str, float], change: Change) -> float:
    """Largest RMS over the noise, in a channel of a run, that calibration cannot absorb.

    Args:
        problem: the declared system.
        truth: values of its parameters.
        change: run -> channel -> what the effect changes, without noise.
    """
    theta = problem.nominal
    for name, value in truth.items():
        theta[problem.index(name)] = value
    stack = SampleStack(problem, problem.chosen("identification"))
    slopes = jacobian(Simulator(problem), theta, stack.names)
    absorber = Absorber(stack.matrix(slopes, problem.scale), problem)
    return round(stack.largest(absorber.rest(over_noise(problem, change, stack))), 4)


def extreme(one: Made) -> bool:
    """Whether an effect changes a channel of a run by more than a machine that still works does."""
    stack = SampleStack(one.problem, one.problem.runs)
    return not stack.largest(over_noise(one.problem, one.change, stack)) < EXTREME


def judged(
    result: Diagnosis, effect: str, size: float, names: tuple[str, ...], truth: dict[str, float]
) -> dict[str, Any]:
    """Compare a diagnosis with the truth.

    Args:
        result: the diagnosis.
        effect: as shown in the table.
        size: of it.
        names: of the catalogue that count as this effect.
        truth: true values of the declared parameters.
    """
    table = result.to_dict()
    named = [e["effect"] for e in table["effects"]]
    same = {label.partition(" at ")[0] for e in table["effects"][:1] for label in e["other_places"]}
    rivals = [e.partition(" at ")[0] for a in table["alternatives"] for e in a["effects"][-1:]]
    others = [_exchanged(named, a) for a in table["alternatives"]]
    covered, away = {}, {}
    for name, entry in table["parameters"].items():
        last = entry.get("after") or entry["before"]
        if name in truth and last["identifiable"]:
            low, high = last["ci95"]
            covered[name] = bool(low <= truth[name] <= high)
            away[name] = round((last["value"] - truth[name]) / max(0.5 * (high - low), 1e-300), 3)
    left = [channel["after"].get("validation") for channel in table["channels"].values()]
    over = [c["noise_rms"] for c in table["channels"].values()]
    sizes = [a / b for a, b in zip(left, over, strict=True) if a is not None]
    fits = {(c.instance, c.port) for c in candidates(result.problem) if c.effect in names}
    first = result.located[0] if result.located else None
    return {
        "truth": effect, "size": size, "verdict": table["verdict"], "named": named,
        "left": round(max(sizes), 3) if sizes else None,
        "right": bool(named) and bool(set(names) & {named[0], *same}),
        "rival": bool(set(names) & {*named[:1], *rivals}), "others": others, "covered": covered,
        "half_intervals_off": away,
        "place": first.label if first else "",
        "placed": (first.instance, first.port) in fits if first and fits else None,
        "wall_s": table["wall_s"],
    }  # fmt: skip


def _exchanged(named: list[str], alternative: dict[str, Any]) -> list[str]:
    """Effects of a set that does as well as the one that is named."""
    found = list(named)
    for label in alternative["instead_of"]:
        found.remove(label.partition(" at ")[0])
    return found + [label.partition(" at ")[0] for label in alternative["effects"]]


def judged_several(
    row: dict[str, Any], bench: Bench, sizes: list[float], plant: Any
) -> dict[str, Any]:
    """The row of a bench with several effects: right if those that show are named, no others."""
    visible = {law.name for law, size in zip(bench.laws, sizes, strict=True) if size >= MATERIAL}
    within = getattr(plant, "CONTAINED", {})
    wanted = [set(plant.EFFECTS[name][1]) for name in visible if within.get(name) not in visible]

    def all_of(named: list[str]) -> bool:
        return len(named) == len(wanted) and all(names & set(named) for names in wanted)

    right = all_of(row["named"])
    return {
        **row, "truth": SEVERAL[len(bench.laws)], "right": right,
        "rival": right or any(all_of(named) for named in row["others"]),
        "laws": [[law.name, law.size, law.shape] for law in bench.laws], "sizes": sizes,
        "shown": max(sizes),
    }  # fmt: skip


def independent(arguments: argparse.Namespace, folder: Path) -> Iterator[dict[str, Any]]:
    """Rows of sets from a plant that shares no code with the components."""
    plant = PLANTS[arguments.rig]
    seconds = arguments.seconds or plant.SECONDS
    chosen = benches(
        arguments.repeats, arguments.clean, arguments.seed, arguments.pairs,
        triples=arguments.triples, wide=arguments.wide, plant=plant,
    )  # fmt: skip
    places = plant.write_sets(folder, chosen, plant.SHEET, arguments.seed, seconds)
    alone = [part for bench in chosen for part in bench.alone()]
    effects = iter(plant.changes(alone, arguments.seed, seconds))
    for number, (bench, place) in enumerate(zip(chosen, places, strict=True)):
        each = [next(effects) for _ in bench.alone()]
        if number < arguments.done:
            continue
        problem = read_problem(place)
        sizes = [shown(problem, bench.parameters, change) for change in each]
        accepted = plant.EFFECTS[bench.effect][1]
        without: set[str] = set()
        if arguments.withheld:
            known = {candidate.effect for candidate in catalogue(problem)}
            without = known & {n for law in bench.laws for n in plant.EFFECTS[law.name][1]}
        result = diagnose(problem, workers=arguments.workers, without=without, law=False)
        row = judged(result, bench.effect, bench.size, accepted, bench.parameters)
        row |= {"shape": bench.shape, "shown": sizes[0]}
        if bench.effect != "none":
            row["foreign"] = arguments.withheld or not accepted
        yield row if not bench.others else judged_several(row, bench, sizes, plant)


def mirrored(arguments: argparse.Namespace, example_set: Path) -> Iterator[dict[str, Any]]:
    """Rows of sets from our own FMUs."""
    rig = example(example_set, arguments.seconds or SECONDS)
    jobs: list[tuple[Candidate | None, float]] = [(None, 0.0)] * arguments.clean
    for repeat in range(arguments.repeats):
        jobs += [(item, (1.0, 2.0, 0.5)[repeat % 3]) for item in catalogue(rig)]
    for number, (item, factor) in enumerate(jobs):
        if number < arguments.done:
            continue
        seed = 1000 * arguments.seed + number
        one = made(rig, item, factor, seed, wide=arguments.wide)
        while extreme(one):
            factor *= 0.1
            one = made(rig, item, factor, seed, wide=arguments.wide)
        effect = "none" if item is None else item.effect
        size = shown(one.problem, one.parameters, one.change)
        result = diagnose(one.problem, workers=arguments.workers, law=False)
        row = judged(result, effect, one.size, (effect,), one.parameters)
        yield {**row, "label": one.effect, "shown": size}


def summary(rows: list[dict[str, Any]]) -> str:
    """Table of outcomes."""
    lines = ["| effect in the data | sets | right | confounded with it | other | missed | hidden |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    right = both = total = 0
    for truth in dict.fromkeys(r["truth"] for r in rows):
        mine = [r for r in rows if r["truth"] == truth]
        counts: Counter[str] = Counter()
        for row in mine:
            if truth == "none":
                counts["other" if row["named"] else "right"] += 1
            elif row.get("foreign") and row["shown"] >= MATERIAL:
                near = "confounded" if row["left"] <= QUIET else "other"
                quiet = "missed" if row["verdict"] == "nothing_missing" else "right"
                counts[near if row["named"] else quiet] += 1
            elif not row["named"]:
                counts["hidden" if row["shown"] < MATERIAL else "missed"] += 1
            elif row["verdict"] == "effect_found" and row["right"]:
                counts["right"] += 1
            elif row["right"] or row["rival"]:
                counts["confounded"] += 1
            else:
                counts["other"] += 1
        if truth != "none":
            right, both = right + counts["right"], both + counts["confounded"]
            total += len(mine) - counts["hidden"]
        cells = [counts[k] for k in ("right", "confounded", "other", "missed", "hidden")]
        lines.append(f"| {truth} | {len(mine)} | " + " | ".join(map(str, cells)) + " |")
    clean = [r for r in rows if r["truth"] == "none"]
    alarms = sum(bool(r["named"]) for r in clean)
    # a model that lacks the effect has no true values to hold
    sound = [r for r in rows if r["right"] or (r["truth"] == "none" and not r["named"])]
    inside = [v for r in sound for v in r["covered"].values()]
    asked = [
        r["placed"] for r in rows if r["verdict"] == "unexplained" and r.get("placed") is not None
    ]
    lines += [
        "",
        f"Right at the first name: {right} of {total} that the data show, "
        f"{both} more as one of several that they do not tell apart. "
        f"False alarms: {alarms} of {len(clean)} "
        f"clean sets. 95 % intervals of identifiable parameters that hold the truth, where the "
        f"model is right: "
        f"{sum(inside)} of {len(inside)}. "
        f"`unexplained` with a place where what is missing enters: {sum(asked)} of {len(asked)}.",
    ]
    return "\n".join(lines) + "\n"


def main(words: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """Run; the rows of all sets.

    Args:
        words: of the command line, that of the program if not given.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--example", type=Path, help="data set whose rig our own FMUs play; else a plant of "
        "--rig, which shares nothing with them",
    )  # fmt: skip
    parser.add_argument("--rig", choices=list(PLANTS), default="motor", help="independent plant")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--clean", type=int, default=20)
    parser.add_argument("--pairs", type=int, default=0, help="benches with two effects")
    parser.add_argument("--triples", type=int, default=0, help="benches with three effects")
    parser.add_argument(
        "--wide", action="store_true", help="shapes of laws over their whole range, ripples too"
    )
    parser.add_argument(
        "--withheld", action="store_true", help="without the laws that the data have"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, help="duration of the runs")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/selftest"))
    arguments = parser.parse_args(words)
    arguments.out.mkdir(parents=True, exist_ok=True)
    kept = arguments.out / "selftest.json"
    rows = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else []
    arguments.done = len(rows)
    with tempfile.TemporaryDirectory() as folder:
        if arguments.example is None:
            found = independent(arguments, Path(folder))
        else:
            found = mirrored(arguments, arguments.example)
        for row in found:
            rows.append(row)
            print(json.dumps(row), file=sys.stderr, flush=True)
            with atomic(kept) as place:
                place.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    table = summary(rows)
    (arguments.out / "selftest.md").write_text(table, encoding="utf-8")
    print(table)
    return rows


if __name__ == "__main__":
    main()
