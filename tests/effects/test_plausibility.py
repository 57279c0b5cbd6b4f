"""Every parameter of every effect has a plausible range with a source; values on both sides of it are told apart."""

import math
from dataclasses import replace

import pytest

from drake_tc.effects.base import Context
from drake_tc.effects.check import implausible, plausible_range
from drake_tc.effects.library import LIBRARY, MULTI_JOINT, UNCOMMON, effect

EVERY = (*LIBRARY, *UNCOMMON, *MULTI_JOINT)
RIG = Context(
    drive="current",
    load="torque",
    recorded=frozenset({"temperature"}),
    max_speed=2.0,
    position_span=(-1.0, 1.0),
    effort_span=(-3.0, 4.0),
    torque_span=(-10.0, 8.0),
    duration=20.0,
    supply_voltage=24.0,
    fitted={"gain": 0.1, "viscous": 2.0, "coulomb": 3.0},
)
"""The drive puts in 4 A / (0.1 A/(N m)) = 40 N m and the load 10 N m; the positions span 2 rad = 0.318 turns."""

CASES: dict[str, tuple[dict[str, float], dict[str, float], str]] = {
    "viscous": ({"viscous": 25.0}, {"viscous": 25.1}, "0 to 25"),
    "coulomb": ({"coulomb": 50.0}, {"coulomb": 50.1}, "0 to 50"),
    "rotor_inertia": ({"rotor_inertia": 0.3}, {"rotor_inertia": 301.0}, "rotor"),
    "stribeck": (
        {"stribeck": 2.0, "stribeck_velocity": 0.1, "stribeck_exponent": 2.0},
        {"stribeck_velocity": 2.1},
        "0 to 2 rad/s",
    ),
    "quadratic_viscous": ({"quadratic_viscous": 12.5}, {"quadratic_viscous": -0.1}, "dissipate"),
    "torque_sensor_bias": ({"bias": -9.9}, {"bias": 10.1}, "defective"),
    "encoder_offset": ({"offset": -0.35}, {"offset": 0.36}, "degrees"),
    "deadzone": ({"deadzone": 1.0}, {"deadzone": 3.7}, "0 to 3.6 A"),
    "load_dependent_friction": ({"load_friction": 0.7}, {"load_friction": -0.01}, "efficient"),
    "torque_sensor_drift": ({"drift": 0.4}, {"drift": 0.6}, "-0.5 to 0.5 N*m/s"),
    "torque_sensor_gain": ({"gain_error": -0.4}, {"gain_error": -0.6}, "scale"),
    "velocity_sign_switch": ({"switch": 0.2}, {"switch": 0.6}, "strong"),
    "servo_integrator": ({"integral_rate": 15.0}, {"integral_rate": 60.0}, "unstable"),
    "saturation": ({"limit": 3.9}, {"limit": 4.1}, "0.08 to 4 A"),
    "delay.command": ({"delay": 0.05}, {"delay": 0.051}, "50 ms"),
    "delay.loop": ({"delay": 0.012}, {"delay": 0.06}, "50 ms"),
    "delay.torque_sensor": ({"delay": 0.012}, {"delay": 0.06}, "50 ms"),
    "current_lag": ({"lag": 0.015}, {"lag": 0.09}, "L/R"),
    "payload": ({"payload_moment": 5.0, "payload_inertia": 0.2}, {"payload_inertia": -1.0}, "m^2"),
    "payload.sliding": ({"payload_weight": 2.0, "payload_mass": 0.3}, {"payload_weight": 9.0}, "weighs at most"),
    "payload.pendulum": ({"payload_moment": 5.0, "hang_angle": 0.2}, {"payload_moment": -0.1}, "mass"),
    "payload.own_arm": (
        {"payload_moment": 5.0, "payload_inertia": 0.2, "hang_angle": 0.2},
        {"payload_inertia": -1.0},
        "m^2",
    ),
    "payload.declared_gain": ({"payload_share": -0.5}, {"payload_share": -0.9}, "another load"),
    "cable_spring.beside_weight": ({"spring_stiffness": 5.0}, {"spring_stiffness": -1.0}, "release energy"),
    "cable_spring": ({"spring_stiffness": 1.0, "spring_preload": 2.0}, {"spring_stiffness": -0.7}, "release energy"),
    "asymmetric_friction": (
        {"coulomb_asymmetry": 2.0, "viscous_asymmetry": 1.0},
        {"coulomb_asymmetry": 2.5, "viscous_asymmetry": 3.0},
        "At 2 rad/s the directions differ by 8.5 N*m",
    ),
    "asymmetric_friction.coulomb": ({"coulomb_asymmetry": 2.9}, {"coulomb_asymmetry": 3.1}, "both directions"),
    "effort_bias": ({"bias_torque": 5.0}, {"bias_torque": 25.1}, "half of what it recorded"),
    "thermal_friction": (
        {"coulomb_per_kelvin": -0.2, "viscous_per_kelvin": -0.1, "thermal_rate": 0.02},
        {"coulomb_per_kelvin": 0.9},
        "-0.6 to 0.6 N*m/K",
    ),
    "presliding_hysteresis.sliding": ({"presliding": 3.0, "presliding_travel": 0.01}, {"presliding": 4.0}, "0 to 3.6"),
    "presliding_hysteresis": ({"presliding": 3.0, "presliding_travel": 0.03}, {"presliding": 4.0}, "0 to 3.6 N*m"),
    "torque_ripple": (
        {"ripple_cosine": 1.0, "ripple_sine": -1.0, "cycles_per_turn": 18.0},
        {"cycles_per_turn": 2.27},
        "three times or more",
    ),
    "position_dependent_friction.linear": (
        {"friction_slope": -2.0, "middle": 0.3, "half_travel": 1.4},
        {"friction_slope": -2.2},
        "3.08 N*m towards one end exceeds",
    ),
    "position_dependent_friction": (
        {"friction_cosine": 2.0, "friction_sine": 2.0, "cycles_per_turn": 3.0},
        {"friction_cosine": 2.5, "friction_sine": 2.5},
        "3.54 N*m exceeds",
    ),
    "backlash": ({"backlash": 0.02}, {"backlash": 0.11}, "play"),
    "elasticity": ({"compliance": 0.02}, {"compliance": 0.04}, "0 to 0.03 rad"),
    "encoder_eccentricity.shared": (
        {"eccentricity_sine": 0.03, "eccentricity_cosine": 0.03},
        {"eccentricity_sine": 0.78, "eccentricity_cosine": 0.0},
        "disc",
    ),
    "encoder_eccentricity.separate": (
        {"eccentricity_sine": 0.03, "eccentricity_cosine": 0.03},
        {"eccentricity_sine": 0.04, "eccentricity_cosine": 0.04},
        "amplitude is 0.0566",
    ),
    "encoder_ripple": (
        {"ripple_sine": 0.01, "ripple_cosine": 0.0, "cycles_per_turn": 90.0},
        {"cycles_per_turn": 110.0},
        "backwards",
    ),
    "delay.position_sensor": ({"delay": 0.012}, {"delay": 0.06}, "50 ms"),
    "directional_efficiency": (
        {"driving_friction": 0.1, "backdriven_friction": 0.3},
        {"backdriven_friction": -0.05},
        "back-driven",
    ),
    "position_dependent_load": (
        {f"level_{k}": 2.0 for k in range(1, 8)} | {"curve_start": -1.0, "curve_end": 1.0},
        {f"level_{k}": 80.0 for k in range(1, 8)},
        "-75 to 75 N*m",
    ),
    "current_lag.winding": ({"lag": 0.015, "back_emf": 1.9}, {"back_emf": 2.1}, "back-EMF"),
    "winding_temperature": (
        {"resistance_per_kelvin": 0.0039, "back_emf": 1.0},
        {"resistance_per_kelvin": 0.015},
        "copper",
    ),
    "supply_sag": ({"supply_sensitivity": 1.0, "nominal_voltage": 24.0}, {"supply_sensitivity": 1.7}, "duty"),
    "saturation.supply": ({"limit_per_volt": 0.2}, {"limit_per_volt": 0.4}, "0 to 0.333 A/V"),
    "servo_gain": ({"gain_error": -0.3}, {"gain_error": 12.0}, "units"),
    "static_friction": ({"static_excess": 6.0, "break_away_speed": 0.01}, {"static_excess": 60.0}, "broken away"),
    "load_stribeck": (
        {"load_stribeck": 0.2, "load_stribeck_velocity": 0.4},
        {"load_stribeck_velocity": 3.0},
        "load-dependent",
    ),
    "drive_compression": ({"half_effort": 8.0}, {"half_effort": 1.0}, "1.2 A or more"),
    "winding_heat": ({"warm_effort": 8.0, "warm_time": 5.0}, {"warm_time": 0.1}, "thermal"),
    "gain_ripple": (
        {"gain_cosine": 0.3, "gain_sine": 0.2, "cycles_per_turn": 40.0},
        {"gain_cosine": 0.45, "gain_sine": 0.3},
        "amplitude is 0.541",
    ),
    "load_tilt": ({"tilt_moment": 3.0}, {"tilt_moment": 4.0}, "degrees"),
    "viscous_power": (
        {"viscous_power": 2.0, "viscous_exponent": 0.5},
        {"viscous_exponent": 1.05},
        "shear-thinning",
    ),
    "run_in_friction": (
        {"run_in_coulomb": 1.0, "run_in_viscous": 1.0, "run_in_time": 10.0},
        {"run_in_coulomb": 60.0},
        "settles",
    ),
}
"""Possible values, those of them that are changed to impossible ones, and a phrase of what is said then."""


