"""The site of docs/ is built without a network, and its links lead somewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests import browser
from tests.tools.pages import ROOT

pytestmark = pytest.mark.slow
OFFLINE = {name: "http://127.0.0.1:9" for name in ("http_proxy", "https_proxy")}
"""Where nobody answers: who asks for a page of the network fails."""


class Links(HTMLParser):
    """Anchors of a page, links to others, and what it loads itself."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.loaded: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.anchors |= {value for key in ("id", "name") if (value := given.get(key))}
        if tag == "a" and given.get("href"):
            self.links.add(str(given["href"]))
        if tag in ("script", "img", "iframe") and given.get("src"):
            self.loaded.add(str(given["src"]))
        if tag == "link" and "stylesheet" in (given.get("rel") or ""):
            self.loaded.add(str(given["href"]))


def dead(folder: Path) -> list[str]:
    """Links of a site to pages, files or headings that there are not."""
    pages = {path: Links(path.read_text("utf-8")) for path in folder.rglob("*.html")}
    found = []
    for path, page in pages.items():
        for link in page.links | page.loaded:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.loaded and not link.startswith("data:"):
                    found.append(f"{path.relative_to(folder)}: loads {link}")
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            known = pages[target].anchors if target in pages else None
            heading = unquote(parts.fragment)
            # 404.html is shown at any address, so its links begin at the root
            if path.name != "404.html" and (
                not target.exists()
                or (heading and known is not None and heading not in known | {"__comments"})
            ):
                found.append(f"{path.relative_to(folder)}: {link}")
    return found


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for name in ("mkdocs", "material", "mkdocstrings"):
        if find_spec(name) is None:
            pytest.skip(f"{name} is not installed: pip install -e '.[docs]'")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)], cwd=ROOT,
        env={**os.environ, **OFFLINE, "NO_MKDOCS_2_WARNING": "1"}, text=True, capture_output=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_links_lead_somewhere_and_nothing_is_loaded_from_outside(site: Path) -> None:
    assert dead(site) == []


def test_references_say_what_the_code_says(site: Path) -> None:
    commands = (site / "reference/command_line.html").read_text("utf-8")
    assert "cosim fmus build" in commands and "--param" in commands
    keys = (site / "reference/mapping_keys.html").read_text("utf-8")
    assert "despike" in keys and "true or false" in keys
    assert "single samples that stand out are gaps" in keys  # of the page of data sets
    python = (site / "reference/python.html").read_text("utf-8")
    assert "bond_turnover" in python and "read_problem" in python


def test_pages_show_and_search_without_a_server(site: Path) -> None:
    executable = browser.find()
    if executable is None:
        pytest.skip(f"none of {', '.join(browser.NAMES)} is installed")
    with browser.browser(executable) as shown:
        for width in (1400, 390):
            shown.open(site / "tutorial_missing.html", width, 900, mobile=width == 390)
            assert shown.errors == []
            assert not [url for url in shown.requests if url.startswith("http")]
            assert shown.run("document.documentElement.scrollWidth") == width
        shown.open(site / "index.html")
        shown.run("document.querySelector('.md-search__input').focus()")
        for key in "backlash":
            for kind in ("keyDown", "keyUp"):
                text = {"text": key} if kind == "keyDown" else {}
                shown.call("Input.dispatchKeyEvent", type=kind, key=key, **text)
        found = shown.run("""new Promise((done) => {
            const look = () => document.querySelectorAll(".md-search-result__link").length;
            const timer = setInterval(() => {
                if (look()) { clearInterval(timer); done(look()); }
            }, 50);
            setTimeout(() => done(0), 30000);
        })""")
        assert found >= 1 and shown.errors == []


def test_dead_links_and_foreign_scripts_are_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<h1 id="here"></h1><a href="b.html"></a><a href="#gone"></a><a href="#here"></a>'
        '<a href="https://example.org"></a><script src="https://example.org/x.js"></script>'
    )
    found = dead(tmp_path)
    assert sorted(re.sub(r"^a.html: ", "", text) for text in found) == [
        "#gone", "b.html", "loads https://example.org/x.js"
    ]  # fmt: skip
