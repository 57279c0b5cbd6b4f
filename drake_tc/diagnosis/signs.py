"""Columns whose signs contradict each other: refused before anything is fitted to them.

The effort is regressed on what the declared model needs,

    y = K (a tau + J qddot + F_v qdot + F_c s) + e                       a: 1 where the signs agree

with a free. A load that turns against the effort (a < 0 beyond its 95 % interval), or an effort that goes against the
torque balance altogether (1/K <= 0 in the declared model's own fit), is a column of the wrong sign and not a property
of the joint.
"""

import numpy as np

from drake_tc.diagnosis.columns import Columns
from drake_tc.diagnosis.estimates import block_lengths
from drake_tc.diagnosis.regression import Fit
from drake_tc.effects.base import EFFORT_UNIT, DriveKind
from drake_tc.errors import IdentificationError
from drake_tc.identification.regression import least_squares
from drake_tc.types import FloatArray

NO_STIFFNESS = 1e-9
"""1/K over the torque per effort of the rows, at or below which the effort does not enter the balance."""
CLEARLY_WORSE = 1.2
"""Error of the balance with the load as it is over that with the load turned, above which the sign is in question."""
LEAST_OWN = 0.3
"""Share of the load that the motion must leave before its sign can be read from the effort."""
LEAST_CORRELATION = 0.3
"""Partial correlation of load and effort below which the load's sign is left to the fit."""


def require_consistent_signs(columns: Columns, declared: Fit, joint: str, drive: DriveKind) -> None:
    """Refuse rows whose load or effort has the wrong sign.

    Args:
        columns: Training rows.
        declared: The declared model, fitted to them.
        joint: For the message.
        drive: For the message.

    Raises:
        IdentificationError: One line that names the column and the repair.
    """
    samples = columns.samples
    s = samples.signals
    effort = samples.reduce(s.effort)
    typical = float(np.std(columns.target)) / max(float(np.std(effort)), 1e-300)
    command = {"position_servo": "position_command", "current": "current", "voltage": "voltage"}[drive]
    if declared.beta[0] <= NO_STIFFNESS * typical:
        raise IdentificationError(
            f"joint {joint}: the torque does not rise with the effort (drive gain not identifiable, "
            f"{EFFORT_UNIT[drive]}/(N*m)): the sign of the torque or of the {command} column is wrong, or they belong "
            f"to different joints; try units: {{torque: -N*m}} in the rig file"
        )
    load = samples.reduce(s.load_torque)
    motion = [samples.reduce(x) for x in (s.acceleration, s.velocity, s.direction)]
    others = np.column_stack([*motion, np.ones(load.size)])
    rest = [x - others @ np.linalg.lstsq(others, x, rcond=None)[0] for x in (load, effort)]
    size = float(np.linalg.norm(rest[0]) * np.linalg.norm(rest[1]))
    if float(np.linalg.norm(rest[0])) < LEAST_OWN * float(np.linalg.norm(load - load.mean())):
        return  # the load follows from the motion: what is left of it is noise, which a controller answers
    if _left(effort, load, motion, s.rotor_inertia) <= CLEARLY_WORSE * _left(effort, -load, motion, s.rotor_inertia):
        return  # the balance holds as the columns are
    if size <= 0.0 or float(rest[0] @ rest[1]) / size > -LEAST_CORRELATION:
        return
    found = least_squares(np.column_stack([load, others]), effort, lengths=block_lengths(columns), max_condition=1e8)
    if found.ci95[0, 1] < 0.0:
        raise IdentificationError(
            f"joint {joint}: the load torque runs against the effort (partial correlation "
            f"{float(rest[0] @ rest[1]) / size:.2f}): more energy would come out of the joint than goes in; turn "
            f"one of them with units: {{torque: -N*m}} or units: {{{command}: -{EFFORT_UNIT[drive]}}} in the rig file"
        )


def _left(effort: FloatArray, load: FloatArray, motion: list[FloatArray], inertia: float) -> float:
    """RMS that the balance with this load leaves of the effort, its gain not negative."""
    acceleration, *friction = motion
    columns = np.column_stack([load + inertia * acceleration, *friction])
    solution = np.linalg.lstsq(columns, effort, rcond=None)[0]
    if solution[0] < 0.0:
        columns = columns[:, 1:]
        solution = np.linalg.lstsq(columns, effort, rcond=None)[0]
    return float(np.sqrt(np.mean((effort - columns @ solution) ** 2)))