def test_every_effect_has_a_case():
    assert {e.key for e in EVERY} == set(CASES)


@pytest.mark.parametrize("member", EVERY, ids=lambda e: e.key)
def test_every_reported_parameter_has_a_range_and_a_source(member):
    for parameter in member.parameters:
        assert parameter.plausible is not None, parameter.name
        assert len(parameter.plausible.source) > 20
        low, high = plausible_range(parameter, RIG)
        assert low < high
        # where the fit may go and where the value is possible must meet, or nothing could ever be found
        assert max(low, parameter.lower) < min(high, parameter.upper)


@pytest.mark.parametrize("key", CASES)
def test_values_on_both_sides_of_the_range(key):
    good, change, phrase = CASES[key]
    assert implausible(effect(key), good, RIG) == ""
    told = implausible(effect(key), good | change, RIG)
    assert phrase in told
    assert told.endswith(".") and "\n" not in told


@pytest.mark.parametrize("key", CASES)
def test_what_the_rig_does_not_know_limits_nothing(key):
    bare = replace(RIG, torque_span=(-math.inf, math.inf), duration=math.inf, fitted={})
    assert implausible(effect(key), CASES[key][0], bare) == ""


@pytest.mark.parametrize("key", CASES)
def test_a_value_that_is_not_a_number_is_implausible(key):
    name = effect(key).parameters[0].name
    assert "not a finite number" in implausible(effect(key), CASES[key][0] | {name: math.nan}, RIG)


