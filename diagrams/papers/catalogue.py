"""Reproductions by id, as `drake-tc reproduce` takes them."""

from collections.abc import Callable, Mapping

from drake_tc.diagrams.papers.delprete2015.closed_loop import closed_loop
from drake_tc.diagrams.papers.delprete2015.com_move import approximations_of_p, five_ways
from drake_tc.diagrams.papers.delprete2015.masses import wrong_masses
from drake_tc.diagrams.papers.delprete2015.reach import far_reach, wrong_sigma
from drake_tc.diagrams.papers.delprete2016.beyond import beyond
from drake_tc.diagrams.papers.delprete2016.force_figures import fig5, fig6
from drake_tc.diagrams.papers.delprete2016.motion_tables import table2, table3
from drake_tc.diagrams.papers.delprete2016.stability import stability
from drake_tc.diagrams.papers.delprete2016.stability_grid import stability_grid
from drake_tc.diagrams.papers.delprete2016.table1 import table1
from drake_tc.diagrams.papers.delprete2016.torque_estimate import torque_estimate
from drake_tc.diagrams.papers.delprete2016.tuning import tuning
from drake_tc.diagrams.papers.faraji2015.contacts import one_foot, three_contacts
from drake_tc.diagrams.papers.faraji2015.faults import faults
from drake_tc.diagrams.papers.faraji2015.motions import genuflection, turn_1hz, turn_half_hz
from drake_tc.diagrams.papers.faraji2015.pushes import pushes
from drake_tc.diagrams.papers.faraji2015.sea_bode import bode
from drake_tc.diagrams.papers.faraji2015.sea_held import held
from drake_tc.diagrams.papers.faraji2015.sea_motor import motor
from drake_tc.diagrams.papers.faraji2015.slip import slip
from drake_tc.diagrams.papers.faraji2015.soles import soles

from drake_tc.errors import ParamsError
from drake_tc.report.reproduction import Progress, Reproduction

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
