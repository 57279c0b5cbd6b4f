"""Drives and effects joined into actuator models, and the system that puts them before a plant."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.actuation.compensator import feedforward_effort
    from drake_tc.actuation.free_run import simulated_inertia
    from drake_tc.actuation.model import ActuatorModel, Drive, EffectValue
    from drake_tc.actuation.model_file import load_models, save_models
    from drake_tc.actuation.plant import ActuatorPlant
    from drake_tc.actuation.wiring import add_actuators, add_joint_actuators, sliding

__all__ = [
    "ActuatorModel",
    "ActuatorPlant",
    "Drive",
    "EffectValue",
    "add_actuators",
    "add_joint_actuators",
    "feedforward_effort",
    "load_models",
    "save_models",
    "simulated_inertia",
    "sliding",
]

_HOMES = {
    "ActuatorModel": "model",
    "ActuatorPlant": "plant",
    "Drive": "model",
    "EffectValue": "model",
    "add_actuators": "wiring",
    "add_joint_actuators": "wiring",
    "feedforward_effort": "compensator",
    "load_models": "model_file",
    "save_models": "model_file",
    "simulated_inertia": "free_run",
    "sliding": "wiring",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
