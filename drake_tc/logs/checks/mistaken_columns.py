"""Columns that are not what the rig file says: of the wrong sign or without one, exchanged, in another unit.

Wrong signs: in the balance  y = (tau + J qddot + f_v qdot + f_c sign(qdot)) / K  every coefficient is positive (K > 0,
friction takes power). The effort is regressed on all of them; what is left of the load torque's share (its partial
correlation with the effort) tells the sign. A turned command turns every coefficient, a turned torque only the load's,
a turned position all but the load's. Two turned columns of three are told as the third: the model is the same.

An effort without its sign, |y| in place of y: some drives report the amplitude of the current. The balance  y = (tau +
J qddot + f_v qdot + f_c sign(qdot)) / K + c then holds for s y, s = 1 or -1, and nowhere for y where the joint needs
efforts of both signs. The signs s are those of the balance itself: they are first those of the load and then of the fit
to s y, until they no longer change.

Position and command of a servo that are exchanged: a servo's position follows its command, the command has no sensor
noise, and friction takes power. With the columns exchanged the "position" leads, the "command" is the noisy one, and
the effort  command - position  turns round, and with it every coefficient of the balance.

The unit of a torque column, by the declared rotor inertia: in the balance  y = (tau + J qddot + f_v qdot + f_c
sign(qdot)) / K  the drive gain K takes up any unit of the torque, but the ratio of the coefficients of qddot and tau is
the rotor inertia J in the torque's unit. Where J is declared and the ratio is 1000 times as large, the column is in
mN*m. A unit that the rig file states is doubted by this factor of 1000 alone, and a factor that it states is believed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_tc.config.joint_units import TORQUE, JointType
from drake_tc.errors import LogError
from drake_tc.logs.channels import run_lengths
from drake_tc.logs.checks.plausible import derivative
from drake_tc.logs.loads import Pendulum, RobotLoad, unknown_form
from drake_tc.logs.record import Run
from drake_tc.logs.rig import Rig
from drake_tc.logs.units import scale_of
from drake_tc.types import FloatArray, IntArray

CLEAR = 0.5
TELLING = 0.04
TURNED = 0.15
"""Share of friction and of inertia, both negative, of a position of the wrong sign; a delay makes only one so."""
MAX_ROWS = 60_000


@dataclass(frozen=True)
class SignEvidence:
    """What one run says of one joint's signs.

    Attributes:
        load: Partial correlation of the effort with the load torque, in [-1, 1].
        friction: Share of the effort that goes with the velocity as friction does, in [-1, 1]; negative feeds power.
        inertia: Partial correlation of the effort with the acceleration, in [-1, 1].
        following: Correlation of command and position (position servo), 0 for other drives.
        gain: Least and largest effort for 1 N m of load torque, of the whole run and of its thirds.
        weight: Usable samples.
        steady: Whether each third of the run agrees with the sign of `load`.
    """

    load: float
    friction: float
    inertia: float
    following: float
    gain: tuple[float, float]
    weight: int
    steady: bool


def _partial(y: FloatArray, x: FloatArray, others: FloatArray) -> float:
    """Correlation of y and x (T,) after the columns of `others` (T, k) are taken out of both."""
    scale = np.linalg.norm(others, axis=0)
    basis = others / np.where(scale > 0, scale, 1.0)
    both = np.column_stack([y, x])
    rest = both - basis @ np.linalg.lstsq(basis, both, rcond=None)[0]
    norms = np.linalg.norm(rest, axis=0)
    small = norms <= 1e-9 * np.linalg.norm(both, axis=0)
    return 0.0 if small.any() else float(rest[:, 0] @ rest[:, 1] / norms.prod())


def _effort_and_motion(run: Run, rig: Rig, joint: str, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Effort y (N,) of some rows, and (N, 4) what else is in its balance but the load: qddot, qdot, sign(qdot), 1.

    The sign is smoothed over a fifth of the upper quartile of the speed.
    """
    q, command = run.columns[f"{joint}/position"], run.columns[rig.command_column(joint)]
    qd, qdd = derivative(q, run.period)[rows], derivative(q, run.period, 2)[rows]
    effort = (command - q if rig.drive[joint] == "position_servo" else command)[rows]
    resolved = float(np.percentile(np.abs(qd), 75)) * 0.2 + 1e-9
    return effort, np.column_stack([qdd, qd, np.tanh(qd / resolved), np.ones(rows.size)])


