"""Sensors checked before they are used, and what stands in for those that fail."""

from typing import TYPE_CHECKING

from drake_tc.front_door import front_door

if TYPE_CHECKING:
    from drake_tc.sensor_validation.fault_monitor import FaultMonitor
    from drake_tc.sensor_validation.monitor_spec import MonitorSpec

__all__ = [
    "FaultMonitor",
    "MonitorSpec",
]

_HOMES = {
    "FaultMonitor": "fault_monitor",
    "MonitorSpec": "monitor_spec",
}

__getattr__, __dir__ = front_door(__name__, _HOMES)
