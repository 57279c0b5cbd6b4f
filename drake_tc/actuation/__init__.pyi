"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.actuation.compensator import feedforward_effort as feedforward_effort
from drake_tc.actuation.free_run import simulated_inertia as simulated_inertia
from drake_tc.actuation.model import ActuatorModel as ActuatorModel
from drake_tc.actuation.model import Drive as Drive
from drake_tc.actuation.model import EffectValue as EffectValue
from drake_tc.actuation.model_file import load_models as load_models
from drake_tc.actuation.model_file import save_models as save_models
from drake_tc.actuation.plant import ActuatorPlant as ActuatorPlant
from drake_tc.actuation.wiring import add_actuators as add_actuators
from drake_tc.actuation.wiring import add_joint_actuators as add_joint_actuators
from drake_tc.actuation.wiring import sliding as sliding
