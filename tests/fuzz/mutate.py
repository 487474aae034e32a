"""Inputs that are almost right: bytes, texts, XML, TOML and JSON changed in a few places."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable, Sequence
from typing import Any

Mutation = Callable[[random.Random, bytes], bytes]

NUMBERS = (
    "0", "-1", "1", "2", "255", "256", "-2147483649", "2147483648", "4294967295", "4294967296",
    "9007199254740993", "9223372036854775808", "18446744073709551616", "1e308", "-1e-308", "1e400",
    "nan", "inf", "-inf", "NaN", "INF", "0x10", "1_0", "٣", "", " ", "1.5", "1,5", "9" * 40,
    "1000000", "2000000000", "1e-9",
)  # fmt: skip
"""Numbers at and beyond the ends of types, and what looks like one."""
TEXTS = (
    "", " ", "a", "..", "../x", "/", "C:\\x", "a\\b", "x" * 300, "é", "日本", "\u0000", "\u202e",
    "%s%n", "{a}", "{}", "'", '"', "<", "&", "a.b", "a[1]", "a[0]", "[", "der(x)", "true", "time",
    "🙂" * 20, "\ud7ff", "a\tb", "a\nb", "::", "http://x/[", "file:///etc/passwd", "#a", "?a",
)  # fmt: skip
TOML_VALUES = (
    "5", "-5", "0", "1.5", "nan", "inf", "-inf", "true", "false", '""', '"a"', '"../a"', "[]",
    "[1]", '["a"]', "[[1]]", "[true]", "{}", "{ a = 1 }", "[{}]", "1979-05-27", "07:32:00",
    "1979-05-27T07:32:00Z", "0x" + "f" * 300, "9" * 30, '"\\u0000"', "[1, 2]", '{ a = "b" }',
    "[[], []]", '"{set}"', "1e300", "-0.0", '"\\"', '["a", 1]', '{ from = 1 }',
)  # fmt: skip
JSON_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1.5, 10**30, "", "a", "../a", [], {}, [1], ["a"], [None], [[]],
    {"a": 1}, "x" * 300, "\x00", "é", float("inf"), float("nan"), [[1, 2], [3]], 2**63,
)  # fmt: skip


def _slice(random: random.Random, size: int, longest: int = 64) -> tuple[int, int]:
    begin = random.randrange(size + 1)
    return begin, min(size, begin + random.randrange(1, longest))


def some_bytes(random: random.Random, content: bytes) -> bytes:
    """Change some bytes, take some out, put some in, cut the end off."""
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 1, 2, 4, 16))):
        kind = random.randrange(8)
        begin, end = _slice(random, len(changed))
        if kind == 0 and changed:
            changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
        elif kind == 1 and changed:
            changed[random.randrange(len(changed))] = random.choice((0, 1, 0x7F, 0x80, 0xFF, 0x22))
        elif kind == 2:
            del changed[begin:end]
        elif kind == 3:
            changed[begin:begin] = random.randbytes(random.randrange(1, 9))
        elif kind == 4:
            changed[begin:begin] = changed[begin:end]
        elif kind == 5 and len(changed) >= 8:
            place = random.randrange(len(changed) - 7)
            width = random.choice((2, 4, 8))
            value = random.choice((0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**40))
            changed[place : place + width] = (value % 2 ** (8 * width)).to_bytes(
                width, random.choice(("little", "big"))
            )
        elif kind == 6 and random.random() < 0.3:
            del changed[random.randrange(len(changed) + 1) :]
        else:
            other, last = _slice(random, len(changed))
            changed[begin : begin + last - other] = changed[other:last]
    return bytes(changed)


def _replaced(random: random.Random, text: str, pattern: str, new: str) -> str:
    places = list(re.finditer(pattern, text))
    if not places:
        return text
    place = random.choice(places)
    return text[: place.start()] + new + text[place.end() :]


def some_text(random: random.Random, content: bytes) -> bytes:
    """Change a number, a word, a line."""
    text = content.decode("utf-8", "surrogateescape")
    kind = random.randrange(6)
    if kind == 0:
        text = _replaced(random, text, r"-?\d+(\.\d+)?", random.choice(NUMBERS))
    elif kind == 1:
        text = _replaced(random, text, r"\w+", random.choice(TEXTS))
    elif kind == 2:
        text = _replaced(random, text, r"[^\w\s]", random.choice(",;:=[]{}()<>\"'#&/\\.|"))
    else:
        lines = text.split("\n")
        place, other = random.randrange(len(lines)), random.randrange(len(lines))
        if kind == 3:
            del lines[place]
        elif kind == 4:
            lines.insert(place, lines[other])
        else:
            lines[place], lines[other] = lines[other], lines[place]
        text = "\n".join(lines)
    return text.encode("utf-8", "surrogateescape" if content.isascii() is False else "replace")


def some_xml(random: random.Random, content: bytes) -> bytes:
    """Change, drop, double or move attributes and elements."""
    text = content.decode("utf-8", "surrogateescape")
    attributes = list(re.finditer(r'\s([\w:]+)="([^"]*)"', text))
    elements = list(re.finditer(r"<[\w:]+[^<>]*/>|<([\w:]+)[^<>]*>[^<>]*</\1>", text))
    kind = random.randrange(9)
    if kind < 5 and attributes:
        one, other = random.choice(attributes), random.choice(attributes)
        value = random.choice((*NUMBERS, *TEXTS, other[2], other[2]))
        value = "".join(f"&#{ord(c)};" if c in '<&"\t\n' else c for c in value)
        new = {
            0: f' {one[1]}="{value}"', 1: "", 2: f' {other[1]}="{one[2]}"',
            3: f' {one[1]}="{one[2]} {other[2]}"', 4: f' {one[1]}="{value}"',
        }[kind]  # fmt: skip
        text = text[: one.start()] + new + text[one.end() :]
    elif elements:
        one, other = random.choice(elements), random.choice(elements)
        if kind == 5:
            text = text[: one.start()] + text[one.end() :]
        elif kind == 6:
            text = text[: one.start()] + one[0] * random.choice((2, 3, 50)) + text[one.end() :]
        elif kind == 7:
            text = text[: one.start()] + other[0] + text[one.end() :]
        else:
            new = random.choice((
                "<![CDATA[x]]>", "<!-- -->", "<?a b?>", "&lt;", "&nbsp;", "<x/>", "text",
                "<x>" * 300,                "<!DOCTYPE a>", f"<{one[1] or 'y'} xmlns='u'/>",
            ))  # fmt: skip
            text = text[: one.start()] + new + text[one.start() :]
    return text.encode("utf-8", "surrogateescape")


def some_toml(random: random.Random, content: bytes) -> bytes:
    """Change values, keys, tables."""
    text = content.decode("utf-8", "replace")
    kind = random.randrange(6)
    values = list(re.finditer(r"(?m)= *([^\n#]+)$", text))
    inner = list(re.finditer(r'"[^"\n]*"|-?\d[\d.e-]*|\[[^\[\]\n]*\]|\{[^{}\n]*\}', text))
    if kind < 2 and values:
        one = random.choice(values)
        text = f"{text[: one.start(1)]}{random.choice(TOML_VALUES)}{text[one.end(1) :]}"
    elif kind == 2 and inner:
        one = random.choice(inner)
        text = text[: one.start()] + random.choice(TOML_VALUES) + text[one.end() :]
    elif kind == 3:
        keys = re.findall(r"(?m)^ *([\w.]+) *=", text) or ["a"]
        new = f"{random.choice(keys)} = {random.choice(TOML_VALUES)}"
        lines = text.split("\n")
        lines.insert(random.randrange(len(lines) + 1), new)
        text = "\n".join(lines)
    elif kind == 4:
        quoted = random.choice(TEXTS).encode("unicode_escape").decode().replace('"', '\\"')
        text = _replaced(random, text, r'"[^"\n]*"', f'"{quoted}"')
    else:
        return some_text(random, content)
    return text.encode("utf-8", "replace")


def some_json(random: random.Random, content: bytes) -> bytes:
    """Change, drop or move values at any depth."""
    try:
        whole = json.loads(content)
    except ValueError:
        return some_bytes(random, content)
    places: list[tuple[Any, Any]] = []

    def walk(item: Any) -> None:
        for key in list(item) if isinstance(item, dict) else range(len(item)):
            places.append((item, key))
            if isinstance(item[key], (dict, list)):
                walk(item[key])

    if isinstance(whole, (dict, list)):
        walk(whole)
    for _ in range(random.choice((1, 1, 2, 3))):
        if not places:
            break
        owner, key = random.choice(places)
        kind = random.randrange(4)
        if kind == 0 and isinstance(owner, dict):
            owner.pop(key, None)
        elif kind == 1 and isinstance(owner, dict):
            owner[random.choice(TEXTS)] = owner.get(key)
        else:
            value = random.choice(JSON_VALUES)
            if isinstance(owner, dict) or key < len(owner):
                owner[key] = value
    try:
        return json.dumps(whole).encode("utf-8", "replace")
    except ValueError:  # put into itself
        return content


def repeated(mutation: Mutation, others: Sequence[Mutation] = (some_bytes,)) -> Mutation:
    """One to four changes of a kind, now and then others."""

    def mutate(random: random.Random, content: bytes) -> bytes:
        for _ in range(random.choice((1, 1, 1, 2, 3, 4))):
            chosen = mutation if random.random() < 0.85 or not others else random.choice(others)
            content = chosen(random, content)
        return content

    return mutate
