"""Columns whose signs contradict each other: refused before anything is fitted to them.

The torque balance of a joint with its load reads, in the declared model,

    y = K (tau + J qddot) + F_v qdot + F_c s + c + e,   K >= 0

An effort that goes against the balance altogether (1/K <= 0 in the declared model's own fit, and with friction of any
sign the load explains next to nothing of the effort), or a load tau whose negative leaves at most half as much of an
effort that is far from explained, is a column of the wrong sign and not a property of the joint.

Where 1/K is 0 although the effort rises with the load, no sign is wrong (`drive_gain`). Nor is one wrong where the
balance of a position servo holds with integral action, y + K_i int y dt in place of y.
"""

import numpy as np

from drake_tc.diagnosis.problem.columns import Columns
from drake_tc.diagnosis.problem.drive_gain import beside_the_load, tells_drive_gain
from drake_tc.diagnosis.problem.regression import Fit
from drake_tc.diagnosis.thresholds import CLEARLY_WORSE, LEAST_UNEXPLAINED, LOAD_EXPLAINS
from drake_tc.effects.base import EFFORT_UNIT, DriveKind
from drake_tc.effects.context import LoadKind
from drake_tc.errors import IdentificationError
from drake_tc.logs.rig import COMMAND_COLUMN, Rig
from drake_tc.types import FloatArray


def require_consistent_signs(
    columns: Columns, declared: Fit, rig: Rig, joint: str, load_kind: LoadKind = "torque"
) -> None:
    """Refuse rows whose load or effort has the wrong sign.

    Args:
        columns: Training rows.
        declared: The declared model, fitted to them.
        rig: Says the drive, and the units for the message.
        joint: Which.
        load_kind: For the message: only a measured load has a column that can be turned.

    Raises:
        IdentificationError: One line that names the column and the repair.
    """
    tells = tells_drive_gain(columns, declared)
    refused: list[IdentificationError] = []
    for others in beside_the_load(columns, rig.drive[joint]):
        try:
            return _require_beside(others, columns, rig, joint, load_kind, tells=tells)
        except IdentificationError as error:
            refused.append(error)
    raise refused[0]


def _require_beside(
    others: FloatArray, columns: Columns, rig: Rig, joint: str, load_kind: LoadKind, *, tells: bool
) -> None:
    """Refuse the signs of load and effort, if the effort holds `others` (N, k) beside the load."""
    samples = columns.samples
    s = samples.signals
    effort = samples.reduce(s.effort)
    load = samples.reduce(s.load_torque)
    inertia = s.rotor_inertia * samples.reduce(s.acceleration)
    as_it_is, turned, without = (_unexplained(effort, x, others) for x in (load + inertia, -load + inertia, 0 * load))
    if not tells and as_it_is > LOAD_EXPLAINS * without:
        raise not_identifiable(joint, rig.drive[joint], turned_column(rig, joint, load_kind))
    if as_it_is > max(CLEARLY_WORSE * turned, LEAST_UNEXPLAINED * float(np.std(effort))):
        unit = EFFORT_UNIT[rig.drive[joint]]
        raise IdentificationError(
            f"joint {joint}: the load torque has the wrong sign: turned, it leaves {turned:.3g} {unit} "
            f"of the effort unexplained, as it is {as_it_is:.3g}; {turned_column(rig, joint, load_kind)}"
        )


def _unexplained(effort: FloatArray, torque: FloatArray, others: FloatArray) -> float:
    """RMS of the effort (N,) that the balance with this joint torque (N,) leaves, its gain K not negative."""
    columns = np.column_stack([torque, others])
    solution = np.linalg.lstsq(columns, effort, rcond=None)[0]
    if solution[0] < 0.0:
        columns, solution = others, np.linalg.lstsq(others, effort, rcond=None)[0]
    return float(np.sqrt(np.mean((effort - columns @ solution) ** 2)))


def not_identifiable(joint: str, drive: DriveKind, repair: str) -> IdentificationError:
    """What is said where the torque does not rise with the effort; `repair` is that of `turned_column`."""
    return IdentificationError(
        f"joint {joint}: the torque does not rise with the effort (drive gain not identifiable, "
        f"{EFFORT_UNIT[drive]}/(N*m)): the sign of the torque or of the {COMMAND_COLUMN[drive]} column is wrong, they "
        f"belong to different joints, or an effect that is not declared exceeds the load; declare the effect, or "
        f"{repair}"
    )


def turned_column(rig: Rig, joint: str, load_kind: LoadKind) -> str:
    """The entry of the rig file that turns a column; a load that is computed has none of its own."""
    command, units = COMMAND_COLUMN[rig.drive[joint]], rig.units_of(joint)
    own = {f"{joint}/{command}": units.effort, f"{joint}/torque": units.torque, f"{joint}/position": units.position}
    effort, torque, position = (f"{column}: {rig.opposite_unit(column, si)}" for column, si in own.items())
    if load_kind == "torque":
        return f"turn one of the columns with units: {{{torque}}} or units: {{{effort}}} in the rig file"
    source = "pendulum" if load_kind == "pendulum" else "robot's model"
    return (
        f"the load is computed from the position and the {source}; reverse the {command} with units: "
        f"{{{effort}}} in the rig file, or, if the position increases against the direction of the {source}, also the "
        f"position with units: {{{effort}, {position}}}"
    )
