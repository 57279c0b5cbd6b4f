"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.analysis.frequency_response import channel as channel
from drake_tc.analysis.frequency_response import swept_sine as swept_sine
from drake_tc.analysis.limit_cycle import coulomb_gain as coulomb_gain
from drake_tc.analysis.limit_cycle import deadzone_gain as deadzone_gain
from drake_tc.analysis.limit_cycle import find_limit_cycle as find_limit_cycle
from drake_tc.analysis.limit_cycle import predicted_limit_cycles as predicted_limit_cycles
from drake_tc.analysis.limit_cycle import saturation_gain as saturation_gain
from drake_tc.analysis.sampled import linearise as linearise
from drake_tc.analysis.sampled import loop_margins as loop_margins
from drake_tc.analysis.sampled import open_loop as open_loop
