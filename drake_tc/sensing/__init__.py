"""Sensor models: what encoders, IMUs and force/torque sensors make of the truth."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.sensing.spec import SensorFault, SensorSpec
    from drake_tc.sensing.suite import SensorSuiteSpec, add_sensors

__all__ = [
    "SensorFault",
    "SensorSpec",
    "SensorSuiteSpec",
    "add_sensors",
]

_HOMES = {
    "SensorFault": "spec",
    "SensorSpec": "spec",
    "SensorSuiteSpec": "suite",
    "add_sensors": "suite",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
