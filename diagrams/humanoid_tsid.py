"""A legged robot on a floor under robust task-space inverse dynamics, from a controller file alone.

The loop is the library's whole-body loop (`drake_tc.loops.whole_body.running`):

    references, contacts --> tsid --> [drives] --> (+ torque error) --> plant and floor --> state or estimate --> tsid

A scenario says what the controller knows (`state`) and where its torques go (`torque`). The loop of Faraji, Colasanto
and Ijspeert (2015), with base estimator and series-elastic drives, is in `coman.scenario.yaml`.

    drake-tc simulate humanoid_tsid --scenario-name one_foot
    drake-tc simulate humanoid_tsid --scenario-file diagrams/coman.scenario.yaml --scenario-name turn_1hz
"""

from pathlib import Path

from drake_tc.loops.entries import whole_body_loop

ENTRY = whole_body_loop(
    "humanoid_tsid",
    "a humanoid on a floor under robust TSID, its torques direct or through drives",
    Path(__file__).with_name("humanoid_tsid.scenario.yaml"),
)
