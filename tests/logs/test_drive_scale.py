"""The drive gain that a rig file states directly, as a motor's constants, or as a servo's gains."""

import pytest
from numpy.testing import assert_allclose

from drake_tc.errors import RigError
from drake_tc.logs.rig import parse_rig, rig_document

CURRENT = {"joint": "knee", "drive": "current"}
SERVO = {"joint": "knee", "drive": "position_servo"}
LEG = {"joints": ["hip", "knee"], "drive": "current"}


def test_a_motors_constants_give_the_drive_gain():
    rig = parse_rig({**CURRENT, "torque_constant": 0.07, "gear_ratio": 100.0})
    assert_allclose(rig.drive_gain["knee"], 1.0 / 7.0, rtol=1e-12)  # 7 N m at the joint for 1 A
    mixed = parse_rig(
        {**LEG, "torque_constant": {"knee": 0.1}, "gear_ratio": {"knee": 50.0}, "drive_gain": {"hip": 0.3}}
    )
    assert mixed.drive_gain == {"hip": 0.3, "knee": 1.0 / 5.0}


def test_a_servos_gains_give_the_drive_gain_and_its_damping():
    rig = parse_rig({**SERVO, "proportional_gain": 20.0, "derivative_gain": 1.5})
    assert rig.drive_gain == {"knee": 0.05} and rig.derivative_gain == {"knee": 1.5}
    assert parse_rig(rig_document(rig)) == rig


def test_a_torque_drive_reads_its_own_column():
    rig = parse_rig({"joint": "knee", "drive": "torque", "units": {"torque_command": "mN*m"}})
    assert rig.command_column("knee") == "knee/torque_command" and not rig.drive_gain


REFUSED = [
    ({**CURRENT, "torque_constant": 0.07}, "torque_constant: expected gear_ratio for knee too"),
    ({**CURRENT, "gear_ratio": 100.0}, "gear_ratio: expected torque_constant for knee too"),
    (
        {**CURRENT, "torque_constant": 0.07, "gear_ratio": 100.0, "drive_gain": 0.1},
        "torque_constant: knee has drive_gain too, and both state the drive's gain",
    ),
    ({**SERVO, "torque_constant": 0.07, "gear_ratio": 9.0}, "it belongs to `drive: current`; the drive of knee is"),
    ({**CURRENT, "proportional_gain": 20.0}, "proportional_gain: it belongs to `drive: position_servo`"),
    ({**SERVO, "derivative_gain": 1.5}, "derivative_gain: expected proportional_gain or drive_gain for knee too"),
    ({**SERVO, "proportional_gain": 9.0, "drive_gain": 0.1}, "proportional_gain: knee has drive_gain too"),
    ({**SERVO, "proportional_gain": -9.0}, "proportional_gain: expected a positive number, got -9.0"),
    ({**LEG, "gear_ratio": {"hipp": 9.0}}, "'hipp' is not a joint of this rig; did you mean 'hip'?"),
]


@pytest.mark.parametrize(("document", "said"), REFUSED)
def test_keys_that_do_not_go_together_are_refused(document, said):
    with pytest.raises(RigError) as caught:
        parse_rig(document, "rig.yaml")
    message = str(caught.value)
    assert message.startswith("rig.yaml: ") and said in message and "\n" not in message
