"""What a user types of this package, and where it is defined; see `drake_tc.front_door`."""

from drake_tc.loops.function_diagram import function_entry as function_entry
from drake_tc.loops.plant import add_robot_plant as add_robot_plant
from drake_tc.loops.scenarios import FilterSpec as FilterSpec
from drake_tc.loops.series_elastic.scenario import SeriesElasticLoopSpec as SeriesElasticLoopSpec
from drake_tc.loops.series_elastic.wiring import add_series_elastic_loop as add_series_elastic_loop
from drake_tc.loops.series_elastic.wiring import series_elastic_controller as series_elastic_controller
from drake_tc.loops.torque.scenario import TorqueLoopSpec as TorqueLoopSpec
from drake_tc.loops.torque.wiring import add_torque_loop as add_torque_loop
from drake_tc.loops.torque.wiring import torque_controller as torque_controller
from drake_tc.loops.whole_body.scenario import WholeBodySpec as WholeBodySpec
from drake_tc.loops.whole_body.wiring import add_whole_body_loop as add_whole_body_loop
from drake_tc.loops.whole_body.wiring import whole_body_controller as whole_body_controller
