"""The printed tables of the crawler paper."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from sources.tools.crawler_identification import Constants, Rounding, Turns

DATA = Path(__file__).parents[2] / "scenarios" / "crawler_paper" / "data"
PAPER = Constants()  # r = 0.0310, B = 0.1900, l_Sx = 0.0775, l_Sy = 0


def rows(table: int) -> list[dict[str, str]]:
    with (DATA / f"table{table}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def column(table: int, name: str) -> np.ndarray:
    return np.array([float(row[name]) for row in rows(table)])


def decimals(text: str) -> int:
    return len(text.partition(".")[2])


def turns() -> Turns:
    """Table 2, speeds from the printed rpm."""
    return Turns(
        column(2, "w2_rpm") * np.pi / 30,
        column(2, "w3_rpm") * np.pi / 30,
        column(2, "yaw_rate_rad_s"),
        column(2, "R_S_m"),
        column(2, "set").astype(int),
    )


def half_digits() -> Rounding:
    """Half a unit of the last digit of each printed value; a printed 0 rpm is a locked track."""

    def rpm(name: str) -> np.ndarray:
        # the shortest spelling of the pair tells the resolution: 19.4 stands for 19.40
        exact = np.array([row[name] == "0" for row in rows(2)])
        digits = np.array([max(2, decimals(row[name])) for row in rows(2)])
        return np.where(exact, 0.0, 0.5 * 10.0**-digits * np.pi / 30)

    e3 = np.array([5e-6 if "e-" in row["e3_m"] else 5e-5 for row in rows(2)])
    return Rounding(rpm("w2_rpm"), rpm("w3_rpm"), 5e-5, 5e-5, 5e-5, e3)
