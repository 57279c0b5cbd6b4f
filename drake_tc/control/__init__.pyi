"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.control.gains import TorqueGains as TorqueGains
from drake_tc.control.guard import CommandGuard as CommandGuard
from drake_tc.control.guard import GuardSpec as GuardSpec
from drake_tc.control.inverse_dynamics import InverseDynamics as InverseDynamics
from drake_tc.control.inverse_dynamics import MotionSources as MotionSources
from drake_tc.control.reference_source import ReferenceSource as ReferenceSource
from drake_tc.control.references import PointToPoint as PointToPoint
from drake_tc.control.references import Slerp as Slerp
from drake_tc.control.references import Swing as Swing
from drake_tc.control.torque_control import TorqueControl as TorqueControl
from drake_tc.control.torque_law import CompensationSpec as CompensationSpec
from drake_tc.control.trajectories import Chain as Chain
from drake_tc.control.trajectories import PosePath as PosePath
from drake_tc.control.trajectories import Sinusoid as Sinusoid
from drake_tc.control.trajectories import constant_trajectory as constant_trajectory
from drake_tc.control.trajectories import knot_trajectory as knot_trajectory
from drake_tc.control.trajectories import sinusoid_trajectory as sinusoid_trajectory
