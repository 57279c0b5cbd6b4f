"""What the report says of a drive gain that the model after does not share with the rig file."""

import pytest

from drake_tc.diagnosis.notes import GainBesideEffects, SizeByRotorInertia
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.drive_notes import drive_notes
from drake_tc.effects.library import effect
from drake_tc.logs.rig import parse_rig

DECLARED = 0.005
RIG = parse_rig({"joint": "joint", "drive": "position_servo", "drive_gain": DECLARED})


def found(gain: float, *effects: str) -> dict[str, dict[str, Estimate]]:
    """Parameters of a model with these effects."""
    return {"drive": {"gain": Estimate(gain, "rad/(N*m)", (gain, gain), False)}} | {name: {} for name in effects}


@pytest.mark.parametrize(("gain", "told"), [(DECLARED, False), (1.01 * DECLARED, False), (0.5 * DECLARED, True)])
def test_a_gain_that_an_effect_has_moved_away_from_the_declared_one_is_told(gain: float, told: bool) -> None:
    notes = drive_notes(RIG, "joint", found(gain, "viscous", "elasticity"), gain)
    moved = (GainBesideEffects(("elasticity of the gear",), "position_servo", gain, DECLARED),)
    assert notes == (moved if told else ())


def test_only_effects_that_scale_the_torques_are_blamed() -> None:
    assert drive_notes(RIG, "joint", found(0.5 * DECLARED, "viscous", "stribeck"), DECLARED) == ()


def test_a_gain_that_no_rig_file_declares_is_not_held_against_one() -> None:
    rig = parse_rig({"joint": "joint", "drive": "position_servo"})
    assert drive_notes(rig, "joint", found(0.1, "elasticity"), 0.1) == ()


@pytest.mark.parametrize("key", ["payload.pendulum", "torque_sensor_gain"])
def test_what_scales_the_torques_alone_says_what_its_size_rests_on(key: str) -> None:
    """A wrong inertia of the rig file scales the torques of a pendulum as a wrong mass does, if the gain is free."""
    rig = parse_rig({"joint": "joint", "drive": "position_servo"})
    assert drive_notes(rig, "joint", found(0.1, "viscous", key), 0.1) == (SizeByRotorInertia((effect(key).title,)),)
