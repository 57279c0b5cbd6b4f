"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.sensor_validation.fault_monitor import FaultMonitor as FaultMonitor
from drake_tc.sensor_validation.monitor_spec import MonitorSpec as MonitorSpec
