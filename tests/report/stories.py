"""A diagnosis of each verdict as its JSON says it, with signals to go with it.

Figures are made up; `tests/diagnose/test_motor_bench.py` holds their shape against a real one.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from cosim.report.material import CandidateRound, Material, ShownChannel, ShownRun

VERDICTS = ("effect_found", "nothing_missing", "confounded", "unexplained", "bad_data")
CHANNELS = (
    ShownChannel("speed", "rad/s", 0.155, "encoder.w_meas"),
    ShownChannel("current", "A", 0.05, "motor.i_measured"),
)
EFFECT: dict[str, Any] = {
    "effect": "coulomb", "component": "load", "port": "flange", "place": "load.flange",
    "text": "Coulomb friction of a shaft.",
    "parameters": {
        "tau_c": {"value": 0.43781, "ci95": [0.41921, 0.45652], "unit": "N.m",
                  "identifiable": True},
        "w_0": {"value": 0.002, "ci95": [1e-6, 0.2], "unit": "rad/s", "identifiable": False},
    },
    "held": {"n": 2.0}, "p_value": 1e-14, "explained": 0.98765, "gain_nats": 1234.5,
    "validation_gain_nats": 567.89,
    "other_places": ["gearbox.flange_a"],
}  # fmt: skip
PLACE: dict[str, Any] = {
    "component": "load", "port": "flange", "element": "", "unit": "N.m", "evidence_nats": 321.0,
    "curves": [
        {"driver": "velocity", "run": "", "at": [-2.0, -1.0, 0.0, 1.0, 2.0],
         "value": [0.4, 0.41, 0.0, -0.4, -0.42], "deviation": [0.01] * 5,
         "evidence_nats": 321.0, "explained": 0.91234},
        {"driver": "time", "run": "MX1", "at": [0.0, 1.0, 2.0], "value": [0.1, 0.2, 0.1],
         "deviation": [0.05] * 3, "evidence_nats": 12.0, "explained": 0.2},
    ],
}  # fmt: skip


def row(unit: str, noise: float, before: float, after: float) -> dict[str, Any]:
    """A channel with errors of so many times its noise."""
    return {
        "unit": unit, "noise_rms": noise,
        "before": {"identification": 0.97 * before * noise, "validation": before * noise},
        "after": {"identification": 0.99 * after * noise, "validation": after * noise},
    }  # fmt: skip


def structured(*channels: str) -> list[dict[str, Any]]:
    """Tests that find more than noise in some channels."""
    return [
        {"channel": item.name, "rms_over_noise": 1.0, "lasting_over_noise": 1.0,
         "slow_over_noise": 1.0, "correlation": 0.0, "effective_samples": 100.0, "p_value": 0.5,
         "p_fast": 0.5, "p_white": 0.5,
         "structured": item.name in channels}
        for item in CHANNELS
    ]  # fmt: skip


def table(verdict: str) -> dict[str, Any]:
    """The JSON of a diagnosis."""
    found = verdict in ("effect_found", "confounded")
    after = 1.0 if found or verdict == "nothing_missing" else 3.21
    before = after if not found else 3.21
    value = {"value": 0.35802, "ci95": [0.35695, 0.35909], "identifiable": True, "at_bound": False}
    unknown = {"value": 0.81297, "ci95": [0.78, 0.86], "identifiable": False, "at_bound": False}
    content: dict[str, Any] = {
        "dataset": "MB-99", "system": "motor_bench", "verdict": verdict, "reason": "said elsewhere",
        "warnings": [], "findings": [], "effects": [copy.deepcopy(EFFECT)] if found else [],
        "model": {
            "scenario": "motor_bench",
            "variants": {"load": "inertia.lab_bench/disc+coulomb@flange"} if found else {},
            "values": {"motor.R_a": 0.35802, **({"load.flange.coulomb.tau_c": 0.43781} if found
                                                else {})},
            "logged": {},
        },
        "alternatives": [], "localisation": [] if verdict == "nothing_missing" else [PLACE],
        "power": {
            "coulomb at load.flange": {"unit": "N.m", "parameter": "load.flange.coulomb.tau_c",
                                       "absorbed": 0.1, "smallest_detectable": 0.012345,
                                       "same_as": []},
            "viscous at load.flange": {"unit": "N.m.s/rad", "parameter": "load.flange.viscous.b",
                                       "absorbed": 1.0, "smallest_detectable": None,
                                       "reason": "calibration of the declared parameters absorbs "
                                       "it", "same_as": []},
        },
        "proposed_experiment": None,
        "channels": {
            "speed": row("rad/s", 0.155, before, after), "current": row("A", 0.05, 0.98, 0.97),
        },
        "further_runs": [],
        "law_from_data": None,
        "withheld": [], "catalogue_asked": True,
        "stopped": "",
        "hints": [], "left": ["speed"] if after > 1.1 else [],
        "parameters": {
            "R_a": {"unit": "ohm", "before": value, "after": value},
            "eta": {"unit": "-", "before": unknown, "after": unknown},
        },
        "clocks": {}, "start_values": {}, "bursts": {}, "unstable_from": {}, "small_laws": [],
        "by_run": [],
        "bounds_opened": {}, "left_white": False,
        "structure": {
            f"{which} {purpose}": structured(*([] if which == "after" and after < 1.1
                                               else ["speed"]))
            for which in ("before", "after") for purpose in ("identification", "validation")
        },
        "evaluations": 174, "wall_s": 63.3, "files": [], "inside": "", "adapters": {},
    }  # fmt: skip
    if verdict == "confounded":
        content["alternatives"] = [
            {"effects": ["bristle at gearbox.flange_b"], "score": -0.3,
             "text": "Dry friction of a shaft that sticks."}
        ]  # fmt: skip
        content["proposed_experiment"] = {
            "run": "RV1", "input_factor": 0.5, "repetitions": 2, "distance": 7.31,
            "channels": {"speed": 5.0},
        }  # fmt: skip
    if verdict == "bad_data":
        empty = {"identification": None, "validation": None}
        for item in content["channels"].values():
            item |= {"before": dict(empty), "after": dict(empty)}
        content |= {"localisation": [], "power": {}, "parameters": {}, "structure": {}}
        content["model"]["values"] = {}
        content["findings"] = [
            {"severity": "error", "kind": "spikes", "run": "ST1", "column": "current",
             "text": "has 55 single samples that stand out; make gaps of them"},
            {"severity": "note", "kind": "reading", "run": "", "column": "", "text": "was read"},
        ]  # fmt: skip
    return content


def runs(verdict: str, samples: int = 400, count: int = 2) -> tuple[ShownRun, ...]:
    """Runs with their residuals; noise is drawn anew from the same seed each time."""
    draw = np.random.default_rng(1)
    found = []
    for number in range(count):
        times = 1e-3 * np.arange(samples)
        smooth = np.column_stack([np.sin(7.0 * times), np.cos(7.0 * times)])
        after = draw.normal(size=smooth.shape)
        before = after + 3.0 * np.sign(smooth)
        sigma = np.array([c.sigma for c in CHANNELS])
        data = smooth + after * sigma
        data[samples // 2, 1] = np.nan
        residuals = {"before": before, "after": after}
        if verdict in ("nothing_missing", "unexplained"):
            residuals = {"before": after if verdict == "nothing_missing" else before}
        if verdict == "bad_data":
            residuals = {}
        purpose = "validation" if number % 2 else "identification"
        found.append(ShownRun(f"R{number}", purpose, times, data, residuals))
    return tuple(found)


def material(verdict: str, **size: int) -> Material:
    """What a report of this verdict shows, without a drawing."""
    stage = CandidateRound(
        2, 1,
        (("coulomb at load.flange", 321.5, 25.1, 1e-14, 0.1, 1234.5, 567.9, 12.0, ""),
         ("viscous at load.flange", 11.5, 3.1, 0.2, 1.0, None, None, None, "viscous at a < b")),
        "coulomb at load.flange" if verdict in ("effect_found", "confounded") else "",
    )  # fmt: skip
    symbols = {"R_a": "armature resistance", "load.flange.coulomb.tau_c": "friction torque"}
    stages = () if verdict == "bad_data" else (stage,)
    return Material(table(verdict), CHANNELS, runs(verdict, **size), None, symbols, stages)
