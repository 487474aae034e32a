"""Reports in a browser: drawn, usable by mouse, keyboard and on a phone, without a network."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from cosim.report.page import rendered
from tests import browser
from tests.report.stories import VERDICTS, material

pytestmark = pytest.mark.slow

EXECUTABLE = browser.find()
INK = """
[...document.querySelectorAll(".plot canvas")].map((canvas) => {
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const colours = new Set();
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] > 200) colours.add(`${data[i] >> 4} ${data[i + 1] >> 4} ${data[i + 2] >> 4}`);
  }
  return colours.size;
})
"""
"""How many colours each plot has: a grid alone has fewer than four."""
PLOTS = "[...document.querySelectorAll('.plot')].filter((p) => p.clientWidth)"


@pytest.fixture(scope="module")
def shown() -> Iterator[browser.Browser]:
    if EXECUTABLE is None:
        pytest.skip(f"none of {', '.join(browser.NAMES)} is installed")
    with browser.browser(EXECUTABLE) as found:
        yield found


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("reports")
    found = {}
    for verdict in VERDICTS:
        found[verdict] = folder / f"{verdict}.html"
        found[verdict].write_text(rendered(material(verdict)), "utf-8")
    return found


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_report_is_drawn_without_errors_and_without_a_network(
    shown: browser.Browser, pages: dict[str, Path], verdict: str
) -> None:
    shown.open(pages[verdict])
    assert shown.errors == [] and shown.requests == []
    colours = shown.run(INK)
    # the first plot and one per channel at least; each has its curves in colours of their own
    assert len(colours) >= 3 and min(colours) >= 4
    assert shown.run(f"{PLOTS}.every((p) => +p.dataset.drawn >= 1)")


def test_errors_and_requests_of_a_page_are_seen(shown: browser.Browser, tmp_path: Path) -> None:
    path = tmp_path / "broken.html"
    path.write_text('<img src="http://127.0.0.1:9/x.png"><script>nothing.there()</script>')
    shown.open(path)
    assert any("nothing is not defined" in text for text in shown.errors)
    assert shown.requests == ["http://127.0.0.1:9/x.png"]


@pytest.mark.parametrize("verdict", VERDICTS)
def test_on_a_phone_nothing_is_cut_off(
    shown: browser.Browser, pages: dict[str, Path], verdict: str
) -> None:
    shown.open(pages[verdict], 390, 844, mobile=True)
    assert shown.run("document.documentElement.scrollWidth") == 390
    # what is wider than the page lies in a box that scrolls
    assert shown.run("""
        [...document.querySelectorAll("body *")].filter((item) =>
          item.getBoundingClientRect().right > 391 && !item.closest(".wide, .drawing"))
        .map((item) => item.outerHTML.slice(0, 80))
    """) == []  # fmt: skip
    assert shown.run("document.querySelector('.wide').scrollWidth") >= 0
    assert shown.errors == []


def test_a_drag_zooms_all_plots_of_a_group_and_a_double_click_resets(
    shown: browser.Browser, pages: dict[str, Path]
) -> None:
    shown.open(pages["effect_found"])
    shown.run("document.querySelector('#signals').scrollIntoView()")
    box = shown.run("""(() => { const b = document.querySelector("#signals canvas")
        .getBoundingClientRect(); return [b.x, b.y, b.width]; })()""")
    x, y, width = box
    for kind, at in (("mousePressed", 0.3), ("mouseMoved", 0.4), ("mouseMoved", 0.6),
                     ("mouseReleased", 0.6)):  # fmt: skip
        shown.mouse(kind, x + at * width, y + 60, button="left", buttons=1, clickCount=1)
    ranges = (
        "[...new Set(plots.filter((p) => p.config.group === 'all').map((p) => p.range.join()))]"
    )
    (zoomed,) = shown.run(ranges)
    low, high = map(float, zoomed.split(","))
    assert 0.05 < low < 0.2 and 0.15 < high < 0.3  # of 0 to 0.399 s
    assert shown.run("plots.find((p) => p.config.group === 'first').group.range") is None
    shown.mouse("mouseMoved", x + 0.5 * width, y + 60)
    reader = shown.run("document.querySelector('#signals .reader').innerText")
    assert "time: " in reader and "speed measured: " in reader and "model after" in reader
    for count in (1, 2):
        for kind in ("mousePressed", "mouseReleased"):
            shown.mouse(kind, x + 0.5 * width, y + 60, button="left", clickCount=count)
    (whole,) = shown.run(ranges)
    assert [float(v) for v in whole.split(",")] == pytest.approx([0.0, 0.399])
    assert shown.errors == []


def test_curves_are_hidden_and_runs_are_chosen(
    shown: browser.Browser, pages: dict[str, Path]
) -> None:
    shown.open(pages["effect_found"])
    before = shown.run(f"({INK.strip()})[0]")
    shown.run("[...document.querySelectorAll('.key')].find((k) => k.innerText === 'model before')"
              ".click()")  # fmt: skip
    assert shown.run(f"({INK.strip()})[0]") < before
    shown.run("""(() => { const s = document.querySelector(".plot select"); s.value = "R0";
        s.dispatchEvent(new Event("change")); })()""")
    assert shown.run("plots[0].run") == "R0" and shown.errors == []


def test_the_keyboard_reads_zooms_and_explains(
    shown: browser.Browser, pages: dict[str, Path]
) -> None:
    shown.open(pages["effect_found"])
    shown.run("document.querySelector('canvas').focus()")

    def press(key: str) -> None:
        shown.call("Input.dispatchKeyEvent", type="keyDown", key=key)

    press("ArrowRight")
    assert shown.run("document.querySelector('.reader').hidden") is False
    press("+")
    assert shown.run("plots[0].group.range[1] - plots[0].group.range[0]") == pytest.approx(0.1995)
    press("Escape")
    assert shown.run("plots[0].group.range") is None
    shown.run("document.querySelector('abbr[data-tip]').focus()")
    assert shown.run("document.querySelector('.bubble').hidden") is False
    assert shown.run("document.querySelector('.bubble').innerText").strip()


def test_tables_sort_by_numbers_and_gaps_stay_below(
    shown: browser.Browser, pages: dict[str, Path]
) -> None:
    shown.open(pages["effect_found"])
    column = """(() => {
        const table = document.querySelector("#candidates table");
        const head = [...table.tHead.rows[0].cells].find((c) => c.innerText.startsWith("refit"));
        head.querySelector("button").click();
        return [head.ariaSort, ...[...table.tBodies[0].rows].map(
            (row) => row.cells[head.cellIndex].innerText)];
    })()"""
    assert shown.run(column) == ["descending", "1234", "–"]
    assert shown.run(column) == ["ascending", "1234", "–"]


def test_paper_shows_what_is_folded_and_has_no_buttons(
    shown: browser.Browser, pages: dict[str, Path]
) -> None:
    shown.open(pages["effect_found"])
    assert len(shown.call("Page.printToPDF")["data"]) > 50_000
    shown.call("Emulation.setEmulatedMedia", media="print")
    display = "getComputedStyle(document.querySelector('{}')).display"
    assert shown.run(display.format("button.copy")) == "none"
    assert shown.run(display.format("th button")) != "none" != shown.run(display.format(".key"))
    shown.call("Emulation.setEmulatedMedia", media="")
    assert shown.run("document.querySelector('details').open") is False  # as it was before
