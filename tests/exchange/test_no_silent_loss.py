"""Every effect that a model may have is in the exported file, or is named as lost: for each target and kind of drive.

An effect is in the file if each of its parameters changes the text. The gain of a drive that a file has no place for is
in the sentence on its loss.
"""

import itertools
from functools import cache
from typing import get_args

import pytest

from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
from drake_tc.effects.base import DriveKind
from drake_tc.effects.library import BUILT_IN, effect
from drake_tc.exchange.actuator_configs import ServoSettings, to_isaaclab, to_isaaclab_bam, to_mjlab_actuators
from drake_tc.exchange.bam import to_bam
from drake_tc.exchange.mjcf import to_mjcf, with_torque_constant
from drake_tc.exchange.projection import TARGETS, project, vocabulary
from drake_tc.exchange.urdf import to_sdf, to_urdf

SETTINGS = ServoSettings(supply_voltage=12.0, position_gain=40.0)
WRITERS = {
    "mjcf": to_mjcf,
    "playground": to_mjcf,
    "newton": to_mjcf,
    "mjlab": to_mjlab_actuators,
    "urdf": to_urdf,
    "drake-urdf": lambda projections: to_urdf(projections, drake=True),
    "sdf": to_sdf,
    "isaaclab": to_isaaclab,
    "isaaclab-bam": lambda projections: to_isaaclab_bam(projections, SETTINGS),
    "bam": to_bam,
}
ON_A_VOLTAGE = ("isaaclab-bam", "bam")
"""Targets that refuse every other drive, and a drive without a torque constant."""
KINDS = [
    (target, kind, constant)
    for target in TARGETS
    for kind, constant in [*((kind, None) for kind in get_args(DriveKind)), ("voltage", 1.2)]
    if target not in ON_A_VOLTAGE or constant is not None
]
GAIN = 0.5
USUAL = {"viscous": {"viscous": 40.0}, "coulomb": {"coulomb": 3.0}, "rotor_inertia": {"rotor_inertia": 0.02}}
"""Of every model: the back-EMF is a part of the viscous friction."""
EXPRESSIBLE = (
    *("viscous", "coulomb", "rotor_inertia", "stribeck", "quadratic_viscous", "load_dependent_friction"),
    *("static_friction", "viscous_power", "saturation", "servo_gain", "delay.command", "delay.loop", "backlash"),
    *(
        "servo_integrator",
        "cable_spring",
        "cable_spring.beside_weight",
        "torque_ripple",
        "current_lag",
        "current_lag.command",
        "elasticity",
    ),
)
"""Effects that at least one target has; only these can displace each other. A servo has one limit, of either form."""


def value(parameter, second):
    """One of two values of a parameter within its bounds."""
    inside = [x for x in (0.02, 0.03, 0.3, 0.5, 1.0, 2.0, 5.0, 30.0) if parameter.lower <= x <= parameter.upper]
    return inside[1 if second else 0]


def parameters(key, changed=""):
    """Two values that differ in the parameter `changed`."""
    usual = USUAL.get(key, {})
    return {
        p.name: usual[p.name] * (1.5 if p.name == changed else 1.0) if p.name in usual else value(p, p.name == changed)
        for p in effect(key).parameters
    }


@cache
def export(target, kind, constant, keys, changed=("", "")):
    """The text with the gain that is lost, and the names of lost effects; `changed` is a key and its parameter."""
    values = {key: parameters(key, changed[1] if key == changed[0] else "") for key in keys}
    model = ActuatorModel("knee", Drive(kind, GAIN), tuple(EffectValue(key, each) for key, each in values.items()))
    projection = project(model, vocabulary(target, kind, constant))
    if constant is not None:
        projection = with_torque_constant(projection, constant, TARGETS[target])
    text = WRITERS[target]([projection])
    text += "".join(loss.why for loss in projection.losses if loss.effect == "drive gain")
    lost = {loss.effect for loss in projection.losses}
    return text, lost | set(projection.refit.effects if projection.refit is not None else ())


def silent(target, kind, constant, keys):
    """Parameters that are neither in the text nor of an effect that is named as lost."""
    text, lost = export(target, kind, constant, keys)
    return [
        f"{target}, {kind}, {constant}: {key}.{p.name} beside {', '.join(keys)}"
        for key in keys
        if not lost & {key, effect(key).id}
        for p in effect(key).parameters
        if export(target, kind, constant, keys, (key, p.name))[0] == text
    ]


def with_usual(*keys):
    return (*USUAL, *(key for key in keys if key not in USUAL))


@pytest.mark.parametrize(("target", "kind", "constant"), KINDS)
def test_no_effect_is_lost_silently(target, kind, constant):
    every = [each.key for each in BUILT_IN]
    assert len(every) > 50
    assert [line for key in every for line in silent(target, kind, constant, with_usual(key))] == []


FAST = (*KINDS[::4], KINDS[-1])
"""Each target, with one or two kinds of drive."""


@pytest.mark.parametrize(
    ("target", "kind", "constant"),
    [pytest.param(*each, marks=[] if each in FAST else pytest.mark.slow) for each in KINDS],
)
def test_no_effect_displaces_another_silently(target, kind, constant):
    pairs = list(itertools.combinations(EXPRESSIBLE, 2))
    assert [line for pair in pairs for line in silent(target, kind, constant, with_usual(*pair))] == []


@pytest.mark.parametrize(("target", "kind"), sorted({each[:2] for each in KINDS}))
def test_each_loss_says_what_it_means(target, kind):
    for each in BUILT_IN:
        model = ActuatorModel("knee", Drive(kind, GAIN), (EffectValue(each.key, parameters(each.key)),))
        assert all(loss.why for loss in project(model, TARGETS[target]).losses), each.key


def test_a_late_sensor_is_no_late_command():
    delay = EffectValue("delay.torque_sensor", {"delay": 0.01})
    (lost,) = project(ActuatorModel("knee", Drive("torque", 1.0), (delay,)), TARGETS["sdf"]).losses[-1:]
    assert lost.why == "an error of the sensor, not of the actuator"


def test_the_pairs_are_of_all_effects_that_a_target_has():
    """Each other effect is named as lost by every target, whatever is beside it."""
    others = [each.key for each in BUILT_IN if each.key not in (*EXPRESSIBLE, "saturation.servo")]
    for target, kind, constant in KINDS:
        for key in others:
            assert {key, effect(key).id} & export(target, kind, constant, with_usual(key))[1], (target, kind, key)


@pytest.mark.parametrize(("target", "kind", "constant"), [each for each in KINDS if each[2] is not None])
@pytest.mark.parametrize("more", [(), ("saturation",), ("delay.loop",), ("saturation", "delay.loop")])
def test_a_torque_constant_is_used_or_said_to_be_lost(target, kind, constant, more):
    text, lost = export(target, kind, constant, with_usual(*more))
    assert ("torque_constant" in lost) != (export(target, kind, 1.5 * constant, with_usual(*more))[0] != text)
