"""What the report says of a drive gain that the model after does not share with the rig file."""

from types import SimpleNamespace

import pytest

from drake_tc.diagnosis.notes import (
    FarFromRotor,
    GainBesideEffects,
    LoadWithRotor,
    PayloadFromRatio,
    SizeByRotorInertia,
)
from drake_tc.diagnosis.problem.estimates import Estimate
from drake_tc.diagnosis.result.drive_notes import drive_notes, scale_alternatives, viscous_age_note
from drake_tc.diagnosis.timing_notes import ViscousByAge
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


def test_what_scales_the_torques_alone_says_what_its_size_rests_on() -> None:
    rig = parse_rig({"joint": "joint", "drive": "position_servo"})
    notes = drive_notes(rig, "joint", found(0.1, "viscous", "torque_sensor_gain"), 0.1)
    assert notes == (SizeByRotorInertia((effect("torque_sensor_gain").title,)),)


@pytest.mark.parametrize(("inertia", "told"), [(199.8, True), (2.0, False)])
@pytest.mark.parametrize("drive", [{"drive": "current"}, {"drive": "torque", "drive_gain": 1.0}])
def test_a_payload_of_a_thousand_rotors_asks_for_the_units(drive: dict, inertia: float, told: bool) -> None:
    """A torque in N*mm that is taken for N*m: the rotor of 0.2 kg m^2 has a thousandth of the inertia that is seen."""
    rig = parse_rig({"joint": "joint", "declared": {"rotor_inertia": 0.2}, **drive})
    parameters = {name: Estimate(value, "", (value, value), False) for name, value in (("payload_inertia", inertia),)}
    notes = drive_notes(rig, "joint", found(1.0) | {"payload": parameters}, 1.0)
    assert [note for note in notes if isinstance(note, FarFromRotor)] == (
        [FarFromRotor("payload", pytest.approx(999.0))] if told else []
    )


@pytest.mark.parametrize(
    ("described", "pairs"),
    [
        ({"declared": {"rotor_inertia": 0.1}}, (("torque_sensor_gain", "rotor_inertia"),)),
        ({"declared": {"rotor_inertia": 0.1}, "drive_gain": DECLARED}, ()),
        ({}, ()),
    ],
)
def test_a_wrong_declared_rotor_inertia_looks_like_a_gain_of_the_torque_sensor(described, pairs) -> None:
    rig = parse_rig({"joint": "joint", "drive": "position_servo", **described})
    assert scale_alternatives(rig, "joint", found(0.1, "viscous", "torque_sensor_gain")) == pairs
    assert scale_alternatives(rig, "joint", found(0.1, "viscous", "stribeck")) == ()


@pytest.mark.parametrize(
    ("declared", "friction", "told"),
    [
        ({}, "load_dependent_friction", True),
        ({"rotor_inertia": 0.1}, "load_dependent_friction", False),
        ({}, "stribeck", False),
    ],
)
def test_friction_over_an_unknown_load_that_contains_the_rotor_is_told(declared, friction, told) -> None:
    described = {"joint": "joint", "drive": "current", "drive_gain": 0.5, "load": "unknown", "declared": declared}
    notes = drive_notes(parse_rig(described), "joint", found(0.5, "unknown_load.pendulum", friction), 0.5)
    assert notes == ((LoadWithRotor((effect(friction).title,)),) if told else ())


@pytest.mark.parametrize(
    ("stated", "drive", "half_width", "told"),
    [
        (None, "position_servo", 0.01, True),
        (None, "position_servo", 0.3, False),
        (False, "position_servo", 0.01, False),
        (True, "position_servo", 0.01, False),
        (None, "current", 0.01, False),
    ],
)
def test_the_age_of_a_servos_command_may_be_viscous_friction(stated, drive, half_width, told) -> None:
    """K = 200 N m/rad at 500 Hz: K T/2 = 0.2 N m s/rad beside 1.1 N m s/rad."""
    friction = Estimate(1.1, "N*m*s/rad", (1.1 - half_width, 1.1 + half_width), False)
    samples = SimpleNamespace(signals=SimpleNamespace(period=2e-3))
    parameters = found(DECLARED) | {"viscous": {"viscous": friction}}
    notes = viscous_age_note(stated, samples, parameters, drive, lambda: 0.5)
    assert notes == ((ViscousByAge(0.2, 2e-3),) if told else ())
    notes = viscous_age_note(stated, samples, parameters, drive, lambda: 0.25)
    assert notes == ((ViscousByAge(0.1, 2e-3),) if told else ())
    assert viscous_age_note(stated, samples, parameters, drive, lambda: 0.125) == ()


ROTOR, MASS, LENGTH = 0.4, 4.0, 0.5
HUNG: dict[str, object] = {
    "joint": "joint",
    "drive": "position_servo",
    "declared": {"rotor_inertia": ROTOR},
    "load": {"pendulum": {"mass": MASS, "length": LENGTH}},
}


def payload_notes(moment: float, **keys: object) -> tuple[object, ...]:
    """Notes of a model with a payload of this least moment."""
    values = {"payload_moment": Estimate(moment, "N*m", (moment, moment), False)}
    return drive_notes(parse_rig(HUNG | keys), "joint", found(0.1, "viscous") | {"payload.pendulum": values}, 0.1)


def test_a_payload_at_the_end_of_the_pendulum_comes_back_from_its_least_moment() -> None:
    """A mass m_p at the same length: the ratio of inertia to moment is that of the pendulum with m + m_p."""
    added = 1.7
    ratio = (ROTOR + (MASS + added) * LENGTH**2) / ((MASS + added) * 9.81 * LENGTH)
    least = (ROTOR + MASS * LENGTH**2) / ratio - MASS * 9.81 * LENGTH
    (note,) = payload_notes(least)
    assert isinstance(note, PayloadFromRatio)
    assert note.least == least
    assert note.like_pendulum == pytest.approx(added * 9.81 * LENGTH, rel=1e-9)


def test_a_ratio_below_the_pendulums_own_is_not_that_of_more_of_the_pendulum() -> None:
    """However heavy, the pendulum alone has I/G; what lies below it is a mass nearer to the axis."""
    limit = ROTOR / LENGTH  # (J + I)/(G + G_p) = I/G at G_p = J G/I = J g/l
    assert payload_notes(1.001 * 9.81 * limit) == (PayloadFromRatio(1.001 * 9.81 * limit, None),)
    (note,) = payload_notes(0.999 * 9.81 * limit)
    assert isinstance(note, PayloadFromRatio) and note.like_pendulum is not None and note.like_pendulum > 1e3


def test_runs_with_different_pendulums_have_no_one_ratio() -> None:
    load = {"pendulum": {"mass": {"light*": 3.0, "*": MASS}, "length": LENGTH}}
    assert payload_notes(2.0, load=load) == (PayloadFromRatio(2.0, None),)
