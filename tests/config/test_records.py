"""Dataclasses are read from files by their own types and docstrings."""

import math
from dataclasses import dataclass, field
from typing import Literal

import pytest

from drake_tc.config.page import json_schema, nested, page
from drake_tc.config.records import read_record, record_keys
from drake_tc.errors import ParamsError


@dataclass(frozen=True)
class Inner:
    """A part.

    Attributes:
        a: Size [m].
        b: Indices.
    """

    a: float
    b: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.a < 0.0:
            raise ParamsError(f"a: expected a number >= 0 [m], got {self.a:g}")


@dataclass(frozen=True)
class Outer:
    """All of it.

    Attributes:
        one: The part
            itself.
        many, named: More
            parts.
        until: End [s].

    Raises:
        ParamsError: never.
    """

    one: Inner
    many: tuple[Inner, ...] = ()
    named: dict[str, Inner] = field(default_factory=dict)
    either: float | tuple[float, ...] = 0.0
    pair: tuple[float, float] | None = None
    text: str = ""
    kind: Literal["soft", "hard"] = "soft"
    until: float = math.inf
    maybe: Inner | None = None
    source: str = "."


def test_nested_records():
    document = {
        "one": {"a": 1e-3, "b": [1, 2]},
        "many": [{"a": 1}, {"a": 2.5}],
        "named": {"x": {"a": 3}},
        "either": [1, 2],
        "pair": [0, 1],
        "kind": "hard",
        "until": math.inf,
    }
    expected = Outer(
        Inner(1e-3, (1, 2)), (Inner(1.0), Inner(2.5)), {"x": Inner(3.0)}, (1.0, 2.0), (0.0, 1.0), kind="hard"
    )
    assert read_record(Outer, document, "f") == expected
    least = {"one": {"a": 1}, "pair": None, "either": 2, "maybe": None}
    assert read_record(Outer, least, "f") == Outer(Inner(1.0), either=2.0)
    assert read_record(Outer, {"one": {"a": 1}}, "f", more={"source": "here"}).source == "here"


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ([], r"f: expected a mapping with one, many, .*, got \[\]"),
        ({}, "f: one is missing"),
        ({"one": {"a": 1}, "mani": 2}, "f: unknown key 'mani'; did you mean 'many'[?]; allowed: one, many"),
        ({"one": {"a": 1}, "source": "x"}, "f: unknown key 'source'"),
        ({"one": {"a": True}}, r"f: one\.a: expected a finite number, got true"),
        ({"one": {"a": "much"}}, r"f: one\.a: expected a finite number, got 'much'"),
        ({"one": {"a": math.nan}}, r"f: one\.a: expected a finite number, got nan"),
        ({"one": {"a": math.inf}}, r"f: one\.a: expected a finite number, got inf"),
        ({"one": {"a": -1}}, r"f: one\.a: expected a number >= 0 \[m\], got -1"),
        ({"one": {"a": 1, "b": [1.5]}}, r"f: one\.b\[0\]: expected a whole number, got 1\.5"),
        ({"one": {"a": 1}, "many": {"a": 1}}, "f: many: expected a list, got {'a': 1}"),
        ({"one": {"a": 1}, "many": [3]}, r"f: many\[0\]: expected a mapping with a, b, got 3"),
        ({"one": {"a": 1}, "named": [1]}, r"f: named: expected a mapping, got \[1\]"),
        ({"one": {"a": 1}, "named": {"x": {"a": "?"}}}, r"f: named\.x\.a: expected a finite number, got '\?'"),
        ({"one": {"a": 1}, "pair": [1, 2, 3]}, r"f: pair: expected a list of 2 values, got \[1, 2, 3\]"),
        ({"one": {"a": 1}, "either": [1, "x"]}, r"f: either\[1\]: expected a finite number, got 'x'"),
        ({"one": {"a": 1}, "either": "x"}, "f: either: expected a finite number, got 'x'"),
        ({"one": {"a": 1}, "text": 7}, "f: text: expected text, got 7"),
        ({"one": {"a": 1}, "kind": "sofd"}, "f: kind: expected one of soft, hard, got 'sofd'; did you mean 'soft'"),
        ({"one": {"a": 1}, "until": math.nan}, "f: until: expected a number, got nan"),
        ({"one": {"a": 1}, "maybe": 3}, "f: maybe: expected a mapping with a, b, got 3"),
    ],
)
def test_refusals(document, message):
    with pytest.raises(ParamsError, match=f"^{message}") as caught:
        read_record(Outer, document, "f", more={"source": "."})
    assert "\n" not in str(caught.value)


def test_docstrings_become_descriptions():
    model = record_keys(Outer)
    assert {name: field.description for name, field in model.model_fields.items()} == {
        "one": "The part itself.",
        "many": "More parts.",
        "named": "More parts.",
        "until": "End [s].",
        **dict.fromkeys(("either", "pair", "text", "kind", "maybe", "source"), ""),
    }
    assert [place for place, _ in nested(model)] == ["one"]
    text = page(model, "A title", "Words.")
    assert "| `a` | Size [m]. |  | required | – |" in text and "| `until` | End [s]. |  | inf | – |" in text
    schema = json_schema(model, "t")
    assert schema["properties"]["kind"]["enum"] == ["soft", "hard"]
    assert schema["required"] == ["one"]
