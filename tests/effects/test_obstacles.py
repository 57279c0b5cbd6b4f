"""Why an effect cannot be looked for: the rig, a signal that is missing, or one that hardly changes."""

from dataclasses import replace

import pytest

from drake_tc.effects.context import Context
from drake_tc.effects.library import LIBRARY, effect

VOLTAGE = Context(
    "voltage",
    "torque",
    frozenset({"temperature", "supply_voltage"}),
    supply_voltage=24.0,
    supply_change=2.0,
    temperature_span=(20.0, 60.0),
)
"""A rig on which all of the effects below can be looked for."""
STILL = {
    "supply_sag": {"supply_change": 0.0},
    "winding_temperature": {"temperature_span": (20.0, 21.0)},
    "position_dependent_load": {"position_span": (0.0, 1e-4)},
    "torque_ripple": {"position_span": (0.0, 1e-4)},
}
CASES = [
    *((key, changes, "not_excited") for key, changes in STILL.items()),
    ("supply_sag", {"recorded": frozenset({"temperature"}), "supply_change": 0.0}, "not_recorded"),
    ("winding_temperature", {"recorded": frozenset()}, "not_recorded"),
    ("torque_ripple", {"position_recorded": False}, "not_recorded"),
    ("supply_sag", {"drive": "current", "recorded": frozenset()}, "cannot_be_looked_for"),
    ("winding_temperature", {"drive": "current", "recorded": frozenset()}, "cannot_be_looked_for"),
    ("position_dependent_load", {"load": "unknown", **STILL["position_dependent_load"]}, "cannot_be_looked_for"),
]


@pytest.mark.parametrize("key", STILL)
def test_nothing_stands_in_the_way_where_all_was_recorded_and_moves(key):
    assert effect(key).unavailable(VOLTAGE) is None


@pytest.mark.parametrize(("key", "changes", "reason"), CASES)
def test_the_reason_is_the_first_that_stands_in_the_way(key, changes, reason):
    found = effect(key).unavailable(replace(VOLTAGE, **changes))
    assert found is not None
    assert found.reason == reason


def test_every_statement_is_a_few_words_without_a_stop():
    nothing = Context("torque", "unknown", frozenset(), position_span=(0.0, 1e-4), position_recorded=False)
    found = [obstacle for member in LIBRARY if (obstacle := member.unavailable(nothing)) is not None]
    assert len(found) > 10
    assert [o.statement for o in found if not o.statement or o.statement.endswith(".") or "nan" in o.statement] == []


def with_load(load, **declared):
    return Context("current", load, frozenset(), declared=declared)


@pytest.mark.parametrize("key", ["directional_efficiency", "torque_sensor_gain"])
def test_an_inertia_that_is_declared_without_a_value_is_not_said_to_be_undeclared(key):
    """`declared: [rotor_inertia]` gives no value, so `Context.declared` lacks it; the file does declare it."""
    why = effect(key).obstacle(with_load("torque"))
    assert "states no value of rotor_inertia" in why
    assert "declares no" not in why
    assert not effect(key).obstacle(with_load("torque", rotor_inertia=0.3))


@pytest.mark.parametrize("load", ["robot", "links"])
@pytest.mark.parametrize("key", ["payload", "payload.pendulum", "payload.declared_gain", "payload.own_arm"])
def test_a_load_that_a_robots_model_computes_is_not_said_to_be_measured(key, load):
    assert effect(key).obstacle(with_load(load)).startswith("a payload is ")
    assert "measured" in effect("payload.pendulum").obstacle(with_load("torque"))
