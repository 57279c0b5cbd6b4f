"""Small rigs for the tests."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from drake_tc.joint_simulator.measurement import CleanLog, clean_log
from drake_tc.joint_simulator.physics import Record, simulate
from drake_tc.joint_simulator.spec import Drive, Joint, RigSpec

from .truth import unmodelled_torque

Traces = dict[str, tuple[Record, CleanLog, np.ndarray]]

SERVO = Joint(
    drive="position_servo",
    gain=1.5e-4,
    servo_damping=26.0,
    viscous=9.0,
    coulomb=4.0,
    breakaway=1e-4,
    rotor_inertia=0.36,
    link_inertia=0.8,
    gravity=18.0,
    heat_capacity=40.0,
    ambient=25.0,
    bandwidth=26.0,
)


def rig(
    causes: Mapping[str, Mapping[str, float]] | None = None,
    drive: Drive = "position_servo",
    duration: float = 3.0,
    **changes: float,
) -> RigSpec:
    """A rig of the joint above with `causes`; `changes` are of the joint."""
    gain = {"position_servo": 1.5e-4, "voltage": 0.4, "current": 0.08}[drive]
    joint = replace(SERVO, drive=drive, **({"gain": gain} | changes))
    return RigSpec("rig", "single", "some", "middle", joint, 5, causes or {}, duration=duration)


def traces_of(rigs: Mapping[str, RigSpec]) -> Traces:
    """What is recorded of each rig's multisine, without noise, and the torque that the declared model leaves."""
    logs = [(record, clean_log(record)) for record in simulate([*rigs.values()], ["multisine"] * len(rigs))]
    return {name: (*each, unmodelled_torque(*each)) for name, each in zip(rigs, logs, strict=True)}
