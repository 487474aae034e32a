"""Parts of a report that not every diagnosis has: nearest laws, and a law learnt from the data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..diagnose.story.facts import Facts
from ..diagnose.whiteness import CALIBRATED
from ..display.document import section
from ..display.html import Cell, Html, number, quantity, table, tag, unit, words
from ..display.plot import Curve, Panel, plot
from ..display.series import Store


def hints(facts: Facts) -> Html:
    """Laws that come nearest to what has no name, with what they would take; "" without any."""
    rows = []
    for item in facts.table.get("hints") or []:
        names = [tag("code", f"{law['effect']} at {law['place']}") for law in item["effects"]]
        takes = [
            f"{name} = {quantity(value['value'], value['unit'])}"
            for law in item["effects"]
            for name, value in law["parameters"].items()
        ]
        left = item.get("left")
        rows.append(
            [words(names), _share(item["explained"], item.get("first_order", False)),
             Cell(", ".join(takes) or "–", kind="text"),
             Cell(f"{left['channel']} at {left['times_noise']:.2f}×" if left else "–",
                  left["times_noise"] if left else None, "text"),
             Cell("; ".join(item["why"]), kind="text")]
        )  # fmt: skip
    return section(
        "hints", "Nearest laws",
        tag("p", "None of these explains the data; what they would take says how far they are "
            "from it."),
        table(["law", "would explain", "with", "leaves (over noise)", "why it is no name"], rows,
              "nearest laws"),
    ) if rows else Html("")  # fmt: skip


def _share(value: float, rough: bool) -> Cell:
    return Cell(f"{100 * value:.1f} %" + (", to first order" if rough else ""), value)


def law(facts: Facts, store: Store) -> Html:
    """A law learnt from the data: its curve with its uncertainty, and errors; "" without one."""
    found = facts.table.get("law_from_data")
    if not found:
        return Html("")
    curve: Mapping[str, Any] = found["curve"]
    at, value = np.array(curve["at"]), np.array(curve["value"])
    edge = 2.0 * np.array(curve["deviation"])
    store.put_axis("law/at", at)
    store.put("law/value", value)
    store.put("law/edge", value - edge)
    store.put("law/edge^", value + edge)
    of = f" [{unit(found.get('unit', ''))}]" if unit(found.get("unit", "")) else ""
    rows = []
    for name, row in found.get("channels", {}).items():
        noise = row["noise_rms"]
        rows.append([name, *(_error(row.get(which), noise) for which in ("before", "after"))])
    return section(
        "law", "A law from the data",
        tag("p", "No law of the catalogue fits, so a free curve was fitted with all parameters and "
            "judged on unused runs. It says what the missing law looks like, not what it is."),
        plot(
            f"law from the data at {found.get('place', '')}",
            [Panel(f"added at {found.get('place', '')}{of}", [
                Curve("± 2 σ", "measured", "law/at", "law/edge", fill=0.3),
                Curve("law", "after", "law/at", "law/value", dots=True)], height=240, short="law")],
            axis=str(curve["driver"]).replace("_", " "), group="law",
        ),
        table(["channel", "before", "after"], rows, "errors with the law"),
    )  # fmt: skip


def _error(value: float | None, noise: float) -> Cell:
    if value is None:
        return Cell("–")
    ratio = value / noise
    return Cell(f"{number(value)} ({ratio:.2f}×)", ratio, "over" if ratio > CALIBRATED else "good")
