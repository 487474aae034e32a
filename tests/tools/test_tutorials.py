"""The code of tutorials runs and prints what they say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.tools.pages import MARK, ROOT, Page

PAGES = [
    path
    for path in (ROOT / "README.md", ROOT / "sources/README.md", *sorted(ROOT.glob("docs/**/*.md")))
    if MARK.search(path.read_text(encoding="utf-8"))
]


@pytest.mark.slow
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_code_of_a_page_runs(path: Path, tmp_path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    page = Page(tmp_path)
    page.run(text)
    assert page.ran == len(re.findall(r"^<!-- run", text, flags=re.M)) > 0


def test_tutorials_have_code_that_runs() -> None:
    assert {"tutorial_fmu", "tutorial_run", "tutorial_missing", "tutorial_write"} <= {
        path.stem for path in PAGES
    }


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<!-- run -->\n```python\nprint(1 + 1)\n```\n<!-- output -->\n```text\n3\n```\n", "'3'"),
        ("<!-- run -->\n```python\nraise ValueError('no')\n```\n", "ValueError: no"),
        ("<!-- run -->\n```sh\nfalse\n```\n", "false"),
        ("<!-- run: fails -->\n```sh\ntrue\n```\n", "true"),
        ("<!-- run -->\n```toml\na = 1\n```\n", "'toml' cannot run"),
        ("<!-- run -->\nno block\n", "no block of code"),
    ],
)
def test_what_does_not_do_as_a_page_says_is_found(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError) as caught:
        Page(tmp_path).run(text)
    assert said in str(caught.value)


def test_blocks_share_names_files_and_a_folder(tmp_path: Path) -> None:
    page = Page(tmp_path)
    page.run(
        "<!-- file: a/b.txt -->\n```text\nhere\n```\n<!-- run -->\n```python\nx = 41\n```\n"
        "plain\n```python\nraise ValueError\n```\n"
        "<!-- run -->\n```python\nprint(x + 1, open('a/b.txt').read())\n```\n"
        "<!-- output -->\n```text\n42 here\n```\n<!-- run: fails -->\n```sh\ncat gone\n```\n"
    )
    assert page.ran == 3
