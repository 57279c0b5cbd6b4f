"""The key `load: unknown` of a rig file."""

import pytest

from drake_tc.errors import RigError
from drake_tc.logs.loads import UnknownLoad, unknown_form
from drake_tc.logs.rig import parse_rig, rig_document


def rig_with(load: object):  # type: ignore[no-untyped-def]
    return parse_rig({"joint": "knee", "drive": "current", "load": load}, "rig.yaml")


@pytest.mark.parametrize(
    ("written", "load", "form"),
    [
        ("unknown", "unknown", "pendulum"),
        ({"unknown": "pendulum"}, "unknown", "pendulum"),
        ({"unknown": "smooth"}, UnknownLoad("smooth"), "smooth"),
        ({"knee": {"unknown": "smooth"}}, UnknownLoad("smooth"), "smooth"),
        ("torque", "torque", None),
    ],
)
def test_the_forms_are_read_and_written_back(written: object, load: object, form: str | None) -> None:
    rig = rig_with(written)
    assert rig.load["knee"] == load and unknown_form(rig.load["knee"]) == form
    assert parse_rig(rig_document(rig)) == rig


@pytest.mark.parametrize("value", ["smoth", None, 3, ["smooth"], {"smooth": 4}])
def test_another_form_is_refused_in_one_line(value: object) -> None:
    with pytest.raises(RigError, match=r"^rig\.yaml: load.unknown: expected one of pendulum, smooth, got ") as refused:
        rig_with({"unknown": value})
    assert "\n" not in str(refused.value)
    if value == "smoth":
        assert "did you mean 'smooth'?" in str(refused.value)
