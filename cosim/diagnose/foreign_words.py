"""What a verdict says of FMUs without sources: whether what is missing lies inside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .answer import Verdict
from .foreign import EFFORTS, Adapter
from .localise import Place
from .models import GATE

CLEAR = 0.5
"""Share of what exceeds the noise from which a free force is said to tell the place."""


def placed(place: str, adapters: Sequence[Adapter]) -> str:
    """The balance that a place of a law means, `fan.tau` that of the adapter there."""
    for adapter in adapters:
        if adapter.at == place and adapter.role != "sensor":
            return f"{adapter.name}.{'inside' if adapter.fidelity in EFFORTS else 'value'}"
    return place


def said(verdict: Verdict, located: Sequence[Place], adapters: Sequence[Adapter]) -> str:
    """Whether what is missing lies inside an FMU without sources, "" where there is none."""
    known = {a.name: a for a in adapters}
    if not known:
        return ""
    if verdict.kind in ("effect_found", "confounded"):
        return " ".join(_of_laws(verdict, known))
    if verdict.kind == "unexplained":
        return _of_force(located, known)
    return ""


def _of_laws(verdict: Verdict, known: Mapping[str, Adapter]) -> list[str]:
    """Sentences on the named laws and what does as well."""
    found = []
    rivals = [_place(label) for labels in verdict.others for label in labels]
    for law in verdict.laws:
        others = [_place(label) for label in verdict.places.get(law.label, ())]
        if len(verdict.laws) == 1:
            others += rivals
        ways = {_side(place, known) for place in (law.place, *others)}
        adapter, inside = known.get(law.component), _side(law.place, known)
        apart = sorted({p for p in others if _side(p, known) != inside})
        it = "It" if len(verdict.laws) == 1 else f"{law.effect} at {law.place}"
        if len(ways) > 1:
            names = " or ".join(f"inside {name}" for name in sorted(ways - {""}))
            outside = " or outside" if "" in ways else ""
            shown = dict.fromkeys(
                known[i].at if (i := place.partition(".")[0]) in known else place
                for place in (law.place, *apart)
            )
            found.append(
                f"Whether {law.effect} lies {names}{outside}, these runs do not tell "
                f"({' or '.join(shown)}): measure what passes between."
            )
        elif inside:
            at = adapter.at if adapter else law.place
            found.append(f"{it} lies inside {inside}, whose FMU has no sources: it shows at {at}.")
        elif adapter is not None:
            found.append(f"{it} acts {adapter.where}, and not inside the FMU.")
        else:
            names = " and ".join(sorted({a.foreign for a in known.values()} - {""}))
            found.append(f"{it} lies outside {names}: nothing inside does the same.")
    return list(dict.fromkeys(found))


def _of_force(located: Sequence[Place], known: Mapping[str, Adapter]) -> str:
    """A sentence on the free force."""
    clear = [p for p in located if max(c.explained for c in p.curves) >= CLEAR]
    near = [p for p in clear if p.evidence > clear[0].evidence - GATE]
    sides = {_side(p.label, known) for p in near}
    inside = " or ".join(sorted(sides - {""}))
    if not inside:
        return ""
    labels = dict.fromkeys(known[p.instance].at if p.instance in known else p.label for p in near)
    if len(sides) > 1:
        return (
            f"Whether it lies inside {inside}{' or outside' if '' in sides else ''}, these runs do "
            f"not tell ({' or '.join(labels)}): measure what passes between."
        )
    return (
        f"It lies most likely inside {inside}, whose FMU has no sources: it shows at "
        f"{' and '.join(labels)}."
    )


def _place(label: str) -> str:
    """Of a label, or a place itself."""
    return label.partition(" at ")[2] or label


def _side(place: str, known: Mapping[str, Adapter]) -> str:
    """The instance without sources inside which a place is, "" for all others."""
    adapter = known.get(place.partition(".")[0])
    return adapter.foreign if adapter is not None and adapter.inside else ""
