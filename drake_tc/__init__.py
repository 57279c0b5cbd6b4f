"""Torque control of position-controlled robots in Drake, with models that are checked against measured data.

What a user types stands in `__all__`; each name is imported when it is first used, so `import drake_tc` costs nothing.
The same names stand in the packages below: `drake_tc.control.GuardSpec` is `drake_tc.GuardSpec`.
"""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.actuation.compensator import feedforward_effort
    from drake_tc.actuation.free_run import simulated_inertia
    from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
    from drake_tc.actuation.model_file import load_models, save_models
    from drake_tc.actuation.plant import ActuatorPlant
    from drake_tc.actuation.wiring import add_actuators, add_joint_actuators, sliding
    from drake_tc.analysis.frequency_response import channel, swept_sine
    from drake_tc.analysis.sampled import linearise, loop_margins, open_loop
    from drake_tc.control.gains import TorqueGains
    from drake_tc.control.guard import CommandGuard, GuardSpec
    from drake_tc.control.inverse_dynamics import InverseDynamics
    from drake_tc.control.torque_control import TorqueControl
    from drake_tc.control.torque_law import CompensationSpec
    from drake_tc.control.trajectories import Sinusoid, constant_trajectory, knot_trajectory, sinusoid_trajectory
    from drake_tc.diagnosis.run import close_loop
    from drake_tc.effects.library import LIBRARY, effect, register_effect
    from drake_tc.errors import DrakeTcError
    from drake_tc.estimation.joint_torque import JointTorqueEstimator, MomentumResidual
    from drake_tc.estimation.torque_model import TorqueModel
    from drake_tc.exchange.c_code import CSpec, to_c
    from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
    from drake_tc.hardware.lcm_link import LcmLink, LcmRobot
    from drake_tc.hardware.link import CallbackLink
    from drake_tc.hardware.loop import RealTimeLoop, RealTimeSpec
    from drake_tc.hardware.simulated_robot import SimulatedRobot
    from drake_tc.hardware.stepper import ControllerStepper
    from drake_tc.identification.actuator import actuator_model
    from drake_tc.identification.identify import identify
    from drake_tc.logs.prepare import load_run, load_runs
    from drake_tc.logs.record import Run
    from drake_tc.logs.rig import Rig, load_rig
    from drake_tc.loops.fused.fuse import fuse
    from drake_tc.loops.plant import add_robot_plant
    from drake_tc.loops.scenarios import FilterSpec
    from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec
    from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop, series_elastic_controller
    from drake_tc.loops.torque.scenario import TorqueLoopSpec
    from drake_tc.loops.torque.wiring import add_torque_loop, torque_controller
    from drake_tc.loops.whole_body.scenario import WholeBodySpec
    from drake_tc.loops.whole_body.wiring import add_whole_body_loop, whole_body_controller
    from drake_tc.report.block_graph.graph import block_graph
    from drake_tc.robot.plant import add_robot, joint_limits
    from drake_tc.robot.robot import Robot, load_robot
    from drake_tc.sensing.spec import SensorFault, SensorSpec
    from drake_tc.sensing.suite import SensorSuiteSpec, add_sensors
    from drake_tc.sensor_validation.fault_monitor import FaultMonitor
    from drake_tc.sensor_validation.monitor_spec import MonitorSpec
    from drake_tc.tsid.configuration import load_law
    from drake_tc.tsid.controller import RobustTsid
    from drake_tc.tsid.kinds import LimitKind, TaskKind, register_limit, register_task
    from drake_tc.tsid.law import Law
    from drake_tc.watch.compare import compare
    from drake_tc.watch.health import ModelHealth, health_of
    from drake_tc.watch.in_loop import add_model_monitor
    from drake_tc.watch.monitor import ModelMonitor, ModelMonitorSpec

__version__ = "0.1.0"

__all__ = [
    "LIBRARY",
    "ActuatorModel",
    "ActuatorPlant",
    "CSpec",
    "CallbackLink",
    "CommandGuard",
    "CompensationSpec",
    "ControllerStepper",
    "DrakeTcError",
    "Drive",
    "EffectValue",
    "FaultMonitor",
    "FilterSpec",
    "GuardSpec",
    "InverseDynamics",
    "JointTorqueEstimator",
    "Law",
    "LcmLink",
    "LcmRobot",
    "LimitKind",
    "ModelHealth",
    "ModelMonitor",
    "ModelMonitorSpec",
    "MomentumResidual",
    "MonitorSpec",
    "RealTimeLoop",
    "RealTimeSpec",
    "Rig",
    "Robot",
    "RobustTsid",
    "Run",
    "SavitzkyGolayFilter",
    "SensorFault",
    "SensorSpec",
    "SensorSuiteSpec",
    "SeriesElasticLoopSpec",
    "SimulatedRobot",
    "Sinusoid",
    "TaskKind",
    "TorqueControl",
    "TorqueGains",
    "TorqueLoopSpec",
    "TorqueModel",
    "WholeBodySpec",
    "actuator_model",
    "add_actuators",
    "add_joint_actuators",
    "add_model_monitor",
    "add_robot",
    "add_robot_plant",
    "add_sensors",
    "add_series_elastic_loop",
    "add_torque_loop",
    "add_whole_body_loop",
    "block_graph",
    "channel",
    "close_loop",
    "compare",
    "constant_trajectory",
    "effect",
    "feedforward_effort",
    "fuse",
    "health_of",
    "identify",
    "joint_limits",
    "knot_trajectory",
    "linearise",
    "load_law",
    "load_models",
    "load_rig",
    "load_robot",
    "load_run",
    "load_runs",
    "loop_margins",
    "open_loop",
    "register_effect",
    "register_limit",
    "register_task",
    "save_models",
    "series_elastic_controller",
    "simulated_inertia",
    "sinusoid_trajectory",
    "sliding",
    "swept_sine",
    "to_c",
    "torque_controller",
    "whole_body_controller",
]