def _balance_of(run: Run, rig: Rig, joint: str) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Effort (N,), load torque (N,) and `_effort_and_motion`'s other columns (N, 4) of the usable rows.

    None where the load is not known before a fit, where fewer than 50 rows are usable, or where load or effort is
    constant.
    """
    load, usable = rig.load[joint], np.flatnonzero(run.segment >= 0)
    pick = usable[:: max(1, usable.size // MAX_ROWS)]
    if unknown_form(load) is not None or isinstance(load, RobotLoad) or pick.size < 50:
        return None
    y, others = _effort_and_motion(run, rig, joint, pick)
    if isinstance(load, Pendulum):
        tau = load.in_run(run).torque(run.columns[f"{joint}/position"][pick], np.zeros(pick.size))
    else:
        tau = run.columns[f"{joint}/torque"][pick]
    return None if np.ptp(tau) == 0.0 or np.ptp(y) == 0.0 else (y, tau, others)


def sign_evidence(run: Run, rig: Rig, joint: str) -> SignEvidence | None:
    """Regress the effort on load torque, acceleration, velocity and its sign; None where there is nothing to go by."""
    balance = _balance_of(run, rig, joint)
    if balance is None:
        return None
    y, tau, others = balance
    qdd, qd = others[:, 0], others[:, 1]
    correlation = _partial(y, tau, others)
    parts = np.array_split(np.arange(y.size), 3)
    thirds = [_partial(y[part], tau[part], others[part]) for part in parts]
    columns = np.column_stack([others, tau])
    coefficients = np.linalg.lstsq(columns, y, rcond=None)[0]
    gains = [coefficients[4], *(np.linalg.lstsq(columns[part], y[part], rcond=None)[0][4] for part in parts)]
    drag = others[:, 1:3] @ coefficients[1:3]
    power = np.linalg.norm(y - y.mean()) * np.linalg.norm(qd)
    changes = qd - qd.mean()  # at one constant speed friction cannot be told from the effort's zero
    friction = float(np.clip(drag @ changes / power, -1.0, 1.0)) if power > 0 else 0.0
    following = _following(run, rig, joint) if rig.drive[joint] == "position_servo" else 0.0
    steady = all(np.sign(third) == np.sign(correlation) for third in thirds)
    inertia = _partial(y, qdd, np.column_stack([others[:, 1:], tau]))
    gain = float(min(gains)), float(max(gains))
    return SignEvidence(correlation, friction, inertia, following, gain, int(y.size), steady)


def _following(run: Run, rig: Rig, joint: str) -> float:
    """Correlation of a servo's command and position over the usable rows; 0 where one of them rests."""
    usable = run.segment >= 0
    command, q = (run.columns[name][usable] for name in (rig.command_column(joint), f"{joint}/position"))
    return float(np.corrcoef(command, q)[0, 1]) if min(np.ptp(q), np.ptp(command)) > 0 else 0.0


def _verdict(evidence: SignEvidence, load: object, *, servo: bool) -> str:
    """Which channel is turned: "command", "torque", "either" of them, "" (none) or "?" (not clear)."""
    if servo and evidence.following < -0.9:
        return "command"
    if abs(evidence.load) < CLEAR or not evidence.steady:
        return "?"
    if evidence.load > 0:
        return ""
    if isinstance(load, Pendulum):
        return "?" if servo else "command"
    return "torque" if servo else "either"


def _torque_or_command(turned: Sequence[SignEvidence]) -> tuple[str, str]:
    """Which of torque and command is turned, over all turned runs together, and the doubt left, in words.

    Friction must take power; where its share of the effort is too small to tell, the torque is blamed, whose sign is
    a matter of convention.
    """
    weight = sum(e.weight for e in turned)
    share = sum(e.friction * e.weight for e in turned) / weight if weight else 0.0
    if abs(share) < TELLING:
        return "torque", " (friction is too small to tell whether the command is the wrong one instead)"
    return ("command" if share < 0 else "torque"), ""


def wrong_signs(runs: Sequence[Run], rig: Rig) -> Sequence[Mapping[str, str]]:
    """For each run, the channels to be turned: canonical name to the reason, in words.

    A run that is clear decides for itself; one that is not follows the others of the same rig. Which of torque and
    current (or voltage) has the wrong sign is decided from all such runs together: friction must dissipate power.
    """
    _require_friction(runs, rig)
    flips: list[dict[str, str]] = [{} for _ in runs]
    for joint in rig.joints:
        servo = rig.drive[joint] == "position_servo"
        found = [sign_evidence(run, rig, joint) for run in runs]
        verdicts = [_told(run, evidence, rig, joint) for run, evidence in zip(runs, found, strict=True)]
        which, doubt = _torque_or_command([e for e in found if e is not None and e.load < 0])
        verdicts = [which if verdict == "either" else verdict for verdict in verdicts]
        clear = [verdict for verdict in verdicts if verdict != "?"]
        common = max(set(clear), key=clear.count) if clear else ""
        for run, flip, evidence, verdict in zip(runs, flips, found, verdicts, strict=True):
            turned = common if verdict == "?" else verdict
            if not turned:
                continue
            if verdict == "?" or evidence is None:
                reason = "as in the other runs of this rig"
            elif turned in ("command", "position") and servo:
                reason = f"its correlation with the {'position' if turned == 'command' else 'command'} is"
                reason += f" {evidence.following:.2f}"
            else:
                reason = f"partial correlation of effort and load torque {evidence.load:.2f}, which should be positive"
                reason += "" if servo or isinstance(rig.load[joint], Pendulum) else doubt
            flip |= dict.fromkeys(_columns(turned, run, rig, joint), reason)
    return flips


