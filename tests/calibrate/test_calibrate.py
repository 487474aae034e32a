"""Known parameters are found again, with intervals that hold them; what cannot be told is said."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from cosim.calibrate.differences import jacobian
from cosim.calibrate.estimate import channel_rms, determined
from cosim.calibrate.felt import felt
from cosim.calibrate.fit import Effort, fit
from cosim.calibrate.sensitivity import correlation_index, local, significance_limit
from cosim.calibrate.simulator import Simulator
from cosim.errors import FmuCallError
from tests.problems import simulator


@pytest.mark.slow
def test_parameters_are_recovered_with_honest_intervals(noisy, truth) -> None:
    covered, errors = [], []
    for seed in range(6):
        problem = noisy(seed)
        estimate = fit(simulator(problem))
        known = estimate.identifiable
        assert known.sum() == 5  # all but eta, J_load and b
        deviation = estimate.deviation[known]
        errors += ((estimate.theta - truth)[known] / deviation).tolist()
        covered += ((estimate.low <= truth) & (truth <= estimate.high))[known].tolist()
        # Student's factor of 30 blocks is 2.04; 4 s of data have four blocks of a second
        assert np.max((estimate.high - estimate.low)[known] / deviation) < 2.0 * 2.1
        simulator(problem).close()
    # 30 cases at 95 %: fewer than 25 has a probability of 6e-4
    assert np.sum(covered) >= 25
    # standard deviations off by a factor of 2 would give 2 or 0.5; 30 cases scatter by 0.13
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.5


@pytest.mark.slow
def test_inseparable_parameters_are_named(noisy) -> None:
    problem = noisy(10)
    estimate = fit(simulator(problem), effort=Effort(end="intervals"))
    flags = dict(zip(problem.names, estimate.identifiable.tolist(), strict=True))
    assert not flags["eta"] and not flags["J_load"] and not flags["b"]
    assert flags["K_t"] and flags["Kp_v"] and flags["acc_max"]
    text = str(estimate.combinations[0])
    assert "eta" in text and "J_load" in text
    # eta/(J_load + N^2 J_m) is what the data determine: the direction keeps it
    weights = estimate.combinations[0].weights
    values = estimate.values
    total = values["J_load"] + 10.167**2 * 1.6e-4
    span = dict(zip(problem.names, problem.scale.tolist(), strict=True))
    relative = [weights["eta"] * span["eta"] / values["eta"],
                weights["J_load"] * span["J_load"] / total]  # fmt: skip
    # derivatives by differences are good to about 1 %
    assert relative[0] == pytest.approx(relative[1], rel=0.05)


def test_residuals_of_the_truth_are_noise(noisy, truth) -> None:
    problem = noisy(1)
    rms = channel_rms(problem, simulator(problem).residuals(truth))
    # 4002 samples per channel: 5 standard deviations are 5/sqrt(2 * 4002) = 0.056
    assert all(abs(value - 1.0) < 0.06 for value in rms.values())


@pytest.mark.slow
def test_gaps_are_left_out(noisy, truth) -> None:
    problem = noisy(2)
    data = {run.name: run.data.copy() for run in problem.runs}
    data["sines"][300:700, 0] = np.nan
    data["stairs"][:, 3] = np.nan
    estimate = fit(simulator(problem.with_data(data)), effort=Effort(end="intervals"))
    fitted = [data[name] for name in ("sines", "stairs")]
    assert estimate.count == sum(int(np.isfinite(item).sum()) for item in fitted)
    error = np.abs(estimate.theta - truth)[estimate.identifiable]
    # 5 standard deviations: a gap that was filled would shift by hundreds
    assert np.all(error < 5.0 * estimate.deviation[estimate.identifiable])


def test_effects_without_strength_change_nothing(short, truth) -> None:
    effect = short.with_effects({"load": "+coulomb"})
    added = effect.parameters[len(short.parameters) :]
    assert {p.role for p in added} == {"effect"}
    strength = next(p for p in added if p.strength)
    assert (strength.name, strength.nominal) == ("load.coulomb.tau_c", 0.0)
    theta = np.concatenate([truth, [p.nominal for p in added]])
    assert np.array_equal(
        simulator(effect).simulate(theta, "sines"), simulator(short).simulate(truth, "sines")
    )
    theta[effect.index("load.coulomb.tau_c")] = 0.5
    assert not np.array_equal(
        simulator(effect).simulate(theta, "sines"), simulator(short).simulate(truth, "sines")
    )


def test_how_a_law_is_computed_is_no_parameter(short) -> None:
    late = short.with_effects({"motor": "+delay@command"})  # beside it, the grid of its memory
    assert [p.name for p in late.parameters[len(short.parameters) :]] == ["motor.command.delay.t_d"]
    warm = short.with_effects({"motor": "+winding_heating@winding"})  # nature has a time constant
    assert "motor.winding.winding_heating.t_th" in warm.names


def test_strengths_have_room_behind_a_gear_and_other_parameters_less(short) -> None:
    """The start is a motor shaft's; behind a gear of 101, the same fan has 101^2 of it."""
    found = short.with_effects({"load": "+quadratic_drag+asymmetric_coulomb"})
    known = {p.name: p for p in found.parameters if p.role == "effect"}
    drag = known["load.quadratic_drag.c"]
    assert drag.minimum == 0.0 and drag.maximum > 0.9 * 101**2 * drag.span  # 1e4 is a round 101^2
    smooth = known["load.asymmetric_coulomb.w_0"]
    assert smooth.maximum == pytest.approx(100.0 * smooth.span, rel=1e-12)  # rounding


