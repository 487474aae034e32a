"""Where shafts of periodic effects stand when runs begin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bench import Bench
from benchmarks.motor_plant import draw, write_sets
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.data.signals import Constant
from cosim.diagnose.shafts import followed_shafts
from tests.problems import simulator

SHEET = Path(__file__).parents[2] / "scenarios/motor_bench/data/motor_bench.toml"
RATIO = 10.167
RIPPLE = "motor.torque_constant.torque_ripple"
CHANGES = (
    {"motor": "+torque_ripple@torque_constant"},
    {"gearbox": "+mesh_ripple@ratio+cogging@flange_a"},
    {"load": "+cogging@flange"},
)


@pytest.fixture(scope="module")
def rippled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Problem, Bench]:
    """An independent bench whose torque constant repeats nine times per turn."""
    plain = draw(np.random.default_rng(41))
    bench = Bench(plain.parameters, "torque_ripple", 0.05, shape=9.0)
    folder = tmp_path_factory.mktemp("bench")
    (place,) = write_sets(folder, [bench], SHEET, 42, 1.5, ("ST", "MS", "LW"))
    return read_problem(place), bench


def test_shafts_are_found_by_their_motion(rippled: tuple[Problem, Bench]) -> None:
    problem, _ = rippled
    found, _ = followed_shafts(simulator(problem), problem.nominal, CHANGES)
    # the load's angle is the balance's own, and nothing is integrated there
    assert set(found) == {
        "motor.torque_constant.theta", "gearbox.ratio.theta", "gearbox.flange_a.theta"
    }  # fmt: skip
    size = {"encoder.theta": 1.0, "load.angle": RATIO}
    motor, teeth = found["motor.torque_constant.theta"], found["gearbox.ratio.theta"]
    # solvers of several FMUs integrate one speed, held over a tick here and there
    assert motor[1] == pytest.approx(size[motor[0]], rel=1e-3)
    assert teeth[1] == pytest.approx(size[teeth[0]] / RATIO, rel=1e-3)


def test_nothing_is_known_where_runs_say_nothing(rippled: tuple[Problem, Bench]) -> None:
    problem, _ = rippled
    odd = {"load.flange.warm_up.t_on": 3.0}  # of an effect that is not there
    silent = problem.changed(runs=[replace(run, starts=odd) for run in problem.runs])
    assert followed_shafts(simulator(silent), silent.nominal, CHANGES).gears == {}
    resting = problem.changed(
        runs=[replace(run, inputs=dict.fromkeys(run.inputs, Constant(0.0))) for run in problem.runs]
    )
    assert followed_shafts(simulator(resting), resting.nominal, CHANGES).gears == {}


def test_a_ripple_has_one_phase_in_all_runs(rippled: tuple[Problem, Bench]) -> None:
    problem, bench = rippled
    shafts, _ = followed_shafts(simulator(problem), problem.nominal, CHANGES[:1])

    def left(changed: Problem) -> list[float]:
        theta = changed.nominal
        truth = {**bench.parameters, f"{RIPPLE}.r": 0.05, f"{RIPPLE}.n": 9.0, f"{RIPPLE}.psi": 0.0}
        for name, value in truth.items():
            theta[changed.index(name)] = value
        rows = dict(simulator(changed).residuals(theta, None))
        return [float(np.sqrt(np.nanmean(row**2))) for row in rows.values()]

    known = left(problem.changed(shafts=shafts).with_effects(CHANGES[0]))
    # what is read when within a tick is worth up to a tenth of the noise beside such a ripple
    assert max(known) < 1.1
    assert max(left(problem.with_effects(CHANGES[0]))) > 2.0


def test_a_span_of_cycles_is_one_more_in_a_run(rippled: tuple[Problem, Bench]) -> None:
    """Also where the balance offers the angle; a count of cycles per turn has no other scale."""
    problem, _ = rippled
    _, turns = followed_shafts(simulator(problem), problem.nominal, CHANGES)
    assert set(turns) == {
        "motor.torque_constant.angle", "gearbox.ratio.angle", "gearbox.flange_a.angle",
        "load.flange.angle",
    }  # fmt: skip
    # of the logs: the longest way of a run
    angle = [c.name for c in problem.channels].index("angle")
    turned = max(float(np.ptp(r.data[:, angle])) for r in problem.chosen("identification"))
    # parameters of the sheet, not the bench's, and 5 mrad of noise
    assert turns["motor.torque_constant.angle"] == pytest.approx(turned, rel=0.01)
    assert turns["load.flange.angle"] == pytest.approx(turned / RATIO, rel=0.01)
    known = problem.changed(turns=turns)
    for change, name in zip(CHANGES, (RIPPLE, "gearbox.flange_a.cogging", "load.flange.cogging"),
                            strict=True):  # fmt: skip
        counting = known.with_effects(change).counting()
        (span,) = (p.span for p in counting.parameters if p.name == f"{name}.n")
        place, _, _ = name.rpartition(".")
        assert span * turns[f"{place}.angle"] == pytest.approx(2.0 * np.pi)
        (plain,) = (p for p in problem.with_effects(change).parameters if p.name == f"{name}.n")
        assert plain.span == plain.nominal
