"""YAML is read strictly: what hides a value, or is no plain key, is an error that says where."""

import pytest

from drake_tc.errors import ParamsError
from drake_tc.robot import fields
from drake_tc.yaml_file import read_yaml


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "line 3: key 'a' is given twice"),
        ("a: 1\n? [1, 2]\n: 3\n", r"line 2: wanted a key that is one word or number; got \[1, 2\]"),
        ("{{a: 1}: 2}", "line 1: wanted a key that is one word or number; got {'a': 1}"),
        ("a: &x {b: 1}\nc: {<<: *x, d: 2}\n", "line 2: wanted the keys themselves; '<<'"),
        ("a: [1", "not YAML"),
        ("a: !!python/object:os.system x", "not YAML"),
        ("&a {b: *a}", "not YAML"),
    ],
)
def test_refused(tmp_path, text, message):
    path = tmp_path / "some.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ParamsError, match=f"{path}: {message}"):
        read_yaml(path)


def test_anchors_without_merging_are_read(tmp_path):
    path = tmp_path / "some.yaml"
    path.write_text("a: &x {b: 1}\nc: *x\n5: '5'\n", encoding="utf-8")
    assert read_yaml(path) == {"a": {"b": 1}, "c": {"b": 1}, 5: "5"}


def test_keys_that_are_the_same_text_are_refused():
    assert fields.mapping("gains", {5: 1.0, "6": 2.0}, optional=None) == {"5": 1.0, "6": 2.0}
    with pytest.raises(ParamsError, match="gains: wanted different keys; got both 5 and '5'"):
        fields.mapping("gains", {5: 1.0, "5": 2.0}, optional=None)