def test_derivatives_over_steps_that_are_felt_are_those_of_the_jacobian(short, truth) -> None:
    along = jacobian(simulator(short), truth, ["sines"], relative=1e-2)[0]
    (other,) = felt(simulator(short), truth, [along], {along.run})
    assert other.columns.tolist() == along.columns.tolist()
    difference = np.linalg.norm((along.values - other.values) * short.scale)
    # these are differences over 1 % of the spans; limits and ticks make them scatter
    assert difference < 0.05 * np.linalg.norm(along.values * short.scale)


@pytest.mark.parametrize("central", [False, True])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_difference_that_cannot_be_simulated_is_taken_on_the_other_side(
    short, truth, monkeypatch, sign, central
) -> None:
    """One simulation of hundreds that a solver gives up must not end a fit."""
    whole = jacobian(simulator(short), truth, ["sines"], central=central)[0].values
    simulate = Simulator.simulate

    def strict(self, theta, run):
        if sign * (theta[2] - truth[2]) > 0.0:
            raise FmuCallError("it took too long")
        return simulate(self, theta, run)

    monkeypatch.setattr(Simulator, "simulate", strict)
    found = jacobian(simulator(short), truth, ["sines"], central=central)[0].values
    others = [i for i in range(truth.size) if i != 2]
    assert np.array_equal(found[:, :, others], whole[:, :, others])
    # one-sided differences over a thousandth of the span
    error = np.abs(found[:, :, 2] - whole[:, :, 2])
    assert 0.0 <= np.nanmax(error) < 0.01 * np.nanmax(np.abs(whole[:, :, 2]))

    def refused(self, theta, run):
        if theta[2] != truth[2]:
            raise FmuCallError("it took too long")
        return simulate(self, theta, run)

    monkeypatch.setattr(Simulator, "simulate", refused)
    with pytest.raises(FmuCallError, match="too long"):
        jacobian(simulator(short), truth, ["sines"], central=central)


def test_held_parameters_leave(short, truth) -> None:
    held = short.hold({"J_load": float(truth[4])})
    assert "J_load" not in held.names
    rest = np.delete(truth, 4)
    assert np.array_equal(
        simulator(held).simulate(rest, "sines"), simulator(short).simulate(truth, "sines")
    )


@pytest.mark.slow
def test_sensitivity(noisy, truth) -> None:
    problem = noisy(3).only(["sines"])
    correlation = correlation_index(simulator(problem), truth, 60, width=0.3)
    assert correlation.samples == 60
    assert correlation.by_run == {"sines": correlation.index}
    # the digital twin paper's 20 sets: 0.444 for one parameter
    assert significance_limit(20, 1) == pytest.approx(0.444, abs=5e-4)
    assert all(-1.0 <= value <= 1.0 for value in correlation.index.values())
    estimate = fit(simulator(problem), truth, effort=Effort("near", "intervals"))
    values = local(estimate)
    assert values["Kp_v"] > values["b"] > 0.0


def test_a_problem_stays_what_it_is(short) -> None:
    with pytest.raises(FrozenInstanceError):
        short.step = 0.5 * short.step
    with pytest.raises(FrozenInstanceError):
        short.model.instances = {}
    finer = short.changed(step=0.5 * short.step)
    assert finer.step == 0.5 * short.step and finer.model is short.model


def test_what_the_data_determine_without_narrow_bounds() -> None:
    """Beside a neighbour of which data and bounds say as much; in a valley; hardly in it."""
    data, bounds = np.array([12.0, 1e-3, 1e-3]), 12.0
    turn = np.array([0.02, 0.05, 1e-6]) ** 2  # how much each is of the open direction
    own = np.array([3e-3, 1e-3, 1e-3]) ** 2
    rests = turn / (data + bounds)
    found = determined(own + rests, rests, turn / (data + bounds / 100.0**2))
    # the share that rests on bounds is 0.65, 0.995 and 0; with wide ones the deviations are
    # 0.0065, 1.07 and 0.001 of the span
    assert found.tolist() == [True, False, True]
    assert determined(np.array([0.07]), np.zeros(1), np.zeros(1)).tolist() == [False]  # 0.26
