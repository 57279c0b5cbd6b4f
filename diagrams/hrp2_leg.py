"""A leg in torque control without joint-torque sensors, hanging free or with its foot on a rigid object.

The loop is the library's torque loop (`drake_tc.loops.torque.running`) around the robot file that a scenario names:

    reference --> inverse_dynamics --> torque_control --> guard --> actuators --> plant --> encoder, imu, force_torque
                       ^                    ^               ^                                      |
                       |--- torque_estimator|               |-- fault_monitor <---- raw readings --|
                                 ^--------- filter <-----------------------------------------------|

    drake-tc simulate hrp2_leg --scenario-name stairs_swing
    drake-tc simulate hrp2_leg --scenario-file diagrams/other_robots.scenario.yaml --scenario-name talos_leg
"""

from pathlib import Path

from drake_tc.loops.entries import torque_loop

HERE = Path(__file__).parent
HANGING = torque_loop(
    "hrp2_leg",
    "a hanging leg in torque control, or under its vendor's servo",
    HERE / "hrp2_leg.scenario.yaml",
)
IN_CONTACT = torque_loop(
    "hrp2_leg_contact",
    "the foot on a rigid object: force control",
    HERE / "hrp2_leg_contact.scenario.yaml",
)
