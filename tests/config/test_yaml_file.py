"""YAML is read strictly: what hides a value, is no plain value or is out of all size is an error that says where."""

import math
import time

import pytest
import yaml

from drake_tc.config.yaml_file import LARGEST, merged, parse_yaml, read_yaml
from drake_tc.errors import ParamsError, RigError

ALIAS_BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{after}: &{after} [{','.join([f'*{before}'] * 9)}]\n"
    for before, after in zip("abcdefgh", "bcdefghi", strict=True)
)

REFUSED = {
    "twice": ("a: 1\nb: {c: 2, c: 3}\n", "line 2: b: key 'c' is given twice"),
    "twice as text": ("5: 1\n'5': 2\n", "line 2: key '5' is given twice"),
    "list as key": ("a: 1\n? [1, 2]\n: 3\n", "line 2: expected a key that is one word or number"),
    "mapping as key": ("{{a: 1}: 2}", "line 1: expected a key that is one word or number"),
    "merged": ("a: &x {b: 1}\nc: {<<: *x, d: 2}\n", "line 2: c: expected the keys themselves; '<<'"),
    "cut": ("a: [1", "not valid YAML at line "),
    "python": ("a: !!python/object:os.system x", "line 1: a: expected the value itself; the tag '!!python/object:os."),
    "float tag": ("b: {a: !!float abc}", "line 1: b.a: expected the value itself; the tag '!!float' is not read"),
    "int tag": ("a: !!int ''", "line 1: a: expected the value itself; the tag '!!int' is not read"),
    "date tag": ("a: [!!timestamp 2001-99-99]", r"line 1: a\[0\]: expected the value itself; the tag '!!timestamp'"),
    "list tag": ("a: !!set {b}", "line 1: a: expected the value itself; the tag '!!set' is not read"),
    "in itself": ("&a {b: *a}", "line 1: b: the alias .a names nothing that is complete above it"),
    "no anchor": ("b: *a", "not valid YAML|line 1: b: the alias .a names nothing"),
    "digits": (f"a:\n  mass: {'7' * 5000}", "line 2: a.mass: expected a number of at most 40 digits, got 5000"),
    "digits of 400": (f"mass: -{'7' * 400}", "line 1: mass: expected a number of at most 40 digits, got 401"),
    "hexadecimal": (f"mass: 0x{'f' * 400}", "line 1: mass: expected a number of at most 40 digits"),
    "too large": ("mass: 1e999", "line 1: mass: expected a number below 1.8e308, got '1e999'"),
    "deep list": ("a: " + "[" * 60, r"line 1: a\[0\]\[0\]: expected at most 50 levels"),
    "deep mapping": ("{a: " * 60, "line 1: a.a.a: expected at most 50 levels"),
    "very deep list": ("a: " + "[" * 10_000, r"line 1: (a\[0\]\[0\]: )?expected at most 50 levels"),
    "very deep mapping": ("{a: " * 10_000, r"line 1: (a\.a\.a: )?expected at most 50 levels"),
    "alias bomb": (ALIAS_BOMB, "line [456]: [def].*expected aliases that repeat at most 10000 values"),
    "two documents": ("a: 1\n---\nb: 1\n", "line 2: expected one document"),
    "control character": ("a: \x07", "not valid YAML"),
    "surrogate": ("a: \ud800", "not valid YAML"),
    "surrogate escape": ('a: "\\ud800"', "not valid YAML"),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_refused_in_one_short_line_at_once(text, message):
    begin = time.process_time()
    with pytest.raises(ParamsError, match=f"^some.yaml: ({message})") as caught:
        parse_yaml(text, "some.yaml")
    assert time.process_time() - begin < 1.0
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 200


def test_the_bomb_is_small():
    assert len(ALIAS_BOMB) < 329


def test_files_that_cannot_be_read(tmp_path):
    path = tmp_path / "some.yaml"
    with pytest.raises(RigError, match=f"{path}: no such rig file"):
        read_yaml(path, "rig file", RigError)
    with pytest.raises(ParamsError, match=f"{tmp_path}: cannot be read: Is a directory"):
        read_yaml(tmp_path)
    path.write_bytes(b"a: \xff")
    with pytest.raises(ParamsError, match=f"{path}: expected a YAML file in UTF-8; byte 3 is not"):
        read_yaml(path)
    path.write_bytes(b"#" * (LARGEST + 1))
    with pytest.raises(ParamsError, match=f"{path}: expected a YAML file of at most 16 MiB"):
        read_yaml(path)
    path.write_bytes("\ufeffa: 1".encode())
    assert read_yaml(path) == {"a": 1}


def test_anchors_without_merging_are_read():
    assert parse_yaml("a: &x {b: 1}\nc: *x\n5: '5'\n", "s") == {"a": {"b": 1}, "c": {"b": 1}, "5": "5"}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-4", 1e-4),
        ("-1.5E+3", -1500.0),
        (".5", 0.5),
        ("010", 10),
        ("0x10", 16),
        ("18446744073709551615", 2**64 - 1),
        ("-.inf", -math.inf),
        ("yes", True),
        ("Off", False),
        ("~", None),
        ("", None),
        ("'1'", "1"),
        ("!!str 1", "1"),
        ("2001-99-99", "2001-99-99"),
        ("2001-01-01", "2001-01-01"),
        ("1:30", "1:30"),
        ("inf", "inf"),
        (".", "."),
        ("=", "="),
    ],
)
def test_scalars(text, value):
    found = parse_yaml(f"a: {text}", "s")["a"]
    assert found == value and type(found) is type(value)


def test_no_document_is_null_and_nan_is_nan():
    assert parse_yaml("", "s") is None
    assert math.isnan(parse_yaml(".nan", "s"))


def test_plain_data_that_pyyaml_writes_come_back():
    data = {
        "a": [1, -2.5, 1e-9, 1e300, True, None, "no", "1.0", "text: x", "é", "2001-01-01", "~", "a\nb"],
        "b": {"c": []},
    }
    assert parse_yaml(yaml.safe_dump(data), "s") == data
    assert parse_yaml(yaml.safe_dump(data, allow_unicode=True, default_flow_style=True), "s") == data


def test_changes_are_laid_over_mapping_by_mapping():
    assert merged({"a": {"b": 1, "c": 2}, "d": [1]}, {"a": {"b": {"e": 3}}, "d": [2]}) == {
        "a": {"b": {"e": 3}, "c": 2},
        "d": [2],
    }