def test_less_than_half_a_period_of_friction_is_a_line():
    wave = {"friction_cosine": 0.5, "friction_sine": 0.0, "cycles_per_turn": 1.5}
    told = implausible(effect("position_dependent_friction"), wave, RIG)
    assert "0.477 of a period" in told and "at least 0.5" in told  # 0.318 turns
    assert implausible(effect("position_dependent_friction"), wave, replace(RIG, position_span=(-1.5, 1.5))) == ""


def test_less_than_one_period_of_a_wave_is_a_curve():
    ripple = {"ripple_cosine": 1.0, "ripple_sine": 0.0, "cycles_per_turn": 3.0}
    assert "0.955 of a period" in implausible(effect("torque_ripple"), ripple, RIG)  # 0.318 turns
    assert implausible(effect("torque_ripple"), ripple, replace(RIG, position_span=(-1.5, 1.5))) == ""


def test_friction_that_falls_by_less_than_a_tenth_within_a_run_was_not_seen_to_settle():
    settling = {"run_in_coulomb": 1.0, "run_in_viscous": 0.0, "run_in_time": 400.0}
    told = implausible(effect("run_in_friction"), settling, replace(RIG, duration=40.0))
    assert "9.5 % of this friction is gone" in told and "not seen to settle" in told
    assert implausible(effect("run_in_friction"), settling, replace(RIG, duration=45.0)) == ""  # 10.6 %
    assert implausible(effect("run_in_friction"), settling, replace(RIG, duration=math.inf)) == ""


def test_units_are_those_of_the_drive():
    servo = replace(RIG, drive="position_servo")
    assert "3.7 rad" in implausible(effect("deadzone"), {"deadzone": 3.7}, servo)


def test_friction_that_varies_about_nothing_names_the_friction_that_is_missing():
    member = effect("position_dependent_friction")
    values = {"friction_cosine": 0.02, "friction_sine": 0.0, "cycles_per_turn": 6.0}
    why = implausible(member, values, replace(RIG, fitted={**RIG.fitted, "coulomb": 0.0}))
    assert why == (
        "friction_cosine is 0.02 N*m; the fitted Coulomb friction, which limits it, is 0: "
        "friction dissipates energy at every position."
    )
    assert "its plausible range is -3 to 3 N*m" in implausible(member, {**values, "friction_cosine": 4.0}, RIG)


def test_a_spring_may_take_all_torque_in_both_directions():
    """50 N m at either end of 2 rad: 50 N m/rad about a rest position in the middle."""
    parameters = {"spring_stiffness": 49.0, "spring_preload": 0.0}
    assert not implausible(effect("cable_spring"), parameters, RIG)
    assert "0 to 50 N*m/rad" in implausible(effect("cable_spring"), parameters | {"spring_stiffness": 51.0}, RIG)
