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
            "from it." if facts.judged else "No run was kept unused to judge these by; what they "
            "would take says how far they are from a name."),
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
    if "curve" not in found:  # none could be made
        return section("law", "No law from the data", tag("p", found["reason"]))
    curve: Mapping[str, Any] = found["curve"]
    of = f" [{unit(found.get('unit', ''))}]" if unit(found.get("unit", "")) else ""
    rows = []
    for name, row in found.get("error", {}).items():
        sizes = (row[which].get(facts.purpose) for which in ("before", "after"))
        rows.append([name, *(_error(size, row["noise_rms"]) for size in sizes)])
    runs = "unused" if facts.judged else "fitted"
    near = [
        [tag("code", f"{item['effect']} at {item['place']}"), item["rms_difference"],
         item[f"{runs}_runs_prefer_the_law_by_nats"]]
        for item in found.get("nearest", [])
    ]  # fmt: skip
    lines = _line(curve, store) if "at" in curve else _slices(found, curve, store)
    return section(
        "law", "A law from the data",
        tag("p", "A law without a name was fitted with all parameters and judged on "
            f"{runs} runs. It says what the missing law looks like, not what it is. ",
            found.get("reason", "")),
        tag("p", "Its form: ", found["formula"], ".") if found.get("formula") else Html(""),
        plot(
            f"law from the data at {found.get('place', '')}",
            [Panel(f"added at {found.get('place', '')}{of}", lines, height=240, short="law")],
            axis=str(curve["driver"]).replace("_", " "), group="law",
        ),
        table(["channel", "before", "after"], rows, f"errors with the law on {runs} runs"),
        table(["named law", f"differs by (RMS){of}", f"worse on {runs} runs [nats]"], near,
              "named laws beside it") if near else Html(""),
    )  # fmt: skip


def _line(curve: Mapping[str, Any], store: Store) -> list[Curve]:
    value, edge = np.array(curve["value"]), 2.0 * np.array(curve["deviation"])
    store.put_axis("law/at", np.array(curve["at"]))
    store.put("law/value", value)
    store.put("law/edge", value - edge)
    store.put("law/edge^", value + edge)
    return [Curve("± 2 σ", "measured", "law/at", "law/edge", fill=0.3),
            Curve("law", "after", "law/at", "law/value", dots=True)]  # fmt: skip


def _slices(found: Mapping[str, Any], curve: Mapping[str, Any], store: Store) -> list[Curve]:
    """A surface along its first signal at three values of its second one."""
    grid = [np.array(curve[name]).reshape(curve["shape"]) for name in ("x", "y", "value")]
    second = found["signals"][-1]["name"].replace("_", " ")
    store.put_axis("law/at", grid[0][:, 0])
    lines = []
    for colour, share in (("before", 0.25), ("after", 0.5), ("other", 0.75)):
        column = round(share * (grid[1].shape[1] - 1))
        store.put(f"law/value {column}", grid[2][:, column])
        name = f"{second} {grid[1][0, column]:.3g}"
        lines.append(Curve(name, colour, "law/at", f"law/value {column}"))
    return lines


def _error(value: float | None, noise: float) -> Cell:
    if value is None:
        return Cell("–")
    ratio = value / noise
    return Cell(f"{number(value)} ({ratio:.2f}×)", ratio, "over" if ratio > CALIBRATED else "good")
