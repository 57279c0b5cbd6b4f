"""Reproductions by id, as `drake-tc reproduce` takes them."""

from collections.abc import Callable, Mapping

from drake_tc.diagrams.papers.beyond import beyond
from drake_tc.diagrams.papers.coman_contacts import one_foot, three_contacts
from drake_tc.diagrams.papers.coman_faults import faults
from drake_tc.diagrams.papers.coman_motions import genuflection, turn_1hz, turn_half_hz
from drake_tc.diagrams.papers.coman_pushes import pushes
from drake_tc.diagrams.papers.coman_slip import slip
from drake_tc.diagrams.papers.coman_soles import soles
from drake_tc.diagrams.papers.force_figures import fig5, fig6
from drake_tc.diagrams.papers.motion_tables import table2, table3
from drake_tc.diagrams.papers.reproduction import Progress, Reproduction
from drake_tc.diagrams.papers.sea_bode import bode
from drake_tc.diagrams.papers.sea_held import held
from drake_tc.diagrams.papers.sea_motor import motor
from drake_tc.diagrams.papers.stability import stability
from drake_tc.diagrams.papers.stability_grid import stability_grid
from drake_tc.diagrams.papers.table1 import table1
from drake_tc.diagrams.papers.torque_estimate import torque_estimate
from drake_tc.diagrams.papers.tsid_closed_loop import closed_loop
from drake_tc.diagrams.papers.tsid_com_move import approximations_of_p, five_ways
from drake_tc.diagrams.papers.tsid_masses import wrong_masses
from drake_tc.diagrams.papers.tsid_reach import far_reach, wrong_sigma
from drake_tc.diagrams.papers.tuning import tuning

from drake_tc.errors import ParamsError

REPRODUCTIONS: Mapping[str, Callable[[int, Progress | None], Reproduction]] = {
    "A.table1": table1,
    "A.table2": table2,
    "A.table3": table3,
    "A.fig5": fig5,
    "A.fig6": fig6,
    "A.stability": stability,
    "A.stability_grid": stability_grid,
    "A.torque_estimate": torque_estimate,
    "A.tune": tuning,
    "A.beyond": beyond,
    "B.test1": approximations_of_p,
    "B.test2": five_ways,
    "B.test3": far_reach,
    "B.test4": wrong_sigma,
    "B.test5": wrong_masses,
    "B.closed_loop": closed_loop,
    "C.bode": bode,
    "C.held": held,
    "C.motor": motor,
    "C.genuflection": genuflection,
    "C.turn1hz": turn_1hz,
    "C.turn_half_hz": turn_half_hz,
    "C.slip": slip,
    "C.soles": soles,
    "C.pushes": pushes,
    "C.faults": faults,
    "C.one_foot": one_foot,
    "C.three_contacts": three_contacts,
}
"""Id to a function of seed and progress."""


def chosen(name: str) -> list[str]:
    """The ids that a name stands for: one of them, or "all".

    Raises:
        ParamsError: no such id; the message lists those there are.
    """
    if name == "all":
        return list(REPRODUCTIONS)
    if name not in REPRODUCTIONS:
        raise ParamsError(f"no reproduction {name!r}; possible: {', '.join(REPRODUCTIONS)}, all")
    return [name]
