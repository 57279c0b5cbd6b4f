"""Torque control of position-controlled robots in Drake, with models that are checked against measured data.

What a user types stands in `__all__`; each name is imported when it is first used, so `import drake_tc` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drake_tc.actuation.compensation import feedforward_effort
    from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
    from drake_tc.actuation.model_file import load_models, save_models
    from drake_tc.actuation.plant import ActuatorPlant
    from drake_tc.actuation.wiring import add_actuators, add_joint_actuators
    from drake_tc.control.gains import TorqueGains
    from drake_tc.control.guard import CommandGuard
    from drake_tc.control.inverse_dynamics import InverseDynamics
    from drake_tc.control.torque_control import TorqueControl
    from drake_tc.diagnosis.run import close_loop
    from drake_tc.effects.library import LIBRARY, effect, register_effect
    from drake_tc.errors import DrakeTcError
    from drake_tc.estimation.joint_torque import JointTorqueEstimator
    from drake_tc.estimation.torque_model import TorqueModel
    from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter
    from drake_tc.identification.actuator import actuator_model
    from drake_tc.identification.identify import identify
    from drake_tc.logs.prepare import load_run, load_runs
    from drake_tc.logs.record import Run
    from drake_tc.logs.rig import Rig, load_rig
    from drake_tc.report.block_graph.graph import block_graph
    from drake_tc.robot.plant import add_robot
    from drake_tc.robot.robot import Robot, load_robot
    from drake_tc.sensing.suite import add_sensors
    from drake_tc.sensor_validation.fault_monitor import FaultMonitor
    from drake_tc.tsid.limit_fields import LimitKind, register_limit
    from drake_tc.tsid.task_fields import TaskKind, register_task

__version__ = "0.1.0"

__all__ = [
    "LIBRARY",
    "ActuatorModel",
    "ActuatorPlant",
    "CommandGuard",
    "DrakeTcError",
    "Drive",
    "EffectValue",
    "FaultMonitor",
    "InverseDynamics",
    "JointTorqueEstimator",
    "LimitKind",
    "Rig",
    "Robot",
    "Run",
    "SavitzkyGolayFilter",
    "TaskKind",
    "TorqueControl",
    "TorqueGains",
    "TorqueModel",
    "actuator_model",
    "add_actuators",
    "add_joint_actuators",
    "add_robot",
    "add_sensors",
    "block_graph",
    "close_loop",
    "effect",
    "feedforward_effort",
    "identify",
    "load_models",
    "load_rig",
    "load_robot",
    "load_run",
    "load_runs",
    "register_effect",
    "register_limit",
    "register_task",
    "save_models",
]

_HOME = {
    "ActuatorModel": "actuation.model",
    "ActuatorPlant": "actuation.plant",
    "CommandGuard": "control.guard",
    "DrakeTcError": "errors",
    "Drive": "actuation.model",
    "EffectValue": "actuation.model",
    "FaultMonitor": "sensor_validation.fault_monitor",
    "InverseDynamics": "control.inverse_dynamics",
    "JointTorqueEstimator": "estimation.joint_torque",
    "LIBRARY": "effects.library",
    "LimitKind": "tsid.limit_fields",
    "Rig": "logs.rig",
    "Robot": "robot.robot",
    "Run": "logs.record",
    "TaskKind": "tsid.task_fields",
    "SavitzkyGolayFilter": "filtering.savitzky_golay",
    "TorqueControl": "control.torque_control",
    "TorqueGains": "control.gains",
    "TorqueModel": "estimation.torque_model",
    "actuator_model": "identification.actuator",
    "add_actuators": "actuation.wiring",
    "add_joint_actuators": "actuation.wiring",
    "add_robot": "robot.plant",
    "add_sensors": "sensing.suite",
    "block_graph": "report.block_graph.graph",
    "close_loop": "diagnosis.run",
    "effect": "effects.library",
    "feedforward_effort": "actuation.compensation",
    "identify": "identification.identify",
    "load_models": "actuation.model_file",
    "load_rig": "logs.rig",
    "load_robot": "robot.robot",
    "load_run": "logs.prepare",
    "load_runs": "logs.prepare",
    "register_effect": "effects.library",
    "register_limit": "tsid.limit_fields",
    "register_task": "tsid.task_fields",
    "save_models": "actuation.model_file",
}


def __getattr__(name: str) -> Any:
    """The public name `name`, from the module that defines it."""
    if name not in _HOME:
        raise AttributeError(f"drake_tc has no {name!r}; public names: {', '.join(__all__)}")
    return getattr(import_module(f"drake_tc.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
