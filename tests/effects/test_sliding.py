"""Effects of joints that slide: which there are, and where their values are possible."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.effects.base import Context, plain_signals
from drake_tc.effects.check import implausible
from drake_tc.effects.library import effect, looked_for

AXIS = Context(
    "current",
    "torque",
    frozenset(),
    max_speed=0.5,
    position_span=(-0.2, 0.2),
    effort_span=(-4.0, 4.0),
    period=2e-3,
    torque_span=(-200.0, 200.0),
    duration=20.0,
    fitted={"gain": 0.01, "viscous": 60.0, "coulomb": 25.0},
    joint_type="prismatic",
)
TURNING = replace(AXIS, joint_type="revolute")


def keys(context):
    return {each.key for each in looked_for(context)}


def test_what_needs_a_turn_is_not_looked_for_on_a_joint_that_slides():
    only_turning = keys(TURNING) - keys(AXIS)
    assert {"payload", "payload.pendulum", "encoder_eccentricity.shared"} <= only_turning
    assert keys(AXIS) - keys(TURNING) == {
        "payload.sliding",
        "presliding_hysteresis.sliding",
        "cable_spring.beside_weight",
    }


def test_an_effect_of_the_other_type_of_joint_says_why_not():
    assert effect("payload").unavailable(AXIS).statement == "the joint is prismatic"
    assert effect("payload.sliding").unavailable(TURNING).statement == "the joint is revolute"


@pytest.mark.parametrize("lead", [2e-3, 5e-3, 10e-3, 20e-3])
def test_the_wave_of_a_screw_is_among_the_starting_points_of_a_ripple(lead):
    grid = np.array([shape["cycles_per_turn"] for shape in effect("torque_ripple").shape_grid(AXIS)])
    apart = np.abs(grid - 2 * np.pi / lead).min() * 0.4 / (2 * np.pi)  # periods over the travel
    assert apart < 0.2
    wave = {"ripple_cosine": 3.0, "ripple_sine": 0.0, "cycles_per_turn": 2 * np.pi / lead}
    assert implausible(effect("torque_ripple"), wave, AXIS) == ""


def test_a_screw_reflects_a_mass_that_no_gear_has_as_an_inertia():
    rotor = effect("rotor_inertia")
    assert implausible(rotor, {"rotor_inertia": 5000.0}, AXIS) == ""
    assert "300 kg*m^2" in implausible(rotor, {"rotor_inertia": 5000.0}, TURNING)


def test_play_of_centimetres_is_implausible_where_the_joint_slides():
    assert "0 to 0.005 m" in implausible(effect("backlash"), {"backlash": 0.05}, AXIS)
    assert implausible(effect("backlash"), {"backlash": 0.05}, TURNING) == ""


def test_a_weight_needs_its_mass():
    payload = effect("payload.sliding")
    assert implausible(payload, {"payload_weight": 19.0, "payload_mass": 2.0}, AXIS) == ""
    assert "weighs at most 9.81 N" in implausible(payload, {"payload_weight": 19.0, "payload_mass": 1.0}, AXIS)


def test_the_weight_of_a_sliding_payload_does_not_follow_the_position():
    known = {"position": np.array([0.0, 1.0, 2.0]), "acceleration": np.array([0.0, 1.0, -1.0])}
    torque = effect("payload.sliding").torque(plain_signals(3, known), {"payload_weight": 5.0, "payload_mass": 2.0})
    np.testing.assert_allclose(torque, [5.0, 7.0, 3.0], rtol=1e-12)


def test_a_spring_is_looked_for_beside_an_unknown_mass_and_not_beside_an_unknown_curve():
    spring = effect("cable_spring.beside_weight")
    unknown = replace(AXIS, load="unknown", load_follows_position=False)
    assert spring.unavailable(unknown) is None
    assert spring.unavailable(replace(unknown, load_follows_position=True)) is not None
    assert spring.unavailable(AXIS) is not None
