"""One voltage-driven series-elastic joint in torque control: clamped, moved by a hand, or with a free link.

The loop is the library's (`drake_tc.loops.series_elastic.loop`), after Faraji, Colasanto and Ijspeert (2015):

    reference --> torque_control --voltage, delayed--> motor and gear --spring--> link <-- hand
                       ^---- motor encoder, strain gauge ----|

    drake-tc simulate sea_joint
"""

from pathlib import Path

from drake_tc.loops.entries import series_elastic_loop

ENTRY = series_elastic_loop(
    "sea_joint",
    "a voltage-driven series-elastic joint in torque control: held, moved by a hand, or free",
    Path(__file__).with_name("sea_joint.scenario.yaml"),
)