_HOMES = {
    "LIBRARY": "effects.library",
    "ActuatorModel": "actuation.model",
    "ActuatorPlant": "actuation.plant",
    "CSpec": "exchange.c_code",
    "CallbackLink": "hardware.link",
    "CommandGuard": "control.guard",
    "CompensationSpec": "control.torque_law",
    "ControllerStepper": "hardware.stepper",
    "DrakeTcError": "errors",
    "Drive": "actuation.model",
    "EffectValue": "actuation.model",
    "FaultMonitor": "sensor_validation.fault_monitor",
    "FilterSpec": "loops.scenarios",
    "GuardSpec": "control.guard",
    "InverseDynamics": "control.inverse_dynamics",
    "JointTorqueEstimator": "estimation.joint_torque",
    "Law": "tsid.law",
    "LcmLink": "hardware.lcm_link",
    "LcmRobot": "hardware.lcm_link",
    "LimitKind": "tsid.kinds",
    "ModelHealth": "watch.health",
    "ModelMonitor": "watch.monitor",
    "ModelMonitorSpec": "watch.monitor",
    "MomentumResidual": "estimation.joint_torque",
    "MonitorSpec": "sensor_validation.monitor_spec",
    "RealTimeLoop": "hardware.loop",
    "RealTimeSpec": "hardware.loop",
    "Rig": "logs.rig",
    "Robot": "robot.robot",
    "RobustTsid": "tsid.controller",
    "Run": "logs.record",
    "SavitzkyGolayFilter": "filtering.savitzky_golay",
    "SensorFault": "sensing.spec",
    "SensorSpec": "sensing.spec",
    "SensorSuiteSpec": "sensing.suite",
    "SeriesElasticLoopSpec": "loops.series_elastic.scenario",
    "SimulatedRobot": "hardware.simulated_robot",
    "Sinusoid": "control.trajectories",
    "TaskKind": "tsid.kinds",
    "TorqueControl": "control.torque_control",
    "TorqueGains": "control.gains",
    "TorqueLoopSpec": "loops.torque.scenario",
    "TorqueModel": "estimation.torque_model",
    "WholeBodySpec": "loops.whole_body.scenario",
    "actuator_model": "identification.actuator",
    "add_actuators": "actuation.wiring",
    "add_joint_actuators": "actuation.wiring",
    "add_model_monitor": "watch.in_loop",
    "add_robot": "robot.plant",
    "add_robot_plant": "loops.plant",
    "add_sensors": "sensing.suite",
    "add_series_elastic_loop": "loops.series_elastic.wiring",
    "add_torque_loop": "loops.torque.wiring",
    "add_whole_body_loop": "loops.whole_body.wiring",
    "block_graph": "report.block_graph.graph",
    "channel": "analysis.frequency_response",
    "close_loop": "diagnosis.run",
    "compare": "watch.compare",
    "constant_trajectory": "control.trajectories",
    "effect": "effects.library",
    "feedforward_effort": "actuation.compensator",
    "fuse": "loops.fused.fuse",
    "health_of": "watch.health",
    "identify": "identification.identify",
    "joint_limits": "robot.plant",
    "knot_trajectory": "control.trajectories",
    "linearise": "analysis.sampled",
    "load_law": "tsid.configuration",
    "load_models": "actuation.model_file",
    "load_rig": "logs.rig",
    "load_robot": "robot.robot",
    "load_run": "logs.prepare",
    "load_runs": "logs.prepare",
    "loop_margins": "analysis.sampled",
    "open_loop": "analysis.sampled",
    "register_effect": "effects.library",
    "register_limit": "tsid.kinds",
    "register_task": "tsid.kinds",
    "save_models": "actuation.model_file",
    "series_elastic_controller": "loops.series_elastic.wiring",
    "simulated_inertia": "actuation.free_run",
    "sinusoid_trajectory": "control.trajectories",
    "sliding": "actuation.wiring",
    "swept_sine": "analysis.frequency_response",
    "to_c": "exchange.c_code",
    "torque_controller": "loops.torque.wiring",
    "whole_body_controller": "loops.whole_body.wiring",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
