"""What counts as chosen of a law: what a fit has free, and what was put elsewhere than usual."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cosim.diagnose.composed import composed
from cosim.diagnose.probes import single
from cosim.diagnose.rivals import exchanged
from cosim.diagnose.signature import unscored
from tests.diagnose import built

DRAG, SHARP = 0.01, 1e-4


def drag(w: float, theta: float, t: float) -> float:
    return DRAG * w * abs(w)


def test_a_parameter_held_as_usual_is_not_chosen_however_a_law_came_in(tmp_path: Path) -> None:
    with built.rig(tmp_path, drag) as rig:
        first = rig.added(rig.base, "quadratic_drag", {"c": DRAG})
        plain = rig.added(first, "coulomb", {"tau_c": 1e-3})
        other = replace(rig.added(first, "viscous", {"b": 1e-3}), signature=None)
        less = composed(rig.search.raw, other, first.effects)
        (probe,) = single(less, [rig.candidate("coulomb")])
        item = unscored(probe)
        same = exchanged(rig.search, other, item, None, less)
    assert same.labels == plain.labels and same.problem.held == plain.problem.held
    assert same.complexity == plain.complexity == plain.free
    (width,) = (p for p in probe.others if p.name.endswith(".w_0"))
    assert not item.at({width.name: width.nominal}).fixed
    sharp = item.at({width.name: SHARP})
    assert sharp.fixed == {width.name: SHARP}
    assert not sharp.at({width.name: width.nominal}).fixed
    # a value of a list that happens to be the usual one was chosen
    chosen = replace(item, fixed={width.name: width.nominal})
    assert chosen.at(chosen.fixed).fixed == chosen.fixed


def test_a_model_without_its_last_law_is_not_described_by_that_one(tmp_path: Path) -> None:
    with built.rig(tmp_path, drag) as rig:
        first = rig.added(rig.base, "quadratic_drag", {"c": DRAG})
        both = rig.added(first, "coulomb", {"tau_c": 1e-3})
        less = {e.effect: rig.search.without(both, e) for e in both.effects}
    assert less["coulomb"].signature is None and less["coulomb"].quantity == ""
    assert less["quadratic_drag"].quantity == "tau_c"
