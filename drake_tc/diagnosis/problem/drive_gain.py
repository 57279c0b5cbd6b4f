"""Whether a fit tells the drive gain, and columns of a wrong sign or unit, which are refused before any search.

The torque balance of a joint with its load reads, in the declared model,

    y = K (tau + J qddot) + F_v qdot + F_c s + c + e,   K >= 0

**Signs.** An effort that goes against the balance altogether (1/K <= 0 in the declared model's own fit, and with
friction of any sign the load explains next to nothing of the effort), or a load tau whose negative leaves at most half
as much of an effort that is far from explained, is a column of the wrong sign and not a property of the joint.

**No drive gain.** Where the effort is nearly all friction, 1/K can rest at 0 in the declared model although no sign is
wrong: an effect that the model lacks weighs more than the load, and the best of all physical frictions is none. The
search then starts from the gain of the reverse regression (`at_reverse_regression`).

**Integral action.** A position servo with a strong one is another such joint. For K_i of the order of the motion's
frequency, y + K_i int y dt = K (tau + ...) is far from in phase with y, and y can even fall while the load rises.
Whether the load explains the effort is therefore asked beside friction, and for a position servo also beside friction
and int y dt.

**Units.** The torque y of a drive that is commanded in N m balances the load beside inertia and friction with K near 1
or the declared gain. No gear makes a K of 1000 or 1/1000 times that of a torque on the link's side, but a torque in
mN m whose unit was not stated or was stated wrongly does. Gains of currents, voltages and servos may have any size.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from drake_tc.diagnosis.data.samples import rms
from drake_tc.diagnosis.priors import CLEARLY_WORSE, LEAST_UNEXPLAINED, LOAD_EXPLAINS, NO_STIFFNESS
from drake_tc.diagnosis.problem.columns import Columns, Term
from drake_tc.diagnosis.problem.regression import Fit, fit
from drake_tc.effects.base import EFFORT_UNIT, DriveKind
from drake_tc.effects.context import LoadKind
from drake_tc.effects.servo_integrator import ServoIntegrator
from drake_tc.errors import IdentificationError
from drake_tc.logs.rig import COMMAND_COLUMN, Rig
from drake_tc.logs.units import scale_of
from drake_tc.types import FloatArray

THOUSAND, WITHIN = 1000.0, 2.0
"""Ratio of the two units, and the factor within which it is one."""
CERTAIN = 0.8
"""Correlation of effort and load, beside all else, above which their ratio means something."""
UNITS = {"revolute": {1.0: "N*m", 1e-3: "mN*m"}, "prismatic": {1.0: "N", 1e-3: "mN"}}
"""By factor to SI, the units between which a log and its rig file may differ."""


def tells_drive_gain(columns: Columns, fitted: Fit) -> bool:
    """Whether the effort enters the balance of a fit to these rows, 1/K > 0."""
    effort = columns.samples.reduce(columns.samples.signals.effort)
    typical = float(np.std(columns.target)) / max(float(np.std(effort)), 1e-300)
    return bool(fitted.beta[0] > NO_STIFFNESS * typical)


def beside_the_load(columns: Columns, drive: DriveKind) -> Iterator[FloatArray]:
    """What the effort may hold beside the load, (N, k): friction of any sign; of a position servo also int y dt."""
    samples = columns.samples
    s = samples.signals
    friction = np.column_stack([samples.reduce(s.velocity), samples.reduce(s.direction), np.ones(columns.target.size)])
    yield friction
    if drive == "position_servo":  # the integral may be charged when a run begins: a constant of its own for each run
        runs = (samples.run[:, None] == np.unique(samples.run)).astype(np.float64)
        yield np.column_stack([friction[:, :2], runs, columns.of(Term(ServoIntegrator()))])


def at_reverse_regression(columns: Columns, declared: Fit, drive: DriveKind) -> Fit:
    """The declared model; where it does not tell the drive gain, fitted at that of the regression of effort on load.

    With y the effort and l the load with the rotor's torque, both less what else explains of them (`beside_the_load`),
    K = (y . l)/(l . l), which is positive where the load explains anything of the effort (`require_consistent_signs`).
    Elsewhere the declared model is returned as it is.
    """
    if tells_drive_gain(columns, declared):
        return declared
    whole, gains = columns.samples.reduce(columns.samples.signals.effort), []
    for others in beside_the_load(columns, drive):
        effort, load = (_left_of(x, others) for x in (whole, columns.target))
        gains.append(float(effort @ load) / float(load @ load))
        if gains[-1] > 0.0 and rms(effort - gains[-1] * load) <= LOAD_EXPLAINS * rms(effort):
            return fit(columns.changed(declared_gain=gains[-1]), declared.terms)
    return fit(columns.changed(declared_gain=gains[0]), declared.terms) if gains[0] > 0.0 else declared


def _left_of(values: FloatArray, others: FloatArray) -> FloatArray:
    """What least squares on the columns `others` (N, k) leaves of the values (N,)."""
    return np.asarray(values - others @ np.linalg.lstsq(others, values, rcond=None)[0])


def require_consistent_signs(
    columns: Columns, declared: Fit, rig: Rig, joint: str, load_kind: LoadKind = "torque"
) -> None:
    """Refuse rows whose load or effort has the wrong sign.

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
    inertia, unit = s.rotor_inertia * samples.reduce(s.acceleration), EFFORT_UNIT[rig.drive[joint]]
    as_it_is, turned, without = (_unexplained(effort, x, others) for x in (load + inertia, -load + inertia, 0 * load))
    if not tells and as_it_is > LOAD_EXPLAINS * without:
        raise IdentificationError(
            f"joint {joint}: the torque does not rise with the effort (drive gain not identifiable, {unit}/(N*m)): the "
            f"sign of the torque or of the {COMMAND_COLUMN[rig.drive[joint]]} column is wrong, they belong to "
            "different joints, or an effect that is not declared exceeds the load; declare the effect, or "
            f"{_turned_column(rig, joint, load_kind)}"
        )
    if as_it_is > max(CLEARLY_WORSE * turned, LEAST_UNEXPLAINED * float(np.std(effort))):
        raise IdentificationError(
            f"joint {joint}: the load torque has the wrong sign: turned, it leaves {turned:.3g} {unit} "
            f"of the effort unexplained, as it is {as_it_is:.3g}; {_turned_column(rig, joint, load_kind)}"
        )


