"""A model far from its data is moved along the log, and sets of laws are told apart there.

The plant is the disc of `disc.py`: friction and an unbalance, of which first orders around the
calibrated model say nothing, since it turns the other way half of the time.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose import directions
from cosim.diagnose.candidates import Candidate, candidates
from cosim.diagnose.directions import Direction, Responses
from cosim.diagnose.evidence import Chosen, Evidence
from cosim.diagnose.following import follow
from cosim.diagnose.search import Search
from tests.diagnose import disc
from tests.diagnose.test_left_out import LAWS

STAMPED = """
[[parameter]]
name = "clock"
unit = "s"
nominal = 0.0
min = -0.2
max = 0.2
targets = "clock:load.tau"
"""


@dataclass
class Moved:
    """A disc's declared model along its log."""

    before: float
    left: float
    responses: Responses
    known: list[Candidate]
    directions: list[Direction]

    def named(self, chosen: Chosen) -> dict[str, list[float]]:
        """Effect -> values of its columns."""
        return {
            self.directions[m].candidate.effect: values.tolist()
            for m, values in zip(chosen.members, chosen.values, strict=True)
        }


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> Moved:
    """The disc with friction and an unbalance."""
    problem = read_problem(disc.write(tmp_path_factory.mktemp("both"), LAWS["both"]))
    search = Search(Simulator(problem))
    base = search.calibrated()
    followed = follow(base.simulator, base.estimate.theta, search.fitting, ("load", "flange"), [])
    responses = Responses(followed, search.fitting)
    residual = search.fit_data - base.fit
    known = candidates(search.declared)
    before = float(np.mean(residual**2))
    return Moved(before, followed.left, responses, known, responses.of(known))


def test_efforts_move_a_model_that_is_hundreds_of_sigma_off_to_the_log(moved: Moved) -> None:
    assert moved.before > 200.0**2
    assert moved.left < 4.0  # the model's own mean square over noise, from which it is far off


def test_two_laws_that_are_there_explain_what_is_wanted_with_their_sizes(moved: Moved) -> None:
    evidence = Evidence(moved.directions, moved.responses.wanted)
    whole = 0.5 * float(moved.responses.wanted @ moved.responses.wanted)
    alone, pairs, *_ = evidence.sets(2)
    both = next(c for c in pairs if set(moved.named(c)) == {"coulomb", "unbalance"})
    assert both.gain > 0.99 * whole
    # no law alone, nor a pair without both kinds of law, comes near
    assert alone[0].gain < 0.95 * whole
    rivals = {"asymmetric_coulomb", "stribeck", "bristle", "coulomb"}, {"cogging", "unbalance"}
    for chosen in pairs[: pairs.index(both)]:
        assert all(set(moved.named(chosen)) & laws for laws in rivals)
    found = moved.named(both)
    # 0.08 tanh(w / 0.02) + 0.1 sin(theta + 0.5); first orders, and a law that is ten times as sharp
    assert found["coulomb"] == [pytest.approx(0.08, rel=0.1)]
    wanted = [0.1 * np.cos(0.5), 0.1 * np.sin(0.5)]
    assert found["unbalance"] == [pytest.approx(x, rel=0.1) for x in wanted]


def test_a_direction_is_the_change_over_the_strength_that_was_simulated(
    moved: Moved, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where no trial is of the size that is sought; these laws are about linear."""
    monkeypatch.setattr(directions, "TRIALS", 1)
    labels = {f"{name} at load.flange" for name in ("coulomb", "bristle", "quadratic_drag")}
    first = moved.responses.of([c for c in moved.known if c.label in labels])
    assert {d.candidate.label for d in first} == labels
    for one in first:
        (usual,) = [d for d in moved.directions if d.candidate is one.candidate]
        assert one.size > 5.0 * usual.size
        ratio = np.linalg.norm(one.change) / np.linalg.norm(usual.change)
        assert ratio == pytest.approx(1.0, rel=0.05)  # by up to 0.01, of strengths 30 times larger


def test_what_calibration_absorbs_is_wanted_of_no_law(tmp_path: Path) -> None:
    """The negative twin: a disc that lacks nothing, whose parameters are only nominal so far."""
    problem = read_problem(disc.write(tmp_path / "none", LAWS["none"]))
    search = Search(Simulator(problem))
    base = search.calibrated()
    followed = follow(base.simulator, problem.nominal, search.fitting, ("load", "flange"), [])
    responses = Responses(followed, search.fitting)
    whole = float(followed.wanted @ followed.wanted)
    # what the step adds to the model is that of the calibrated point
    assert float(responses.wanted @ responses.wanted) < 1e-4 * whole
    found = problem.nominal + responses.absorber.change(followed.wanted) * problem.scale
    assert found == pytest.approx([disc.J, disc.B], rel=0.03)


def test_a_late_input_stays_late_while_efforts_move_the_model(tmp_path: Path) -> None:
    """A torque that is stamped 60 ms late, with its clock calibrated, leaves nothing to efforts."""
    names = ("sweep", "steps", "check")
    disc.write(tmp_path, LAWS["none"], seconds=2.0, names=names)
    for name in names:
        path = tmp_path / f"{name}.csv"
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        table[:, 1] = np.interp(table[:, 0] - 0.06, table[:, 0], table[:, 1])
        np.savetxt(path, table, delimiter=",", fmt="%.7g", header="time,tau,w,theta", comments="")
    with (tmp_path / "dataset.toml").open("a", encoding="utf-8") as file:
        file.write(STAMPED)
    search = Search(Simulator(read_problem(tmp_path)))
    base = search.calibrated()
    assert base.estimate.values["clock"] == pytest.approx(0.06, abs=1e-3)
    (run, *_) = search.fitting.runs
    theta, simulator = base.estimate.theta, base.simulator
    (driven,) = simulator.driven(theta, run, [{}])
    assert np.array_equal(driven, simulator.simulate(theta, run), equal_nan=True)
    assert not np.array_equal(driven, simulator.simulate(base.problem.nominal, run))
    followed = follow(simulator, theta, search.fitting, ("load", "flange"), [])
    residual = search.fit_data - followed.model
    assert float(np.mean(residual**2)) < 2.0  # noise is 1; it was 7700 with the torque as stamped
    search.close()
