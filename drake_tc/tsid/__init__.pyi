"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.tsid.configuration import load_law as load_law
from drake_tc.tsid.controller import RobustTsid as RobustTsid
from drake_tc.tsid.kinds import LimitKind as LimitKind
from drake_tc.tsid.kinds import TaskKind as TaskKind
from drake_tc.tsid.kinds import register_limit as register_limit
from drake_tc.tsid.kinds import register_task as register_task
from drake_tc.tsid.law import Law as Law
