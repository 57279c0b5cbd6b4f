"""What cannot be looked for, by its reason."""

from drake_tc.experiments.check.effects import Visibility, by_reason, shared_and_own
from drake_tc.experiments.sizes import Size

SIZE = Size("a", "N*m", 1.0)


def effect(key, obstacle=""):
    return Visibility(key, key.partition(".")[0], key, "not_seen", SIZE, 1.0, 1.0, obstacle=obstacle)


def test_effects_of_one_reason_stand_together():
    effects = [effect("a", "no sensor"), effect("b"), effect("c", "no motor"), effect("d.x", "no sensor")]
    assert by_reason(effects) == {"no sensor": ("a", "d.x"), "no motor": ("c",)}


def test_what_no_joint_can_show_is_told_once():
    """The same reason for other effects is each joint's own."""
    hip = [effect("a", "no sensor"), effect("b", "no motor"), effect("c", "no load")]
    knee = [effect("a", "no sensor"), effect("b", "no motor"), effect("d", "no motor")]
    shared, own = shared_and_own({"hip": hip, "knee": knee})
    assert shared == {"no sensor": ("a",)}
    assert own == {"hip": {"no motor": ("b",), "no load": ("c",)}, "knee": {"no motor": ("b", "d")}}


def test_a_single_joint_keeps_all():
    assert shared_and_own({"hip": [effect("a", "no sensor")]}) == ({}, {"hip": {"no sensor": ("a",)}})
    assert shared_and_own({}) == ({}, {})
