"""Units of joints that turn and of joints that slide."""

import pytest

from drake_tc.config.joint_units import JointUnits, in_units_of
from drake_tc.effects.library import all_effects

SLIDES = {
    "N*m": "N",
    "kg*m^2": "kg",
    "rad": "m",
    "N*m*s/rad": "N*s/m",
    "N*m*s^2/rad^2": "N*s^2/m^2",
    "N*m*(s/rad)^p": "N*(s/m)^p",
    "N*m*s/(rad*K)": "N*s/(m*K)",
    "rad/(N*m)": "m/N",
    "mrad/(N*m)": "mm/N",
    "1/turn": "rad/m",
    "N·m": "N",
    "kg m^2": "kg",
    "kg·m²": "kg",
    "rad/s²": "m/s²",
    "A": "A",
    "s": "s",
    "-": "-",
}


@pytest.mark.parametrize("unit", SLIDES)
def test_the_unit_of_a_joint_that_slides_follows_from_that_of_one_that_turns(unit):
    assert in_units_of("prismatic", unit) == SLIDES[unit]
    assert in_units_of("revolute", unit) == unit
    assert in_units_of("prismatic", SLIDES[unit]) == SLIDES[unit]  # told twice, it stays


def test_no_parameter_of_the_library_keeps_an_angle_or_a_torque():
    units = JointUnits("prismatic", "position_servo")
    for effect in all_effects():
        for parameter in effect.parameters:
            told = units.of(parameter.unit)
            assert "N*m" not in told and "kg*m" not in told and "effort" not in told
            assert "rad" not in told or told == "rad/m"


@pytest.mark.parametrize(
    ("drive", "effort", "gain"),
    [("position_servo", "m", "m/N"), ("current", "A", "A/N"), ("voltage", "V", "V/N"), ("torque", "N", "N/N")],
)
def test_effort_and_gain_of_a_joint_that_slides(drive, effort, gain):
    units = JointUnits("prismatic", drive)
    assert (units.effort, units.gain, units.torque, units.position) == (effort, gain, "N", "m")
    assert JointUnits("prismatic", drive, torque_as_effort=True).torque == effort


def test_effort_and_gain_of_a_joint_that_turns():
    units = JointUnits("revolute", "position_servo")
    assert (units.effort, units.gain, units.torque, units.position) == ("rad", "rad/(N*m)", "N*m", "rad")
    assert JointUnits("revolute", "current", torque_as_effort=True).of("kg*m^2") == "A*s^2/rad"


def test_a_sentence_has_the_units_of_the_joint():
    said = "It breaks away at 3 N*m, slides at 2 rad/s and weighs 4 kg m^2."
    assert in_units_of("prismatic", said) == "It breaks away at 3 N, slides at 2 m/s and weighs 4 kg."