def _require_friction(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse a current's or voltage's run in which the load is right and all that the position makes is turned.

    The position has the wrong sign then, or effort and torque are exchanged, which gives another model.
    """
    for joint in (joint for joint in rig.joints if rig.drive[joint] != "position_servo"):
        for run in runs:
            e = sign_evidence(run, rig, joint)
            turned = e is not None and max(e.friction, e.inertia) < -TURNED and abs(e.load) > CLEAR and e.steady
            if e is None or not turned or e.load < 0.0:
                continue
            names = (f"{joint}/position", rig.command_column(joint), f"{joint}/torque")
            entry = f"{names[0]}: {rig.opposite_unit(names[0], rig.units_of(joint).position)}"
            position, command, torque = (repr(rig.columns.get(name, name)) for name in names)
            raise LogError(
                f"{run.source or run.name}: friction and inertia of {joint} would drive it: column {position} has the"
                f" wrong sign, or {command} and {torque} are exchanged; set units: {{{entry}}}, or exchange"
                " them under `columns:` in the rig file"
            )


def _told(run: Run, evidence: SignEvidence | None, rig: Rig, joint: str) -> str:
    """The verdict on one run; of a servo whose angles run against each other, the one that the load torque blames."""
    if evidence is None:
        return "?"
    servo, load = rig.drive[joint] == "position_servo", rig.load[joint]
    verdict = _verdict(evidence, load, servo=servo)
    if verdict != "command" or not servo or isinstance(load, Pendulum):
        return verdict
    command = rig.command_column(joint)
    turned = sign_evidence(replace(run, columns={**run.columns, command: -run.columns[command]}), rig, joint)
    return "position" if turned is not None and turned.load < -CLEAR and turned.steady else "command"


def _columns(turned: str, run: Run, rig: Rig, joint: str) -> list[str]:
    """The channels that have the sign of a turned one; velocity and motor position are those of the position."""
    if turned == "command":
        return [rig.command_column(joint)]
    suffixes = ("torque",) if turned == "torque" else ("position", "velocity", "motor_position")
    return [name for name in (f"{joint}/{suffix}" for suffix in suffixes) if name in run.columns]


BELOW_ZERO = 0.01
"""Least effort over the largest one, below 0, of an effort that has a sign."""
BOTH_SIGNS = 0.1
"""Share of the samples in which the balance must ask for either sign."""
LEAST_LEFT = 0.2
"""Share of the effort's standard deviation that the balance must leave of it as it is recorded."""
MUCH_BETTER = 0.5
"""Share of that error which may be left at most of the effort with the signs of the balance."""
ROUNDS = 10


def refuse_unsigned(runs: Sequence[Run], rig: Rig) -> None:
    """Refuse runs whose current, voltage or commanded torque is an absolute value.

    Raises:
        LogError: names file and column.
    """
    for joint in (joint for joint in rig.joints if rig.drive[joint] != "position_servo"):
        for run in runs:
            balance = _balance_of(run, rig, joint)
            if balance is not None and is_unsigned(*balance):
                name = rig.command_column(joint)
                raise LogError(
                    f"{run.source or run.name}: column {rig.columns.get(name, name)!r} of {joint} seems to be an "
                    "absolute value: it is never negative, and load and motion need efforts of both signs; record it "
                    "with its sign"
                )


def is_unsigned(effort: FloatArray, load: FloatArray, others: FloatArray) -> bool:
    """Whether an effort (N,) of one sign fits the balance only with the signs that the balance asks for.

    Args:
        effort: (N,) as recorded.
        load: (N,) load torque [N m].
        others: (N, k) what else is in the balance.
    """
    if effort.min() < -BELOW_ZERO * effort.max():
        return False
    columns = np.column_stack([load, others])
    as_it_is = effort - columns @ np.linalg.lstsq(columns, effort, rcond=None)[0]
    sign = np.where(load < 0.0, -1.0, 1.0)
    for _ in range(ROUNDS):
        fitted = columns @ np.linalg.lstsq(columns, sign * effort, rcond=None)[0]
        before, sign = sign, np.where(fitted < 0.0, -1.0, 1.0)
        if np.array_equal(before, sign):
            break
    left = float(np.std(as_it_is))
    share = float(np.mean(sign < 0.0))
    return bool(
        min(share, 1.0 - share) >= BOTH_SIGNS
        and left > LEAST_LEFT * np.std(effort)
        and np.std(sign * effort - fitted) <= MUCH_BETTER * left
    )


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
    shifts = range(-reach, reach + 1)
    score = np.array([_alike(a[max(0, -s) : size - max(0, s)], b[max(0, s) : size + min(0, s)]) for s in shifts])
    best = int(np.argmax(score))
    if not 0 < best < score.size - 1:
        return 0.0
    before, at, after = score[best - 1 : best + 2].tolist()
    bend = before - 2.0 * at + after
    return float(best - reach + (0.5 * (before - after) / bend if bend else 0.0))


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
    effort, motion = _effort_and_motion(run, rig, joint, rows)
    columns = np.column_stack([run.columns[f"{joint}/torque"][rows], motion])
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    load, inertial = (np.linalg.lstsq(columns / scale, effort, rcond=None)[0] / scale)[:2].tolist()
    return inertial / load if load else 0.0
