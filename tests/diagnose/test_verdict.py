"""What holds for the verdict on any table of models, and its rules one by one."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from cosim.diagnose.answer import Verdict
from cosim.diagnose.doubts import threshold
from cosim.diagnose.facts import Comparison, Force, Gain, Law, Left, Model, Table, Value
from cosim.diagnose.table import comparable
from cosim.diagnose.verdict import above, beaten, decide, proposal, unasked

COUNT = 4000
"""Measured values in identification runs, and in unused ones."""
EFFECTS = ("coulomb", "bristle", "cogging", "delay", "viscous")
PLACES = ("motor.shaft", "load.flange", "gearbox.flange_a")
TABLES = 500


def law(
    effect: str = "coulomb", place: str = "load.flange", *, value: float = 0.4, half: float = 0.05,
    gain: float = 500.0, z: float = 20.0, own: int = 1, change: float = 3.0,
    fitted: float = 1000.0, extra: tuple[Value, ...] = (), twins: tuple[str, ...] = (),
    contains: tuple[str, ...] = (), tick: float = 0.0,
) -> Law:  # fmt: skip
    """A law whose absence costs unused runs `gain` nats."""
    component, port = place.split(".")
    name = f"size_of_{effect}"
    low, high = max(value - half, 0.0), value + half
    size = Value(name, "N.m", value, low, high, 0.0, 10.0, True)
    missed = Gain(fitted, gain, z, z, change)
    return Law(effect, component, port, name, (size, *extra), own=own, contains=contains,
               twins=twins, missed=missed, tick=tick)  # fmt: skip


def left(rms: float, channel: str = "speed", purpose: str = "validation") -> Left:
    """What is left of a channel; noise if it is not above it."""
    return Left(channel, purpose, rms, rms, 0.5 if rms < 1.05 else 1e-9)


def model(*laws: Law, rms: float = 1.0, force: float | None = None, gain: float = 0.0) -> Model:
    """A model that leaves this RMS in both kinds of runs.

    Args:
        laws: of it.
        rms: residual over noise.
        force: share of the rest that a free force explains, None if that was not asked.
        gain: log likelihood besides.
    """
    cost = 0.5 * rms**2 * COUNT - 0.5 * gain
    unknown = Force("motor", "shaft", "", force or 0.0)
    gains = [item.missed for item in laws if item.missed is not None]
    better = Gain(
        sum(g.fitted for g in gains), sum(g.unused for g in gains), 20.0,
        min((g.unused_z for g in gains), default=0.0), 3.0,
    ) if laws else None  # fmt: skip
    rest = left(rms), left(rms, purpose="identification")
    return Model(laws, 9 + len(laws), -cost, -cost, rest, better,
                 None if force is None else (unknown,), 0.2 * COUNT * (rms**2 - 1.0))  # fmt: skip


def table(*models: Model, alike: tuple[tuple[int, int], ...] = ()) -> Table:
    """A table whose first model is the declared one; some pairs are not told apart."""
    nothing = Gain(0.0, 0.0, 0.0, 0.0, 0.0)
    pairs = tuple(Comparison(i, k, nothing) for i, k in alike)
    return Table(models, pairs, 80, COUNT, COUNT)


FAR, CLEAN = model(rms=5.0, force=0.9), model()


def random_table(seed: int) -> Table:
    """Facts of any kind, whether they can go together or not."""
    random = np.random.default_rng(seed)

    def pick(*values: float) -> float:
        return float(random.choice(values))

    def some_law() -> Law:
        value = pick(1e-6, 0.3, 0.9, 2.0, 4.0)
        extra = (Value("x_0", "rad", 1.0, *random.choice([[0.0, 9.0], [0.9, 1.1]]).tolist(),
                       0.0, 9.0, True),)  # fmt: skip
        return law(
            str(random.choice(EFFECTS)), str(random.choice(PLACES)), value=value,
            half=pick(0.01, 0.1, 0.1, 0.5), gain=pick(6.0, 300.0, 900.0, 9e4),
            z=pick(1.0, 9.0, 9.0, 9.0),
            own=int(random.integers(1, 4)),
            contains=("coulomb",) if random.random() < 0.3 else (),
            change=pick(0.1, 4.0, 4.0, 4.0), fitted=pick(-5.0, 500.0, 500.0, 500.0),
            extra=extra[: int(random.integers(2))],
        )  # fmt: skip

    models = [model(rms=pick(1.0, 1.3, 9.0),
                    force=random.choice([None, 0.2, 0.9]))]  # fmt: skip
    known = {frozenset[str]()}
    for _ in range(int(random.integers(0, 9))):
        laws = tuple(
            {x.label: x for x in (some_law() for _ in range(int(pick(1, 1, 2, 3))))}.values()
        )
        one = model(*laws, rms=pick(1.0, 1.0, 1.2, 3.0, 40.0),
                    force=random.choice([None, 0.1, 0.7]), gain=float(random.normal()))  # fmt: skip
        one = replace(one, rough=bool(random.random() < 0.1))
        if one.labels not in known:
            known.add(one.labels)
            models.append(one)
    alike = tuple((i, k) for k in range(len(models)) for i in range(1, k) if random.random() < 0.6)
    unused = 0 if random.random() < 0.1 else COUNT
    return replace(table(*models, alike=alike), unused_count=unused)


@pytest.fixture(scope="module")
def tables() -> list[tuple[Table, Verdict]]:
    """Random ones, with their verdicts."""
    found = [random_table(seed) for seed in range(TABLES)]
    return [(one, decide(one)) for one in found]


def test_random_tables_end_with_every_verdict(tables: list[tuple[Table, Verdict]]) -> None:
    """And with each often enough to test something."""
    kinds = Counter(verdict.kind for _, verdict in tables)
    assert set(kinds) == {"effect_found", "confounded", "unexplained", "nothing_missing"}
    assert min(kinds.values()) >= TABLES // 20


def test_no_law_is_named_at_strength_0_or_without_gain(
    tables: list[tuple[Table, Verdict]],
) -> None:
    for one, verdict in tables:
        for item in verdict.laws:
            assert item.size.low > 0.0 and item.missed is not None
            assert item.missed.unused > threshold(one.candidates) and item.missed.fitted > 0.0
        for hint in verdict.hints:
            assert hint.explained > 0.0 and hint.why


def test_nothing_is_named_that_leaves_what_a_force_explains_or_that_is_much(
    tables: list[tuple[Table, Verdict]],
) -> None:
    for one, verdict in tables:
        if not verdict.laws:
            continue
        named, declared = one.models[verdict.model], one.models[0]
        if above(named):
            assert named.forces is not None and named.forces[0].explained < 0.5
            assert named.left[0].rms < 0.2 * declared.left[0].rms
        assert one.unused_count > 0 and beaten(one, verdict.model) is None


def test_nothing_is_missing_only_where_the_declared_model_leaves_noise(
    tables: list[tuple[Table, Verdict]],
) -> None:
    for one, verdict in tables:
        if verdict.kind == "nothing_missing":
            assert not above(one.models[0]) and not verdict.laws and not verdict.hints


def test_sentence_tables_and_json_say_the_same(tables: list[tuple[Table, Verdict]]) -> None:
    for one, verdict in tables:
        content = json.loads(json.dumps(verdict.to_dict(), allow_nan=False))
        named = [f"{e['effect']} at {e['place']}" for e in content["effects"]]
        assert content["reason"] == verdict.reason and content["verdict"] == verdict.kind
        assert bool(named) == (verdict.kind in ("effect_found", "confounded"))
        assert bool(content["alternatives"]) == (verdict.kind == "confounded")
        for label in (*named, *(x for a in content["alternatives"] for x in a["effects"])):
            assert label in verdict.reason
        for entry, item in zip(content["effects"], verdict.laws, strict=True):
            assert entry["parameters"][item.strength]["value"] == item.size.value
        # what is said to be above the noise is that of the model that the tables show as "after"
        assert verdict.left == above(one.models[verdict.model])
        for x in verdict.left[:1]:
            assert f"{x.channel} ({x.rms:.3g} times" in verdict.reason
        if content["hints"]:
            assert verdict.kind == "unexplained" and str(verdict.hints[0]) in verdict.reason


def test_the_verdict_does_not_hang_on_the_order_of_the_table(
    tables: list[tuple[Table, Verdict]],
) -> None:
    for seed, (one, verdict) in enumerate(tables):
        order = [0, *(1 + np.random.default_rng(seed).permutation(len(one.models) - 1)).tolist()]
        where = {old: new for new, old in enumerate(order)}
        pairs = tuple(Comparison(where[c.first], where[c.second], c.gain) for c in one.comparisons)
        turned = replace(one, models=tuple(one.models[i] for i in order), comparisons=pairs)
        again = decide(turned)
        assert (again.kind, again.laws) == (verdict.kind, verdict.laws)
        assert again.reason == verdict.reason


def test_a_table_that_was_written_and_read_has_the_same_verdict(
    tables: list[tuple[Table, Verdict]],
) -> None:
    for one, verdict in tables[:100]:
        again = Table.read(json.loads(json.dumps(one.to_dict(), allow_nan=False)))
        assert again == one and decide(again) == verdict


def test_more_that_no_law_explains_never_makes_a_name(tables: list[tuple[Table, Verdict]]) -> None:
    for one, verdict in tables:
        for more in (0.6, 3.0, 30.0):
            models = []
            for m in one.models:
                rest = tuple(left(math.hypot(x.rms, more), purpose=x.purpose) for x in m.left)
                cost = 0.5 * COUNT * more**2
                models.append(replace(m, left=rest, fitted=m.fitted - cost, unused=m.unused - cost))
            worse = decide(replace(one, models=tuple(models)))
            assert not worse.laws or verdict.laws
            assert worse.kind != "nothing_missing"


def test_a_force_that_explains_more_of_the_rest_never_makes_a_name(
    tables: list[tuple[Table, Verdict]],
) -> None:
    for one, verdict in tables:
        models = [
            replace(m, forces=tuple(replace(f, explained=1.0) for f in m.forces or ()) or None)
            for m in one.models
        ]
        worse = decide(replace(one, models=tuple(models)))
        assert not worse.laws or verdict.laws


def test_without_unused_runs_nothing_is_named(tables: list[tuple[Table, Verdict]]) -> None:
    for one, _ in tables:
        assert not decide(replace(one, unused_count=0)).laws


def test_a_law_that_explains_all_is_named_and_its_twin_without_it_is_clean() -> None:
    found = decide(table(FAR, model(law())))
    assert (found.kind, [x.label for x in found.laws]) == (
        "effect_found",
        ["coulomb at load.flange"],
    )
    assert found.explained == pytest.approx(1.0)
    clean = decide(table(CLEAN, model(law(value=1e-3), gain=3.0)))
    assert clean.kind == "nothing_missing"


@pytest.mark.parametrize(
    ("one", "why"),
    [
        (law(value=0.01, half=0.05), "holds 0: absence"),
        (law(gain=6.0), "do not want it"),  # 6 nats: enough for one candidate, not for 80
        (law(z=1.5), "do not want it"),  # one moment
        (law(change=0.1), "changes no channel by 0.15"),
        (law(fitted=-3.0), "do not want it"),
    ],
)
def test_a_law_that_does_not_stand_up_is_a_hint_with_the_reason(one: Law, why: str) -> None:
    found = decide(table(FAR, model(one)))
    assert found.kind == "unexplained" and not found.laws
    (hint,) = found.hints
    assert hint.laws == (one,) and why in "; ".join(hint.why)
    assert "coulomb at load.flange" in found.reason and "no name" in found.reason
    assert found.force is not None and "motor.shaft" in found.reason


def test_the_gate_is_the_number_of_candidates_over_a_hundredth() -> None:
    assert threshold(1) == pytest.approx(math.log(100.0))
    assert threshold(80) == pytest.approx(math.log(8000.0))
    for more, kind in ((0.1, "effect_found"), (-0.1, "unexplained")):
        assert decide(table(FAR, model(law(gain=threshold(80) + more)))).kind == kind


@pytest.mark.parametrize(
    ("rms", "force", "kind"),
    [
        (1.05, None, "effect_found"),  # noise needs no force
        (1.3, 0.2, "effect_found"),  # RMS beyond noise 0.83 of 40
        (1.3, 0.6, "unexplained"),  # something acts at a port that the law is not
        (1.3, None, "unexplained"),  # not asked
        (4.4, 0.2, "unexplained"),  # 4.3 of 40 is more than a tenth
        (33.0, 0.0, "unexplained"),
    ],
)
def test_what_is_left_must_be_noise_or_little_that_no_force_explains(
    rms: float, force: float | None, kind: str
) -> None:
    far = model(rms=40.0, force=0.9)
    found = decide(table(far, model(law(), rms=rms, force=force)))
    assert found.kind == kind
    if kind == "unexplained":
        (hint,) = found.hints
        assert hint.left is not None and hint.left.rms == rms
        assert any("more than noise in speed" in text for text in hint.why)


def test_what_was_explained_counts_in_full_where_likelihoods_count_by_logarithms() -> None:
    """Of runs in which casters turn over a wrong moment counts little, and so would all else."""
    declared = replace(model(rms=40.0, force=0.9), fitted=-3.0 * COUNT, unused=-3.0 * COUNT)
    one = model(law(), rms=1.25, force=0.2)
    assert decide(table(declared, one)).kind == "unexplained"
    squares = 2.0 * COUNT * (40.0**2 - 1.0)
    assert decide(table(replace(declared, squares=squares), one)).kind == "effect_found"


def test_a_law_must_leave_less_than_a_free_force_would() -> None:
    """Where it leaves more than noise: a curve with nine knots is no better than a law."""
    for share, kind in ((0.99, "effect_found"), (0.9999, "unexplained")):
        far = model(rms=40.0, force=share)
        found = decide(table(far, model(law(), rms=1.3, force=0.2)))
        assert found.kind == kind
    assert "a free force at motor.shaft would explain more" in found.hints[0].why[-1]


def test_a_law_must_carry_over_to_unused_runs() -> None:
    """Where it leaves more than noise: parameters made the best of it in the runs that they saw."""
    far = model(rms=40.0, force=0.9)
    for fitted, kind in ((1.3, "effect_found"), (1.02, "unexplained")):
        one = model(law(), rms=1.3, force=0.2)
        one = replace(one, left=(one.left[0], left(fitted, purpose="identification")))
        assert decide(table(far, one)).kind == kind


def test_each_law_of_a_set_must_be_missed() -> None:
    both = model(law(), law("delay", "motor.shaft"))
    assert decide(table(FAR, both)).kind == "effect_found"
    spare = model(law(), law("delay", "motor.shaft", gain=2.0), gain=20.0)
    found = decide(table(FAR, model(law()), spare))
    assert [x.effect for x in found.laws] == ["coulomb"]
    unknown = replace(law("delay", "motor.shaft"), missed=None)
    assert decide(table(FAR, model(law(), unknown))).kind == "unexplained"


@pytest.mark.parametrize("columns", [3, 4])
def test_delays_of_all_columns_of_a_log_are_none(columns: int) -> None:
    """Only delays against each other can be seen; the twin has a column that is in time."""
    late = [law("delay", f"log.{name}") for name in ("u", "y", "phi")]
    found = decide(replace(table(FAR, model(*late)), columns=columns))
    assert found.kind == ("unexplained" if columns == 3 else "effect_found")
    if columns == 3:
        assert any("delays every column of the log" in why for why in found.hints[0].why)


def test_two_laws_that_the_data_do_not_tell_apart_are_confounded() -> None:
    rivals = (model(law(), gain=1.0), model(law("cogging", "motor.shaft")))
    found = decide(table(FAR, *rivals, alike=((1, 2),)))
    assert found.kind == "confounded" and found.others == (("cogging at motor.shaft",),)
    assert decide(table(FAR, *rivals)).kind == "effect_found"


def test_a_rival_of_one_of_two_laws_is_no_rival_of_both() -> None:
    drift = law("delay", "motor.shaft")
    both, other = model(law(), drift), model(law("cogging", "motor.shaft"), drift)
    found = decide(table(FAR, both, other, alike=((1, 2),)))
    assert found.kind == "confounded" and len(found.others) == 1
    rival = ("cogging at motor.shaft", "coulomb at load.flange")
    first, second = rival if found.others == (rival[:1],) else rival[::-1]
    assert f"but so does {first} in place of {second}." in found.reason
    (alternative,) = found.to_dict()["alternatives"]
    assert (alternative["effects"], alternative["instead_of"]) == ([first], [second])


def test_a_set_that_a_wider_bound_makes_needless_has_no_name() -> None:
    far = Value("J", "kg.m2", 0.1, 0.09, 0.11, 0.005, 0.08, True)
    for gain, kind in ((-3.0, "unexplained"), (500.0, "effect_found")):
        named = replace(model(law()), beyond=Gain(gain, gain, 20.0, 20.0, 3.0))
        open_ = replace(model(), gain=Gain(900.0, 900.0, 20.0, 20.0, 3.0))
        found = decide(replace(table(FAR, named), opened=open_, bounds=(far,)))
        assert found.kind == kind
        assert ("J beyond its bound 0.08, at 0.1 [0.09, 0.11] kg.m2" in found.reason) == (
            gain < 0.0
        )
        bounds = {n: v["bounds"] for n, v in found.to_dict()["bounds_opened"].items()}
        assert bounds == ({"J": [0.005, 0.08]} if gain < 0.0 else {})
    content = json.loads(json.dumps(replace(table(FAR), opened=open_, bounds=(far,)).to_dict()))
    assert Table.read(content).opened == open_


def test_laws_are_compared_with_the_one_to_be_named_where_little_is_to_be_explained() -> None:
    """A better one that cannot be named, with half of the evidence, hides no rival of it."""
    found = [
        replace(model(*laws), fitted=-fitted, unused=-unused)
        for laws, fitted, unused in (
            ((), 30.0, 68.0),
            ((law("delay", half=1.0),), 30.0, 15.0),
            ((law("coulomb"),), 21.0, 36.5),
            ((law("bristle", "motor.shaft"),), 20.6, 38.0),
            ((law("viscous"),), 28.0, 66.0),
        )
    ]
    assert comparable(table(*found)) == [1, 2, 3]


def test_a_law_is_no_name_where_one_without_a_known_strength_does_better() -> None:
    """Of a winding that warms up a product of two parameters shows; a wrong gain is no answer."""
    product = law("temperature_drift", value=0.3, half=0.4)
    vague = model(product, gain=50.0)
    found = decide(table(FAR, model(law()), vague))
    assert found.kind == "unexplained"
    first, second = found.hints
    assert first.laws == (product,) and "absence" in first.why[0]
    assert second.why == ("temperature_drift at load.flange does better, and cannot be named",)
    # not where it does no better, has the law, is a general case of it, or takes more laws
    assert decide(table(FAR, model(law()), vague, alike=((1, 2),))).kind == "effect_found"
    others = (
        model(product, gain=1.0),
        model(law(), product, gain=50.0),
        model(law("bristle", value=0.3, half=0.4, contains=("coulomb",)), gain=50.0),
        model(product, law("delay", "motor.shaft"), gain=50.0),
    )
    for other in others:
        assert decide(table(FAR, model(law()), other)).kind == "effect_found"


def test_fewer_laws_that_do_the_same_are_named() -> None:
    """Two sensors that are late by as much as a command is."""
    late = law("delay", "motor.shaft"), law("delay", "gearbox.flange_a")
    sets = model(law(), *late, gain=4.0), model(law(), law("first_order_lag", "motor.shaft"))
    found = decide(table(FAR, *sets, alike=((1, 2),)))
    assert found.kind == "effect_found"
    assert [x.effect for x in found.laws] == ["coulomb", "first_order_lag"]
    # told apart by the data, all three are there
    assert len(decide(table(FAR, *sets)).laws) == 3


def test_the_same_law_elsewhere_is_another_place_and_no_rival() -> None:
    rivals = (model(law(), gain=1.0), model(law(place="gearbox.flange_a")))
    found = decide(table(FAR, *rivals, alike=((1, 2),)))
    assert found.kind == "effect_found"
    assert found.places == {"coulomb at load.flange": ("gearbox.flange_a",)}
    twin = law(twins=("bristle at motor.shaft",))
    assert decide(table(FAR, model(twin))).places == {twin.label: ("bristle at motor.shaft",)}


def test_a_law_that_does_the_same_with_a_strength_that_does_not_show_is_said() -> None:
    """It is there, or leaving it out would do as well; beside another law that says nothing."""
    vague = law("payload", "base.body", value=0.3, half=0.4)
    found = decide(table(FAR, model(law(), gain=1.0), model(vague), alike=((1, 2),)))
    assert found.kind == "effect_found" and found.laws == (law(),)
    assert found.places == {"coulomb at load.flange": ("payload at base.body",)}
    assert "no effect of the catalogue does better. The data do not tell coulomb" in found.reason
    assert found.reason.endswith("coulomb at load.flange from payload at base.body.")
    clear = law("viscous", "motor.shaft")
    other = model(law("delay", "motor.shaft"), vague)
    found = decide(table(FAR, model(law(), clear, gain=1.0), other, alike=((1, 2),)))
    assert not any(found.places.values())


@pytest.mark.parametrize("more", [0.0, 1.0])
def test_a_law_and_its_special_case_are_one_answer(more: float) -> None:
    """The simpler one is named, though its likelihood is less by a hair."""
    simple, general = law(), law("bristle", own=4, contains=("coulomb",))
    found = decide(table(FAR, model(simple), model(general, gain=more), alike=((1, 2),)))
    assert found.kind == "effect_found" and [x.effect for x in found.laws] == ["coulomb"]
    # told apart by the data, the general one is what is there
    apart = decide(table(FAR, model(simple, rms=1.2), model(general)))
    assert [x.effect for x in apart.laws] == ["bristle"]


@pytest.mark.parametrize("more", [0.0, 3.0])
def test_of_as_many_parameters_the_special_case_is_named(more: float) -> None:
    """Dry friction whose sticking speed was fitted, not one whose asymmetry is 0 within noise."""
    simple, general = law(own=2), law("bristle", own=2, contains=("coulomb",))
    found = decide(table(FAR, model(general, gain=more), model(simple), alike=((1, 2),)))
    assert [x.effect for x in found.laws] == ["coulomb"]
    apart = decide(table(FAR, model(general), model(simple, rms=1.2)))
    assert [x.effect for x in apart.laws] == ["bristle"]


@pytest.mark.parametrize("special", [True, False])
def test_sets_of_special_cases_are_one_answer_law_by_law(special: bool) -> None:
    """Whichever place a law has in its set; a set with another law is a rival."""
    simple = model(law(), law("unbalance"))
    other = ("unbalance",) if special else ()
    general = model(
        law("cogging", own=3, contains=other), law("bristle", own=4, contains=("coulomb",))
    )
    found = decide(table(FAR, simple, general, alike=((1, 2),)))
    assert found.kind == ("effect_found" if special else "confounded")
    assert not special or [x.effect for x in found.laws] == ["coulomb", "unbalance"]


@pytest.mark.parametrize(("known", "named"), [(False, "coulomb"), (True, "bristle")])
def test_a_law_of_which_only_its_special_case_shows_is_that(known: bool, named: str) -> None:
    """Though it does a little better: of what is open, something always fits noise."""
    span = (0.9, 1.1) if known else (0.0, 9.0)
    extra = (Value("x_0", "rad", 1.0, *span, 0.0, 9.0, True),)
    simple = law()
    general = law("bristle", own=4, contains=("coulomb",), extra=extra)
    found = decide(table(FAR, model(simple), model(general, gain=90.0)))
    assert [x.effect for x in found.laws] == [named]
    much = decide(table(FAR, model(simple, gain=-9000.0), model(general)))
    assert [x.effect for x in much.laws] == ["bristle"]


def test_a_strength_that_cannot_be_0_must_leave_its_bound() -> None:
    """A delay is fitted from a tick on, an elastic shaft from the stiffest one."""
    size = Value("t_d", "s", 0.002, 0.001, 0.004, 0.001, 0.5, True)
    one = replace(law("delay"), strength="t_d", values=(size,))
    assert decide(table(FAR, model(one))).kind == "unexplained"
    free = replace(one, values=(replace(size, low=0.0015),))
    assert decide(table(FAR, model(free))).kind == "effect_found"


def test_data_that_cannot_be_used_end_there() -> None:
    found = decide(Table(errors=("MS, current: it is late",)))
    assert (found.kind, found.reason) == ("bad_data", "MS, current: it is late")
    assert found.to_dict()["effects"] == []


def test_a_first_order_is_a_hint_at_most() -> None:
    rough = replace(model(replace(law(), missed=None), rms=1.0), rough=True, left=())
    found = decide(table(FAR, rough))
    assert found.kind == "unexplained"
    assert found.hints[0].rough and "to first order" in found.reason


def test_the_nearest_set_is_the_first_hint_without_laws_that_add_nothing() -> None:
    near, spare = law("delay"), law("viscous", gain=1.0, fitted=1.0, half=9.0)
    far = model(law("cogging"), rms=4.5, force=0.9)
    close = model(near, rms=1.3, force=0.9)
    both = model(near, spare, rms=1.29, force=0.9)
    found = decide(table(FAR, far, both, close))
    assert found.kind == "unexplained"
    assert [[x.effect for x in hint.laws] for hint in found.hints] == [["delay"], ["cogging"]]


def test_fewer_laws_are_asked_where_the_data_do_not_tell_them_from_the_best() -> None:
    late = [law("delay", place, gain=900.0) for place in ("motor.shaft", "gearbox.flange_a")]
    friction = law("coulomb", "load.flange")
    command = law("delay", "load.flange", gain=900.0)
    three, two = model(*late, friction), model(command, friction)
    open_ = replace(two, laws=tuple(replace(item, missed=None) for item in two.laws))
    assert unasked(table(FAR, three, open_, alike=((1, 2),)), 1) == [2]
    assert unasked(table(FAR, three, open_), 1) == []  # told apart
    assert unasked(table(FAR, three, two, alike=((1, 2),)), 1) == []  # asked before
    assert proposal(table(FAR, three, two, alike=((1, 2),))) == 2
    assert unasked(table(FAR, open_, three, alike=((1, 2),)), 1) == []  # more laws


def test_as_many_laws_that_do_better_are_asked_law_by_law() -> None:
    """They are told from the best only once it is known that each of them is missed."""
    friction = law("coulomb", "load.flange")
    scrub, turning = (law(name, "crawler.body") for name in ("pivot_torque", "turning_friction"))
    known = model(scrub, friction)
    better, worse = (
        model(replace(turning, missed=None), friction, gain=gain) for gain in (70.0, -70.0)
    )
    assert unasked(table(FAR, known, better), 1) == [2]
    assert unasked(table(FAR, known, worse), 1) == []
    assert unasked(table(FAR, known, model(turning, friction, gain=70.0)), 1) == []  # asked before


@pytest.mark.parametrize(("value", "kind"), [(3e-4, "nothing_missing"), (6e-4, "effect_found")])
def test_a_time_within_a_tick_of_the_rig_is_no_cause(value: float, kind: str) -> None:
    late = law("delay", "log.speed", value=value, half=1e-4, gain=40.0, z=5.0, tick=5e-4)
    found = decide(table(model(), model(late)))
    assert found.kind == kind


@pytest.mark.parametrize(
    ("slow", "p_value", "named"), [(1.5, 1e-9, False), (1.15, 1e-9, True), (1.5, 4e-3, True)]
)
def test_a_set_that_leaves_slow_parts_has_no_name(slow: float, p_value: float, named: bool) -> None:
    """Though it is no larger than noise; 1.15 is what laws leave that are too small for a name."""
    one = model(law("coulomb", "motor.shaft"), rms=1.05)
    rest = (
        replace(left(1.05), p_value=p_value, slow=slow), left(1.0, "current"),
        left(1.0, purpose="identification"),
    )  # fmt: skip
    verdict = decide(table(FAR, replace(one, left=rest)))
    assert (verdict.kind == "effect_found") == named
    if not named:
        assert verdict.kind == "unexplained"
        why = "it leaves more than noise in speed (slow parts of 1.5 times its noise's)"
        assert why in verdict.hints[0].why
        assert "leave speed at slow parts of 1.5 times its noise's" in verdict.reason


@pytest.mark.parametrize(
    ("change", "gain", "named"), [(0.1, 90.0, True), (0.1, 5.0, False), (0.2, 90.0, False)]
)
def test_what_a_law_too_small_for_a_name_does_is_not_left(
    change: float, gain: float, named: bool
) -> None:
    """Beside it a set is judged; not beside one that unused runs do not want, or a larger one."""
    one, small = law("coulomb", "motor.shaft"), law(gain=gain, fitted=50.0, change=change)
    rest = (
        replace(left(1.05), p_value=1e-9, slow=1.24), left(1.0, "current"),
        left(1.0, purpose="identification"),
    )  # fmt: skip
    alone = replace(model(one, rms=1.05), left=rest)
    both = model(replace(one, missed=None), small)
    both = replace(both, gain=alone.gain)
    verdict = decide(table(FAR, alone, both))
    assert (verdict.kind == "effect_found") == named
    if named:
        assert [x.label for x in verdict.laws] == [one.label] and not verdict.left


def test_slow_parts_of_a_model_without_laws_are_no_ground_for_one() -> None:
    """Noise may be slow itself: silence asks for less than a name."""
    rest = tuple(replace(x, p_value=1e-9, slow=1.5) for x in CLEAN.left)
    assert decide(table(replace(CLEAN, left=rest))).kind == "nothing_missing"
