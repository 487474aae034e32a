"""A law outside the catalogue, rebuilt from a shaft's log by `cosim diagnose --law-from-data`.

    python -m benchmarks.law_from_data [--picture FILE]

The shaft is `benchmarks.shaft_plant`, its undeclared law a drag that sets in at 2 rad/s. Prints the
error of each channel before and after and the nearest named laws.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np

from cosim.diagnose import diagnose

from .shaft_plant import FRICTION, shaft

PLACE, SEED = "load.flange", 7


def late_drag(w: float, _: float) -> float:
    """Drag that sets in at 2 rad/s and grows with the square from there [N.m]."""
    return -0.05 * math.copysign(max(abs(w) - 2.0, 0.0) ** 2, w)


def draw(path: Path, law: dict[str, Any]) -> None:
    """The law with its band, what is true, the nearest named law, and where the runs were."""
    from matplotlib.figure import Figure

    curve = {name: np.array(values) for name, values in law["curve"].items()}
    x, seen = curve["x"], curve["visited"]
    slope = law["declared"]["b"]["value"] - FRICTION  # what the law has of the declared friction
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    axis = figure.subplots()
    for kind, shade, label in (
        ("", 0.15, "95 % band"), ("_others_held", 0.35, "with all else as fitted")
    ):  # fmt: skip
        low, high = curve["low" + kind] - slope * x, curve["high" + kind] - slope * x
        axis.fill_between(x, low, high, color="tab:blue", alpha=shade, lw=0, label=label)
    axis.plot(x, curve["value"] - slope * x, color="tab:blue", label="law from the data")
    axis.plot(x, [late_drag(v, 0.0) for v in x], "k--", lw=1.2, label="true law")
    first = law["nearest"][0]
    named = np.array(first["value"]) - slope * x
    axis.plot(x, named, color="tab:orange", lw=1.2, label=f"nearest name: {first['effect']}")
    level = np.full(x.size, curve["low"].min())
    axis.scatter(x, level, s=400.0 * seen, color="0.5", label="how often visited", lw=0)
    axis.set(xlabel="speed [rad/s]", ylabel="torque beside the declared friction [N.m]")
    axis.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    axis.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picture", type=Path, help="file to draw the law to")
    args = parser.parse_args()
    result = diagnose(shaft(late_drag, SEED), law_at=PLACE, workers=2)
    law = result.to_dict()["law_from_data"]
    print(result.reason)
    for name, row in law["error"].items():
        sizes = ", ".join(
            f"{purpose} {row['before'][purpose]:.3g} -> {row['after'][purpose]:.3g}"
            for purpose in row["before"]
        )
        print(f"{name} [{row['unit']}], noise {row['noise_rms']:g}: {sizes}")
    for named in law["nearest"]:
        print(f"{named['effect']}: {named['unused_runs_prefer_the_law_by_nats']:.0f} nats worse")
    if args.picture:
        draw(args.picture, law)


if __name__ == "__main__":
    main()
