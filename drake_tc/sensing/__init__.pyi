"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.sensing.spec import SensorFault as SensorFault
from drake_tc.sensing.spec import SensorSpec as SensorSpec
from drake_tc.sensing.suite import SensorSuiteSpec as SensorSuiteSpec
from drake_tc.sensing.suite import add_sensors as add_sensors
