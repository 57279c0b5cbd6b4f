"""Columns that are not what the rig file says: position and command exchanged, a torque in another unit.

Position and command of a servo that are exchanged: what must speak for it before a log is refused.

A servo's position follows its command, the command has no sensor noise, and friction takes power. With the columns
exchanged the "position" leads, the "command" is the noisy one, and the effort  command - position  turns round, and
with it every coefficient of the balance (`signs`).

The unit of a torque column, by the declared rotor inertia.

In the balance  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K  the drive gain K takes up any unit of the torque,
but the ratio of the coefficients of qddot and tau is the rotor inertia J in the torque's unit. Where J is declared and
the ratio is 1000 times as large, the column is in mN*m. A unit that the rig file states is doubted by this factor of
1000 alone, and a factor that it states is believed.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from drake_tc.config.joint_units import TORQUE, JointType
from drake_tc.errors import LogError
from drake_tc.logs.channels import run_lengths
from drake_tc.logs.checks.plausible import derivative
from drake_tc.logs.checks.signs import TELLING, effort_and_motion, sign_evidence
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.units import scale_of
from drake_tc.types import FloatArray, IntArray

LEAD = 0.5
"""Samples by which the position leads the command, to count."""
NOISIER = 4.0
"""Times that the command is noisier than the position, to count."""
LONGEST_LAG = 100
"""Samples that are looked at on each side."""
LONGEST_USED = 60_000
"""Samples from which the lead is computed."""


def refuse_exchanged(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse a servo's runs whose columns of position and command are exchanged.

    Two must say so in most of the runs. Where the load torque is known, one of them is that effort and load torque run
    against each other while friction feeds power. The others: the position leads the command by half a sample or
    more; the command is at least four times as noisy, or alone has an encoder's steps.

    Raises:
        LogError: names file and columns.
    """
    for joint in rig.joints:
        if rig.drive[joint] != "position_servo":
            continue
        said = [(run, _signs(run, rig, joint)) for run in runs if f"{joint}/position" not in run.speed_only]
        turned = [(run, reasons) for run, reasons in said if len(reasons) >= 2]
        if 2 * len(turned) > len(said):
            run, reasons = turned[0]
            q, command = (rig.columns.get(name, name) for name in (f"{joint}/position", f"{joint}/position_command"))
            raise LogError(
                f"{run.source}: the columns {q!r} (position) and {command!r} (position_command) of {joint} seem to be"
                f" exchanged: {' and '.join(reasons)}; exchange them under `columns:` in the rig file"
            )


def _signs(run: Run, rig: Rig, joint: str) -> list[str]:
    """What says that this run's columns are exchanged."""
    names = (f"{joint}/position", f"{joint}/position_command")
    usable = run.segment >= 0
    position, command = (run.columns[name] for name in names)
    reasons = []
    lead = leads_by(position, command, usable.astype(np.float64), run.period)
    if lead > LEAD:
        reasons.append(f"the position leads the command by {1e3 * lead * run.period:.3g} ms")
    noise = [_noise(values[usable], name in run.steps) for values, name in zip((position, command), names, strict=True)]
    if noise[1] > NOISIER * noise[0] or (names[1] in run.steps and names[0] not in run.steps):
        reasons.append("the command has a sensor's noise or steps, and the position has not")
    evidence = sign_evidence(run, rig, joint)
    if evidence is None:
        return reasons
    turned = evidence.steady and evidence.load < 0.0 and evidence.friction < -TELLING
    return [*reasons, "friction would drive the joint"] if turned else []


def leads_by(first: FloatArray, second: FloatArray, weights: FloatArray, period: float) -> float:
    """Samples by which the channel `first` (T,) comes before `second` (T,), negative if after; 0 where nothing tells.

    The maximum over whole samples of the correlation of their rates where both overlap, and between samples that of
    the parabola through three.
    """
    a, b = (derivative(values, period) * weights for values in (first[:LONGEST_USED], second[:LONGEST_USED]))
    reach = min(LONGEST_LAG, a.size // 4)
    if reach < 2 or a.std() == 0.0 or b.std() == 0.0:
        return 0.0
    size = a.size
    score = np.array([_alike(a[max(0, -s) : size - max(0, s)], b[max(0, s) : size + min(0, s)]) for s in _range(reach)])
    best = int(np.argmax(score))
    if not 0 < best < score.size - 1:
        return 0.0
    before, at, after = score[best - 1 : best + 2].tolist()
    bend = before - 2.0 * at + after
    return float(best - reach + (0.5 * (before - after) / bend if bend else 0.0))


def _range(reach: int) -> range:
    return range(-reach, reach + 1)


def _alike(a: FloatArray, b: FloatArray) -> float:
    """Correlation of two stretches (T,); 0 where one is constant."""
    a, b = a - a.mean(), b - b.mean()
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / norm if norm > 0.0 else 0.0


def _noise(values: FloatArray, has_steps: bool) -> float:
    """Robust level of what changes from row to row: median of fourth differences, as of white noise.

    Values (T,) that repeat although they lie on no grid are held between the messages of a slower topic. They count
    once, because the staircase of a held command is not noise.
    """
    if not has_steps:
        values = values[run_lengths(values)[0]]
    if values.size < 10:
        return 0.0
    return float(np.median(np.abs(np.diff(values, 4))) / np.sqrt(70.0))


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