def _unexplained(effort: FloatArray, torque: FloatArray, others: FloatArray) -> float:
    """RMS of the effort (N,) that the balance with this joint torque (N,) leaves, its gain K not negative."""
    columns = np.column_stack([torque, others])
    solution = np.linalg.lstsq(columns, effort, rcond=None)[0]
    return rms(_left_of(effort, others) if solution[0] < 0.0 else effort - columns @ solution)


def _turned_column(rig: Rig, joint: str, load_kind: LoadKind) -> str:
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


def require_torque_unit(columns: Columns, rig: Rig, joint: str, load_kind: LoadKind) -> None:
    """Refuse the torque of a drive that is 1000 times as large, or as small, as its known load asks for.

    A unit that the rig file states as a number is believed.

    Raises:
        IdentificationError: One line that names both units and the entry of the rig file.
    """
    if rig.drive[joint] != "torque" or columns.samples.load_unknown or load_kind == "links":
        return
    ratio = _gain(columns) / rig.drive_gain.get(joint, 1.0)
    power = next((p for p in (THOUSAND, 1.0 / THOUSAND) if p / WITHIN < ratio < p * WITHIN), None)
    if power is None:
        return
    sides = [("torque_command", 1.0 / power)] + ([("torque", power)] if load_kind == "torque" else [])
    found = [each for name, factor in sides if (each := _other_unit(rig, joint, name, factor)) is not None]
    if found:
        raise IdentificationError(_refusal(joint, ratio, found, UNITS[rig.joint_type(joint)][1.0]))


def _refusal(joint: str, ratio: float, found: Sequence[tuple[str, str, str]], si: str) -> str:
    """One line; `found` as `_other_unit` gives them, `si` the unit in which a number as a unit is told."""
    what = " or ".join(f"{joint}/{name} is in {other} and not in {said}" for name, said, other in found)
    entries = " or ".join(f"units: {{{joint}/{name}: {other}}}" for name, _, other in found)
    return (
        f"joint {joint}: the torque of the drive is {ratio:.3g} times what balances the load: {what}; set {entries} in "
        f"the rig file (a number, the factor to {si}, is believed)"
    )


def _other_unit(rig: Rig, joint: str, name: str, factor: float) -> tuple[str, str, str] | None:
    """(column, stated unit, unit) of a column whose scale is to be multiplied by a factor; None where it is no unit."""
    full = f"{joint}/{name}"
    if isinstance(rig.units.get(full, rig.units.get(name)), float | int):
        return None
    scale = scale_of(full, rig.units).factor
    units = UNITS[rig.joint_type(joint)]
    other = next((unit for value, unit in units.items() if np.isclose(abs(scale) * factor, value)), None)
    said = next((unit for value, unit in units.items() if np.isclose(abs(scale), value)), None)
    return None if other is None or said is None else (name, said, f"-{other}" if scale < 0.0 else other)


def _gain(columns: Columns) -> float:
    """K; NaN where the effort does not follow the load."""
    samples = columns.samples
    friction = next(iter(beside_the_load(columns, "torque")))
    others = np.column_stack([friction, samples.reduce(samples.signals.acceleration)])
    effort, load = (_left_of(samples.reduce(x), others) for x in (samples.signals.effort, samples.signals.load_torque))
    product, square = float(effort @ load), float(load @ load)
    return product / square if product > CERTAIN * float(np.sqrt((effort @ effort) * square)) else float("nan")
