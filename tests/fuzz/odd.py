"""Odd values as YAML text, odd names, and a writer of YAML that takes them as they are."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random
from typing import Any


@dataclass(frozen=True)
class Raw:
    """YAML text that is written as it stands."""

    text: str


_BOMB = "[" + ", ".join(f"&a{i} [{', '.join(['x' if i == 0 else f'*a{i - 1}'] * 9)}]" for i in range(9)) + "]"
SCALARS = (
    *("2001-99-99", "2001-01-01", "!!float abc", "!!int ''", "!!binary ???", "!!python/object/apply:os.getcwd []"),
    *("9" * 5000, "1" + "0" * 400, "1e308", "-1e308", "1e400", "1e-320", ".nan", ".inf", "-.inf", "0x1F", "1_000"),
    *("0", "-1", "1", "2.5", "-0.0", "9223372036854775808", "2147483648", "-2147483649", "true", "false", "null"),
    *("''", "' '", "[]", "{}", "[b]", "[[]]", "[null]", "{a: 1}", "{null: 1}", "{[1]: 2}", "{1: 2}", "[1, 2, 3]"),
    *('"[/x]"', '"[bold]x"', '"a\\u0000b"', '"\\e[31m"', '"\\ud800"', '"a\\nb"', '"\\u202e"', "'é'", '"%s{}"'),
    *("'../../x'", "/etc/passwd", "package://../x", "package://x/../../y", "/dev/null", ".", "'~'", "CON", "-"),
    *("*nope", "&a [*a]", _BOMB, "[" * 200 + "]" * 200, "{a: " * 80 + "1" + "}" * 80, "x" * 100_000, "@", "`"),
    *("hip", "position", "torque", "30 ms", "5 %", "-3 N", "0 s", "1e9 rad", "10 bananas"),
)
NAMES = (
    "[/x]",
    "[red]a",
    "a\u0000b",
    "\x1b[31m",
    "",
    " ",
    "a/b",
    "../a",
    "a\nb",
    "é",
    "x" * 3000,
    "1",
    "null",
    "\u202e",
)
"""Of joints, links, keys."""


class Pairs(list[Any]):
    """A mapping as (key, value) pairs, which may repeat a key."""


def tree(value: Any) -> Any:
    """A document with `Pairs` for its mappings."""
    if isinstance(value, dict):
        return Pairs((key, tree(each)) for key, each in value.items())
    return [tree(each) for each in value] if isinstance(value, list) else value


def yaml_text(value: Any) -> str:
    """YAML in flow style."""
    if isinstance(value, Raw):
        return value.text
    if isinstance(value, Pairs):
        return "{" + ", ".join(f"{_key(key)}: {yaml_text(each)}" for key, each in value) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(yaml_text, value)) + "]"
    return json.dumps(value)


def _key(key: Any) -> str:
    return key.text if isinstance(key, Raw) else json.dumps(key)


def _places(value: Any) -> Iterator[tuple[Any, int]]:
    """(container, index) of everything in a tree."""
    if isinstance(value, list):
        for index, each in enumerate(value):
            yield value, index
            yield from _places(each[1] if isinstance(value, Pairs) else each)


def damage(document: Any, rng: Random) -> str:
    """YAML of a document of which one to three places are odd."""
    root = [tree(document)]
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        places = list(_places(root))
        if places:
            _change(*rng.choice(places), rng)
    return yaml_text(root[0]) if root else ""


def _change(place: Any, index: int, rng: Random) -> None:
    odd = Raw(rng.choice(SCALARS))
    if not isinstance(place, Pairs):
        place[index : index + 1] = rng.choice(([odd], [odd], [], [place[index]] * 2, [[place[index]]]))
        return
    key, value = place[index]
    how = rng.randrange(9)
    if how < 4:
        place[index] = (key, odd)
    elif how == 4:
        del place[index]
    elif how == 5:
        place.insert(index, (key, rng.choice((value, odd))))
    elif how == 6:
        place[index] = (rng.choice((*NAMES, f"{key}s", Raw(rng.choice(SCALARS[:60])))), value)
    elif how == 7:
        place.append((rng.choice(NAMES), odd))
    else:
        factor = rng.choice((-1.0, 0.0, 1e-9, 1e9, 1e300, 1000.0))
        place[index] = (key, value * factor if isinstance(value, int | float) else [value])


def damage_bytes(content: bytes, rng: Random) -> bytes:
    """The bytes cut, flipped, repeated or replaced somewhere."""
    at = rng.randrange(len(content) + 1)
    how = rng.randrange(7)
    if how == 0:
        return content[:at]
    if how == 1:
        flipped = bytearray(content)
        for _ in range(rng.choice((1, 3, 30))):
            flipped[rng.randrange(len(flipped))] = rng.randrange(256)
        return bytes(flipped)
    if how == 2:
        return content[:at] + content[at + rng.randrange(1, 200) :]
    if how == 3:
        return content[:at] + bytes(rng.randrange(256) for _ in range(rng.choice((1, 8, 300)))) + content[at:]
    if how == 4:
        return content[:at] + content[max(0, at - 100) :]
    if how == 5:
        return rng.choice((b"", b"\x00" * 100, b"\xff\xfe", b"\x80\x81", b"PK\x03\x04", b"\x1f\x8b"))
    return content[:at] + rng.choice((b"\x00", b"\xe9", b"\xff", b"\r", b"\n\n", b"\xef\xbb\xbf", b'"')) + content[at:]
