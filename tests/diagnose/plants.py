"""Plants of a few lines beside the disc, and models of a plant of which a rule sees numbers only.

The gear is driven at a known speed, and a sensor tells the torque behind it:

    m = tau - b w - size tanh(w / w_s)

Its friction does the same on either side. With a load and a direction of motion that never change,
friction in proportion to the load is Coulomb's, and friction that differs between the directions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.calibrate.estimate import Estimate
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.parts import Parameter
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import Candidate
from cosim.diagnose.judge import Judge
from cosim.diagnose.linear import MATERIAL, ScoreTest
from cosim.diagnose.models import Fitted, Gate
from cosim.diagnose.probes import Probe, single
from cosim.diagnose.signature import Signature, unscored
from cosim.diagnose.values import Values
from tests.diagnose import disc
from tests.problems import simulator

B, SMOOTHING, NOISE = 0.03, 0.02, 1e-3
GEAR = """
rig = "gear"
system = "system.toml"
step = 0.01
algorithm = "gauss_seidel"

[columns]
time = { unit = "s" }
tau = { unit = "N.m" }
w = { unit = "rad/s" }
m = { unit = "N.m" }

[inputs]
"gearbox.tau_a" = { column = "tau", interpolation = "linear" }
"gearbox.w_b" = { column = "w", interpolation = "linear" }

[parameters]
"gearbox.ratio" = 1.0
"gearbox.eta" = 1.0

[channels.m]
signal = "gearbox.tau_b"
sigma = 0.001

[[parameter]]
name = "b"
unit = "N.m.s/rad"
nominal = 0.02
min = 0.0
max = 0.3
targets = "gearbox.b"
"""
STARTS = (0.8, 0.2, 0.7, 0.4, 0.75)
"""Angles at which the runs of `swinging` begin, the weight's own included [rad]."""
WANTED = Gate(10.0, 9.0)
"""What unused runs say of a law."""


def alone(instance: str, variant: str) -> str:
    """A system of one FMU."""
    return f'description = "One FMU."\nconnections = []\n[instances]\n{instance} = "{variant}"\n'


def gear(folder: Path, size: float) -> Problem:
    """A gear with so much dry friction [N.m], its load and direction always the same."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(3)
    text = GEAR
    for place, purpose in enumerate(("identification", "identification", "validation")):
        time = np.arange(401) * 0.01
        tau, w = np.full(time.size, 0.5), 2.0 + 1.5 * np.sin((2.1 + 0.7 * place) * time)
        m = tau - B * w - size * np.tanh(w / SMOOTHING)
        m += NOISE * random.standard_normal(time.size)
        np.savetxt(folder / f"{place}.csv", np.column_stack([time, tau, w, m]), delimiter=",",
                   fmt="%.9g", header="time,tau,w,m", comments="")  # fmt: skip
        text += f'\n[[run]]\nname = "run {place}"\nfile = "{place}.csv"\npurpose = "{purpose}"\n'
    (folder / "dataset.toml").write_text(text, encoding="utf-8")
    (folder / "system.toml").write_text(alone("gearbox", "gearbox/ratio"), encoding="utf-8")
    return read_problem(folder)


def base_on_casters(folder: Path) -> Problem:
    """What a base on four casters may lack; it is not simulated, its log is a disc's."""
    disc.write(folder, lambda w, theta, t: 0.0, seconds=2.0)
    text = (folder / "dataset.toml").read_text("utf-8")
    head, _, rest = text.partition("[[parameter]]")
    for name in ("tau", "w", "phi"):
        head = head.replace(f'"load.{name}"', f'"base.{name}_l"')
    runs = rest[rest.index("[[run]]") :]
    (folder / "dataset.toml").write_text(head + runs, encoding="utf-8")
    (folder / "system.toml").write_text(alone("base", "mobile_base/six_dof"), encoding="utf-8")
    return read_problem(folder)


def turning_over(problem: Problem, variable: str = "load.angle") -> Problem:
    """The problem with start angles of which little is known, and that may decide what follows."""
    late = [
        Parameter(f"start@{run.name}", "rad", 0.0, -1.0, 1.0, ((variable, 1.0),), "nuisance",
                  run.name, 0.3, span=0.3)
        for run in problem.runs
    ]  # fmt: skip
    return problem.changed(late=late)


def swinging(folder: Path, size: float) -> Problem:
    """A disc with a weight [N.m], in each run from another angle, which its log does not tell."""
    problem = read_problem(disc.write(folder, lambda w, theta, t: 0.0, seconds=2.0))
    random = np.random.default_rng(3)
    data = {}
    for name, start in zip(disc.RUNS, STARTS, strict=True):
        _, _, w, _ = disc.run(name, _weight(size, start), 2.0)
        data[name] = (w + disc.SIGMA["w"] * random.standard_normal(w.size))[:, None]
    return turning_over(problem.changed(channels=problem.channels[:1]).with_data(data))


def _weight(size: float, start: float) -> disc.Law:
    return lambda w, theta, t: size * math.sin(theta + start)


def leaving(judge: Judge, mean_square: float | Mapping[str, float]) -> Fitted:
    """The declared model where it leaves so much, over the noise's, in all runs or by run.

    What is beyond noise is slow, as what a model lacks.
    """
    random = np.random.default_rng(8)
    rows = []
    for run in judge.fitting.runs:
        size = mean_square if isinstance(mean_square, float) else mean_square[run.name]
        slow = np.sqrt(2.0 * (size - 1.0)) * np.sin(2.0 * np.pi * 0.75 * run.times)
        rows.append(slow[:, None] + random.standard_normal(run.data.shape))
    residual = judge.fitting.vector(rows)
    problem, cost = judge.raw, judge.fitting.cost(residual)
    number = len(problem.parameters)
    estimate = Estimate(
        simulator(problem), problem.nominal, np.eye(number), problem.lower, problem.upper,
        np.ones(number, dtype=np.bool_), (), (), cost, cost, residual.size, 0, [], [],
    )  # fmt: skip
    return Fitted((), estimate, Values(judge.fit_data - residual, judge.check_data.copy()))


def gaining(judge: Judge, candidate: Candidate, gain: float, z: float = 9.0) -> Signature:
    """A candidate that gains so much to first order, by enough to matter."""
    name = f"{candidate.prefix}size"
    size = Parameter(name, "1", 0.0, 0.0, 9.0, (), strength=True)
    item = unscored(Probe(candidate, judge.raw, size, (name,)))
    return replace(
        item, rest=np.ones(judge.fit_data.size, dtype=np.float32),
        score=ScoreTest(1.0, gain, z, 1.0, 1.0, 1.0),
    )  # fmt: skip


def fitted(judge: Judge, base: Fitted, candidate: Candidate, gain: float) -> Fitted:
    """A quick fit of a candidate that gains so much on fitted runs; unused ones want it."""
    (probe,) = single(base.problem, [candidate])
    problem = probe.problem.hold({p.name: p.nominal for p in probe.others})
    estimate = replace(
        base.estimate, simulator=simulator(problem), theta=problem.nominal,
        robust=base.estimate.robust - 1.0 - gain,
    )  # fmt: skip
    # by as much as a law must change a channel at least
    return Fitted(
        (candidate,), estimate, Values(base.fit + MATERIAL + 1e-3, base.check), unscored(probe),
        WANTED,
    )  # fmt: skip
