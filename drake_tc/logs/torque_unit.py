"""The unit of a torque column, by the declared rotor inertia.

In the balance  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K  the drive gain K takes up any unit of the torque,
but the ratio of the coefficients of qddot and tau is the rotor inertia J in the torque's unit. Where J is declared and
the ratio is 1000 times as large, the column is in mN*m. A unit that the rig file states is doubted by this factor of
1000 alone, and a factor that it states is believed.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from drake_tc.config.joint_units import TORQUE, JointType
from drake_tc.errors import LogError
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.signs import effort_and_motion
from drake_tc.logs.units import scale_of
from drake_tc.types import IntArray

UNITS: Mapping[JointType, Mapping[str, float]] = {
    "revolute": {"mN*m": 1e3, "kN*m": 1e-3, "kgf*cm": 10.1972, "kgf*m": 0.101972, "lbf*in": 8.85075},
    "prismatic": {"mN": 1e3, "kN": 1e-3, "kgf": 0.101972, "4.44822": 0.224809},
}
"""What a rig file may say of the column (a number is the factor to N*m or N) and how much of it is one N*m or N."""
NEAR = 0.07
"""Relative distance from such a factor."""
STATED: Mapping[JointType, Mapping[float, tuple[str, Mapping[str, float]]]] = {
    "revolute": {1.0: ("N*m", {"mN*m": 1e3}), 1e-3: ("mN*m", {"N*m": 1e-3})},
    "prismatic": {1.0: ("N", {"mN": 1e3}), 1e-3: ("mN", {"N": 1e-3})},
}
"""By the factor of a stated unit, its name and what the column may be in instead, with its factor as in `UNITS`."""
PARTS = 3
"""Parts of a run that must all say so, too."""
ALIKE = 1.6
"""Factor within which each part does."""
LEAST_ROWS = 50


def check_torque_unit(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse torque columns of an unstated or wrongly stated unit that the declared rotor inertia contradicts in every
    run.

    Raises:
        LogError: names file, column and unit.
    """
    for joint in rig.joints:
        inertia, name = rig.known(joint, "rotor_inertia"), f"{joint}/torque"
        scale, written = scale_of(name, rig.units), rig.units.get(name, rig.units.get("torque"))
        if inertia <= 0.0 or rig.load[joint] != "torque" or isinstance(written, float | int):
            continue
        said, possible = "", UNITS[rig.joint_type(joint)]
        if scale.stated:
            said, possible = STATED[rig.joint_type(joint)].get(abs(scale.factor), ("", {}))
        units = {_unit_of(run, rig, joint, possible) for run in runs}
        if len(units) == 1 and (unit := units.pop()):
            told = rig.units_of(joint)
            shown = told.text(f"units of {unit} N*m") if unit[0].isdigit() else unit
            right = f"{scale.factor:g}, the factor to {told.text(TORQUE)}," if said else told.text(TORQUE)
            raise LogError(
                f"{runs[0].source}: column {rig.columns.get(name, name)!r}: with the declared rotor inertia of"
                f" {inertia:.4g} {told.text('kg m^2')} of {joint}, inertia and load torque balance if the torque is in"
                f" {shown}{f' and not in {said}' if said else ''}; set units:"
                f" {{torque: {'-' if scale.factor < 0.0 else ''}{unit}}} in the rig file (or torque: {right} if it is"
                " right)"
            )


def _unit_of(run: Run, rig: Rig, joint: str, possible: Mapping[str, float]) -> str:
    """The one of possible units that a run points to, as a whole and in each of its parts; an empty string for none."""
    usable = np.flatnonzero(run.segment >= 0)
    if usable.size < PARTS * LEAST_ROWS:
        return ""
    declared = rig.known(joint, "rotor_inertia")
    ratio, *parts = [_inertia(run, rig, joint, rows) / declared for rows in (usable, *np.array_split(usable, PARTS))]
    unit = next((unit for unit, factor in possible.items() if abs(ratio / factor - 1.0) < NEAR), "")
    return unit if all(ratio / ALIKE < part < ratio * ALIKE for part in parts) else ""


def _inertia(run: Run, rig: Rig, joint: str, rows: IntArray) -> float:
    """Coefficient of qddot over that of tau, of some rows of a run."""
    effort, motion = effort_and_motion(run, rig, joint, rows)
    columns = np.column_stack([run.columns[f"{joint}/torque"][rows], motion])
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    load, inertial = (np.linalg.lstsq(columns / scale, effort, rcond=None)[0] / scale)[:2].tolist()
    return inertial / load if load else 0.0
