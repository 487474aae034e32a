"""The C core and its Python twin: ticks, modes, and what they refuse, with its words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sources.packaging.build import collect
from sources.packaging.layout import METHODS
from tests.fmus import Slave, fmu

KINDS = [("native", 2), ("native", 3), ("python", 2)]


@pytest.mark.parametrize(("kind", "fmi"), KINDS)
@pytest.mark.parametrize("period", [0.02, 0.01, 0.1 / 3, 1e-3])
def test_a_tick_at_the_end_of_a_step_belongs_to_the_next(
    kind: str, fmi: int, period: float
) -> None:
    """A link that holds commands for two steps gives in the second what the first was given."""
    with Slave(fmu("command_link/held", kind, fmi), {"T": period}) as slave:
        for k in range(400):
            slave.set({"v_set": float(k)})
            slave.step(k * (period / 2), period / 2)
            assert slave.get(["v_d"])[0] == 2 * (k // 2), k


@pytest.mark.parametrize(("kind", "fmi"), KINDS)
def test_ticks_inside_a_step_happen_at_their_time(kind: str, fmi: int) -> None:
    """Times of one step added up, not multiplied: the rounding of 1e5 sums may not move a tick."""
    with Slave(fmu("command_link/held", kind, fmi), {"T": 0.01}) as slave:
        t, expected = 0.0, 0.0
        for k in range(1000):
            if k % 10 == 0:
                expected = t
            slave.set({"v_set": t})
            slave.step(t, 1e-3)
            t += 1e-3
            assert slave.get(["v_d"])[0] == expected, k


@pytest.mark.parametrize(("kind", "fmi"), KINDS)
def test_clocks_of_a_late_start_keep_to_the_grid(kind: str, fmi: int) -> None:
    with Slave(fmu("command_link/held", kind, fmi), {"T": 0.01}, start=0.013) as slave:
        seen = []
        for k in range(10):
            t = 0.013 + 0.003 * k
            slave.set({"v_set": float(k)})
            slave.step(t, 0.003)
            seen.append(slave.get(["v_d"])[0])
    # passes on until the first tick at 0.02 (in step 2), then 0.03 (step 5), 0.04 begins step 9
    assert seen == [0, 1, 2, 2, 2, 5, 5, 5, 5, 9]


@pytest.mark.parametrize(("kind", "fmi"), KINDS[:2])
def test_a_solver_that_gets_nowhere_says_so(kind: str, fmi: int) -> None:
    """An explicit one where friction that holds decays at 1e10/s: 3e9 steps for a second."""
    values = {"coulomb.tau_c": 100.0, "coulomb.w_0": 1e-6, "J": 1e-2} | {
        "solver.method": METHODS["dopri5"][0], "solver.step": 1e-2,
    }  # fmt: skip
    with Slave(fmu("inertia/disc+coulomb", kind, fmi), values) as slave:
        slave.set({"tau": 90.0})
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(0.0, 1.0)
        text = slave.messages[-1]
        assert text.startswith("inertia_disc_coulomb: 300000 solver steps from 0 s on have only ")
        assert text.endswith("loosen solver.tolerance or use a fixed-step method")


@pytest.mark.parametrize(("kind", "fmi"), KINDS)
def test_a_result_that_is_not_finite_is_refused(kind: str, fmi: int) -> None:
    with Slave(fmu("gearbox/ratio", kind, fmi)) as slave:
        slave.set({"tau_a": 1e308})
        with pytest.raises(Exception, match=r"status [34]"):
            slave.get(["tau_b"])
        assert any("variable tau_b is not finite (inf)" in text for text in slave.messages)
        if not slave.alive:
            assert kind == "python"
            return
        slave.set({"tau_a": 1.0})
        assert np.isfinite(slave.get(["tau_b"])[0])


@pytest.mark.parametrize("fmi", [2, 3])
def test_values_of_another_type_are_refused(fmi: int) -> None:
    with Slave(fmu("gearbox/elastic", fmi=fmi)) as slave:
        method = [slave.vr["solver.method"]]
        read = slave.fmu.getReal if fmi == 2 else slave.fmu.getFloat64
        write = slave.fmu.setReal if fmi == 2 else slave.fmu.setFloat64
        with pytest.raises(Exception, match=r"status [34]"):
            read(method)
        with pytest.raises(Exception, match=r"status [34]"):
            write(method, [1.5])
        assert all("is no real variable" in text for text in slave.messages)
        assert len(slave.messages) == 2


def test_doing_things_at_the_wrong_time_is_refused_with_the_reason() -> None:
    with Slave(fmu("gearbox/elastic"), initialize=False) as slave:
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(0.0, 0.1)
        slave.initialize()
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(0.5, 0.1)
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(0.0, -0.1)
        slave.fmu.terminate()
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(0.0, 0.1)
        expected = ["is not initialized", "starts at 0.5 s but", "step -0.1 s", "is terminated"]
        for text, part in zip(slave.messages, expected, strict=True):
            assert part in text


def test_a_failed_step_stays_failed_until_reset() -> None:
    values = {"solver.method": 1, "solver.step": 1e-3}  # explicit steps far beyond stability
    with Slave(fmu("gearbox/elastic"), {"d": 1e6, "w_b": 1.0, **values}) as slave:
        with pytest.raises(Exception, match=r"status [34]"):
            for k in range(1000):
                slave.step(0.1 * k, 0.1)
        assert "is not finite" in slave.messages[0]
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(0.1, 0.1)
        assert "has failed before" in slave.messages[1]
        slave.fmu.reset()
        slave.initialize()
        slave.step(0.0, 0.1)


def test_messages_reach_printf_loggers_unharmed() -> None:
    """FMI 2 hands messages to the logger as a format."""
    slave = Slave(fmu("gearbox/ratio"), initialize=False)
    with pytest.raises(Exception, match="instantiate"):
        Slave(fmu("gearbox/ratio"), token="%s%n%d")
    slave.fmu.freeInstance()


def test_periods_of_clocks_are_fixed(monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    import sources.command_link.held as held
    from sources.model import ModelError

    monkeypatch.setattr(held, "T", replace(held.T, variability="tunable"))
    with pytest.raises(ModelError) as caught:
        collect("command_link/held")
    assert str(caught.value) == (
        "command_link/held: the period of clock 'command' depends on T; "
        "it may depend on fixed parameters only"
    )


@pytest.mark.parametrize(("kind", "fmi"), KINDS)
def test_steps_past_the_stop_time_are_refused(kind: str, fmi: int) -> None:
    """As the standards ask; 1e-9 s more is rounding."""
    with Slave(fmu("inertia/disc", kind, fmi), initialize=False) as slave:
        if fmi == 2:
            slave.fmu.setupExperiment(startTime=0.5, stopTime=1.0)
            slave.fmu.enterInitializationMode()
        else:
            slave.fmu.enterInitializationMode(startTime=0.5, stopTime=1.0)
        slave.fmu.exitInitializationMode()
        slave.step(0.5, 0.4)
        slave.step(0.9, 0.1 + 1e-12)
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(1.0, 0.1)
        text = " ".join(slave.messages)  # pythonfmu logs the traceback line by line
        assert "doStep from 1 s to 1.1 s goes past the stop time 1 s" in text


def test_a_failed_step_leaves_the_time_where_it_was() -> None:
    values = {"solver.method": 1, "solver.step": 1e-3, "d": 1e6, "w_b": 1.0}
    with Slave(fmu("gearbox/elastic"), values) as slave:
        with pytest.raises(Exception, match=r"status [34]"):
            slave.step(0.0, 1.0)
        assert slave.fmu.getRealStatus(2) == 0.0  # fmi2LastSuccessfulTime


def test_directional_derivatives_that_are_not_finite_are_refused() -> None:
    with Slave(fmu("gearbox/ratio"), {"ratio": 1e3, "tau_a": 1e3}) as slave:
        references = [slave.vr["tau_b"]], [slave.vr["tau_a"]]
        assert np.isfinite(slave.fmu.getDirectionalDerivative(*references, [1.0])[0])
        with pytest.raises(Exception, match=r"status [34]"):
            slave.fmu.getDirectionalDerivative(*references, [1e308])
        assert "directional derivative of tau_b is not finite (inf)" in slave.messages[-1]


def test_what_a_solver_keeps_is_not_taken_by_another() -> None:
    """Jacobian and factors serve the method and the step that they were made for."""

    def run(kind: str) -> list[list[float]]:
        with Slave(fmu("dc_motor/electrical", kind)) as slave:
            vr = [slave.vr["solver.method"]]
            rows, t = [], 0.0
            for k in range(40):
                # rodas3, its error-controlled form and the one that keeps its Jacobian, in turns
                slave.fmu.setInteger(vr, [(2, 4, 5)[k // 5 % 3]])
                slave.set({"w_ref": 20.0 * (k // 8), "w": 2.0 * k})
                h = 1e-3 if k % 10 < 7 else 5e-4
                slave.step(t, h)
                t += h
                rows.append(slave.get(slave.names("output")))
            return rows

    # the twin makes factors anew in each step; same operations, so not one bit may differ
    np.testing.assert_array_equal(run("native"), run("python"))


def test_outputs_do_not_depend_on_which_of_them_were_fetched_before() -> None:
    """Outputs that are states are computed without the others; the others follow when asked for."""

    def run(first: list[str], second: list[str]) -> list[list[float]]:
        with Slave(fmu("mobile_base/planar", "native")) as slave:
            rows = []
            for k in range(20):
                slave.set({"tau_l": 3.0 * (k // 4), "tau_r": 2.0})
                slave.get(first)
                slave.step(k * 1e-3, 1e-3)
                found = dict(zip(first, slave.get(first), strict=True))
                found |= dict(zip(second, slave.get(second), strict=True))
                rows.append([found[name] for name in sorted(found)])
            return rows

    states, others = ["x", "v", "w_l"], ["P_in", "E_stored", "P_loss"]
    # the same operations in another order of calls: not one bit may differ
    np.testing.assert_array_equal(run(states, others), run(others, states))
    assert len({tuple(row) for row in run(states, others)}) == 20


@pytest.mark.parametrize("start", [0.0, 0.37])
@pytest.mark.parametrize("t_lag", [0.05, 0.015, 0.002])
def test_a_lag_is_the_same_in_all_builds(t_lag: float, start: float) -> None:
    """Above and below two steps of 0.01 s, and its tick at the start of a run alone."""

    def run(kind: str, fmi: int) -> list[list[float]]:
        path = fmu("adapter/signal+first_order_lag", kind, fmi)
        values = {"first_order_lag.t_lag": t_lag, "u": 1.0}
        with Slave(path, values, start=start) as slave:
            rows = []
            for k in range(30):
                slave.set({"u": 1.0 + 0.5 * (k // 7)})
                slave.step(start + 0.01 * k, 0.01)
                rows.append(slave.get(["y"]))
            return rows

    native = run("native", 2)
    np.testing.assert_array_equal(run("python", 2), native)
    np.testing.assert_array_equal(run("native", 3), native)
    assert native[6] == [1.0]  # settled, until the step in the signal
    lagged = 1.5 - 0.5 * math.exp(-0.01 / t_lag)
    assert native[7][0] == pytest.approx(lagged, abs=1e-3)
