"""A torque that is 1000 times too large or too small for a known load is refused in one line with both units."""

from dataclasses import replace

import numpy as np
import pytest

from drake_tc.diagnosis.problem.prepared import prepare_joint
from drake_tc.errors import IdentificationError

from ..pendulum_rig import JOINT, Swing, motion, record, rig_of

GRAVITY = 9.81
SWING = Swing(drive="torque", gain=1.0, moment=2.5, zero=0.0, constant=0.0, inertia=0.15, effort_noise=2e-3)
MASS = SWING.moment**2 / (GRAVITY**2 * SWING.inertia)
"""Of the point mass with this moment and this inertia [kg]."""
PENDULUM = {"pendulum": {"mass": MASS, "length": SWING.moment / (MASS * GRAVITY)}}


def prepare(scale, load=PENDULUM, torque=None, **more):
    """The joint of which the log has `scale` times the drive's torque and, where given, `torque` times the load's."""
    swing = replace(SWING, gain=scale, effort_noise=2e-3 * scale, drive=more.get("drive", "torque"))
    runs = []
    for k in range(2):
        run = record(swing, f"run{k}", k, 0.37 * k)
        if torque is not None:
            q, _, a = motion(swing, 0.37 * k)
            measured = swing.moment * np.sin(q) + swing.inertia * a
            run = replace(run, columns=run.columns | {f"{JOINT}/torque": torque * measured})
        runs.append(run)
    return prepare_joint(runs, [], rig_of(swing, load, **({"drive_gain": None} | more)), JOINT)


@pytest.mark.parametrize(
    ("scale", "units", "said"),
    [
        (1e3, {}, "joint/torque_command is in mN*m and not in N*m; set units: {joint/torque_command: mN*m}"),
        (1e3, {"torque_command": "N*m"}, "is in mN*m and not in N*m"),
        (1e-3, {"torque_command": "mN*m"}, "is in N*m and not in mN*m; set units: {joint/torque_command: N*m}"),
    ],
)
@pytest.mark.parametrize("declared", [None, 1.0])
def test_the_torque_of_a_drive_on_a_pendulum(scale, units, said, declared):
    with pytest.raises(IdentificationError) as told:
        prepare(scale, units=units, drive_gain=declared)
    assert said in str(told.value) and "\n" not in str(told.value)


@pytest.mark.parametrize(("torque", "units"), [(1e3, {}), (1e-3, {"torque": "mN*m"})])
def test_a_measured_load_may_be_the_wrong_one(torque, units):
    with pytest.raises(IdentificationError) as told:
        prepare(1.0, "torque", torque, units=units)
    said, other = ("mN*m", "N*m") if units else ("N*m", "mN*m")
    assert f"joint/torque is in {other} and not in {said}" in str(told.value)


@pytest.mark.parametrize(
    ("scale", "more"),
    [
        (1.0, {}),
        (1.0 / 160.0, {}),  # on the motor's side of a gear
        (1e3, {"units": {"torque_command": 1.0}}),  # a stated factor is believed
        (1e3, {"drive_gain": 1e3}),  # and so is a declared gain
        (1e3, {"drive": "current"}),
        (1e-3, {"drive": "current"}),
    ],
)
def test_what_is_possible_is_believed(scale, more):
    assert prepare(scale, **more).train.target.size > 50


def test_an_effort_that_does_not_follow_the_load_tells_no_unit():
    """Friction of 1 N m beside a load of 1 mN m: the ratio is that of two other things."""
    swing = replace(SWING, moment=2.5e-3, inertia=0.15e-3, coulomb=1.0)
    light = {"pendulum": {"mass": 1e-3 * MASS, "length": PENDULUM["pendulum"]["length"]}}
    runs = [record(swing, f"run{k}", k, 0.37 * k) for k in range(2)]
    try:
        prepare_joint(runs, [], rig_of(swing, light, drive_gain=None), JOINT)
    except IdentificationError as error:
        assert "mN*m" not in str(error)
